"""`mapcli slam-replay --search book`: Algorithm 9.2 in its own form, along a whole drive."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import FIXTURES, run
from support.replaying import traced

from mapcli import open_log
from mapcli.algorithms.scans.odometry_interpolation import odometry_at_scans
from mapcli.algorithms.similarity.measures import SIMILARITIES
from mapcli.model.range_reading import GatheredScan, RangeReading

ROBOT = ("--odom-noise", "0,0,0,0", "--speed", "0.2", "--range-max", "2")
LASER = ("--beams", "61", "--fov-deg", "180")
FIVE_SENSORS = ("--beams", "5", "--fov-deg", "180", "--range-max", "1")

THREE_SENSORS = (
    "--range-max", "1", "--sensor", "a=0.05,0,0", "--sensor", "b=0.04,0.03,45",
    "--sensor", "c=0.04,-0.03,-45",
)  # fmt: skip
TO_THE_SIDE = "--range-max", "1", "--sensor", "left=0,0.05,90"
RING = tuple(word for k in range(8) for word in ("--sensor", f"r{k}=0,0,{45 * k}"))

CELL = 0.05


@pytest.fixture(autouse=True)
def _somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def simulated(*options: str, world_name: str = "corridor") -> str:
    """A drive down the corridor, or through another world."""
    world, path = (str(FIXTURES / f"{world_name}{end}") for end in (".yaml", "-path.txt"))
    assert run("simulate", "-q", world, "--path", path, *ROBOT, *options, "drive.mcap") == 0
    return "drive.mcap"


def error(log: str, *options: str) -> float:
    """The ATE of a replay, metres."""
    assert run("slam-replay", "-q", log, *options, "--trace", "t.tum") == 0
    assert run("evaluate", "-q", "t.tum", log, "--json", "e.json") == 0
    return float(json.loads(Path("e.json").read_text())["summary"]["ate_rmse"])


@pytest.mark.parametrize("sensor", [LASER, FIVE_SENSORS, THREE_SENSORS, TO_THE_SIDE, RING])
def test_perfect_odometry_is_never_left_by_more_than_a_cell(sensor: tuple[str, ...]) -> None:
    log = simulated(*sensor)
    assert error(log, "--search", "none") < 1e-5
    for similarity in SIMILARITIES:
        assert error(log, "--search", "book", "--similarity", similarity) <= CELL


def test_sonars_that_fire_one_after_another_are_gathered() -> None:
    """Eight of them, 1/80 s apart: none of their readings are at the same time."""
    log = simulated(*RING, "--stagger")
    records = list(open_log(log).records())
    stamps = [one.stamp_ns for one in records if isinstance(one, RangeReading)]
    assert np.diff(stamps).tolist() == [12_500_000] * (len(stamps) - 1)
    scans = [scan for scan, _ in odometry_at_scans(iter(records))]
    gathered = [scan for scan in scans if isinstance(scan, GatheredScan)]
    assert len(scans) == len(gathered) + 1  # the first reading stays alone
    assert all(len({one.mount for one, _ in scan.readings}) == 8 for scan in gathered)
    assert error(log, "--search", "book") <= CELL


def test_what_is_staggered_are_sensors(capsys: pytest.CaptureFixture[str]) -> None:
    world, path = str(FIXTURES / "corridor.yaml"), str(FIXTURES / "corridor-path.txt")
    assert run("simulate", world, "--path", path, "--stagger", "x.mcap") == 2
    assert "--stagger is for range sensors; add --sensor" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    "sensor",
    [
        (*LASER, "--range-max", "1"),
        ("--range-max", "3", "--sensor", "left=0,0.05,90"),
        (*THREE_SENSORS, "--range-max", "3"),
        (*RING, "--range-max", "3"),
        (*RING, *(w for k in range(4) for w in ("--sensor", f"s{k}=0,0,{22 + 90 * k}"))),
    ],
)
def test_nor_is_it_in_a_furnished_apartment(sensor: tuple[str, ...]) -> None:
    """Legs of chairs, walls on borders of cells: few sensors went astray by up to six metres."""
    log = simulated(*sensor, world_name="apartment")
    assert error(log, "--search", "book") <= CELL


def test_wheels_that_slip_are_followed() -> None:
    log = simulated(*LASER, "--odom-fault", "slip@3-5")
    assert error(log, "--search", "none") == pytest.approx(0.140, abs=0.001)
    assert error(log, "--search", "book") <= 0.07
    for similarity in SIMILARITIES:
        assert error(log, "--search", "book", "--similarity", similarity) <= 0.10


def test_scans_are_compared_when_the_robot_has_moved_about_a_cell() -> None:
    log = simulated(*LASER)
    trace = traced(log, "--search", "book")
    odometry = [pose["odom"]["x"] for pose in trace["poses"]]
    compared = [k for k, pose in enumerate(trace["poses"]) if pose["status"] == "matched"]
    assert all(odometry[k] - odometry[k - 1] < CELL for k in range(1, len(odometry)))
    steps = [odometry[b] - odometry[a] for a, b in zip([0, *compared], compared, strict=False)]
    assert min(steps) > 0.9 * CELL
    assert max(steps) < 2 * CELL


def test_the_test_positions_can_be_chosen() -> None:
    log = simulated(*LASER)
    options = ("--search", "book", "--book-steps", "1,2", "--turns-deg", "-5,5")
    match = traced(log, *options, "--end", "3")["parameters"]["match"]
    assert match["book_steps"] == [1, 2]
    assert match["turns_deg"] == [-5, 5]


def test_options_that_change_nothing_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    log = simulated(*LASER)
    assert run("slam-replay", log, "--end", "2", "--turns-deg", "5", "--trace", "t.tum") == 0
    assert "Note: --turns-deg is for --search book" in capsys.readouterr().err


def test_test_positions_that_are_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-replay", "x.mcap", "--book-steps", "0") == 2
    assert "'0' is not of the form CELLS,...: up to 20 numbers" in capsys.readouterr().err


def test_the_comparisons_can_be_leafed_through(capsys: pytest.CaptureFixture[str]) -> None:
    log = simulated(*LASER, "--odom-fault", "slip@3-5")
    options = ("--search", "book", "--explain", "turns", "--explain-most", "20")
    assert run("slam-replay", log, "-o", "out", *options) == 0
    assert "explained  20 of 81 comparisons in turns/index.html; --explain-most" in (
        capsys.readouterr().err
    )
    page = Path("turns/index.html").read_text()
    assert page.count("<section") == 20
    assert page.count("data:image/png;base64,") == 40
    assert "http" not in page
    assert "prefers-color-scheme: dark" in page
    assert "ArrowRight" in page
    pictures = sorted(Path("turns").glob("*.png"))
    assert len(pictures) == 40
    tables = [path.read_text().splitlines() for path in sorted(Path("turns").glob("*.csv"))]
    assert len(tables) == 20
    assert all(len(lines) == 16 for lines in tables)
    best = [next(line for line in lines if line.endswith(",1")) for lines in tables]
    assert any(line.startswith("left,0,") for line in best)  # while the wheel slips
    assert best[0].startswith("intended,0,")


def test_only_the_books_search_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-replay", "x.mcap", "--explain", "turns") == 2
    assert "--explain shows what --search book compares" in capsys.readouterr().err
