"""How the loops of this package are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit as njit

from mapcli import startup

startup.import_numba_without_scipy()

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}
"""Compiled once a machine (`cache`), other threads run meanwhile (`nogil`). The rest leaves out
what would take as long to compile as the loops themselves: exceptions for divisions by zero, a
way in from C, and memory. Kernels do not allocate; what they fill is given to them."""


def kernel(function: Function) -> Function:
    """Compile a loop when it is first called."""
    compiled: Function = njit(**OPTIONS)(function)
    return compiled
