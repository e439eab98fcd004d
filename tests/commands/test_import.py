"""`mapcli import` as a user types it, and what it does to real logs."""

from __future__ import annotations

import gzip
import io
import math
from pathlib import Path
from typing import Any

import pytest
from conftest import SHARED
from support.mcap_making import mcap_bytes, mcap_file, odom, scan

from mapcli import Pose2D, open_log
from mapcli.cli import main
from mapcli.model.scan import Mount, Odometry, RangeScan, Record

DATASETS = SHARED / "datasets"

CARMEN = "\n".join(
    f"ODOM {t / 10} 0 0.1 0 0 0 {t} host {t}\n"
    f"FLASER 3 {t} 2.5 81.91 {t / 10} 0.1 3.1 {t / 10} 0.1 3.1 {t}.5 host {t}.5"
    for t in range(1, 6)
)


@pytest.fixture
def log(tmp_path: Path) -> str:
    path = tmp_path / "robot.log"
    path.write_text(CARMEN)
    return str(path)


def run(*args: str) -> int:
    with pytest.raises(SystemExit) as stop:
        main(["import", *args])
    return int(stop.value.code or 0)


def identity(record: Record) -> tuple[Any, ...]:
    if isinstance(record, RangeScan):
        return (
            record.stamp_ns, record.angle_min, record.angle_increment, record.ranges.tobytes(),
            record.range_min, record.range_max, record.mount,
        )  # fmt: skip
    return record.stamp_ns, record.pose


def records_of(path: str | Path) -> list[Record]:
    return list(open_log([str(path)]).records())


def test_carmen_to_mcap(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "robot.mcap"
    assert run(log, str(out)) == 0
    assert list(map(identity, records_of(out))) == list(map(identity, records_of(log)))
    heard = capsys.readouterr()
    assert heard.out == ""
    assert heard.err == f"{out}: 5 scans and 10 odometry records of 4.5 s\n"


def test_the_same_bytes_again(log: str, tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap", "c.mcap"):
        assert (
            run("-q", log if name != "c.mcap" else str(tmp_path / "b.mcap"), str(tmp_path / name))
            == 0
        )
    a, b, c = ((tmp_path / name).read_bytes() for name in ("a.mcap", "b.mcap", "c.mcap"))
    assert a == b == c


def test_quiet_and_verbose(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-q", log, str(tmp_path / "a.mcap")) == 0
    assert capsys.readouterr().err == ""
    assert run("-v", log, str(tmp_path / "a.mcap")) == 0
    assert "Scans from FLASER, odometry from ODOM.\n" in capsys.readouterr().err


def test_pipelines(
    log: str, monkeypatch: pytest.MonkeyPatch, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    packed = gzip.compress(CARMEN.encode())

    class Stdin:
        buffer = io.BytesIO(packed)

    monkeypatch.setattr("sys.stdin", Stdin())
    assert run("-", "-") == 0
    heard = capfdbinary.readouterr()
    assert heard.out.startswith(b"\x89MCAP0\r\n")
    assert heard.out.endswith(b"\x89MCAP0\r\n")
    assert heard.err == b"-: 5 scans and 10 odometry records of 4.5 s\n"


def test_part_of_a_log(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.mcap"
    assert run("--start", "1", "--end", "3.5", "--every", "2", log, str(out)) == 0
    stamps = [r.stamp_ns / 1e9 for r in records_of(out) if isinstance(r, RangeScan)]
    assert stamps == [2.5, 4.5]
    capsys.readouterr()
    assert run("--start", "90", log, str(out)) == 1
    assert capsys.readouterr().err == "Error: robot.log: no scan in the part asked for\n"
    assert len(records_of(out)) > 2  # the older result stays
    assert run("--start", "2", "--end", "1", log, str(out)) == 2
    assert "--end is before --start." in capsys.readouterr().err


def test_laser_pose(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.mcap"
    assert run("--laser-pose", "0.1,0,180,flip", log, str(out)) == 0
    (mount,) = {record.mount for record in records_of(out) if isinstance(record, RangeScan)}
    assert mount.flipped
    assert (mount.pose.x, mount.pose.y) == (0.1, 0.0)
    assert abs(mount.pose.theta) == pytest.approx(math.pi, abs=1e-8)
    for wrong in ("1,2", "1,2,x", "1,2,3,flop", "1,2,3,flip,4", "nan,0,0", "flip"):
        assert run("--laser-pose", wrong, log, str(out)) == 2
        assert f"'{wrong}' is not of the form X,Y,YAW_DEG[,flip]." in capsys.readouterr().err


def test_topics_and_parts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = mcap_file(tmp_path, scan(1, topic="/a"), scan(2, topic="/b"), odom(1), name="one.mcap")
    two = mcap_file(tmp_path, scan(3, topic="/a"), odom(3), name="two.mcap")
    out = tmp_path / "out.mcap"
    assert run(two, one, str(out)) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"Error: {two}: several scan topics: /a (sensor_msgs/msg/LaserScan, 2")
    assert not out.exists()
    assert run("--scan-topic", "/a", two, one, str(out)) == 0
    assert [r.stamp_ns for r in records_of(out) if isinstance(r, RangeScan)] == [10**9, 3 * 10**9]


def test_time_source(tmp_path: Path) -> None:
    sent = mcap_file(tmp_path, scan(1, log=9), odom(2, log=8))
    assert run("-q", "--time-source", "log", sent, str(tmp_path / "out.mcap")) == 0
    assert [r.stamp_ns / 1e9 for r in records_of(tmp_path / "out.mcap")] == [8, 9]


def test_a_damaged_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = mcap_bytes(*(scan(t, [1.0] * 50) for t in range(1, 50)))
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    cut, out = str(tmp_path / "cut.mcap"), tmp_path / "out.mcap"
    assert run(cut, str(out)) == 0
    heard = capsys.readouterr().err
    assert f"Warning: cut.mcap: 1 file cut short (byte {len(data) // 2})\n" in heard
    assert "Note: no odometry: poses come from matching scans alone\n" in heard
    before = out.read_bytes()
    assert run("--strict", cut, str(out)) == 1
    assert capsys.readouterr().err == (
        f"Error: {cut}: byte {len(data) // 2}: 1 file cut short; "
        "expected an undamaged log (--strict)\n"
    )
    assert out.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.mcap", "out.mcap"]


def test_outputs_are_protected(
    log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.mcap"
    assert run("-q", log, str(out)) == 0
    assert run("--no-clobber", log, str(out)) == 1
    assert "exists already, and --no-clobber is set" in capsys.readouterr().err
    assert run(str(out), str(out)) == 1
    assert capsys.readouterr().err == f"Error: {out}: is one of the logs to be read\n"
    assert run(str(out), log) == 2
    assert "does not end in .mcap." in capsys.readouterr().err


def test_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("a.mcap") == 2
    assert run("--every", "0", "a.log", "b.mcap") == 2
    assert run(str(tmp_path / "none.log"), str(tmp_path / "b.mcap")) == 1
    assert capsys.readouterr().err.endswith("none.log: no such file\n")


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    text = capsys.readouterr().out
    assert "mapcli import intel.log.gz intel.mcap" in text
    assert "[default: auto]" in text


# Real logs

FACTS = {  # scans, ODOM lines, beams, readings without return
    "aces": (440, 7374, 180, 620),
    "belgioioso": (395, 4047, 361, 699),
    "csail": (406, 1988, 361, 3907),
    "freiburg-101": (292, 4277, 360, 12555),
    "intel": (910, 13631, 180, 4172),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FACTS)
def test_real_logs_and_their_imports_are_the_same(name: str, tmp_path: Path) -> None:
    path = DATASETS / f"{name}.log.gz"
    if not path.exists():
        pytest.skip("the datasets are not there")
    carmen = open_log([str(path)])
    records = list(carmen.records())
    scans, odom_lines, beams, no_return = FACTS[name]
    found = [record for record in records if isinstance(record, RangeScan)]
    assert len(found) == carmen.scan_count == scans
    assert sum(isinstance(record, Odometry) for record in records) == scans + odom_lines
    assert {len(record.ranges) for record in found} == {beams}
    assert {record.mount for record in found} == {Mount(Pose2D())}
    assert (carmen.beams.no_return, carmen.beams.invalid) == (no_return, 0)
    assert carmen.damage.counts == {}
    out = tmp_path / "out.mcap"
    assert run("-q", str(path), str(out)) == 0
    assert list(map(identity, records_of(out))) == list(map(identity, records))
