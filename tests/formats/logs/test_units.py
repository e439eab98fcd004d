"""Readings that are no metres, angles that are no radians."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from support.mcap_making import mcap_file, odom, scan

from mapcli.formats.logs.open_log import open_log
from mapcli.formats.logs.units import count_units
from mapcli.model.log import LogOptions, UnitCounts
from mapcli.model.scan import RangeScan

RANGES = np.linspace(0.5, 8.0, 31)


def the_scan(file: str, options: LogOptions = LogOptions()) -> tuple[RangeScan, UnitCounts]:  # noqa: B008
    log = open_log(file, options)
    (record,) = (record for record in log.records() if isinstance(record, RangeScan))
    return record, log.units


def assert_right(record: RangeScan) -> None:
    assert record.ranges == pytest.approx(RANGES, rel=1e-5)
    assert (record.range_min, record.range_max) == pytest.approx((0.1, 10.0))
    assert record.angle_min == pytest.approx(-1.5)
    assert record.angle_increment == pytest.approx(0.1)


@pytest.mark.parametrize("limit", [1000, 1])
def test_millimetres(tmp_path: Path, limit: float) -> None:
    """Drivers give the limits in millimetres, too, or in metres."""
    sent = scan(
        0, 1000 * RANGES, angle_min=-1.5, increment=0.1,
        range_min=0.1 * limit, range_max=10.0 * limit,
    )  # fmt: skip
    file = mcap_file(tmp_path, odom(0), sent)
    record, units = the_scan(file)
    assert (units.sampled, units.too_far, units.turning) == (1, 1, 0)
    assert units.middle == pytest.approx(4250)
    record, units = the_scan(file, LogOptions(range_unit="mm"))
    assert_right(record)
    assert units.too_far == 0


def test_degrees(tmp_path: Path) -> None:
    sent = scan(0, RANGES, angle_min=math.degrees(-1.5), increment=math.degrees(0.1))
    file = mcap_file(tmp_path, odom(0), sent)
    _, units = the_scan(file)
    assert (units.sampled, units.too_far, units.turning) == (1, 0, 1)
    assert units.turns == pytest.approx(31 * math.degrees(0.1) / math.tau)
    record, units = the_scan(file, LogOptions(angle_unit="deg"))
    assert_right(record)
    assert units.turning == 0


@pytest.mark.parametrize("factor", [100.0, 1000.0])
def test_carmen(tmp_path: Path, factor: float) -> None:
    """Before the codes for no return are looked for, which are in the same unit."""
    readings = [*(factor * RANGES), *[factor * 81.91] * 30]
    words = " ".join(f"{reading:.2f}" for reading in readings)
    lines = [f"FLASER {len(readings)} {words} 0 0 0 0 0 0 {t} host {t}\n" for t in range(40)]
    file = tmp_path / "a.log"
    file.write_text("".join(lines))
    options = LogOptions(range_unit="mm" if factor == 1000 else "cm")
    record = next(r for r in open_log(file, options).records() if isinstance(r, RangeScan))
    assert record.ranges[:31] == pytest.approx(RANGES, rel=1e-3)
    assert np.isposinf(record.ranges[31:]).all()
    log = open_log(file)
    list(log.records())
    assert log.units.too_far == log.units.sampled == 3
    assert log.units.millimetres == (3 if factor == 1000 else 0)


@pytest.mark.parametrize(
    ("ranges", "increment"),
    [
        (np.full(360, 65535.0), 0.017),  # a code for no return
        (np.r_[np.linspace(1, 9, 20), [65533.0, 65534.0, 65535.0] * 100], 0.017),
        (np.linspace(5, 190, 360), 0.017),  # a far-sighted laser
        (np.full(360, np.nan), 0.017),
        (np.linspace(1, 9, 720), 2 * math.tau / 720),  # two turns
        (np.linspace(1, 9, 16), math.tau / 16),  # sonars
    ],
)
def test_unusual_scans_in_the_right_units(ranges: np.ndarray, increment: float) -> None:
    counts = UnitCounts()
    count_units(ranges.astype(np.float32), increment, counts)
    assert (counts.sampled, counts.too_far, counts.turning) == (1, 0, 0)
