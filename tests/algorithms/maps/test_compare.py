"""Comparison of two maps: numbers by hand, alignment, distances of walls."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mapcli import GridMap, Pose2D, compare, load_map, move
from mapcli.model.comparison import FREE, OCCUPIED
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
    # B's 1,3 is one cell from 0,3; B's 1,4 root 2
    assert sorted(comparison.walls_b) == pytest.approx([0] * 6 + [0.5, 0.5 * 2**0.5])
    facts = comparison.document()
    assert facts["wall_mean_m"] == pytest.approx((0.5 + 2**0.5) / 15, abs=1e-6)
    assert facts["wall_p95_m"] == pytest.approx(0.5 * 2**0.5, abs=1e-6)
    assert facts["common_m2"] == 3


def test_a_map_and_itself_and_a_map_elsewhere() -> None:
    a, _ = grids()
    same = compare(a, a)
    assert (same.agreement, same.agreement_all, same.iou(FREE), same.iou(OCCUPIED)) == (1, 1, 1, 1)
    assert same.document()["wall_max_m"] == 0
    far = compare(a, move(a, Pose2D(10, -5))[0])
    assert (far.agreement, far.agreement_all, far.iou(FREE)) == (0, 0, 0)
    assert far.document()["wall_mean_m"] > 5
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


def test_picture_colours() -> None:
    pairs = np.array([[0, 1], [3, 4]], dtype=np.uint8)  # free/free, free/occ, occ/free, occ/occ
    image = Image.open(io.BytesIO(difference_picture(pairs, ("a", "b")))).convert("RGB")
    inner = [image.getpixel((24 + x, 24 + y)) for y in (8, 40) for x in (8, 40)]
    assert inner == [(255, 255, 255), (38, 90, 196), (214, 39, 40), (38, 42, 48)]


def test_reduced_pictures_show_differences() -> None:
    pairs = np.zeros((10, 9001), dtype=np.uint8)
    pairs[5, 4500] = 3
    image = Image.open(io.BytesIO(difference_picture(pairs, ("a", "b")))).convert("RGB")
    assert image.width < 3200
    assert (np.asarray(image)[:40] == (214, 39, 40)).all(axis=2).any()
