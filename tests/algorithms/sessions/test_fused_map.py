"""Maps of several drives in one, where things have moved."""

from __future__ import annotations

import numpy as np
import pytest

from mapcli import GridMap, Pose2D
from mapcli.algorithms.sessions.fused_map import fuse

SIGNS = {"#": 0.9, ".": 0.1, "?": np.nan}


def grid(*rows: str, corner: tuple[float, float] = (0.0, 0.0)) -> GridMap:
    cells = np.array([[SIGNS[sign] for sign in row] for row in rows], np.float32)
    return GridMap(cells, 0.5, Pose2D(*corner))


def picture(one: GridMap) -> list[str]:
    signs = np.where(np.isnan(one.cells), "?", np.where(one.cells > 0.5, "#", "."))
    return ["".join(row) for row in signs.tolist()]


def test_what_agrees_adds_up() -> None:
    """Odds of 9 twice are odds of 81."""
    both = fuse([grid("#."), grid("#.")], static=False)
    np.testing.assert_allclose(both.cells, [[81 / 82, 1 / 82]], atol=2e-3)


def test_what_one_drive_knows_is_kept() -> None:
    one, other = grid("#??", "..?"), grid(".#", corner=(0.5, 0.0))
    assert picture(fuse([one, other], static=False)) == ["#??", "..#"]
    assert fuse([one, other], static=True).origin == Pose2D(0.0, 0.0)


def test_a_map_that_begins_before_the_first() -> None:
    fused = fuse([grid("#"), grid(".?", corner=(-1.0, 0.5))], static=False)
    assert (picture(fused), fused.origin) == ([".??", "??#"], Pose2D(-1.0, 0.0))


@pytest.mark.parametrize(("static", "moved"), [(False, "....#"), (True, "?...?")])
def test_a_box_that_was_moved(static: bool, moved: str) -> None:
    """It stood at the left and stands at the right now; only the middle is as it was."""
    old, new = grid("#...."), grid("....#")
    assert picture(fuse([old, new], static=static)) == [moved]


@pytest.mark.parametrize("static", [False, True])
def test_a_wall_that_is_a_cell_off_has_not_moved(static: bool) -> None:
    old, new = grid(".#.."), grid("..#.")
    assert "?" not in picture(fuse([old, new], static=static))[0]


def test_the_newest_is_right() -> None:
    days = grid("....#"), grid("....."), grid("#....")
    assert picture(fuse(days, static=False)) == ["#...."]
    assert picture(fuse(days[::-1], static=False)) == ["....#"]
