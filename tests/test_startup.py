"""A replay loads numba without SciPy's linear algebra, and takes it from nobody else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import FIXTURES

APARTMENT = FIXTURES / "apartment.mcap"


@pytest.mark.slow
def test_a_replay_does_not_load_linear_algebra(tmp_path: Path) -> None:
    arguments = ["slam-replay", str(APARTMENT), "-o", str(tmp_path), "-q", "--end", "2"]
    code = (
        "import sys\nfrom mapcli.cli import main\n"
        f"try: main({arguments!r})\nexcept SystemExit as left: assert not left.code\n"
        "assert 'numba' in sys.modules\n"
        "assert not [name for name in sys.modules if name.startswith('scipy.linalg')]\n"
        "import scipy.linalg.cython_blas\n"
        "import numba, numpy\n"
        "square = numba.njit(lambda matrix: numpy.dot(matrix, matrix))\n"
        "assert square(2 * numpy.eye(2))[0, 0] == 4\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
