"""Activity 9.1: a robot on a line, a sensor to its side, obstacles, and one taken away."""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import FIXTURES, run
from mcap.reader import make_reader
from numpy.typing import NDArray

from mapcli import load_map
from mapcli.algorithms.slam.log_odds import log_odds_counts

LOG = FIXTURES / "lateral.mcap"
STAYS, GOES, WALL = (0.8, 0.5), (1.7, 0.5), (1.2, 1.1)
"""Points of the map, which begins where the robot does, at 0.1, 0.1 of the world."""


def mapped(folder: Path, end: float) -> NDArray[np.float32]:
    """Obstacle probabilities at the three points after so many seconds."""
    out = folder / f"{end}.txt"
    options = ["--search", "none", "--resolution", "0.2", "--p-hit", "0.65", "--p-miss", "0.35"]
    assert run("slam-replay", "-q", str(LOG), *options, "--end", str(end), "--map", str(out)) == 0
    grid = load_map(out).grid
    rows, columns = grid.cells_of_world([STAYS, GOES, WALL]).T
    return grid.cells[rows, columns]


def test_probabilities_rise_and_fall(tmp_path: Path) -> None:
    first, half, later, last = (mapped(tmp_path, end) for end in (12, 59, 90, 120))
    assert (first > 0.5).all()
    assert (half > first).all()  # each pass makes it surer
    assert half.min() > 0.98
    assert half[1] > later[1] > last[1]  # the obstacle is gone, and the beams pass
    assert last[1] < 0.5
    assert (last[[0, 2]] >= half[[0, 2]]).all()
    picture = tmp_path / "labels.png"
    assert run("render", str(tmp_path / "120.txt"), "--labels", "--png", str(picture)) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def messages(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as file:
        return [(c.topic, m.log_time, m.data) for _, c, m in make_reader(file).iter_messages()]


def test_the_fixture_is_what_its_script_writes(tmp_path: Path) -> None:
    for name in ("lateral.py", "lateral.yaml", "lateral-path.txt"):
        shutil.copy(FIXTURES / name, tmp_path)
    runpy.run_path(str(tmp_path / "lateral.py"), run_name="__main__")
    assert messages(tmp_path / "lateral.mcap") == messages(LOG)
    assert LOG.stat().st_size < 60_000


def test_probabilities_as_counts() -> None:
    assert (log_odds_counts(0.65), log_odds_counts(0.35)) == (
        11,
        -11,
    )  # ln(13/7) = 0.619 = 10.5 / 17
    assert (log_odds_counts(0.5001), log_odds_counts(0.4999)) == (1, -1)
    assert log_odds_counts(0.9933) == 85


def test_bad_probabilities(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-replay", str(LOG), "--p-hit", "0.5") == 2
    assert run("slam-replay", str(LOG), "--p-miss", "0.6") == 2
    assert run("slam-replay", str(LOG), "--p-hit", "nan") == 2
    assert "--p-miss" in capsys.readouterr().err
