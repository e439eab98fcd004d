"""Comparison of two maps: numbers by hand, alignment, distances of walls."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mapcli import GridMap, Pose2D, compare, load_map, move
from mapcli.model.comparison import FREE, OCCUPIED, Comparison
from mapcli.pictures.difference import difference_picture

A = b"""resolution: 0.5
####?
#...?
#.#.?
"""
B = b"""resolution: 0.5
####.
#..##
#...?
"""
# both know 12 cells: occupied in both 6, free in both 4, 1 occupied in A only, 1 in B only;
# B alone knows 2 more, one free and one occupied.


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("a.txt").write_bytes(A)
    Path("b.txt").write_bytes(B)
    return tmp_path


def grids() -> tuple[GridMap, GridMap]:
    return load_map("a.txt").grid, load_map("b.txt").grid


def test_numbers_by_hand() -> None:
    comparison = compare(*grids())
    assert comparison.cells.tolist() == [[4, 1, 0], [1, 6, 0], [1, 1, 0]]
    assert comparison.agreement == 10 / 12
    assert comparison.agreement_all == 10 / 14
    assert comparison.iou(OCCUPIED) == 6 / 9
    assert comparison.iou(FREE) == 4 / 7
    assert comparison.pairs.shape == (3, 5)
    # walls: A's cell 2,2 is two cells from 2,0 and from 0,2, and root 2 from B's 1,3
    assert sorted(comparison.walls_a) == pytest.approx([0] * 6 + [0.5 * 2**0.5])
    # B's 1,3 is one cell from 0,3; of B's 1,4 A knows nothing
    assert sorted(comparison.walls_b) == pytest.approx([0] * 6 + [0.5])
    facts = comparison.document()
    assert facts["wall_mean_m"] == pytest.approx((0.5 + 0.5 * 2**0.5) / 14, abs=1e-6)
    # 95 % of the way through 14 sorted distances: 0.35 of the way from the last but one to the last
    assert facts["wall_p95_m"] == pytest.approx(0.5 + 0.35 * (0.5 * 2**0.5 - 0.5), abs=1e-6)
    assert facts["common_m2"] == 3


def test_a_map_and_itself_and_a_map_elsewhere() -> None:
    a, _ = grids()
    same = compare(a, a)
    assert (same.agreement, same.agreement_all, same.iou(FREE), same.iou(OCCUPIED)) == (1, 1, 1, 1)
    assert same.document()["wall_max_m"] == 0
    far = compare(a, move(a, Pose2D(10, -5))[0])
    assert (far.agreement, far.agreement_all, far.iou(FREE)) == (0, 0, 0)
    assert far.document()["wall_mean_m"] is None  # neither knows anything where the other has walls
    assert far.pairs.shape == (3 + 10, 5 + 20)


def test_no_walls_fail_every_limit_on_walls() -> None:
    open_field = GridMap(np.zeros((3, 3)))
    comparison = compare(open_field, open_field)
    assert comparison.document()["wall_mean_m"] is None
    assert comparison.limits()["wall_mean_m"] == np.inf


def test_a_finer_map_is_looked_up_at_the_centres() -> None:
    a, b = grids()
    fine = GridMap(b.cells.repeat(2, axis=0).repeat(2, axis=1), 0.25)
    assert np.array_equal(compare(a, fine).cells, compare(a, b).cells)


def compared(*pairs: tuple[str, str]) -> Comparison:
    """Rows of A and of B, drawn with `#`, `.` and `?`, cells of 5 cm."""
    signs = {"#": 1.0, ".": 0.0, "?": np.nan}
    rows = [[[signs[sign] for sign in row] for row in one] for one in zip(*pairs, strict=True)]
    return compare(*(GridMap(np.array(one, np.float32), 0.05) for one in rows))


def test_what_has_changed() -> None:
    """A box of three cells has moved from the left to the right; a wall is a cell off; what only
    one map knows has not changed."""
    found = compared(
        ("###......?", ".......###"),
        ("..........", ".........."),
        ("?.........", "#........."),
        ("..........", ".........."),
        ("..####....", "?........?"),
        ("..........", "..####...."),
    )
    assert [(one.kind, one.width, one.height) for one in found.changes] == [
        ("vanished", pytest.approx(0.15), pytest.approx(0.05)),
    ]
    facts = found.document()
    assert (facts["vanished_m2"], facts["appeared_m2"]) == (0.0075, 0.0)
    (change,) = found.changes
    assert (change.x, change.y) == pytest.approx((1.5 * 0.05, 5.5 * 0.05))


def test_both_ways() -> None:
    found = compared(("###.......", ".......###"), ("..........", ".........."))
    kinds = {one.kind: one.x for one in found.changes}
    assert kinds == {"vanished": pytest.approx(0.075), "appeared": pytest.approx(0.425)}
    assert found.document()["changed_m2"] == 0.015
    assert found.document()["places_changed"] == 2


def test_two_cells_are_no_place() -> None:
    assert not compared(("##........", ".........."), ("..........", "..........")).changes


def test_walls_count_only_where_the_other_map_knows_something() -> None:
    """One drive saw less: its map lacks a wall, and nothing has changed."""
    found = compared(("#....#", "#...??"), ("#....#", "#...??"))
    assert found.document()["wall_max_m"] == 0.0


def colours_of(found: Comparison) -> set[tuple[int, int, int]]:
    image = Image.open(io.BytesIO(difference_picture(found, ("a", "b")))).convert("RGB")
    return {colour for _, colour in image.getcolors(1 << 24) or ()}  # type: ignore[misc]


RED, BLUE, INK = (214, 39, 40), (38, 90, 196), (38, 42, 48)


def test_picture_colours() -> None:
    """The legend has a colour only where the map has it."""
    moved = colours_of(compared(("###...###", "...###..."), (".........", ".........")))
    assert {RED, BLUE} <= moved
    same = colours_of(compared(("#..#", "#..#"), ("#..#", "#..#")))
    assert INK in same
    assert not {RED, BLUE} & same


def test_reduced_pictures_show_differences() -> None:
    cells = np.zeros((10, 9001), dtype=np.uint8)
    cells[5, 4500:4503] = 100
    found = compare(GridMap(cells, 0.05), GridMap(np.zeros_like(cells), 0.05))
    image = Image.open(io.BytesIO(difference_picture(found, ("a", "b")))).convert("RGB")
    assert image.width < 3400
    assert (np.asarray(image)[:140] == RED).all(axis=2).any()


def test_places_of_large_maps_are_those_of_small_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells are put together into blocks there, and areas stay exact."""
    found = compared(("###.......", ".......###"), ("..........", ".........."))
    monkeypatch.setattr("mapcli.algorithms.maps.changes.MOST_BLOCKS", 6)
    again = compared(("###.......", ".......###"), ("..........", ".........."))
    assert again.changes == found.changes
