"""CSV logs of educational robots: what they say, and one line for each way to be wrong."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from mapcli import LogOptions, Pose2D, open_log, save_log
from mapcli.errors import MapcliError
from mapcli.formats.file_kind import kind_of
from mapcli.formats.logs.csv.sensors_file import sensors_file_of
from mapcli.formats.logs.log import Log
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Mount, Odometry

YAML = """\
units: {time: ms, length: cm, angle: deg, range: mm}
range_min: 20
range_max: 800
nothing: 0
sensors:
  r1: {x: 5, y: 0, yaw_deg: 0}
  r2: {x: 0, y: -4, yaw_deg: -90, range_max: 500, fov_deg: 90, nothing: -1}
  g1: {ground: true}
ignore: [battery]
"""
CSV = """\
# a drive
t, x, y, theta, r1, r2, g1, battery
0, 0, 0, 0, 400, 600, 12, 5.1
100, 1.5, 0, 90, 0, -1, 13, low
100.5, 2, -1, 450, , 10, 13, low
"""


def log_of(folder: Path, csv: str = CSV, yaml: str | None = YAML, **options: object) -> Log:
    (folder / "robot.csv").write_text(csv)
    if yaml is not None:
        (folder / "robot.yaml").write_text(yaml)
    return open_log(folder / "robot.csv", LogOptions(**options))  # type: ignore[arg-type]


def test_rows_are_odometry_and_readings(tmp_path: Path) -> None:
    log = log_of(tmp_path)
    records = list(log.records())
    quarter = round(math.pi / 2, 9)
    assert [(r.stamp_ns, r.pose) for r in records if isinstance(r, Odometry)] == [
        (0, Pose2D()),
        (100_000_000, Pose2D(0.015, 0, quarter)),
        (100_500_000, Pose2D(0.02, -0.01, quarter)),  # 450 degrees
    ]
    readings = [
        (r.sensor, r.stamp_ns // 10**6, pytest.approx(r.ranges.tolist()))
        for r in records
        if isinstance(r, RangeReading)
    ]
    assert readings == [
        ("r1", 0, [0.4]),
        ("r2", 0, [math.inf]),  # 0.6 m, and it sees 0.5 m
        ("r1", 100, [math.inf]),  # 0 is written for nothing...
        ("r2", 100, [math.inf]),  # ... and -1 of this one
        ("r2", 100, [-math.inf]),  # 1 cm, nearer than it measures
    ]
    r2 = next(r for r in records if isinstance(r, RangeReading) and r.sensor == "r2")
    assert r2.mount == Mount(Pose2D(0, -0.04, -quarter))
    assert (r2.range_min, r2.range_max) == (pytest.approx(0.02), 0.5)
    assert r2.field_of_view == pytest.approx(math.pi / 2)
    floor = log.sensors["g1"]
    assert (floor.kind, floor.readings) == ("ground", 3)
    assert (floor.least, floor.most) == (pytest.approx(0.012), pytest.approx(0.013))
    assert sorted(log.digests()) == ["robot.csv", "robot.yaml"]


def test_defaults_are_seconds_metres_radians(tmp_path: Path) -> None:
    csv = "t,x,y,theta,r1\n1600000000.123456789,1,2,0.5,9.5\n"
    log = log_of(tmp_path, csv, "sensors: {r1: {x: 0, y: 0, yaw_deg: 0}}")
    odometry, reading = log.records()
    assert odometry == Odometry(1_600_000_000_123_456_789, Pose2D(1, 2, 0.5))
    assert isinstance(reading, RangeReading)
    assert reading.ranges.tolist() == [9.5]
    assert reading.range_max == math.inf


def test_a_packed_log_and_parts(tmp_path: Path) -> None:
    head, *rows = CSV.partition("\n")[2].splitlines(keepends=True)
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress((head + rows[0]).encode()))
    (tmp_path / "b.csv").write_text(head + "".join(rows[1:]))
    (tmp_path / "robot.yaml").write_text(YAML)
    names = [str(tmp_path / "b.csv"), str(tmp_path / "a.csv.gz")]
    log = open_log(names, LogOptions(sensors_file=str(tmp_path / "robot.yaml")))
    assert [record.stamp_ns for record in log.records()] == [
        record.stamp_ns for record in log_of(tmp_path).records()
    ]
    assert sensors_file_of("x/a.csv.gz") == "x/a.yaml"


def test_it_is_the_same_as_mcap(tmp_path: Path) -> None:
    log = log_of(tmp_path)
    save_log(log.records(), tmp_path / "robot.mcap")
    again = open_log(tmp_path / "robot.mcap")
    for one, other in zip(log.records(), again.records(), strict=True):
        assert (one.stamp_ns, type(one)) == (other.stamp_ns, type(other))
        if isinstance(one, RangeReading) and isinstance(other, RangeReading):
            assert one.ranges.tolist() == other.ranges.tolist()
            assert (one.range_min, one.range_max, one.mount) == (
                other.range_min, other.range_max, other.mount,
            )  # fmt: skip
            assert other.sensor == f"/range/{one.sensor}"


def test_one_sensor_may_be_chosen_and_moved(tmp_path: Path) -> None:
    log = log_of(tmp_path, scan_topics=("r1",), sensors=(("r1", Mount(Pose2D(0, 0.1))),))
    readings = [r for r in log.records() if isinstance(r, RangeReading)]
    assert {(r.sensor, r.mount) for r in readings} == {("r1", Mount(Pose2D(0, 0.1)))}


@pytest.mark.parametrize(
    ("found", "replaced", "complaint"),
    [
        ("theta, r1", "r1", "head: has no column theta; expected a head line `t,x,y,theta,r1,...`"),
        ("t, x", "time, x", "head: has no column t; expected a head line `t,x,y,theta,r1,...`"),
        ("r2, g1", "r3, g1", "head: the column r3 is no sensor that {yaml} names; "
         "expected r1, r2, g1, or `ignore: [r3]` there"),
        (", r2, g1", ", g1, g1", "head: has the column g1 twice"),
        (", r2, g1", ", battery2, g1", "head: the column battery2 is no sensor that {yaml} names; "
         "expected r1, r2, g1, or `ignore: [battery2]` there"),
        ("13, low\n100.5", "13\n100.5", "line 4: has 7 columns; expected 8, as the head line"),
        ("400", "abc", "line 3: r1 is 'abc'; expected a distance, or nothing at all"),
        ("1.5, 0", "1.5, north", "line 4: y is 'north'; expected a number"),
        ("400", "-3", "line 3: r1 is -3; expected a distance, 0 or more"),
        ("400", "inf", "line 3: r1 is 'inf'; expected a distance, or nothing at all"),
        ("400", "1e999", "line 3: r1 is '1e999'; expected a distance, or nothing at all"),
        ("400", "nan", "line 3: r1 is 'nan'; expected a distance, or nothing at all"),
        ("\n100,", "\n-100,", "line 4: t is '-100'; expected a time from 0 on, or since 1970, to "
         "2038"),
        ("\n100,", "\n1134860000000000,", "line 4: t is '1134860000000000'; expected a time from 0 "
         "on, or since 1970, to 2038; the unit of t is told in the YAML, as in "
         "`units: {{time: ms}}`"),
        ("\n100,", "\n,", "line 4: t is ''; expected a time from 0 on, or since 1970, to 2038"),
        ("100.5", "99.5", "line 5: the time goes back from 0.1 to 0.0995 s; expected rows in time "
         "order"),
        ("2, -1, 450", "2e99, -1, 450", "line 5: x, y are 2e+97, -0.01 m; expected a place on "
         "Earth"),
    ],
)  # fmt: skip
def test_what_makes_no_sense(tmp_path: Path, found: str, replaced: str, complaint: str) -> None:
    assert found in CSV
    with pytest.raises(MapcliError) as refused:
        list(log_of(tmp_path, CSV.replace(found, replaced, 1)).records())
    yaml = tmp_path / "robot.yaml"
    assert str(refused.value) == f"{tmp_path}/robot.csv: {complaint.format(yaml=yaml)}"


@pytest.mark.parametrize(
    ("found", "replaced", "complaint"),
    [
        ("r1: {x: 5, y: 0, yaw_deg: 0}", "r1: 5", "line 6: r1: does not say where it sits; "
         "expected {x: M, y: M, yaw_deg: DEG}, or {ground: true}"),
        ("r1: {x: 5, ", "r1: {", "line 6: x: key is missing; expected where r1 sits on the robot"),
        ("yaw_deg: 0", "yaw_deg: ahead", "line 6: yaw_deg: 'ahead' is not a number; expected where "
         "r1 looks, degrees to the left of ahead"),
        ("x: 5", "x: 50000", "line 6: x: r1 is more than 100 m off the robot; expected a place on "
         "it, or another unit of length"),
        ("length: cm", "length: inch", "line 1: length: 'inch'; expected m or cm or mm"),
        ("units:", "unit:", "line 1: unit: is no key of this file; expected ignore, nothing, "
         "range_max, range_min, sensors, units"),
        ("range_max: 800", "range_max: -800", "line 3: range_max: -800 is negative; expected a "
         "distance"),
        ("range_max: 500", "range_max: 5", "line 7: range_max: r2 sees less far than its "
         "range_min; expected more"),
        ("ground: true", "ground: yes", "line 8: ground: 'yes'; expected true or false"),
        ("  g1: {ground: true}\n", "  g1: {ground: true}\n  r9: {x: 0, y: 0, yaw_deg: 0}\n", None),
    ],
)  # fmt: skip
def test_a_yaml_that_makes_no_sense(
    tmp_path: Path, found: str, replaced: str, complaint: str | None
) -> None:
    assert found in YAML
    with pytest.raises(MapcliError) as refused:
        log_of(tmp_path, CSV, YAML.replace(found, replaced, 1))
    yaml, csv = tmp_path / "robot.yaml", tmp_path / "robot.csv"
    missing = f"{csv}: head: has no column r9, which {yaml} names"
    assert str(refused.value) == (f"{yaml}: {complaint}" if complaint else missing)


def test_no_yaml(tmp_path: Path) -> None:
    with pytest.raises(MapcliError) as refused:
        log_of(tmp_path, yaml=None)
    assert str(refused.value) == (
        f"{tmp_path}/robot.csv: nothing says where its sensors sit; "
        f"expected a file {tmp_path}/robot.yaml, or --sensors"
    )
    with pytest.raises(MapcliError, match=r"none.yaml: no such file"):
        log_of(tmp_path, sensors_file="none.yaml")


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"t,x,y,theta,r1\n0,0,0,0,1\n", "a CSV log of a robot"),
        (b'\xef\xbb\xbf# note\n"t", x, y, r.1\n', "a CSV log of a robot"),  # theta is missing
        (b"stamp_ns,x,y,theta,odom_x,odom_y,odom_theta,score,status\n", "a CSV trace"),
        (b"t,x,y,theta\n0,0,0,0\n", "a CSV trace"),
    ],
)
def test_it_is_told_by_its_head(head: bytes, kind: str) -> None:
    found = kind_of(head, "a.csv")
    assert found is not None
    assert found.name == kind


# Time


PLAIN = """\
range_max: 3
sensors:
  r1: {x: 0, y: 0, yaw_deg: 0}
  r2: {x: 0, y: 0, yaw_deg: 90}
"""


def driven(stamp: str) -> str:
    """Ten rows a second, at 0.1 m/s; `stamp` is formatted with the time."""
    rows = (f"{stamp.format(t=k / 10)},{k / 100},0,0,{1 + k / 1000},2" for k in range(100))
    return "\n".join(["t,x,y,theta,r1,r2", *rows, ""])


@pytest.mark.parametrize(("stamp", "step"), [("{t:.0f}", 0.1), ("0", 0.2), ("1.13486e9", 0.2)])
def test_coarse_times_give_way_to_the_order_of_the_rows(
    tmp_path: Path, stamp: str, step: float
) -> None:
    log = log_of(tmp_path, driven(stamp), PLAIN)
    stamps = [r.stamp_ns * 1e-9 for r in log.records() if isinstance(r, Odometry)]
    assert np.diff(stamps) == pytest.approx(np.full(99, step), abs=0.02)
    assert log.clock.source == "order"
    assert log.clock.why.endswith("of the rows have the stamp of the one before")
    assert log.topics()[0].last_ns - log.topics()[0].first_ns == pytest.approx(99e9 * step, 0.02)


def test_a_row_for_each_sensor(tmp_path: Path) -> None:
    """Rows of one moment are no coarse clock."""
    rows = [f"{k / 10},{k / 100},0,0,{own}" for k in range(50) for own in ("1,", ",2")]
    log = log_of(tmp_path, "\n".join(["t,x,y,theta,r1,r2", *rows, ""]), PLAIN)
    stamps = [r.stamp_ns for r in log.records() if isinstance(r, RangeReading)]
    assert stamps == [k * 10**8 for k in range(50) for _ in range(2)]
    assert (log.clock.source, log.clock.why) == ("header", "")


def test_rows_that_are_far_apart(tmp_path: Path) -> None:
    """Milliseconds, of which the YAML does not tell."""
    lines = driven("{t:.1f}").splitlines()
    rows = [lines[0], *(f"{100 * k},{line.split(',', 1)[1]}" for k, line in enumerate(lines[1:]))]
    log = log_of(tmp_path, "\n".join([*rows, ""]), PLAIN)
    list(log.records())
    told = "rows are far apart: is t in another unit than the YAML tells (units: time)?"
    assert told in log.notes
