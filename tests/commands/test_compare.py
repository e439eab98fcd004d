"""`mapcli compare`: the numbers by hand, the picture, the limits."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import run as run_mapcli

from mapcli import GridMap, Pose2D, move
from mapcli.algorithms.maps.transform import bake_yaw
from mapcli.formats.maps.save import dump_map

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


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("a.txt").write_bytes(A)
    Path("b.txt").write_bytes(B)
    return tmp_path


def run(*arguments: object) -> int:
    return run_mapcli("compare", *arguments)


@pytest.mark.slow
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
        "        walls  0.086 m apart on average, 95 % within 0.572 m, all within 0.707 m\n"
        "      changed  nothing\n",
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
