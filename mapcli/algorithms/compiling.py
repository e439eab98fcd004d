"""How the loops of this package are compiled."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from numba import njit as njit


@contextmanager
def _missing(module: str) -> Iterator[None]:
    """Have a module not found meanwhile, unless it is loaded already."""
    if module in sys.modules:
        yield
        return
    sys.modules[module] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[module]


# Before its first loop runs, numba looks whether SciPy's BLAS is there, for `numpy.kron`, which no
# kernel needs. Looking takes longer than loading all kernels.
with _missing("scipy.linalg.cython_blas"), suppress(ImportError):
    import numba.np.arraymath  # noqa: F401

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
