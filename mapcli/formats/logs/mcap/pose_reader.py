"""The poses on a topic of an MCAP file: ground truth of a simulator, or another tool's estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mapcli.errors import DataError, FormatError
from mapcli.formats.logs.log import Source
from mapcli.formats.logs.mcap.container import McapFile
from mapcli.formats.logs.mcap.reader import topics_of
from mapcli.formats.logs.ros import decode as decode
from mapcli.formats.logs.ros.decode import OdometryMessage, PoseMessage
from mapcli.formats.logs.ros.messages import ODOMETRY, POSE_STAMPED
from mapcli.formats.logs.topics import LogNames
from mapcli.model.log import Damage, Topic
from mapcli.model.trajectory import Trajectory

DECODERS: dict[str, Callable[[Any], PoseMessage | OdometryMessage]] = {
    POSE_STAMPED: decode.pose_from_cdr,
    ODOMETRY: decode.odometry_from_cdr,
}
"""Message type -> decoder. Odometry is used only when its topic is named."""

TRUTH_TOPIC = LogNames().truth_topic
"""Where `mapcli simulate` writes the true poses; preferred to other topics."""


def read_mcap_poses(source: Source, topic: str | None, damage: Damage) -> Trajectory:
    """The poses on a topic, in the order of their stamps; what is unreadable is counted.

    Raises:
        DataError: no topic with poses, several and none named, or not the one named.
        FormatError: not one readable pose.
    """
    file = McapFile(source, damage)
    carriers = topics_of([file])
    try:
        chosen = choose_pose_topic([*carriers], topic, source.name)
    except DataError as error:
        error.where = "; ".join(damage.lines()) or None
        raise
    decoder = DECODERS[chosen.type]
    rows = []
    for log_time, _, data, _ in file.messages({number for _, number in carriers[chosen]}, damage):
        try:
            message = decoder(data)
        except ValueError:
            where = f"at {log_time * 1e-9:.3f} s"
            damage.add(f"messages on {chosen.name} without readable content", where=where)
            continue
        pose = message.pose
        rows.append((message.stamp_ns or log_time, pose.x, pose.y, pose.theta))
    if not rows:
        raise FormatError("has no readable pose", file=source.name, where=chosen.name)
    rows.sort(key=lambda row: row[0])
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    return Trajectory(np.array([row[1:] for row in rows]), stamps)


def choose_pose_topic(topics: Sequence[Topic], wanted: str | None, file: str) -> Topic:
    """The topic named, or `TRUTH_TOPIC`, or the only one of stamped poses.

    Raises:
        DataError: as of `read_mcap_poses`.
    """
    readable = [t for t in topics if t.type in DECODERS and t.encoding == "cdr" and t.count]
    poses = [t for t in readable if t.type == POSE_STAMPED]
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
