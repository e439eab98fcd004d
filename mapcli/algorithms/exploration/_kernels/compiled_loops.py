"""The loops of Algorithm 9.1, compiled.

Their text is that of the room itself: plain functions on flat arrays, which small maps run
as they are, so that no numba needs to be imported for them. Here the same functions are compiled
for large maps. Nothing is written twice, and a test compares the two.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, TypeVar, cast

from mapcli.algorithms.exploration import (
    exploration_state,
    field_of_view,
    frontier,
    goal_selection,
    initialisation,
    limits,
    path_search,
    return_home,
    robots,
    trace_columns,
    viewpoints,
    visibility,
    voronoi_partition,
)

MODULES = (
    exploration_state, field_of_view, trace_columns, path_search, voronoi_partition,
    goal_selection, visibility, viewpoints, robots, limits, frontier, return_home, initialisation,
)  # fmt: skip
"""Whose functions are compiled, callees first."""


CALLED_FROM_PYTHON = (
    exploration_state.unknown_neighbours,
    frontier.explore_frontier,
    frontier.choose_goal,
    goal_selection.reported_utility,
    return_home.return_home,
    return_home.record_stops,
    path_search.search_everything,
    path_search.write_path,
    initialisation.has_place_to_stand,
    initialisation.mark_explorable,
    initialisation.register_known_map,
)
"""The others need no way in from Python, which would take as long to compile as they do."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
"""Nothing here allocates. Without `_nrt=False` numba counts the references to every array of every
tuple at every call, which takes ten times as long as the work itself."""

INNER: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """The compiled twin of a function of one of the modules above."""
    return cast(Function, _twins()[function])


@cache
def _twins() -> dict[Callable[..., Any], Callable[..., Any]]:
    from mapcli.algorithms import compiling

    sources = [Path(__file__), *(Path(str(module.__file__)) for module in MODULES)]
    twins: dict[Callable[..., Any], Callable[..., Any]] = {}
    for module in MODULES:
        # The twins call each other: they live in a copy of their module's names in which
        # functions are replaced by their twins.
        names = dict(vars(module))
        for name, value in names.items():
            if isinstance(value, FunctionType) and value in twins:
                names[name] = twins[value]
        for function in _functions(module):
            twin = FunctionType(function.__code__, names, function.__name__)
            inner = {} if function in CALLED_FROM_PYTHON else INNER
            compiled_twin = compiling.compiled(twin, {**OPTIONS, **inner}, sources)
            names[function.__name__] = twins[function] = compiled_twin
    return twins


def _functions(module: ModuleType) -> list[FunctionType]:
    own = [value for value in vars(module).values() if isinstance(value, FunctionType)]
    return [function for function in own if function.__module__ == module.__name__]
