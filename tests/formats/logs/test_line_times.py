"""Lines whose stamps do not tell the time: the times of logging, or the order of the lines, do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mapcli.formats.logs.line_clock import PERIOD_S, line_clock
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan

Stamp = Callable[[float], str]

SECONDS = 60


def fine(t: float) -> str:
    return f"{t:.6f}"


def six_digits(t: float) -> str:
    """As C++ prints numbers."""
    return f"{1.13486e9 + t:g}"


def rounded_to(seconds: float) -> Stamp:
    return lambda t: f"{seconds * int((1e6 + t) / seconds):.6f}"


def late(t: float) -> str:
    """A clock that is set back by an hour after 40 s."""
    return fine(10_000 + t - 3600 * (t >= 40))


def carmen(
    folder: Path,
    header: Stamp,
    log: Stamp | None = None,
    wheels: tuple[Stamp, Stamp] | None = None,
    kind: str = "FLASER",
) -> str:
    """A minute of driving at 0.1 m/s: a scan every 0.2 s, odometry every 0.1 s.

    Args:
        header, log: right time -> how it is printed; wheels: the same of the ODOM lines.
    """
    log = log or header
    lines = []
    for k in range(10 * SECONDS):
        t = k / 10
        printed = [clock(t) for clock in (wheels or (header, log))]
        lines.append(f"ODOM {t / 10:.6f} 0 0 0.1 0 0 {printed[0]} host {printed[1]}")
        if k % 2 == 0:
            t += 0.05
            pose, tail = f"{t / 10:.6f} 0 0", f"{header(t)} host {log(t)}"
            if kind == "FLASER":
                lines.append(f"FLASER 3 {1 + t / 100:.6f} 2 3 {pose} {pose} {tail}")
            else:
                lines.append(f"RAWLASER1 0 -1.57 3.14 1.57 80 0 0 3 {1 + t / 100:.6f} 2 3 0 {tail}")
    path = folder / "a.log"
    path.write_text("\n".join([*lines, ""]))
    return str(path)


def check(path: str, source: str, why: str, error: float) -> Log:
    """That every scan is there, at the right time after the first one, and so is its odometry."""
    log = open_log(path, LogOptions())
    records = list(log.records())
    scans = [record for record in records if isinstance(record, RangeScan)]
    assert len(scans) == 5 * SECONDS
    for scan in scans:
        right = 100 * (float(scan.ranges[0]) - 1) - 0.05
        assert (scan.stamp_ns - scans[0].stamp_ns) / NANOSECONDS == pytest.approx(right, abs=error)
    wheels = [record for record in records if isinstance(record, Odometry)]
    known = [record.stamp_ns for record in wheels], [record.pose.x for record in wheels]
    for scan in scans:
        x = float(np.interp(scan.stamp_ns, *known))
        assert x == pytest.approx(10 * (float(scan.ranges[0]) - 1), abs=0.011)
    assert (log.clock.source, log.clock.why) == (source, why)
    assert log.breaks == []
    assert log.damage.counts == {}
    return log


def test_good_stamps_are_taken_as_they_are(tmp_path: Path) -> None:
    assert check(carmen(tmp_path, fine), "header", "", 1e-4).odom_topic == "ODOM"


@pytest.mark.parametrize(
    ("stamp", "share"),
    [(six_digits, 100), (lambda t: "0", 100), (lambda t: fine(1e9), 100),
     (rounded_to(1), 80), (rounded_to(10), 98), (rounded_to(1000), 100)],
    ids=["six digits", "zero", "equal", "1 s", "10 s", "1000 s"],
)  # fmt: skip
def test_coarse_stamps_give_way_to_the_order(tmp_path: Path, stamp: Stamp, share: int) -> None:
    """The odometry is that of the scans, which no line is ahead of or behind."""
    told = f"{share}% of the scans have the stamp of the one before"
    log = check(carmen(tmp_path, stamp), "order", told, 0.21)
    assert f"{told}: the order of the lines is used" in log.notes
    assert log.odom_topic == "FLASER"


def test_coarse_stamps_of_scans_without_odometry(tmp_path: Path) -> None:
    told = "100% of the scans have the stamp of the one before"
    log = check(carmen(tmp_path, six_digits, kind="RAWLASER"), "order", told, 0.21)
    assert (log.scan_topics, log.odom_topic) == (["RAWLASER1"], "ODOM")


@pytest.mark.parametrize("stamp", [six_digits, lambda t: fine(1e9), rounded_to(10)])
def test_coarse_stamps_beside_fine_times_of_logging(tmp_path: Path, stamp: Stamp) -> None:
    log = open_log(carmen(tmp_path, stamp, fine))
    assert log.odom_topic == "ODOM"
    list(log.records())
    check(carmen(tmp_path, stamp, fine), "log", log.clock.why, 1e-4)


def test_zeros_beside_fine_times_of_logging(tmp_path: Path) -> None:
    """They are no stamps, as ever."""
    check(carmen(tmp_path, lambda t: "0", fine), "header", "", 1e-4)


def test_a_clock_that_is_set_back(tmp_path: Path) -> None:
    told = "a clock was set back by 60 min"
    check(carmen(tmp_path, late, fine), "log", told, 1e-4)
    assert check(
        carmen(tmp_path, late), "header", f"{told}, which is taken out", 0.1
    ).clock.steps == 1  # fmt: skip


def test_a_clock_that_is_set_ahead(tmp_path: Path) -> None:
    told = "a clock was set ahead by 60 min"
    check(carmen(tmp_path, lambda t: fine(t + 3600 * (t >= 40)), fine), "log", told, 1e-4)


def test_an_hour_without_records(tmp_path: Path) -> None:
    """Both clocks tell of it."""
    log = open_log(carmen(tmp_path, lambda t: fine(t + 3600 * (t >= 40))))
    stamps = [record.stamp_ns for record in log.records()]
    assert (stamps[-1] - stamps[0]) / NANOSECONDS == pytest.approx(3600 + SECONDS, abs=0.2)
    assert log.clock.why == ""


def test_clocks_that_are_apart(tmp_path: Path) -> None:
    """Of the messages; or both of the scans, which the order of the lines shows."""
    told = "stamps of scans and odometry are 4 min apart"

    def ahead(t: float) -> str:
        return fine(t + 250)

    check(carmen(tmp_path, ahead, fine, (fine, fine)), "log", told, 1e-4)
    log = check(carmen(tmp_path, ahead, None, (fine, fine)), "order", told, 1e-4)
    assert log.odom_topic == "FLASER"


@pytest.mark.parametrize(
    ("unit", "name"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
@pytest.mark.parametrize("start", [0.0, 1.13486e9])
def test_stamps_that_are_no_seconds(tmp_path: Path, unit: float, name: str, start: float) -> None:
    path = carmen(tmp_path, lambda t: str(round((start + t + 1) * unit)))
    log = check(path, "header", "", 1e-4)
    assert f"stamps are taken as {name}" in log.notes
    first = next(iter(log.records()))
    assert first.stamp_ns == pytest.approx((start + 1) * NANOSECONDS, abs=1000)


def test_stamps_that_were_hit_change_no_clock(tmp_path: Path) -> None:
    path = Path(carmen(tmp_path, fine))
    lines = path.read_text().splitlines()
    for k in (100, 400, 700):
        lines[k] = lines[k].replace(lines[k].split()[-3], "3.5").replace(" host ", " host 4")
    path.write_text("\n".join([*lines, ""]))
    log = open_log(str(path))
    list(log.records())
    assert (log.clock.source, log.clock.why) == ("header", "")


def test_times_by_lines() -> None:
    """A clock that ticks each second, and 4, 4, 4 scans between the ticks."""
    stamps = np.repeat([7.0, 8.0, 9.0, 10.0, 11.0], [2, 4, 4, 4, 3])
    clock = line_clock(np.arange(0, 34, 2), stamps)
    seconds = (clock.times_ns - clock.times_ns[0]) / NANOSECONDS
    assert seconds == pytest.approx(np.arange(17) * 0.25)
    assert clock.at(2) - clock.at(0) == NANOSECONDS // 4
    assert clock.at(3) - clock.at(0) == NANOSECONDS * 3 // 8
    assert clock.times_ns[2] == 8 * NANOSECONDS


def test_times_where_nothing_tells_them() -> None:
    clock = line_clock(np.arange(10), np.zeros(10))
    assert clock.times_ns.tolist() == [round(k * PERIOD_S * NANOSECONDS) for k in range(10)]
