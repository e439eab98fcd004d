"""Logs that do not tell where the laser sits say so, and where it seems to be if they show it."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path
from typing import Any

import pytest
from conftest import FIXTURES, run
from support import dresses

from mapcli.model.pose import Pose2D

AHEAD = Pose2D(0.34, 0.0, 0.0)

UNKNOWN = "mount unknown: the log does not tell where the laser sits, assumed at the robot's centre"
SEEMS = "; scans against wheels: it seems to sit at x 0.34 +- 0.01 m, y 0.00 +- 0.01 m, yaw "


def seen_from_behind(message: Any) -> Any:
    """Odometry of a robot whose laser is so far ahead of its centre, for a laser's."""
    at = message.pose.pose
    yaw = 2 * math.atan2(at.orientation.z, at.orientation.w)
    at.position.x -= AHEAD.x * math.cos(yaw)
    at.position.y -= AHEAD.x * math.sin(yaw)
    return message


def log_without_transforms(folder: Path, *, is_ahead: bool, wheels: bool = True) -> str:
    """The apartment without its tf_static; its laser is in the middle, or ahead."""
    topics = ("/scan", "/odom") if wheels else ("/scan",)
    said = dresses.said_in(FIXTURES / "apartment.mcap", math.inf, *topics)
    for one in said if is_ahead else ():
        if one.topic == "/odom":
            seen_from_behind(one.message)
    return str(dresses.write_mcap(folder / "a.mcap", said))


def info(log: str, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, Any], str]:
    assert run("info", "--json", "-", log) == 0
    document = json.loads(capsys.readouterr().out)
    assert run("info", log) == 0
    return document, capsys.readouterr().out


def trace_of(log: str, *options: str) -> dict[str, Any]:
    assert run("slam-replay", log, "--json", "t.json", *options) == 0
    return dict(json.loads(Path("t.json").read_text()))


def test_a_laser_ahead(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = log_without_transforms(tmp_path, is_ahead=True)
    document, text = info(log, capsys)
    assert document["lasers"] == [{"x": 0, "y": 0, "theta": 0, "flipped": False, "known": False}]
    (reason,) = document["reasons"]
    assert (reason["kind"], reason["try"]) == ("mount_unknown", "--laser-pose 0.34,0,0")
    assert reason["text"].startswith(UNKNOWN + SEEMS)
    assert "yaw 0 deg on the robot, assumed: the log does not tell" in text
    assert "; try --laser-pose 0.34,0,0" in text
    trace = trace_of(log)
    assert trace["summary"]["reasons"] == [reason]
    assert trace["summary"]["verdict"] == "good"
    told = capsys.readouterr().err
    assert f"reason  {UNKNOWN}{SEEMS}" in told
    assert "try --laser-pose 0.34,0,0" in told
    # What is to be tried is right, and leaves nothing to say.
    trace = trace_of(log, *shlex.split(reason["try"]))
    assert trace["summary"]["reasons"] == []
    assert "mount unknown" not in capsys.readouterr().err


def test_a_laser_in_the_middle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = log_without_transforms(tmp_path, is_ahead=False)
    document, text = info(log, capsys)
    (reason,) = document["reasons"]
    assert (reason["kind"], reason["text"], reason["try"]) == ("mount_unknown", UNKNOWN, "")
    assert f"warning     {UNKNOWN}\n" in text
    summary = trace_of(log)["summary"]
    assert (summary["reasons"], summary["verdict"]) == ([reason], "good")


def test_where_the_log_tells(capsys: pytest.CaptureFixture[str]) -> None:
    document, text = info(str(FIXTURES / "apartment.mcap"), capsys)
    assert [laser["known"] for laser in document["lasers"]] == [True]
    assert document["reasons"] == []
    assert "assumed" not in text


def test_without_odometry_the_place_of_the_laser_does_not_matter(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = log_without_transforms(tmp_path, is_ahead=False, wheels=False)
    document, _ = info(log, capsys)
    assert [laser["known"] for laser in document["lasers"]] == [False]
    assert document["reasons"] == []
    assert any("mount unknown" in note for note in document["notes"])
