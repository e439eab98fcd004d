"""Starting numba without SciPy's linear algebra, which takes 0.2 s to import."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Any

_BLAS = "scipy.linalg.cython_blas"


def start_numba() -> None:
    """Import numba's array functions, and let them find no BLAS.

    Before the first compiled loop runs, numba looks whether matrices could be multiplied, by
    importing the module; no loop of mapcli multiplies any. None in `sys.modules` makes that import
    fail at once. Afterwards SciPy can be imported by anybody, numba included.
    """
    modules: dict[str, Any] = sys.modules
    if _BLAS in modules:
        return
    modules[_BLAS] = None
    try:
        with suppress(ImportError):  # should they move in a later numba, only the time is lost
            import numba.np.arraymath  # noqa: F401
    finally:
        del modules[_BLAS]
