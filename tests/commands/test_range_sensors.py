"""The book's robots: a few range sensors, as Range topics and as CSV, from the log to the map."""

from __future__ import annotations

import json
from itertools import groupby
from pathlib import Path

import pytest
from conftest import FIXTURES, run
from support.mcap_making import Sent, mcap_bytes, odom, sonar, tf_static, transform

from mapcli import load_trajectory, open_log
from mapcli.formats.logs.ros import messages as ros
from mapcli.model.scan import Odometry, RangeScan, Record

LATERAL = FIXTURES / "lateral.mcap"
CORRIDOR = """\
polygons:
  - [[-1, 0.5], [2, 0.5], [2, 0.8], [3, 0.8], [3, 0.5], [7, 0.5], [7, 1], [-1, 1]]
  - [[-1, -0.5], [4, -0.5], [4, -0.3], [4.5, -0.3], [4.5, -0.5], [7, -0.5], [7, -1], [-1, -1]]
"""
RING = [
    f"--sensor={name}"
    for name in ("a=0.06,0,0", "b=0.05,0.04,45", "c=0.05,-0.04,-45", "d=0,0.05,90", "e=0,-0.05,-90")
]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def drive(out: str, *options: str) -> None:
    """Along 6 m of a corridor with a door niche and a pillar; sensors that see 1 m."""
    Path("corridor.yaml").write_text(CORRIDOR)
    Path("path.txt").write_text("0 0\n6 0\n")
    given = "corridor.yaml", out, "--path", "path.txt", "--speed", 0.2, "--range-max", 1
    assert run("simulate", "-q", *given, "--odom-noise", "0,0,0,0", *RING, *options) == 0


def range_topic(records: list[Record], kind: str) -> bytes:
    """The same log, its only beam on a Range topic."""
    messages = [tf_static(records[0].stamp_ns / 1e9, transform(0, "base_link", "side", (0, 0, 0),
                                                              (0, 0, 90)))]  # fmt: skip
    for record in records:
        t = record.stamp_ns / 1e9
        if isinstance(record, Odometry):
            messages.append(odom(t, record.pose.x, record.pose.y, record.pose.theta))
        elif isinstance(record, RangeScan):
            variance = 0.01 if kind == "variance" else None
            messages.append(sonar(t, float(record.ranges[0]), frame="side", limits=(0, 2),
                                  variance=variance))  # fmt: skip
            if kind == "json":
                messages[-1].data = as_json(messages[-1])
    if kind == "json":
        others = [m for m in messages if m.type != ros.RANGE]
        Path("others.mcap").write_bytes(mcap_bytes(*others))
        return mcap_bytes(*(m for m in messages if m.type == ros.RANGE), encoding="json")
    return mcap_bytes(*messages)


def as_json(sent: Sent) -> bytes:
    m = sent.message
    stamp = {"sec": m.header.stamp.sec, "nanosec": m.header.stamp.nanosec}
    return json.dumps({
        "header": {"stamp": stamp, "frame_id": m.header.frame_id}, "radiation_type": 0,
        "field_of_view": 0.25, "min_range": m.min_range, "max_range": m.max_range,
        "range": m.range,
    }).encode()  # fmt: skip


def as_csv(records: list[Record]) -> str:
    lines = ["t,x,y,theta,side"]
    for stamp, group in groupby(records, key=lambda record: record.stamp_ns):
        odometry, scan = group
        assert isinstance(odometry, Odometry)
        assert isinstance(scan, RangeScan)
        pose = odometry.pose
        t = f"{stamp // 10**9}.{stamp % 10**9:09d}"
        lines.append(f"{t},{pose.x!r},{pose.y!r},{pose.theta!r},{float(scan.ranges[0])!r}")
    return "\n".join(lines)


def map_of(*log: str, **options: str) -> bytes:
    words = [word for key, value in options.items() for word in (f"--{key}", value)]
    assert run("slam-replay", "-q", *log, *words, "--map", "m.pgm") == 0
    return Path("m.pgm").read_bytes()


@pytest.mark.parametrize("search", ["none", "window"])
def test_one_beam_makes_the_same_map_in_every_format(search: str) -> None:
    records = list(open_log(LATERAL).records())
    expected = map_of(str(LATERAL), search=search)
    for kind in ("cdr", "variance"):
        Path("range.mcap").write_bytes(range_topic(records, kind))
        assert map_of("range.mcap", search=search) == expected
    Path("json.mcap").write_bytes(range_topic(records, "json"))
    assert map_of("json.mcap", "others.mcap", search=search) == expected
    Path("side.csv").write_text(as_csv(records))
    Path("side.yaml").write_text("range_max: 2\nsensors: {side: {x: 0, y: 0, yaw_deg: 90}}\n")
    assert map_of("side.csv", search=search) == expected
    assert run("import", "-q", "side.csv", "again.mcap") == 0
    assert map_of("again.mcap", search=search) == expected


@pytest.mark.parametrize("search", ["window", "none"])
def test_five_sensors_in_a_corridor_end_where_the_robot_is(search: str) -> None:
    drive("ring.mcap")
    drive("ring.csv")
    maps = [map_of(log, search=search, trace="t.csv") for log in ("ring.mcap", "ring.csv")]
    assert maps[0] == maps[1]
    found = load_trajectory("t.csv").trajectory.poses[-1]
    truth = load_trajectory("ring.mcap", "/ground_truth").trajectory.poses
    right = truth[-1] - truth[0]  # the robot starts at 0, 0, 0
    assert right[:2] == pytest.approx([6, 0], abs=1e-3)
    assert found[:2] == pytest.approx(right[:2], abs=0.12)
    assert found[2] == pytest.approx(0, abs=0.03)


def test_few_hits_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-replay", LATERAL, "--map", "m.pgm") == 0
    assert (
        "Note: no scan is matched: none has the 5 hits that a match takes (--min-hits), at "
        "most 1; the map is made by odometry.\n" in capsys.readouterr().err
    )
    assert run("slam-replay", LATERAL, "--map", "m.pgm", "--min-hits", 1) == 0
    told = capsys.readouterr().err
    assert "Note: no scan" not in told
    assert "matched  0" not in told
    assert run("slam-replay", LATERAL, "--map", "m.pgm", "--min-hits", 0) == 2


def test_info_says_what_the_sensors_are(capsys: pytest.CaptureFixture[str]) -> None:
    places = transform(0, "base_link", "a", (0.1, 0, 0)), transform(
        0, "base_link", "b", (0, 0.1, 0), (0, 0, 90)), transform(
        0, "base_link", "floor", (0, 0, 0), (0, 90, 0))  # fmt: skip
    Path("ring.mcap").write_bytes(mcap_bytes(
        tf_static(0, *places), odom(1), odom(4, x=1),
        sonar(1, 0.5, topic="/a", frame="a"), sonar(2, float("inf"), topic="/a", frame="a"),
        sonar(2, -float("inf"), topic="/b", frame="b", limits=(0.3, 0.3)),
        sonar(3, 0.05, topic="/floor", frame="floor"),
    ))  # fmt: skip
    assert run("info", "ring.mcap", "--json", "i.json") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("  sensor")] == [
        "  sensor      /a: distance, up to 2 m, x 0.1 m, y 0 m, yaw 0 deg on the robot; 2 readings "
        "of 0.5 to 0.5 m, 50.0% saw nothing",
        "  sensor      /b: switch at 0.3 m, x 0 m, y 0.1 m, yaw 90 deg on the robot; 1 reading, "
        "100.0% saw something",
        "  sensor      /floor: looks at the floor or up, up to 2 m; 1 reading of 0.05 to 0.05 m",
    ]
    sensors = json.loads(Path("i.json").read_bytes())["sensors"]
    assert [(s["name"], s["kind"], s["nothing"]) for s in sensors] == [
        ("/a", "distance", 1), ("/b", "switch", 0), ("/floor", "ground", 0),
    ]  # fmt: skip


def test_a_sensor_without_a_mount(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.mcap").write_bytes(mcap_bytes(odom(0), odom(3, x=1), sonar(1, 0.5), sonar(2, 0.5)))
    assert run("slam-replay", "a.mcap", "--map", "m.pgm") == 1
    assert capsys.readouterr().err == (
        "Error: a.mcap: /sonar: nothing tells where the sensor 'sonar' sits on 'base_link'; "
        "expected a transform to it, or --sensor /sonar=X,Y,YAW_DEG\n"
    )
    assert run("slam-replay", "-q", "a.mcap", "--map", "m.pgm", "--sensor", "/sonar=0,0,90") == 0
    assert run("slam-replay", "-q", "a.mcap", "--map", "m.pgm", "--sensor", "/sonar") == 2
    assert run("slam-replay", "-q", "a.mcap", "--map", "m.pgm", "--sensor", "/b=0,0,0") == 1
    assert "no sensor /b among /sonar" in capsys.readouterr().err


def test_what_is_read_is_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    drive("ring.csv")
    before = Path("ring.yaml").read_bytes()
    assert run("perceive", "ring.csv", "ring.yaml", "--at", 3) == 1
    assert run("slam-replay", "ring.csv", "--map", "ring.yaml") == 1
    assert capsys.readouterr().err.count("ring.yaml: is one of the ") == 2
    assert Path("ring.yaml").read_bytes() == before


def test_simulated_sensors(capsys: pytest.CaptureFixture[str]) -> None:
    drive("ring.csv", "--scan-rate", "4", "--odom-rate", "8", "--start-time", "0", "--range-min",
          "0.02", "--dropout", "0.1")  # fmt: skip
    log = open_log("ring.csv")
    assert log.scan_topics == ["a", "b", "c", "d", "e"]
    assert {record.stamp_ns % (10**9 // 8) for record in log.records()} == {0}
    drive("bad.mcap")
    for words, complaint in (
        (("ring.csv", "--odom-rate", "3"), "between two of odometry"),
        (("b.mcap", "--sensor", "a=0,0,0"), "two sensors the same name"),
        (("b.mcap", "--rear-laser-pose", "0,0,0"), "without a laser"),
    ):
        world = "corridor.yaml", words[0], "--path", "path.txt", *RING, *words[1:]
        assert run("simulate", "-q", *world) in (1, 2)
        assert complaint in capsys.readouterr().err
    assert run("simulate", "corridor.yaml", "c.csv", "--path", "path.txt") == 2
    assert "add --sensor" in capsys.readouterr().err
    assert not Path("b.mcap").exists()
