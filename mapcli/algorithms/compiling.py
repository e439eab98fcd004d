"""How the loops of this package are compiled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import njit

from mapcli import startup
from mapcli.algorithms.kernel_cache import KernelCache

startup.import_numba_without_scipy()

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}
"""Other threads run meanwhile (`nogil`). The rest leaves out what would take as long to compile as
the loops themselves: exceptions for divisions by zero, a way in from C, and memory. Kernels do not
allocate; what they fill is given to them."""


def kernel(function: Function) -> Function:
    """Compile a loop when it is first called, once a machine."""
    return compiled(function, OPTIONS)


def allocating_kernel(function: Function) -> Function:
    """The same for one that makes arrays."""
    return compiled(function, {})


def compiled(
    function: Function, options: dict[str, Any], sources: Sequence[Path] | None = None
) -> Function:
    """A function, compiled when it is first called.

    Args:
        options: of `numba.njit`.
        sources: the files on whose text the machine code depends, because the function calls
            others: all of its folder, unless given.
    """
    dispatcher: Any = njit(**options)(function)
    if sources is None:
        sources = _sources_beside(Path(function.__code__.co_filename).parent)
    dispatcher._cache = KernelCache(function, sources)
    result: Function = dispatcher
    return result


@cache
def _sources_beside(folder: Path) -> tuple[Path, ...]:
    # This file has the options of all.
    return Path(__file__), *sorted(folder.glob("*.py"))
