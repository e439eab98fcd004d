"""`mapcli perceive` and `slam-replay --save-perception`: what is expected, what was measured, and
the way back through `mapcli similarity-table`."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES, ROOT, run

from mapcli import load_perception
from mapcli.formats.documents.perception_writer import dump_perception
from mapcli.model.perception import (
    LandmarkPerception,
    PerceptionDatabase,
    ScanPerception,
)

DATASETS = ROOT.parent / "shared" / "datasets"
APARTMENT = str(FIXTURES / "apartment.mcap")
CORNER, POINTS = str(FIXTURES / "corner.txt"), str(FIXTURES / "landmarks-map.yaml")

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def best_of(capsys: Capture, *arguments: str) -> dict[str, Any]:
    capsys.readouterr()
    assert run("similarity-table", *arguments, "--format", "json") == 0
    return dict(json.loads(capsys.readouterr().out)["best"])


def database(name: str) -> PerceptionDatabase:
    found = load_perception(name)
    assert isinstance(found, PerceptionDatabase)
    return found


# --- at a pose of a map


def test_the_perceptions_of_activity_9_4() -> None:
    """At ((0, 1), -15 deg) the book has (2.2, 41.6), (2.2, -11.6), (3.6, -41.3)."""
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", "all.yaml") == 0
    found = database("all.yaml")
    assert len(found.expectations) == 15
    (up,) = [e for e in found.expectations if (e.position, e.turn_deg) == ("up", -15)]
    assert up.pose is not None
    assert (up.pose.x, up.pose.y, math.degrees(up.pose.theta)) == pytest.approx((0, 1, -15))
    degrees = [(d, math.degrees(b)) for d, b in up.readings.tolist()]
    expected = [(2.2, 41.6), (2.2, -11.6), (3.6, -41.3)]
    assert np.round(degrees, 1).tolist() == [list(pair) for pair in expected]


def test_the_database_of_activity_9_5_finds_its_own_poses(capsys: Capture) -> None:
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", "all.json") == 0
    for pose, position, turn in (("0,1,-15", "up", -15), ("-1,0,15", "left", 15)):
        assert run("perceive", "-q", POINTS, "--pose", pose, "--alone", "one.yaml") == 0
        best = best_of(capsys, "--database", "all.json", "one.yaml")
        assert (best["position"], best["turn_deg"]) == (position, turn)
        assert best["score"] == pytest.approx(0, abs=1e-5)
    # The book's measured set gives the book's pose here as well.
    best = best_of(capsys, "--database", "all.json", str(FIXTURES / "landmarks.yaml"))
    assert (best["position"], best["turn_deg"]) == ("up", -15)
    assert best["score"] == pytest.approx(1.717, abs=5e-4)


@pytest.mark.parametrize("similarity", ["l1", "l2", "agreement", "jaccard", "correlation"])
def test_a_database_of_scans(similarity: str, capsys: Capture) -> None:
    place = ("--heading-deg", "90", "--beams", "12", "--range-max", "4")
    assert run("perceive", "-q", CORNER, "--cell", "4,6", *place, "all.yaml") == 0
    found = database("all.yaml")
    assert found.of == "scan"
    assert {len(e.readings) for e in found.expectations} == {12}
    there = ("--cell", "5,6", "--heading-deg", "105", *place[2:])
    assert run("perceive", "-q", CORNER, *there, "--alone", "one.yaml") == 0
    capsys.readouterr()
    options = ("--database", "all.yaml", "one.yaml", "--similarity", similarity)
    assert run("similarity-table", *options, "--format", "json") == 0
    table = json.loads(capsys.readouterr().out)
    # Readings within a step are equal for `agreement` and `jaccard`, so others may be as good.
    winners = [(w["position"], w["turn_deg"]) for w in (table["best"], *table["ties"])]
    assert ("down", 15) in winners
    assert len(winners) == 1 or similarity in ("agreement", "jaccard")
    assert table["best"]["score"] == (0 if similarity in ("l1", "l2") else 1)


def test_a_scan_expected_in_a_grid_map() -> None:
    """Straight up from the middle of cell 4,6 the wall is 3.5 away; to the right is nothing."""
    options = ("--heading-deg", "90", "--beams", "4", "--alone")
    assert run("perceive", "-q", CORNER, "--cell", "4,6", *options, "one.yaml") == 0
    scan = load_perception("one.yaml")
    assert isinstance(scan, ScanPerception)
    assert np.degrees(scan.beams[:, 0]).round(6).tolist() == [-180, -90, 0, 90]
    assert scan.beams[:, 1].tolist() == [math.inf, math.inf, 3.5, 2.5]


def test_candidates_in_obstacles_are_left_out(capsys: Capture) -> None:
    assert run("perceive", CORNER, "--cell", "1,4", "all.yaml") == 0
    assert "12 poses, scan" in capsys.readouterr().err
    assert {e.position for e in database("all.yaml").expectations} == {
        "intended", "down", "left", "right"}  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ((CORNER, "--cell", "0,5"), "is in an obstacle or outside the map"),
        ((CORNER, "--pose", "90,5,0"), "outside the map; expected a place in its 8 rows"),
        ((POINTS, "--cell", "0,0"), "expected x and y, because the map has no cells"),
        ((APARTMENT, "--at", "500"), "no scan at 500 s; expected a time up to 101.6 s"),
        ((CORNER, "--at", "5"), "is a text map; draw it with mapcli render"),
        (("nope.yaml", "--pose", "0,0,0"), "nope.yaml: no such file"),
    ],
)
def test_bad_input(arguments: tuple[str, ...], error: str, capsys: Capture) -> None:
    assert run("perceive", *arguments, "out.yaml") == 1
    assert error in capsys.readouterr().err
    assert not Path("out.yaml").exists()


@pytest.mark.parametrize(
    "arguments",
    [("out.yaml",), ("--pose", "0,0,0", "--at", "1", "out.yaml"), ("--pose", "0,0,0", "out.txt"),
     ("--pose", "0,0,0", "--steps", "-1", "out.yaml"), ("--pose", "0,0", "out.yaml")],
)  # fmt: skip
def test_wrong_usage(arguments: tuple[str, ...]) -> None:
    assert run("perceive", POINTS, *arguments) == 2


# --- files


@pytest.mark.parametrize("suffix", ["yaml", "json"])
@pytest.mark.parametrize("source", ["corner-scan.yaml", "landmarks.yaml"])
def test_perceptions_read_back_as_written(source: str, suffix: str) -> None:
    perception = load_perception(FIXTURES / source)
    assert isinstance(perception, ScanPerception | LandmarkPerception)
    data = dump_perception(perception, f"x.{suffix}")
    Path(f"x.{suffix}").write_bytes(data)
    again = load_perception(f"x.{suffix}")
    assert isinstance(again, ScanPerception | LandmarkPerception)
    assert dump_perception(again, f"x.{suffix}") == data
    assert again.intended_pose == perception.intended_pose
    assert again.turns_deg == perception.turns_deg
    if isinstance(perception, ScanPerception) and isinstance(again, ScanPerception):
        np.testing.assert_allclose(again.beams, perception.beams)
        assert np.isinf(again.beams).any()


# --- out of a log


def test_the_scan_at_a_time_of_a_log(capsys: Capture) -> None:
    assert run("slam-replay", "-q", APARTMENT, "--json", "trace.json") == 0
    assert run("perceive", APARTMENT, "--at", "30.05", "one.yaml") == 0
    assert "scan 150 at 30.00 s, 360 beams" in capsys.readouterr().err
    odom = json.loads(Path("trace.json").read_text())["poses"][150]["odom"]
    scan = load_perception("one.yaml")
    assert isinstance(scan, ScanPerception)
    found = (*scan.intended_pose.xy, scan.intended_pose.theta)
    assert found == pytest.approx((odom["x"], odom["y"], odom["theta"]), abs=2e-6)


def agrees_within_a_step(folder: str, number: int, cell: float, capsys: Capture) -> None:
    """The best of the fifteen around the replay's pose is that pose, or one step from it."""
    best = best_of(capsys, f"{folder}/map.yaml", f"{folder}/perception-{number}.yaml")
    pose = json.loads(Path(folder, "trace.json").read_text())["poses"][number]
    away = math.hypot(best["pose"]["x"] - pose["x"], best["pose"]["y"] - pose["y"])
    assert away <= cell * 1.001
    assert best["turn_deg"] == 0


def test_round_trip(capsys: Capture) -> None:
    numbers = (0, 77, 200, 508)
    saved = [word for n in numbers for word in ("--save-perception", str(n))]
    assert run("slam-replay", "-q", APARTMENT, "-o", "out", *saved) == 0
    for number in numbers:
        agrees_within_a_step("out", number, 0.05, capsys)
    # By odometry alone the pose is off; a window around it finds the replay's pose.
    assert run("perceive", "-q", APARTMENT, "--at", "30", "one.yaml") == 0
    window = ("--window-xy", "0.4", "--window-theta-deg", "10", "--step-theta-deg", "1")
    best = best_of(capsys, "out/map.yaml", "one.yaml", *window)
    pose = json.loads(Path("out/trace.json").read_text())["poses"][150]
    assert best["pose"]["x"] == pytest.approx(pose["x"], abs=0.05)
    assert best["pose"]["y"] == pytest.approx(pose["y"], abs=0.05)
    assert best["pose"]["theta"] == pytest.approx(pose["theta"], abs=math.radians(2))


@pytest.mark.slow
@pytest.mark.skipif(not DATASETS.exists(), reason="no data sets here")
def test_round_trip_of_a_real_log(capsys: Capture) -> None:
    shutil.copy(DATASETS / "freiburg-101.log.gz", "robot.log.gz")
    saved = ("--save-perception", "20", "--save-perception", "250")
    assert run("slam-replay", "-q", "robot.log.gz", "-o", "out", *saved) == 0
    for number in (20, 250):
        agrees_within_a_step("out", number, 0.05, capsys)


def test_saving_a_scan_that_is_not_there(capsys: Capture) -> None:
    arguments = ("slam-replay", "-q", str(FIXTURES / "corridor.mcap"), "-o", "out")
    assert run(*arguments, "--save-perception", "50") == 1
    assert (
        "--save-perception 50: there is no such scan; expected 0 to 49" in capsys.readouterr().err
    )
    assert not Path("out").exists()  # it was said before the work


def test_similarity_of_the_replay(capsys: Capture) -> None:
    arguments = ("slam-replay", str(FIXTURES / "corridor.mcap"), "--json")
    for similarity in ("product", "jaccard"):
        options = ("--search", "book", "--similarity", similarity)
        assert run(*arguments, f"{similarity}.json", *options) == 0
    one, other = (json.loads(Path(f"{n}.json").read_text()) for n in ("product", "jaccard"))
    assert one["parameters"]["match"]["similarity"] == "product"
    assert other["parameters"]["match"]["similarity"] == "jaccard"
    capsys.readouterr()
    assert run(*arguments, "window.json", "--similarity", "l1") == 0
    assert "Note: --similarity is for --search book" in capsys.readouterr().err


def test_a_saved_scan_keeps_the_parameters_of_the_replay() -> None:
    options = ("--range-max", "2", "--no-return", "clear", "--save-perception", "3")
    assert run("slam-replay", "-q", str(FIXTURES / "corridor.mcap"), "-o", "out", *options) == 0
    scan = load_perception("out/perception-3.yaml")
    assert isinstance(scan, ScanPerception)
    assert (scan.range_max, scan.no_return, scan.walls) == (2, "clear", "ends")
    assert np.isinf(scan.beams[:, 1]).any()
    assert scan.beams[np.isfinite(scan.beams[:, 1]), 1].max() <= 2


# --- Activity 9.5


def test_sets_of_readings_and_how_precise_they_are(capsys: Capture) -> None:
    base = str(FIXTURES / "proximity-database.yaml")
    best = best_of(capsys, "--database", base, str(FIXTURES / "proximity.yaml"))
    assert (best["position"], best["turn_deg"]) == ("right", -15)
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", "all.yaml") == 0
    noise = "--noise", "0.05,1", "--times", "4"
    assert run("perceive", POINTS, "--pose", "0,0,0", *noise, "trials.yaml") == 0
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", *noise, "again.json") == 0
    assert load_perception("trials.yaml").trials[3].turn_deg == 0  # type: ignore[union-attr]
    capsys.readouterr()
    assert run("similarity-table", "--database", "all.yaml", "trials.yaml") == 0
    said = capsys.readouterr().out
    assert "pose      60 of 60 found (100.0%)" in said
    assert run("similarity-table", "--database", "all.yaml", "again.json") == 0
    assert capsys.readouterr().out == said


def test_how_precise_as_numbers(capsys: Capture) -> None:
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", "all.yaml") == 0
    noise = "--noise", "0.5,10", "--times", "20"
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", *noise, "trials.yaml") == 0
    ask = "similarity-table", "-q", "--database", "all.yaml", "trials.yaml"
    assert run(*ask, "--json", "c.json", "--fail-if", "right_share<0.5") == 0
    table = json.loads(Path("c.json").read_text())
    assert table["format"] == "mapcli.confusion-table"
    assert table["poses"][4] == {"position": "up", "turn_deg": -15}
    counts, summary = np.array(table["counts"]), table["summary"]
    assert (counts.sum(axis=1) + table["ties"]).tolist() == [20] * 15
    assert summary["trials"] == 300
    assert summary["right"] == counts.trace()
    assert 0.5 < summary["right_share"] == counts.trace() / 300 < summary["right_position_share"]
    capsys.readouterr()
    assert run(*ask, "--format", "json") == 0
    assert capsys.readouterr().out == Path("c.json").read_text()
    assert run(*ask, "--fail-if", "right_position_share<1") == 3
    assert "right_position_share is 0." in capsys.readouterr().err
    assert run(*ask, "--fail-if", "margin<1") == 2
    assert "the summary of a set of trials has trials, ties, right" in capsys.readouterr().err
    assert run(*ask, "--format", "csv") == 2
    assert run(*ask, "--png", "p.png") == 2


def test_a_measured_set_needs_no_pose_with_a_database(capsys: Capture) -> None:
    assert run("perceive", "-q", POINTS, "--pose", "0,0,0", "all.yaml") == 0
    text = "kind: landmarks\nmeasured: [[2.2, 41.6], [2.2, -11.6], [3.6, -41.3]]\n"
    Path("set.yaml").write_text(text)
    best = best_of(capsys, "--database", "all.yaml", "set.yaml")
    assert (best["position"], best["turn_deg"]) == ("up", -15)
    assert run("similarity-table", POINTS, "set.yaml") == 1
    assert "set.yaml: line 1: pose: key is missing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: readings\nreadings: [1, 2]\n", "set.yaml: readings: 2 readings; expected 3"),
        ("kind: readings\nreadings: []\n", "set.yaml: line 2: readings: no readings"),
        ("kind: readings\nreadings: [a]\n", "set.yaml: line 2: readings: "),
        ("kind: readings\n", "set.yaml: line 1: readings: key is missing"),
        ("kind: trials\nof: readings\ntrials: []\n", "set.yaml: line 3: trials: no trials"),
        (
            "kind: trials\nof: readings\ntrials:\n"
            "  - {position: up, turn_deg: 0, readings: [1, 2, 3]}\n"
            "  - {position: up, turn_deg: 0, readings: [1, 2]}\n",
            "set.yaml: line 5: readings: 2 readings; expected 3, as at the first pose",
        ),
    ],
)
def test_malformed_readings(text: str, message: str, capsys: Capture) -> None:
    Path("set.yaml").write_text(text)
    base = str(FIXTURES / "proximity-database.yaml")
    assert run("similarity-table", "--database", base, "set.yaml") == 1
    assert f"Error: {message}" in capsys.readouterr().err


def test_noise_of_nothing_is_wrong_usage() -> None:
    base = "perceive", POINTS, "--pose", "0,0,0", "x.yaml"
    for wrong in (["--times", "2"], ["--noise", "1", "--alone"], ["--noise", "-1"],
                  ["--noise", "a"], ["--noise", "1,2,3"]):  # fmt: skip
        assert run(*base, *wrong) == 2
