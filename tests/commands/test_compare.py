"""`mapcli compare`: the numbers by hand, the picture, the limits."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from conftest import run as run_mapcli
from PIL import Image

from mapcli import GridMap, Pose2D, compare, load_map, move
from mapcli.algorithms.maps.transform import bake_yaw
from mapcli.formats.maps.load import dump_map
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


def run(*arguments: object) -> int:
    return run_mapcli("compare", *arguments)


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


def test_alignment_finds_a_turned_map(capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(3)
    cells = np.zeros((80, 100), dtype=np.uint8)
    cells[[0, -1]], cells[:, [0, -1]], cells[30, :60], cells[:50, 70] = 100, 100, 100, 100
    for row, column in rng.integers(5, 75, (6, 2)):
        cells[row : row + 4, column : column + 3] = 100
    grid = GridMap(cells, 0.1)
    turned = bake_yaw(move(grid, Pose2D(3, -8, 1.9))[0])
    for name, made in (("g.yaml", grid), ("t.yaml", turned)):
        for file, data in dump_map(made, name).items():
            Path(file).write_bytes(data)
    assert run("g.yaml", "t.yaml", "--align", "--json", "c.json") == 0
    out = capsys.readouterr().out
    assert out.startswith("    alignment  B turned by -108.")
    found = json.loads(Path("c.json").read_text())
    assert found["alignment"]["theta"] == pytest.approx(-1.9, abs=0.005)
    assert found["agreement"] > 0.98
    assert found["wall_p95_m"] < 0.1


def test_report_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.txt", "b.txt", "--json", "c.json", "--png", "c.png") == 0
    assert capsys.readouterr() == (
        "    agreement  83.3% of 12 cells that both know\n"
        "               71.4% of 14 cells that either knows\n"
        "          IoU  occupied 0.667, free 0.571\n"
        "        walls  0.128 m apart on average, 95 % within 0.707 m, all within 0.707 m\n",
        "",
    )
    found = json.loads(Path("c.json").read_text())
    assert (found["format"], found["version"]) == ("mapcli.map-comparison", 1)
    assert [item["file"] for item in found["input"]] == ["a.txt", "b.txt"]
    assert found["cells"]["occupied_free"] == 1
    assert found["iou_free"] == 0.571429
    assert Path("c.png").read_bytes().startswith(b"\x89PNG")


def test_limits(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.txt", "b.txt", "-q", "--fail-if", "iou_occupied<0.6") == 0
    assert run("a.txt", "b.txt", "-q", "--fail-if", "iou_occupied<0.7") == 3
    assert capsys.readouterr().err == (
        "Error: a.txt, b.txt: iou_occupied is 0.666667; expected not iou_occupied<0.7 (--fail-if)\n"
    )
    assert run("a.txt", "b.txt", "--fail-if", "iou<0.7") == 2
    assert "no 'iou' in the summary; expected one of agreement, agreement_all" in (
        capsys.readouterr().err
    )
    assert run("-", "-") == 2
    assert run("a.txt", "no.txt") == 1


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
