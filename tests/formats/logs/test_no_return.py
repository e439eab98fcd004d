"""Codes for "nothing seen": found by how often a log has them, and never a wall."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mapcli.formats.logs import no_return
from mapcli.formats.logs.no_return import NoReturnFilter
from mapcli.formats.logs.open_log import open_log
from mapcli.model.log import BeamCounts
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount, Odometry, RangeScan, Record

DAMAGE = Path(__file__).resolve().parents[4] / "shared" / "cases" / "damage"
DATASETS = DAMAGE.parents[1] / "datasets"

STEP_M = 0.25
BEAMS = 181
Ranges = NDArray[np.float32]


def drive(
    ranges: Callable[[int], Ranges],
    scans: int = 100,
    step_m: float = STEP_M,
    mount: Mount | None = None,
) -> Iterator[Record]:
    """Scans of half a circle every tenth of a second, each after its odometry."""
    for k in range(scans):
        stamp = (k + 1) * 100_000_000
        yield Odometry(stamp, Pose2D(step_m * k))
        increment = math.pi / (BEAMS - 1)
        yield RangeScan(stamp, -math.pi / 2, increment, ranges(k), mount=mount or Mount())


def room(k: int) -> Ranges:
    """Real readings: every scan its own, thinning out towards 40 m."""
    random = np.random.default_rng(k)
    return np.float32(np.round(40 * random.random(BEAMS) ** 2 + 0.5, 2))


def with_codes(*codes: float, share: float = 0.05) -> Callable[[int], Ranges]:
    """The room where beams here and there read one of the codes."""

    def ranges(k: int) -> Ranges:
        random = np.random.default_rng(1000 + k)
        coded = random.random(BEAMS) < share
        return np.where(coded, np.float32(random.choice(codes, BEAMS)), room(k))

    return ranges


def filtered(records: Iterable[Record]) -> tuple[list[RangeScan], list[str], BeamCounts]:
    codes, beams = NoReturnFilter(), BeamCounts()
    scans = [r for r in codes.records(records, beams) if isinstance(r, RangeScan)]
    return scans, list(codes.lines()), beams


@pytest.mark.parametrize(
    ("codes", "said"),
    [
        ((65.53,), "65.53 m"),
        ((81.91,), "81.91 m"),
        ((51.14, 51.15), "51.14 to 51.15 m"),
        ((51.12, 51.14, 51.15, 51.17), "51.12 to 51.17 m"),
        ((50.0, 51.14, 51.15), "50.00 m and 51.14 to 51.15 m"),
        ((40.9,), "40.90 m"),  # where the room ends
    ],
)
def test_codes_are_found_however_they_spread(codes: tuple[float, ...], said: str) -> None:
    """Also with a stray reading beyond them, which is no return then."""

    def ranges(k: int) -> Ranges:
        found = with_codes(*codes)(k)
        found[0] = codes[-1] + 0.1 if k == 7 else found[0]
        return found

    scans, lines, beams = filtered(drive(ranges))
    assert lines == [f"readings of {said} are taken for no return"]
    far = [ranges(k) >= np.float32(min(codes)) for k in range(100)]
    assert [np.isposinf(scan.ranges).tolist() for scan in scans] == [f.tolist() for f in far]
    assert beams.no_return == sum(map(np.count_nonzero, far))
    assert all(scan.range_max == np.float32(min(codes)) for scan in scans)


def test_real_readings_stay() -> None:
    scans, lines, beams = filtered(drive(room))
    assert (lines, beams.no_return) == ([], 0)
    assert all(np.array_equal(scan.ranges, room(k)) for k, scan in enumerate(scans))


def corridor(k: int) -> Ranges:
    """2 m wide, 20 m long to its end: six beams of equal reading where the robot stands."""
    bearings = np.abs(np.linspace(-math.pi / 2, math.pi / 2, BEAMS))
    return np.float32(np.round(np.minimum(20 / np.cos(bearings), 1 / np.sin(bearings + 1e-9)), 2))


def test_a_far_wall_is_no_code_where_the_robot_stands() -> None:
    assert filtered(drive(corridor, 500, step_m=0.0))[1] == []


def test_a_far_wall_is_no_code_where_the_robot_drives_along_it() -> None:
    def ranges(k: int) -> Ranges:
        bearings = np.linspace(-math.pi / 2, math.pi / 2, BEAMS)
        return np.float32(np.round(np.minimum(20 / np.cos(bearings), 25), 2))

    scans, lines, _ = filtered(drive(ranges))
    assert lines == ["readings of 25.00 m are taken for no return"]
    assert np.isfinite(scans[0].ranges[54:127]).all()


def test_wide_arcs_tell_where_the_robot_stands() -> None:
    """No wall is equally far over 90 degrees."""

    def ranges(k: int) -> Ranges:
        return np.where(np.arange(BEAMS) < 90, np.float32(30.0), corridor(k))

    scans, lines, _ = filtered(drive(ranges, 5, step_m=0.0))
    assert lines == ["readings of 30.00 m are taken for no return"]
    assert np.isposinf(scans[0].ranges[:90]).all()
    assert np.isfinite(scans[0].ranges[90:]).all()


def test_a_sensor_that_sees_beyond_has_no_code_there() -> None:
    """A fifth of all beams reads 10 m, and as many see farther."""
    assert filtered(drive(with_codes(10.0, 15.0, 22.0, 31.0, 37.0, share=0.5)))[1] == []


def test_without_odometry_a_laser_may_stand() -> None:
    scans = (record for record in drive(with_codes(45.0), 500) if isinstance(record, RangeScan))
    assert filtered(scans)[1] == []


def test_each_laser_has_codes_of_its_own() -> None:
    front, back = Mount(Pose2D(1)), Mount(Pose2D(-1, 0, math.pi))
    records = sorted(
        [*drive(with_codes(45.0), mount=front), *drive(room, mount=back)],
        key=lambda record: record.stamp_ns,
    )
    scans, lines, _ = filtered(iter(records))
    assert lines == ["readings of 45.00 m are taken for no return"]
    assert {scan.mount for scan in scans if np.isinf(scan.ranges).any()} == {front}


def test_records_keep_their_order_and_are_not_all_held(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(no_return, "MOST_SCANS", 10)
    passed = list[Record]()

    def noted() -> Iterator[Record]:
        for record in drive(room, step_m=0.0):
            passed.append(record)
            yield record

    given = NoReturnFilter().records(noted(), BeamCounts())
    assert next(given) is passed[0]
    assert len(passed) == 20
    assert [record.stamp_ns for record in given] == [r.stamp_ns for r in passed[1:]]


def test_codes_that_come_late_are_found_from_then_on() -> None:
    """A robot that stands at first sees no code for what it is before it has been around."""
    scans, lines, _ = filtered(
        record
        for part in (
            drive(room, no_return.MOST_SCANS, step_m=0.0),
            drive(with_codes(45.0), 2 * no_return.PLACES, step_m=0.5),
        )
        for record in part
    )
    assert lines == ["readings of 45.00 m are taken for no return"]
    assert (scans[-1].ranges != 45.0).all()


def test_every_reader_passes_them_through(tmp_path: Path) -> None:
    lines = [
        f"FLASER 181 {' '.join(map(str, with_codes(45.0)(k)))} {k} 0 0 {k} 0 0 {k} host {k}"
        for k in range(100)
    ]
    path = tmp_path / "a.log"
    path.write_text("\n".join([*lines, ""]))
    log = open_log(path)
    scans = [record for record in log.records() if isinstance(record, RangeScan)]
    assert log.notes == ["FLASER: readings of 45.00 m are taken for no return"]
    assert log.beams.no_return == sum(np.isposinf(scan.ranges).sum() for scan in scans) > 500


@pytest.mark.skipif(not DAMAGE.is_dir(), reason="the handed-out logs are not here")
@pytest.mark.parametrize("name", ["range-good", "range-one-3000"])
def test_a_stray_reading_changes_nothing(name: str) -> None:
    log = open_log(DAMAGE / f"{name}.log")
    list(log.records())
    assert log.notes == ["FLASER: readings of 50.00 m are taken for no return"]
    assert log.beams.no_return == 73 + (name == "range-one-3000")


@pytest.mark.skipif(not DATASETS.is_dir(), reason="the public logs are not here")
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("acapulco.log.gz", "50.00 m and 51.14 to 51.16 m"),
        ("aces.log.gz", "50.00 m"),
        ("simulated/depot-wheels.mcap", None),
        ("simulated/depot-people.mcap", None),
        ("intel.log.gz", None),
        ("freiburg-101.log.gz", None),
    ],
)
def test_public_logs(name: str, said: str | None) -> None:
    """Readings of 80 m and more in CARMEN logs are SICK's codes, which need not be found out."""
    log = open_log(DATASETS / name)
    list(log.records())
    notes = [note for note in log.notes if "no return" in note]
    assert notes == ([f"FLASER: readings of {said} are taken for no return"] if said else [])
