"""Where a laser sits, as logs have it."""

from __future__ import annotations

import math
from dataclasses import replace

from mapcli.model.pose import rounded_angle
from mapcli.model.scan import Mount


def rounded_mount(mount: Mount) -> Mount:
    """The mount with its yaw rounded as all angles of logs are (`rounded_angle`)."""
    return Mount(replace(mount.pose, theta=rounded_angle(mount.pose.theta)), mount.flipped)


def describe_mount(topic: str, mount: Mount) -> str:
    """Where the laser sits, for a person."""
    pose = mount.pose
    flipped = "upside down, " if mount.flipped else ""
    return (
        f"laser {topic}: mounted {flipped}at x {pose.x:.3f} m, y {pose.y:.3f} m, "
        f"yaw {math.degrees(pose.theta):.1f} deg"
    )
