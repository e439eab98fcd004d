"""The poses on a topic of a log of messages: ground truth of a simulator, or another tool's
estimate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from operator import itemgetter

import numpy as np

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.log import Source
from mapcli.formats.logs.message_file import MessageFile
from mapcli.formats.logs.message_kinds import decoder_of, unpacked
from mapcli.formats.logs.open_log import open_files
from mapcli.formats.logs.stream_topics import topics_of
from mapcli.formats.logs.topics import LogNames
from mapcli.model.log import Damage, Topic
from mapcli.model.trajectory import Trajectory

TRUTH_TOPIC = LogNames().truth_topic
"""Where `mapcli simulate` writes the true poses; preferred to other topics."""


def read_logged_poses(sources: Sequence[Source], topic: str | None, damage: Damage) -> Trajectory:
    """The poses on a topic, in the order of their stamps; what is unreadable is counted.

    Args:
        sources: a file of messages, or the files of a bag.

    Raises:
        DataError: no topic with poses, several and none named, or not the one named.
        FormatError: not one readable pose.
    """
    files, name = open_files(sources, damage), sources[0].name
    carriers = topics_of(files, {topic} if topic else ())
    try:
        chosen = choose_pose_topic([*carriers], topic, name)
    except DataError as error:
        error.where = "; ".join(damage.lines()) or None
        raise
    rows = sorted(_poses(chosen, carriers[chosen], damage), key=itemgetter(0))
    if not rows:
        raise FormatError("has no readable pose", file=name, where=chosen.name)
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    return Trajectory(np.array([row[1:] for row in rows]), stamps)


def _poses(
    topic: Topic, carriers: Sequence[tuple[MessageFile, int]], damage: Damage
) -> Iterator[tuple[int, float, float, float]]:
    """Stamp, x, y and theta of each message."""
    for file, number in carriers:
        decoder = decoder_of(topic, file.streams[number])
        for log_time, _, data, lost, _ in file.messages({number}, damage):
            if lost:
                continue
            try:
                message = decoder(unpacked(data))
            except ValueError:
                where = f"at {log_time * 1e-9:.3f} s"
                damage.add(f"messages on {topic.name} without readable content", where=where)
                continue
            pose = message.pose
            yield message.stamp_ns or log_time, pose.x, pose.y, pose.theta


def choose_pose_topic(topics: Sequence[Topic], wanted: str | None, file: str) -> Topic:
    """The topic named, or `TRUTH_TOPIC`, or the only one of stamped poses; odometry only if named.

    Raises:
        DataError: as of `read_logged_poses`.
    """
    readable = [t for t in topics if t.role in ("pose", "odometry") and t.count]
    poses = [t for t in readable if t.role == "pose"]
    if wanted is not None:
        poses = [topic for topic in readable if topic.name == wanted]
    elif len(poses) > 1:
        poses = [topic for topic in poses if topic.name == TRUTH_TOPIC] or poses
    if len(poses) == 1:
        return poses[0]
    listed = ", ".join(f"{t.name} ({t.type})" for t in (poses or readable or topics)) or "nothing"
    if poses:
        expected = "one of them named with --topic"
        raise DataError(f"has several topics of poses: {listed}", file=file, expected=expected)
    named = f" {wanted}" if wanted else ""
    expected = "one of geometry_msgs/msg/PoseStamped, or of nav_msgs/msg/Odometry named by --topic"
    raise DataError(f"has no topic{named} of poses among {listed}", file=file, expected=expected)
