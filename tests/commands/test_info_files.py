"""`mapcli info` about files that are neither a map nor a log."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from conftest import FIXTURES, run
from PIL import Image

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def facts(file: str) -> dict[str, Any]:
    """What the document about a file says."""
    assert run("info", file, "--json", "out.json", "-q") == 0
    return dict(json.loads(Path("out.json").read_text()))


TUM = """\
1600000000.0 0 0 0 0 0 0 1
1600000001.0 3 0 0 0 0 0 1
1600000003.5 3 4 0 0 0 0.6 0.8
"""

TUM_REPORT = """\
t.tum: trace, TUM
  poses       3, 3.5 s, from 1600000000.000 to 1600000003.500 s
  way         7.0 m and 74 deg of turns; ends 5.00 m from its start
  extent      x 0 to 3 m, y 0 to 4 m
"""


def test_a_trace_of_another_program(capsys: Capture) -> None:
    Path("t.tum").write_text(TUM)
    assert run("info", "t.tum") == 0
    assert capsys.readouterr() == (TUM_REPORT, "")
    found = facts("t.tum")
    assert found["format"] == "mapcli.trace-info"
    assert (found["poses"], found["distance_m"], found["duration_s"]) == (3, 7, 3.5)
    assert (found["longest_gap_s"], found["longest_step_m"], found["end_to_start_m"]) == (2.5, 4, 5)
    assert found["turned_deg"] == pytest.approx(73.74, abs=0.001)
    assert (found["verdict"], found["statuses"], found["loops"]) == (None, {}, 0)


def test_the_content_says_that_it_is_a_trace() -> None:
    Path("t.tum").write_text(TUM)
    Path("poses.txt").write_text(TUM)
    Path("poses.gz").write_bytes(gzip.compress(TUM.encode()))
    wanted = facts("t.tum")
    for name in ("poses.txt", "poses.gz"):
        assert {**facts(name), "input": None} == {**wanted, "input": None}


def test_a_trace_of_slam_replay(capsys: Capture) -> None:
    assert run("slam-replay", FIXTURES / "corridor.mcap", "--json", "t.json", "-q") == 0
    summary = json.loads(Path("t.json").read_text())["summary"]
    assert run("info", "t.json") == 0
    told = capsys.readouterr().out
    assert "  made of     corridor.mcap\n" in told
    assert f"  verdict     {summary['verdict']}\n" in told
    found = facts("t.json")
    assert found["verdict"] == summary["verdict"]
    assert found["mean_score"] == summary["mean_score"]
    assert found["distance_m"] == pytest.approx(summary["distance_m"], abs=1e-3)
    assert found["statuses"]["matched"] == summary["matched"]


def test_a_trace_without_times(capsys: Capture) -> None:
    Path("t.kitti").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n")
    assert run("info", "t.kitti") == 0
    assert "  poses       2, without times\n" in capsys.readouterr().out
    assert facts("t.kitti")["duration_s"] is None


@pytest.mark.parametrize(
    "rest",
    ['"poses": []', '"poses": [], "input": 5, "summary": {"verdict": [], "reasons": [5]}',
     '"poses": [{"stamp_ns": 1, "x": 0, "y": 0, "theta": 0, "status": []}]'],
)  # fmt: skip
def test_an_odd_trace(rest: str, capsys: Capture) -> None:
    Path("t.json").write_text(f'{{"format": "mapcli.pose-trace", "version": 1, {rest}}}')
    assert run("info", "t.json") == 0
    assert "t.json: trace, mapcli.pose-trace\n" in capsys.readouterr().out


def test_an_exploration(capsys: Capture) -> None:
    line = ("frontier", FIXTURES / "corner.txt", "--robot", "5,6", "-q", "--json", "e.json")
    assert run(*line) == 0
    trace = json.loads(Path("e.json").read_text())
    found = facts("e.json")
    assert found["format"] == "mapcli.file-info"
    assert found["kind"] == "a mapcli.exploration-trace document"
    assert found["facts"]["steps"] == len(trace["steps"])
    assert found["facts"]["coverage"] == trace["summary"]["coverage"]
    assert run("info", "e.json") == 0
    assert "mapcli schema exploration-trace says what its fields" in capsys.readouterr().out


def test_tables_in_csv() -> None:
    assert run("frontier", FIXTURES / "corner.txt", "--robot", "5,6", "-q", "--curve", "c.csv") == 0
    found = facts("c.csv")
    assert (found["kind"], found["facts"]["columns"]) == ("a coverage curve in CSV", 7)


@pytest.mark.parametrize(
    ("file", "wanted"),
    [
        ("corner-scan.yaml", {"perception": "scan", "turns": 3}),
        ("landmarks.yaml", {"perception": "landmarks", "landmarks": 3}),
        ("corner-grids.yaml", {"perception": "grids", "candidates": 15}),
        ("corridor-path.txt", {"waypoints": 4, "in_reverse": 0}),
    ],
)
def test_what_people_write(file: str, wanted: dict[str, Any]) -> None:
    found = facts(str(FIXTURES / file))["facts"]
    assert {key: found[key] for key in wanted} == wanted


def test_relations() -> None:
    Path("a.relations").write_text("1.5 2.5 1 0 0 0 0 0\n2.5 9.5 1 0 0 0 0 0\n")
    wanted = {"relations": 2, "start_ns": 1_500_000_000, "end_ns": 9_500_000_000}
    assert facts("a.relations")["facts"] == wanted


def test_pictures(capsys: Capture) -> None:
    Image.new("RGB", (8, 4)).save("photo.jpg")
    assert facts("photo.jpg")["facts"] == {"width": 8, "height": 4, "mode": "RGB", "frames": 1}
    Path("photo.jpg").write_bytes(Path("photo.jpg").read_bytes()[:20])
    assert run("info", "photo.jpg") == 1
    assert "photo.jpg: the picture is damaged" in capsys.readouterr().err


def test_a_picture_that_mapcli_drew_is_no_map(capsys: Capture) -> None:
    assert run("render", FIXTURES / "corner.txt", "--png", "map.png") == 0
    assert run("info", "map.png") == 0
    assert "map.png: picture that mapcli drew\n" in capsys.readouterr().out
    assert run("frontier", "map.png", "--robot", "5,5") == 1
    assert capsys.readouterr().err == (
        "Error: map.png: is a picture that mapcli drew; name the map that it was drawn of; "
        "expected a map\n"
    )


@pytest.mark.parametrize(
    ("content", "error"),
    [
        (b"PK\x03\x04", "x: is a zip archive; unpack it first"),
        (b"<html>", "x: is a web page; download the file itself"),
        (b'{"format": "mapcli.evaluation", ', "x: is not JSON: "),
    ],
)
def test_what_cannot_be_looked_into(content: bytes, error: str, capsys: Capture) -> None:
    Path("x").write_bytes(content)
    assert run("info", "x") == 1
    assert f"Error: {error}" in capsys.readouterr().err


def test_at_is_for_maps(capsys: Capture) -> None:
    Path("t.tum").write_text(TUM)
    assert run("info", "t.tum", "--at", "1,1") == 2
    assert "--at is for maps, and t.tum is a TUM trace." in capsys.readouterr().err
