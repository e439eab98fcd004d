"""Several robots in one log, in every dress in which their topics and frames come: each gets its
own mount and its own odometry, and they never become one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import run
from support import dresses
from support.mcap_making import Sent, mcap_file, odom, scan, tf, transform

from mapcli.errors import DataError
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.formats.logs.ros.robots import encloses, namespace_of
from mapcli.model.log import LogOptions
from mapcli.model.scan import Odometry, RangeScan

CONTAINERS = "mcap", "db3", "bag"

MOUNTS = {1: 0.1, 2: 0.44}
"""Robot -> metres ahead of its middle at which its laser sits; odometry of robot n is at x = n."""


def robot(
    number: int,
    topic: str = "/robot{n}/{name}",
    frame: str = "{name}",
    *,
    in_message: str | None = None,
    moving: str | None = None,
    static: str | None = None,
    wheels: bool = True,
    odom_frame: bool = False,
) -> list[Sent]:
    """What one robot sends.

    Args:
        topic, frame: what its topics and frames are called.
        in_message: what frames are called in scans and odometry, if it is something else.
        moving, static: its topics of transforms.
        wheels: it sends odometry; odom_frame: its transforms tell how it moves.
    """

    def at(name: str, form: str | None = None) -> str:
        return (form or topic).format(n=number, name=name)

    def called(name: str) -> str:
        return frame.format(n=number, name=name)

    def said(name: str) -> str:
        return (in_message or frame).format(n=number, name=name)

    mounted = transform(0, called("base_link"), called("laser"), (MOUNTS[number], 0, 0))
    sent = [tf(1, mounted, topic=at("tf_static", static))]
    for t in (2, 4):
        if wheels:
            sent.append(odom(t, float(number), child=said("base_link"), topic=at("odom")))
        if odom_frame:
            moved = transform(t, called("odom"), called("base_link"), (number, 0, 0))
            sent.append(tf(t, moved, topic=at("tf", moving)))
    sent.append(scan(3, frame=said("laser"), topic=at("scan")))
    return sent


ONE_TF = {"moving": "/tf", "static": "/tf_static"}

DRESSES: dict[str, dict[str, Any]] = {
    "namespaces": {},
    "namespaces, moving transforms": {"odom_frame": True},
    "namespaces, no odometry": {"odom_frame": True, "wheels": False},
    "deep namespaces": {"topic": "/fleet/robot{n}/{name}"},
    "no leading slash of topics": {"topic": "robot{n}/{name}"},
    "prefixes": {"frame": "robot{n}/{name}", **ONE_TF},
    "prefixes, moving transforms": {"frame": "robot{n}/{name}", "odom_frame": True, **ONE_TF},
    "prefixes, no odometry": {
        "frame": "robot{n}/{name}", "odom_frame": True, "wheels": False, **ONE_TF
    },
    "leading slashes": {"frame": "/robot{n}/{name}", **ONE_TF},
    "tf_prefix": {"frame": "robot{n}/{name}", "in_message": "{name}", **ONE_TF},
    "tf_prefix, leading slashes, no odometry": {
        "frame": "/robot{n}/{name}", "in_message": "/{name}", "odom_frame": True, "wheels": False,
        **ONE_TF,
    },
    "topics at the root": {"topic": "/{name}{n}", "frame": "robot{n}/{name}", **ONE_TF},
    "underscores": {"topic": "/robot{n}_{name}", "frame": "robot{n}_{name}", **ONE_TF},
    "underscores, no odometry": {
        "topic": "/robot{n}_{name}", "frame": "robot{n}_{name}", "odom_frame": True,
        "wheels": False, **ONE_TF,
    },
    "transforms of fixed joints on /tf": {
        "frame": "robot{n}/{name}", "moving": "/tf", "static": "/tf", "odom_frame": True
    },
}  # fmt: skip


def in_order(*robots: list[Sent]) -> list[Sent]:
    """What several robots send, as it is recorded."""
    return sorted((one for sent in robots for one in sent), key=lambda one: one.log_ns)


def log_file(folder: Path, container: str, sent: list[Sent]) -> str:
    """A log of messages: MCAP, a ROS 2 bag in SQLite, or a ROS 1 bag."""
    said = [dresses.Said(one.topic, one.type, one.log_ns, one.message) for one in sent]
    path = folder / f"a.{container}"
    writers = {"mcap": dresses.write_mcap, "db3": dresses.write_ros2, "bag": dresses.write_ros1}
    return str(writers[container](path, said))


def read(path: str, **options: Any) -> tuple[list[float], list[float], Log]:
    """Where lasers sit, what odometry tells (metres ahead), and the log."""
    log = open_log([path], LogOptions(**options))
    records = list(log.records())
    mounts = [record.mount.pose.x for record in records if isinstance(record, RangeScan)]
    return mounts, [r.pose.x for r in records if isinstance(r, Odometry)], log


def scans_of(path: str) -> list[str]:
    return [topic.name for topic in open_log([path]).topics() if topic.role == "scan"]


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("dress", DRESSES)
def test_each_robot_has_its_own_mount_and_odometry(
    dress: str, container: str, tmp_path: Path
) -> None:
    sent = in_order(*(robot(number, **DRESSES[dress]) for number in MOUNTS))
    path = log_file(tmp_path, container, sent)
    topics = scans_of(path)
    for topic, (number, ahead) in zip(topics, MOUNTS.items(), strict=True):
        mounts, odometry, _ = read(path, scan_topics=(topic,))
        assert mounts == [ahead]
        assert odometry == [float(number)] * 2
    one, other = topics
    ways = f"those of one: --scan-topic {one}, or --scan-topic {other}"
    for named in ((), ("all",), (one, other)):
        with pytest.raises(DataError, match=f"scans of 2 robots: {one} .*{other} ") as raised:
            read(path, scan_topics=named)
        assert raised.value.expected == ways


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("dress", DRESSES)
def test_one_robot_alone_needs_no_option(dress: str, container: str, tmp_path: Path) -> None:
    path = log_file(tmp_path, container, in_order(robot(2, **DRESSES[dress])))
    mounts, odometry, log = read(path)
    assert (mounts, odometry) == ([MOUNTS[2]], [2.0, 2.0])
    assert not log.unknown_mounts


def lasers_of_one(space: str, prefix: str) -> Iterator[Sent]:
    yield tf(1, transform(0, f"{prefix}base_link", f"{prefix}front", (0.3, 0, 0)),
             topic=f"{space}/tf_static")  # fmt: skip
    yield tf(1, transform(0, f"{prefix}base_footprint", f"{prefix}base_link"),
             transform(0, f"{prefix}base_footprint", f"{prefix}rear", (-0.3, 0, 0)),
             topic=f"{space}/tf_static")  # fmt: skip
    yield odom(2, 1.0, child=f"{prefix}base_link", topic=f"{space}/odom")
    yield scan(3, frame=f"{prefix}front", topic=f"{space}/front/scan")
    yield scan(4, frame=f"{prefix}rear", topic=f"{space}/rear/scan")


@pytest.mark.parametrize(("space", "prefix"), [("", ""), ("/robot1", ""), ("/robot1", "robot1/")])
def test_several_lasers_of_one_robot(space: str, prefix: str, tmp_path: Path) -> None:
    path = mcap_file(tmp_path, *lasers_of_one(space, prefix))
    assert read(path, scan_topics=("all",))[:2] == ([0.3, -0.3], [1.0])
    with pytest.raises(DataError, match="several scan topics"):
        read(path)


def test_several_lasers_of_one_of_two_robots(tmp_path: Path) -> None:
    path = mcap_file(tmp_path, *in_order([*lasers_of_one("/robot1", "")], robot(2)))
    front, rear, other = "/robot1/front/scan", "/robot1/rear/scan", "/robot2/scan"
    assert read(path, scan_topics=(front, rear))[:2] == ([0.3, -0.3], [1.0])
    with pytest.raises(DataError, match="scans of 2 robots") as raised:
        read(path)
    ways = f"--scan-topic {front} --scan-topic {rear}, or --scan-topic {other}"
    assert raised.value.expected == f"those of one: {ways}"


def test_lasers_in_namespaces_without_transforms_are_of_one_robot(tmp_path: Path) -> None:
    sent = [odom(1), scan(2, topic="/front/scan"), scan(3, topic="/rear/scan")]
    assert len(read(mcap_file(tmp_path, *sent), scan_topics=("all",))[0]) == 2


def test_several_lasers_cannot_all_be_at_the_centre(tmp_path: Path) -> None:
    sent = [odom(1), scan(2, frame="front", topic="/front"), scan(3, frame="rear", topic="/rear")]
    with pytest.raises(DataError, match="/front: nothing tells where the laser 'front' sits"):
        read(mcap_file(tmp_path, *sent), scan_topics=("all",))


def test_namespaces_without_transforms(tmp_path: Path) -> None:
    """Each has odometry of its own."""
    sent = in_order(*(
        [odom(2, float(n), topic=f"/robot{n}/odom"), scan(3, topic=f"/robot{n}/scan")]
        for n in MOUNTS
    ))  # fmt: skip
    path = mcap_file(tmp_path, *sent)
    with pytest.raises(DataError, match="scans of 2 robots"):
        read(path, scan_topics=("all",))
    mounts, odometry, log = read(path, scan_topics=("/robot2/scan",))
    assert (mounts, odometry) == ([0.0], [2.0])
    assert log.unknown_mounts == {"/robot2/scan"}


def test_a_robot_at_the_root_and_one_in_a_namespace(tmp_path: Path) -> None:
    sent = in_order(robot(1, topic="/{name}"), robot(2))
    path = mcap_file(tmp_path, *sent)
    assert read(path, scan_topics=("/scan",))[:2] == ([0.1], [1.0, 1.0])
    assert read(path, scan_topics=("/robot2/scan",))[:2] == ([0.44], [2.0, 2.0])
    with pytest.raises(DataError, match="scans of 2 robots"):
        read(path, scan_topics=("all",))


def test_the_mount_of_another_robot_is_never_taken(tmp_path: Path) -> None:
    """Of one of two robots the static transforms are missing."""
    for missing in MOUNTS:
        sent = in_order(robot(1, topic="/{name}", odom_frame=True), robot(2, odom_frame=True))
        of_it = "/tf_static" if missing == 1 else "/robot2/tf_static"
        path = mcap_file(tmp_path, *(one for one in sent if one.topic != of_it))
        topic = "/scan" if missing == 1 else "/robot2/scan"
        mounts, odometry, log = read(path, scan_topics=(topic,))
        assert (mounts, odometry) == ([0.0], [float(missing)] * 2)
        assert log.unknown_mounts == {topic}


@pytest.mark.parametrize("dress", ["prefixes", "prefixes, no odometry", "tf_prefix"])
def test_the_odometry_of_another_robot_is_never_taken(dress: str, tmp_path: Path) -> None:
    """One of the robots sends no odometry, and no scans come from the other."""
    silent = robot(1, **DRESSES[dress])
    silent = [one for one in silent if one.topic not in ("/robot1/odom", "/tf")]
    other = [one for one in robot(2, **DRESSES[dress]) if one.topic != "/robot2/scan"]
    mounts, odometry, log = read(mcap_file(tmp_path, *in_order(silent, other)))
    assert (mounts, odometry) == ([0.1], [])
    assert "no odometry: poses come from matching scans alone" in log.notes


def test_odometry_of_the_scans_namespace(tmp_path: Path) -> None:
    """Nothing else tells whose it is; said is what is left out."""
    sent = [odom(2, float(n), topic=f"/robot{n}/odom") for n in MOUNTS]
    path = mcap_file(tmp_path, *sent, scan(3, topic="/robot1/scan"))
    _, odometry, log = read(path)
    assert odometry == [1.0]
    note = "/robot2/odom is not used: it seems to be another robot's odometry"
    assert note in log.notes
    assert read(path, odom_topic="/robot2/odom")[1] == [2.0]


def test_several_odometry_topics_of_one_robot_are_not_chosen_from(tmp_path: Path) -> None:
    sent = [odom(1, topic="/odom"), odom(1, topic="/wheel/odom"), scan(2)]
    with pytest.raises(DataError, match="several odometry topics"):
        read(mcap_file(tmp_path, *sent))


def test_static_transforms_outside_the_namespace_of_the_only_robot(tmp_path: Path) -> None:
    sent = robot(1, static="/tf_static", odom_frame=True)
    assert read(mcap_file(tmp_path, *in_order(sent)))[:2] == ([0.1], [1.0, 1.0])


def test_odometry_on_one_of_several_topics_of_transforms(tmp_path: Path) -> None:
    """What moves is on /tf, and joints of the robot's arm are in its namespace."""
    arm = tf(1, transform(1, "base_link", "arm"), topic="/robot1/tf")
    sent = robot(1, static="/tf_static", moving="/tf", wheels=False, odom_frame=True)
    _, odometry, log = read(mcap_file(tmp_path, *in_order([arm, *sent])))
    assert (odometry, log.odom_topic) == ([1.0, 1.0], "/tf")


def test_transforms_of_a_room_beside_those_of_the_robot(tmp_path: Path) -> None:
    """A camera in the room tells where other things are."""
    seen = transform(1, "vicon", "base_link", (7, 7, 0))
    sent = [*robot(1, topic="/{name}"), tf(1, seen, topic="/vicon/tf")]
    assert read(mcap_file(tmp_path, *in_order(sent)))[:2] == ([0.1], [1.0, 1.0])


def test_two_robots_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    mcap_file(tmp_path, *in_order(robot(1), robot(2)), name="two.mcap")
    assert run("slam-replay", "two.mcap") == 1
    told = capsys.readouterr().err
    assert "scans of 2 robots: /robot1/scan (sensor_msgs/msg/LaserScan, 1 message)" in told
    assert "--scan-topic /robot1/scan, or --scan-topic /robot2/scan" in told
    assert run("info", "two.mcap") == 0
    assert "slam-replay cannot use it: scans of 2 robots" in capsys.readouterr().out
    assert run("slam-replay", "two.mcap", "--scan-topic", "/robot2/scan", "--search", "none") == 0
    assert "mounted at x 0.440 m" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("topic", "space"),
    [("/scan", ""), ("scan", ""), ("/a/scan", "a"), ("a/b/scan", "a/b"), ("//scan", "")],
)
def test_namespaces(topic: str, space: str) -> None:
    assert namespace_of(topic) == space


def test_what_a_namespace_encloses() -> None:
    assert encloses("", "a/b")
    assert encloses("a", "a/b")
    assert encloses("a/b", "a/b")
    assert not encloses("a", "ab/c")
    assert not encloses("a/b", "a")
