"""Several lasers on one robot make one map, each with its mount."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import FIXTURES, run

from mapcli import Pose2D, open_log
from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.model.scan import Mount, RangeScan

APARTMENT = str(FIXTURES / "apartment.mcap")


def half(scan: RangeScan, *, front: bool) -> RangeScan:
    """What a laser that looks ahead, or back, sees of a scan all around."""
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    ahead = np.cos(bearings) >= 0
    if front:
        some = np.flatnonzero(ahead)
        return replace(scan, angle_min=float(bearings[some[0]]), ranges=scan.ranges[some])
    # Behind, bearings go on from 90 to 270 degrees, of a laser that is turned by 180.
    some = np.argsort(bearings % math.tau)
    some = some[~ahead[some]]
    first = float(bearings[some[0]] % math.tau) - math.pi
    mount = Mount(Pose2D(0.0, 0.0, math.pi))
    return replace(scan, angle_min=first, ranges=scan.ranges[some], mount=mount)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The apartment's drive, its scanner replaced by two that see a half each, by turns."""
    path = tmp_path_factory.mktemp("lasers") / "two.mcap"
    number = 0
    with path.open("wb") as file, McapLogWriter(file) as writer:
        usual = writer.names
        for record in open_log([APARTMENT]).records():
            if not isinstance(record, RangeScan):
                writer.write(record)
                continue
            front = number % 2 == 0
            number += 1
            writer.names = usual._replace(scan_topic="/front" if front else "/rear")
            writer.write(half(record, front=front))
            writer.names = usual
    return str(path)


def summary(name: str) -> dict[str, object]:
    return dict(json.loads(Path(name).read_text())["summary"])


@pytest.mark.parametrize(
    "topics", [("--scan-topic", "all"), ("--scan-topic", "/rear", "--scan-topic", "/front")]
)
def test_two_lasers_make_one_map(
    log: str, topics: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("slam-replay", "-q", log, *topics, "-o", "both") == 0
    found = summary("both/trace.json")
    assert (found["used"], found["matched"], found["verdict"]) == (
        509,
        507,
        "good",
    )  # the first of each is not matched
    assert run("evaluate", "both/trace.json", APARTMENT, "--fail-if", "ate_rmse>0.02") == 0
    # Both halves of what was seen all around are in the map.
    assert run("slam-replay", "-q", APARTMENT, "-o", "one") == 0
    limit = "--fail-if", "iou_free<0.9"
    assert run("compare", "one/map.yaml", "both/map.yaml", *limit) == 0


def test_one_of_them_alone(log: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = "--scan-topic", "/rear", "--search", "none", "--json", "t.json"
    assert run("slam-replay", "-q", log, *options) == 0
    assert summary("t.json")["used"] == 254


def test_a_laser_pose_is_of_one_laser(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-replay", log, "--scan-topic", "all", "--laser-pose", "0,0,0") == 1
    assert "2 lasers, and one --laser-pose for them" in capsys.readouterr().err
