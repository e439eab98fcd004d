"""Where another recording begins, and where nothing but the wheels failed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from mapcli.formats.logs.continuity import Continuity
from mapcli.formats.logs.odometry_track import Place
from mapcli.formats.logs.recording_break import Break
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, RangeScan, Record

S = 10**9

HOUR = 3600.0


def drive(start: Pose2D = Pose2D(), seconds: float = 40.0, turn: float = 0.05) -> list[Record]:  # noqa: B008
    """A robot that drives a curve at half a metre per second, from time 0: odometry ten times a
    second, scans five times."""
    records: list[Record] = []
    pose = start
    for tick in range(round(seconds * 10)):
        records.append(Odometry(round(tick * S / 10), pose))
        if tick % 2:
            records.append(RangeScan(round(tick * S / 10), 0.0, 0.1, np.ones(3, np.float32)))
        pose = pose.compose(Pose2D(0.05, 0.0, turn / 10))
    return records


def later(records: Iterable[Record], seconds: float) -> list[Record]:
    return [replace(r, stamp_ns=r.stamp_ns + round(seconds * S)) for r in records]


def moved(records: Iterable[Record], by: Pose2D) -> list[Record]:
    """The same with odometry in another frame."""
    return [replace(r, pose=by.compose(r.pose)) if isinstance(r, Odometry) else r for r in records]


def breaks(records: Iterable[Record], second_file: int | None = None) -> list[Break]:
    continuity, numbers = Continuity(), itertools.count()
    parts = iter(0 if second_file is None or n < second_file else 1 for n in numbers)
    for _ in continuity.watched(records, lambda: Place(next(parts))):
        pass
    return continuity.breaks


DRIVE = drive()
HALF = len(DRIVE) // 2
HALF_S = DRIVE[HALF].stamp_ns / S


def at(index: int) -> Pose2D:
    """Odometry at that record or just before."""
    return next(r.pose for r in reversed(DRIVE[: index + 1]) if isinstance(r, Odometry))


# One recording


@pytest.mark.parametrize("pause", [2.0, 60.0, HOUR, 24 * HOUR])
def test_odometry_that_goes_on_after_a_pause_of_any_length(pause: float) -> None:
    assert breaks([*DRIVE[:HALF], *later(DRIVE[HALF:], pause)]) == []
    # The same with a robot that was pushed, or turned on the spot, meanwhile.
    pushed = moved(DRIVE[HALF:], Pose2D(0.3, -0.3))
    assert breaks([*DRIVE[:HALF], *later(pushed, pause)]) == []


@pytest.mark.parametrize("hole", [2.0, 10.0, 19.0])
def test_a_hole_in_which_the_robot_drove_on(hole: float) -> None:
    kept = [r for r in drive(seconds=60) if not 20 < r.stamp_ns / S < 20 + hole]
    assert breaks(kept) == []


@pytest.mark.parametrize("jump", [Pose2D(30, 0), at(HALF).inverse(), Pose2D(0, 0, math.pi)])
def test_wheels_that_jump_or_restart_while_recording_goes_on(jump: Pose2D) -> None:
    assert breaks([*DRIVE[:HALF], *moved(DRIVE[HALF:], jump)]) == []
    # Odometry may also be missing before, as long as scans go on.
    silent = [
        r
        for r in moved(DRIVE[HALF:], jump)
        if isinstance(r, RangeScan) or r.stamp_ns / S > HALF_S + 5
    ]
    assert breaks([*DRIVE[:HALF], *silent]) == []


def test_nonsense_in_single_records() -> None:
    records = list(DRIVE)
    for index in range(30, len(records), 60):
        nonsense = Odometry(records[index].stamp_ns + 1000 * S * (index % 3 - 1), Pose2D(-50, 7, 3))
        records[index] = nonsense if index % 4 else replace(nonsense, pose=Pose2D())
    assert breaks(records) == []
    assert breaks([*records[:HALF], *later(records[HALF:], HOUR)]) == []


@pytest.mark.parametrize("seconds", [1.5, HOUR])
def test_a_clock_that_is_set_back(seconds: float) -> None:
    assert breaks([*DRIVE[:HALF], *later(DRIVE[HALF:], -seconds)]) == []


def test_a_second_file_that_goes_on() -> None:
    assert breaks(DRIVE, second_file=HALF) == []


def test_a_pause_without_odometry() -> None:
    scans = [r for r in DRIVE if isinstance(r, RangeScan)]
    assert breaks([*scans[:50], *later(scans[50:], 300)]) == []
    stray = [*scans[:50], replace(scans[50], stamp_ns=10**18), *scans[51:]]
    assert breaks(stray) == []


# Several recordings

SECOND = drive(turn=-0.1)


def test_a_restart_after_hours() -> None:
    gap = 2 * HOUR
    (found,) = breaks([*DRIVE, *later(SECOND, DRIVE[-1].stamp_ns / S + gap)])
    assert found.what == "odometry starts again after nothing was recorded for 2.0 h"
    assert (found.after_ns - found.before_ns) / S == pytest.approx(gap, abs=0.1)
    assert not found.mixed


@pytest.mark.parametrize("gap", [3.0, 60.0, HOUR])
def test_a_restart_after_a_gap(gap: float) -> None:
    assert breaks([*DRIVE, *later(SECOND, DRIVE[-1].stamp_ns / S + gap)])


def test_odometry_somewhere_else_after_hours() -> None:
    end = Pose2D(576.5, 0.1, -2.2)
    (found,) = breaks([*DRIVE, *later(moved(SECOND, end), 3 * HOUR)])
    assert found.what == (
        "odometry starts again after nothing was recorded for 3.0 h, "
        f"{at(len(DRIVE) - 1).distance(end):.1f} m from where it was"
    )


def test_a_restart_that_is_recorded_late() -> None:
    """The robot has moved a little when recording begins."""
    assert breaks([*DRIVE, *later(SECOND[2:], 3 * HOUR)])


def test_times_that_start_again() -> None:
    (found,) = breaks([*DRIVE, *SECOND])
    assert found.what == "odometry starts again, 39.9 s before the time it had reached"
    assert found.mixed
    assert breaks([*DRIVE, *DRIVE])


def test_a_second_file_that_starts_elsewhere() -> None:
    (found,) = breaks(
        [*DRIVE, *later(SECOND, DRIVE[-1].stamp_ns / S + 0.1)], second_file=len(DRIVE)
    )
    assert found.what == "odometry starts again"
    assert found.parts == (0, 1)


def test_two_drives_interleaved() -> None:
    second = moved(SECOND, Pose2D(20, 5, 1))
    both = sorted([*DRIVE, *second], key=lambda record: record.stamp_ns)
    (found,) = breaks(both)
    assert found.what == "odometry goes back and forth between two places, on from each of them"
    assert found.mixed


def test_hours_without_odometry() -> None:
    scans = [r for r in DRIVE if isinstance(r, RangeScan)]
    (found,) = breaks([*scans[:50], *later(scans[50:], 2 * HOUR)])
    assert found.what == "nothing was recorded for 2.0 h, and no odometry goes on over it"
