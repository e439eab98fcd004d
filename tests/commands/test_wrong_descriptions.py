"""Logs that describe their laser wrongly are told, with the option that mends them."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SHARED, run
from support.replaying import APARTMENT, replay, write_log

from mapcli import Pose2D, open_log
from mapcli.algorithms.slam.slam import Slam
from mapcli.model.reason import DESCRIPTIONS
from mapcli.model.scan import RangeScan
from mapcli.model.trace import TracedPose

CASES = SHARED / "cases" / "logs"

RECORDS = list(open_log(APARTMENT).records())


def in_millimetres(scan: RangeScan) -> RangeScan:
    return replace(scan, ranges=scan.ranges * np.float32(1000), range_min=100.0, range_max=12000.0)


def in_centimetres(scan: RangeScan) -> RangeScan:
    return replace(scan, ranges=scan.ranges * np.float32(100), range_min=10.0, range_max=1200.0)


def in_degrees(scan: RangeScan) -> RangeScan:
    angles = math.degrees(scan.angle_min), math.degrees(scan.angle_increment)
    return replace(scan, angle_min=angles[0], angle_increment=angles[1])


Change = Callable[[RangeScan], RangeScan]

WRONG: dict[str, tuple[Change, str, str]] = {
    "laser_turned": (
        lambda scan: replace(scan, angle_min=scan.angle_min - math.pi),
        "scans move another way than the wheels: the laser is mounted backwards",
        "--laser-pose 0,0,180",
    ),
    "laser_mirrored": (
        lambda scan: replace(
            scan, angle_min=-scan.angle_min, angle_increment=-scan.angle_increment
        ),
        "scans turn the other way than the wheels: the laser is mirrored",
        "--laser-pose 0,0,0,flip",
    ),
    "range_unit": (
        in_millimetres,
        "readings of 1,057 m in the middle: they look like millimetres",
        "--range-unit mm",
    ),
    "range_unit, cm": (
        in_centimetres,
        "readings of 106 m in the middle: they look like centimetres",
        "--range-unit cm",
    ),
    "angle_unit": (
        in_degrees,
        "a scan's angles make 57 full turns: they look like degrees",
        "--angle-unit deg",
    ),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def wrong_log(kind: str) -> str:
    change = WRONG[kind][0]
    return write_log("wrong.mcap", [change(r) if isinstance(r, RangeScan) else r for r in RECORDS])


def summary() -> dict[str, Any]:
    return dict(json.loads(Path("t.json").read_text())["summary"])


def described() -> list[dict[str, Any]]:
    """Reasons that are faults of the description; `--search none` makes others."""
    return [reason for reason in summary()["reasons"] if reason["kind"] in DESCRIPTIONS]


QUICK = "--search", "none", "--json", "t.json"


@pytest.mark.parametrize("kind", WRONG)
def test_it_is_said_by_both_commands(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    log, (_, text, remedy) = wrong_log(kind), WRONG[kind]
    reason = {"kind": kind.split(",")[0], "from_s": 0.0, "to_s": 101.6, "text": text, "try": remedy}
    assert run("info", log, "--json", "i.json") == 0
    assert f"  warning     {text}; try {remedy}" in capsys.readouterr().out.splitlines()
    assert json.loads(Path("i.json").read_text())["reasons"] == [reason]
    assert replay("-q", log, *QUICK) == 0
    assert capsys.readouterr().err == f"Warning: wrong.mcap: {text}; try {remedy}\n"
    assert described() == [reason]
    assert summary()["verdict"] == "bad"


@pytest.mark.parametrize("kind", ["range_unit", "angle_unit"])
def test_units_are_told_before_anything_is_mapped(
    kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log, step, said = wrong_log(kind), Slam.step, []

    def counted(slam: Slam, scan: RangeScan, odom: Pose2D | None) -> TracedPose:
        said.append(capsys.readouterr().err)
        return step(slam, scan, odom)

    monkeypatch.setattr(Slam, "step", counted)
    replay("-q", log, *QUICK, "--end", "5")
    assert said[0] == f"Warning: wrong.mcap: {'; try '.join(WRONG[kind][1:])}\n"
    assert not any(said[1:])
    assert capsys.readouterr().err == ""


@pytest.mark.slow
@pytest.mark.parametrize("kind", WRONG)
def test_the_option_mends_it(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    log, remedy = wrong_log(kind), WRONG[kind][2]
    assert replay("-q", log, *shlex.split(remedy), "--json", "t.json") == 0
    assert capsys.readouterr().err == ""
    assert (summary()["verdict"], summary()["reasons"]) == ("good", [])
    assert run("evaluate", "t.json", APARTMENT, "--fail-if", "ate_rmse>0.01") == 0


def test_wheels_did_not_fail_when_the_laser_looks_backwards(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert replay(wrong_log("laser_turned"), "--json", "t.json") == 0
    assert summary()["odometry_faults"] > 0
    assert "wheels that failed" not in capsys.readouterr().err


@pytest.mark.skipif(not CASES.is_dir(), reason="needs the shared cases")
@pytest.mark.parametrize(
    ("log", "remedy"),
    [
        ("cw_mirrored/cw_mirrored.mcap", "--laser-pose 0,0,0,flip"),
        ("degrees/deg.mcap", "--angle-unit deg"),
    ],
)
def test_cases(log: str, remedy: str) -> None:
    assert replay("-q", str(CASES / log), *QUICK) == 0
    assert [reason["try"] for reason in described()] == [remedy]
    assert replay("-q", str(CASES / log), *shlex.split(remedy), *QUICK) == 0
    assert described() == []
