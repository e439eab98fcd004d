"""What a log's time_increment is worth, and what is said instead of it."""

from __future__ import annotations

import math
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from mapcli import open_log
from mapcli.formats.logs.beam_times import CHECKED_SCANS, with_beam_times
from mapcli.formats.logs.mcap.writer import write_log
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.sweep import AT_ONCE, BeamTiming

MS = 1_000_000
BEAMS = 101


def scan(ms: float, increment: float) -> RangeScan:
    ranges = np.ones(BEAMS, np.float32)
    timing = BeamTiming(increment, order=None)
    return RangeScan(round(ms * MS), 0.0, math.tau / 200, ranges, timing=timing)


def timings(records: list[Record], **options: object) -> tuple[list[BeamTiming], list[str]]:
    """Of the scans, and what was noted; every record comes out in its place."""
    notes: list[str] = []
    out = list(with_beam_times(records, LogOptions(**options), notes.append))  # type: ignore[arg-type]
    assert [one.stamp_ns for one in out] == [one.stamp_ns for one in records]
    return [one.timing for one in out if isinstance(one, RangeScan)], notes


def every_100_ms(increment: float, scans: int = 20) -> list[Record]:
    return [
        record
        for k in range(scans)
        for record in (Odometry(100 * k * MS, Pose2D()), scan(100 * k, increment))
    ]


@pytest.mark.parametrize("increment", [1e-3, 1.1e-3, 1e-5])
def test_a_sweep_that_fits_between_two_stamps_is_believed(increment: float) -> None:
    found, notes = timings(every_100_ms(increment))
    assert found == [BeamTiming(increment, "first", None)] * 20
    assert not notes


@pytest.mark.parametrize("increment", [1.11e-3, 86400.0, math.inf, -1e-3, math.nan, 2.2e-7])
def test_others_are_reported_and_not_used(increment: float) -> None:
    found, notes = timings(every_100_ms(increment))
    assert found == [BeamTiming(order=None)] * 20  # to be found from the scans
    assert len(notes) == 1
    assert "not used" in notes[0]
    assert "time_increment" in notes[0]


def test_no_time_from_beam_to_beam_takes_all_at_once_and_holds_nothing_back() -> None:
    def records():  # type: ignore[no-untyped-def]
        yield scan(0, 0.0)
        raise AssertionError("another record was asked for")

    assert next(with_beam_times(records(), LogOptions(), print)) is not None


@pytest.mark.parametrize("increment", [0.0, 5.0])
def test_what_the_stamp_is_of_counts_for_times_that_are_found_too(increment: float) -> None:
    found, _ = timings(every_100_ms(increment), scan_stamp="last")
    assert found == [BeamTiming(0.0, "last", None)] * 20


def test_all_at_once_is_not_searched_for_where_it_is_said() -> None:
    found, _ = timings(every_100_ms(1e-3), turn_time=0.0)
    assert found == [AT_ONCE] * 20


def test_nonsense_is_reported_once_however_it_varies() -> None:
    _, notes = timings([scan(100 * k, 2e-7 + 1e-9 * k) for k in range(CHECKED_SCANS + 50)])
    assert len(notes) == 1


def test_the_median_counts() -> None:
    # Stamps in bursts of two, and a pause: most steps are 100 ms.
    stamps = [0, 1, *range(100, 1200, 100), 9000]
    found, _ = timings([scan(ms, 1e-3) for ms in stamps])
    assert found == [BeamTiming(1e-3, order=None)] * len(stamps)


def test_scans_after_those_that_are_checked_are_judged_as_well() -> None:
    records = every_100_ms(1e-3, CHECKED_SCANS + 20)
    records[-1] = scan(100 * (CHECKED_SCANS + 19), 5.0)
    found, notes = timings(records)
    assert found[:-1] == [BeamTiming(1e-3, order=None)] * (CHECKED_SCANS + 19)
    assert found[-1] == BeamTiming(order=None)
    assert len(notes) == 1


@pytest.mark.parametrize("increment", [0.0, 3.0])
def test_a_turn_time_is_believed_whatever_the_log_says(increment: float) -> None:
    found, notes = timings(
        every_100_ms(increment), turn_time=0.3, scan_stamp="last", beam_order="backward"
    )
    assert {(one.stamp, one.order) for one in found} == {("last", "backward")}
    assert found[0].increment == pytest.approx(0.3 / 200)
    assert not notes


def test_times_of_beams() -> None:
    timing = BeamTiming(0.1)
    assert timing.after_stamp(3).tolist() == pytest.approx([0, 0.1, 0.2])
    assert BeamTiming(0.1, "middle").after_stamp(3).tolist() == pytest.approx([-0.1, 0, 0.1])
    assert BeamTiming(0.1, "last").after_stamp(3).tolist() == pytest.approx([-0.2, -0.1, 0])
    flipped = BeamTiming(0.1, "first", "backward")
    assert flipped.after_stamp(3).tolist() == pytest.approx([0.2, 0.1, 0])
    assert BeamTiming(0.1).after_stamp(1).tolist() == [0]


def test_the_times_survive_a_log(tmp_path: Path) -> None:
    stream = BytesIO()
    write_log(every_100_ms(1e-3), stream)
    path = tmp_path / "log.mcap"
    path.write_bytes(stream.getvalue())
    log = open_log(path)
    scans = [record for record in log.records() if isinstance(record, RangeScan)]
    assert {one.timing.order for one in scans} == {None}
    assert scans[0].timing.increment == pytest.approx(1e-3)
    assert scans[0].last_ns - scans[0].first_ns == pytest.approx(100 * MS, rel=1e-6)
