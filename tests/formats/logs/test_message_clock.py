"""Messages whose stamps do not tell the time: the times of recording show it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import SHARED
from support.mcap_making import S, Sent, mcap_file, odom, scan

from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.scan import Odometry, RangeScan

Stamp = Callable[[float], float]

CASES = SHARED / "cases" / "logs"

SECONDS = 60


def right(t: float) -> float:
    return t


def recording(scans: Stamp = right, wheels: Stamp = right) -> Iterator[Sent]:
    """A minute from 1000 s on: a scan every 0.2 s, recorded 0.05 s after it is taken, odometry ten
    times as often and at once. What is seen, and the way, tell when each is from.

    Args:
        scans, wheels: right time -> stamp.
    """
    for k in range(50 * SECONDS):
        t = 1000 + k / 50
        yield odom(wheels(t), (t - 1000) / 10, log=t)
        if k % 10 == 0:
            yield scan(scans(t), (1 + (t - 1000) / 100, 2, 3), log=t + 0.05)


def read(folder: Path, *sent: Sent, **options: Any) -> tuple[Log, list[tuple[float, float]]]:
    """The log; right time, and time that it is taken for, of each record."""
    log, times = open_log(mcap_file(folder, *sent), LogOptions(**options)), []
    for record in log.records():
        if isinstance(record, RangeScan):
            times.append((1000 + 100 * (float(record.ranges[0]) - 1), record.stamp_ns / S))
        elif isinstance(record, Odometry):
            times.append((1000 + 10 * record.pose.x, record.stamp_ns / S))
    return log, times


def late(t: float) -> float:
    """A clock that is set back by an hour after 40 s."""
    return t - 3600 * (t >= 1040) + 10_000


def ahead(t: float) -> float:
    return t + 3600 * (t >= 1040)


def check(folder: Path, source: str, why: str, error: float, *sent: Sent) -> Log:
    """That every scan is there, at about the right time after the first record."""
    log, times = read(folder, *sent)
    assert log.damage.scans_read == 5 * SECONDS
    begin = times[0][1]
    assert all(abs(taken - begin - (time - 1000)) < error for time, taken in times)
    assert (log.clock.source, log.clock.why) == (source, why)
    assert log.damage.counts == {}
    return log


def test_good_stamps_are_taken_as_they_are(tmp_path: Path) -> None:
    log = check(tmp_path, "header", "", 1e-3, *recording())
    assert log.delays["/scan"].mean_s == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("stamp", "why"),
    [
        (lambda t: 0.0, "/scan"),
        (lambda t: 1134.0, "/scan"),
        (lambda t: float(int(t)), "/scan"),
        (lambda t: 10.0 * int(t / 10), "/scan"),
    ],
    ids=["zero", "equal", "1 s", "10 s"],
)
def test_coarse_stamps(tmp_path: Path, stamp: Stamp, why: str) -> None:
    """Of the scans alone, and of both."""
    told = f"one stamp on many messages of {why}"
    log = check(tmp_path, "log", told, 0.06, *recording(scans=stamp))
    assert f"{told}: times of recording are used" in log.notes
    check(tmp_path, "log", "one stamp on many messages of /odom", 0.06, *recording(stamp, stamp))


def test_odometry_that_repeats_its_last_reading(tmp_path: Path) -> None:
    """With its stamp: the stamps are right, the times of recording are not."""
    sent = []
    for k in range(500):
        fresh = 1000 + k // 2 / 25
        sent.append(odom(fresh, fresh - 1000, log=1000 + k / 50))
    log, _ = read(tmp_path, *sent, *(scan(1000 + k / 10) for k in range(100)))
    assert (log.clock.source, log.clock.why) == ("header", "")


def test_a_clock_that_is_set_back(tmp_path: Path) -> None:
    told = "a clock was set back by 60 min, which is taken out"
    log = check(tmp_path, "header", told, 0.06, *recording(late, late))
    assert told in log.notes
    assert log.breaks == []


def test_a_clock_that_is_set_ahead(tmp_path: Path) -> None:
    told = "a clock was set ahead by 60 min, which is taken out"
    check(tmp_path, "header", told, 0.06, *recording(ahead, ahead))


def test_the_clock_of_one_topic_is_set(tmp_path: Path) -> None:
    told = "a clock was set ahead by 60 min, which is taken out"
    check(tmp_path, "header", told, 0.06, *recording(scans=ahead))


def test_a_clock_that_is_set_for_a_while(tmp_path: Path) -> None:
    """The way back is known: time is right to the nanosecond afterwards."""
    log, times = read(tmp_path, *recording(lambda t: t - 100 * (1020 <= t < 1030)))
    assert [taken for time, taken in times if time > 1031] == pytest.approx(
        [time for time, _ in times if time > 1031], abs=1e-4
    )
    assert log.clock.steps == 1


def test_clocks_that_are_apart(tmp_path: Path) -> None:
    told = "stamps of /odom and /scan are 4 min apart"
    log = check(tmp_path, "log", told, 0.06, *recording(scans=lambda t: t + 250))
    assert log.delays["/scan"].mean_s == pytest.approx(-249.95)


def test_stamps_that_go_at_another_rate(tmp_path: Path) -> None:
    told = "stamps of /scan go 1.5 times as fast as those of /odom"
    check(tmp_path, "log", told, 0.06, *recording(scans=lambda t: 1.5 * t))


def test_milliseconds_for_seconds(tmp_path: Path) -> None:
    told = "a second of recording is 1e+03 s in the stamps of /odom"
    check(tmp_path, "log", told, 0.06, *recording(lambda t: 1000 * t, lambda t: 1000 * t))


def test_a_log_that_was_played_again(tmp_path: Path) -> None:
    """At ten times its speed, with a pause of the robot, and one of the player."""
    sent, begin = list(recording()), 1000 * S
    for one in sent:
        played = begin + (one.log_ns - begin) // 10
        one.log_ns = played + 60 * S * (played > begin + 3 * S)
    paused = [one for one in sent if not 1020 * S < begin + 10 * (one.log_ns - begin) < 1025 * S]
    log, times = read(tmp_path, *paused)
    assert (log.clock.source, log.clock.why) == ("header", "")
    assert all(abs(taken - time) < 1e-3 for time, taken in times)


def test_a_recorder_that_writes_late(tmp_path: Path) -> None:
    """Messages wait for half a minute: their stamps are right."""
    sent = list(recording())
    for one in sent:
        if 1010 * S < one.log_ns < 1040 * S:
            one.log_ns = 1039 * S + (one.log_ns - 1010 * S) // 100
    check(tmp_path, "header", "", 1e-3, *sent)


def test_stamps_as_they_are_on_demand(tmp_path: Path) -> None:
    log, _ = read(tmp_path, *recording(scans=lambda t: t + 250), time_source="header")
    assert (log.clock.source, log.clock.why, log.clock.steps) == ("header", "", 0)
    assert log.outside.share == 1.0


@pytest.mark.skipif(not CASES.exists(), reason="the cases are not there")
def test_the_case_of_a_clock_that_was_set_back() -> None:
    log = open_log(CASES / "clock_back_long" / "long1.mcap")
    stamps = [record.stamp_ns for record in log.records() if isinstance(record, RangeScan)]
    assert len(stamps) == 509
    assert stamps[-1] - stamps[0] == pytest.approx(508 * 0.2 * S, abs=0.01 * S)
