"""`mapcli slam-replay --sessions`: several drives, one map; and `--continue`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from conftest import FIXTURES, run
from support.replaying import CORRIDOR, files, replay, write_log

from mapcli import Pose2D
from mapcli.model.scan import Odometry

WHEN = {"monday": (0, 45, 5), "tuesday": (86_400, 60, 6), "wednesday": (172_800, 70, 7)}
"""Of each drive: seconds after the first, seconds into the apartment's log, seed."""


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three drives through the apartment on three days, from three places."""
    folder = tmp_path_factory.mktemp("drives")
    corners = {
        "monday": "0.8 5.0\n3.05 5.0\n3.05 7.4\n3.05 5.0 back\n9.25 5.0\n9.25 7.2\n",
        "tuesday": "9.25 7.2\n9.25 5.0\n10.0 4.9\n10.0 2.2\n10.0 4.9 back\n3.05 5.0\n",
        "wednesday": "1.65 3.2\n1.65 5.0\n10.0 5.0\n10.0 2.2\n",
    }
    for day, (name, path) in enumerate(corners.items()):
        (folder / f"{name}.txt").write_text(path)
        line = (
            f"simulate {FIXTURES}/apartment.yaml {folder}/{name}.mcap --path {folder}/{name}.txt "
            f"--seed {day} --start-time {1_700_000_000 + 86_400 * day} --scan-rate 5 --beams 180 -q"
        )
        assert run(*line.split()) == 0
    return folder


@pytest.fixture(autouse=True)
def folder(drives: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for path in drives.glob("*.mcap"):
        shutil.copy(path, tmp_path)
    return tmp_path


def document(out: str) -> dict[str, Any]:
    return dict(json.loads((Path(out) / "sessions.json").read_text()))


def bytes_of(out: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path(out).iterdir()}


MAPS = "map.pgm", "map.yaml", "map.png"


def test_one_map_of_three_days(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay("--sessions", "wednesday.mcap", "monday.mcap", "tuesday.mcap", "-o", "out") == 0
    report = capsys.readouterr().err
    assert "joined  3 of 3 drives" in report
    assert report.splitlines()[-1] == "      verdict  good"
    assert files() == sorted(
        [*(f"out/{name}" for name in (*MAPS, "sessions.json")), "monday.mcap", "tuesday.mcap",
         "wednesday.mcap", *(f"out/trace-{name}.json" for name in WHEN)]
    )  # fmt: skip
    found = document("out")
    assert [one["name"] for one in found["drives"]] == ["monday", "tuesday", "wednesday"]
    assert found["summary"]["unjoined"] == 0
    # Where each began: the robot of Monday looks east at (0.8, 5.0), and is the origin.
    begins = [(one["begin"]["x"], one["begin"]["y"]) for one in found["drives"]]
    for begin, right in zip(begins, ((0, 0), (8.45, 2.2), (0.85, -1.8)), strict=True):
        assert begin == pytest.approx(right, abs=0.03)


def test_the_order_of_the_logs_does_not_matter() -> None:
    assert replay("-q", "--sessions", "monday.mcap", "tuesday.mcap", "-o", "one") == 0
    assert replay("-q", "--sessions", "tuesday.mcap", "monday.mcap", "-o", "two") == 0
    assert bytes_of("one") == bytes_of("two")
    assert replay("-q", "--sessions", "--newest-last", "tuesday.mcap", "monday.mcap", "-o",
                  "three") == 0  # fmt: skip
    assert [one["name"] for one in document("three")["drives"]] == ["tuesday", "monday"]


def test_a_state_is_gone_on_from() -> None:
    """Drive by drive, into the same state: the same bytes as all at once."""
    logs = [f"{name}.mcap" for name in WHEN]
    assert replay("-q", "--sessions", *logs, "-o", "at-once") == 0
    assert replay("-q", logs[0], "-o", "first", "--save-state", "s.mcap") == 0
    assert (Path("first") / "trace.json").exists()  # as without a state
    for log in logs[1:]:
        assert replay("-q", log, "--continue", "s.mcap", "--save-state", "s.mcap", "-o", "o") == 0
    assert bytes_of("o") == bytes_of("at-once")


def test_drives_that_share_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    limit = "--fail-if", "unjoined>0"
    assert replay("--sessions", "monday.mcap", CORRIDOR, "-o", "out", *limit) == 3
    assert "could not be joined, and has a map of its own" in capsys.readouterr().err
    assert {path.name for path in Path("out").glob("map*.pgm")} == {"map.pgm", "map-monday.pgm"}
    apart = {one["name"]: one["map"] for one in document("out")["drives"]}
    assert apart == {"corridor": 0, "monday": 1}  # the older is the first


def test_a_drive_twice_and_names_that_are_alike(capsys: pytest.CaptureFixture[str]) -> None:
    Path("again").mkdir()
    shutil.copy("monday.mcap", "again")
    assert replay("--sessions", "monday.mcap", "again/monday.mcap", "-o", "out") == 0
    assert "monday-2 is the same drive as monday, and is used once" in capsys.readouterr().err
    assert [one["name"] for one in document("out")["drives"]] == ["monday"]


def test_drives_at_the_same_time_have_no_newest(capsys: pytest.CaptureFixture[str]) -> None:
    line = f"import {CORRIDOR} early.mcap --end 5 -q"
    assert run(*line.split()) == 0
    assert replay("--sessions", "early.mcap", CORRIDOR, "-o", "out") == 0
    assert "none is the newest" in capsys.readouterr().err


def test_a_drive_that_cannot_be_read_is_told_when_the_others_are_done(
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_log("bad.mcap", [Odometry(10**9, Pose2D())])
    assert replay("-q", "--sessions", "monday.mcap", "bad.mcap", "tuesday.mcap", "-o", "out") == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith("Error: bad.mcap: no range scans")
    assert len(document("out")["drives"]) == 2


def test_a_file_that_is_no_log_is_told_before_any_work(capsys: pytest.CaptureFixture[str]) -> None:
    Path("bad.mcap").write_bytes(b"something else")
    assert replay("--sessions", "monday.mcap", "bad.mcap", "-o", "out") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("Error: bad.mcap: is no log")
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("--sessions monday.mcap --known map.yaml", "--known is for one recording"),
        ("--sessions monday.mcap --search none", "--search none is for one recording"),
        ("--sessions monday.mcap --no-loop-closing", "--no-loop-closing is for one recording"),
        ("monday.mcap --static", "need --sessions or --continue"),
        ("monday.mcap --no-loop-closing --save-state s.mcap", "--save-state needs loop closing"),
    ],
)
def test_wrong_usage(line: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(*line.split()) == 2
    assert said in capsys.readouterr().err


def test_another_resolution_than_the_state(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay("-q", "monday.mcap", "--save-state", "s.mcap") == 0
    assert replay("tuesday.mcap", "--continue", "s.mcap", "--resolution", "0.1") == 1
    assert "cells of 0.1 m, where monday has 0.05 m" in capsys.readouterr().err


def test_a_log_is_no_state(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay("monday.mcap", "--continue", "tuesday.mcap") == 1
    said = "Error: tuesday.mcap: is an MCAP log; make a map of it with mapcli slam-replay; expected"
    assert capsys.readouterr().err.startswith(said)


def test_a_state_is_no_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert replay("-q", "monday.mcap", "--save-state", "s.mcap") == 0
    assert replay("s.mcap") == 1
    assert "is the state of a map of several drives; go on from it" in capsys.readouterr().err


def test_the_lines_of_the_page() -> None:
    """`docs/sessions.md`: each of its commands, in its order."""
    page = (FIXTURES.parent / "docs" / "sessions.md").read_text()
    lines = [line[2:].split() for line in page.splitlines() if line.startswith("$ ")]
    assert len(lines) == 3
    for program, *words in lines:
        assert (program, run(*words, "-q")) == ("mapcli", 0)
    assert len(document("building")["drives"]) == 2
