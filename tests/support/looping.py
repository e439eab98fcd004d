"""Worlds in which a robot comes back, and trajectories through them that drift."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapcli import Pose2D, World
from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.scans.ray_casting import cast, edges_of
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.loop_closure import LoopCloser, LoopParameters
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.motion_model import MotionModel
from mapcli.algorithms.slam.scan_points import voxel_filtered
from mapcli.model.pose import IDENTITY
from mapcli.model.scan import Odometry, RangeScan, Record

MAP = MapParameters()
BEAMS, REACH = 180, 8.0
MATCH = np.diag([0.02**-2, 0.02**-2, math.radians(0.3) ** -2])
"""The information from the local map on each keyframe of these trajectories."""

ODOMETRY = MotionModel()
NOTHING = Perception(np.empty((0, 2)), np.empty((0, 2)), np.zeros(2))
"""What is seen in a hall that is too large."""

LAP = 35.0
"""Metres around the ring, and a little more."""

Edges = NDArray[np.float64]


def box(left: float, bottom: float, right: float, top: float) -> list[list[float]]:
    return [[left, bottom], [right, bottom], [right, top], [left, top]]


def ring() -> Edges:
    """A corridor of a metre around a block of 8 m by 8 m, with posts that are nowhere alike."""
    posts = [
        (-3.1, -5.0, 0.4, 0.3), (0.7, -5.0, 0.9, 0.2), (3.2, -4.3, 0.3, 0.3),
        (4.7, -2.2, 0.3, 0.6), (4.0, 0.4, 0.2, 0.9), (4.6, 2.9, 0.4, 0.3),
        (2.3, 4.8, 0.7, 0.2), (-0.4, 4.0, 0.5, 0.2), (-2.8, 4.7, 0.3, 0.3),
        (-5.0, 2.6, 0.2, 0.8), (-4.3, 0.1, 0.3, 0.5), (-5.0, -1.9, 0.4, 0.3),
    ]  # fmt: skip
    things = [box(x, y, x + width, y + height) for x, y, width, height in posts]
    return edges_of(
        World.of([box(-5.02, -5.02, 5.02, 5.02), box(-3.98, -3.98, 3.98, 3.98), *things])
    )


def rooms(count: int, side: float = 3.0) -> Edges:
    """A corridor of 2 m with rooms on both sides that are all alike: doors of 1 m, no furniture."""
    length, things = count * side, []
    for y in (-1.1, 1.0):  # walls with doors
        doors = [k * side + side / 2 for k in range(count)]
        for one, other in pairwise([-1.0, *doors, length + 1.0]):
            left, right = one + 0.5 * (one > -1), other - 0.5 * (other < length + 1)
            things.append(box(left, y, right, y + 0.1))
    for k in range(count + 1):  # walls between rooms
        things += [box(k * side - 0.05, y, k * side + 0.05, y + 3) for y in (-4.1, 1.1)]
    outline = box(-1.0, -4.1, length + 1.0, 4.1)
    return edges_of(World.of([outline, *things]))


def there_and_back(length: float, step: float = 0.4) -> list[Pose2D]:
    """Along the x axis, a turn on the spot, and back half a metre beside."""
    there = [Pose2D(x) for x in np.arange(0.5, length, step).tolist()]
    end = there[-1].x
    turn = [Pose2D(end, 0.5 * a / math.pi, a) for a in np.linspace(0.4, math.pi, 8).tolist()]
    back = [Pose2D(pose.x, 0.5, math.pi) for pose in reversed(there[:-1])]
    return [*there, *turn, *back]


def laps(metres: float, step: float = 0.4) -> list[Pose2D]:
    """The middle of the ring's corridor, counter-clockwise with round corners, from below."""
    half, radius = 4.5, 0.6
    straight, bend = 2 * (half - radius), radius * math.pi / 2
    poses = []
    for at in np.arange(0.0, metres, step).tolist():
        side, along = divmod(at + straight / 2, straight + bend)
        turn = max(along - straight, 0.0) / radius
        x = min(along, straight) - (half - radius) + radius * math.sin(turn)
        y = -half + radius * (1 - math.cos(turn))
        poses.append(Pose2D(0, 0, side * math.pi / 2).compose(Pose2D(x, y, turn)))
    return poses


def see(edges: Edges, pose: Pose2D, reach: float = REACH) -> Perception:
    """What a laser that looks all around sees there."""
    step = math.tau / BEAMS
    ranges = cast(edges, pose, -math.pi, step, BEAMS, reach)
    bearings = -math.pi + step * np.arange(BEAMS)
    beams = np.column_stack([np.cos(bearings), np.sin(bearings)])[ranges < reach]
    hits = ranges[ranges < reach, None] * beams
    return Perception(hits, np.empty((0, 2)), np.zeros(2))


def drifted(true: list[Pose2D], metres: float, deg_per_m: float) -> list[Pose2D]:
    """What is tracked when every metre counts for so many, and turns by so much besides."""
    poses = [true[0]]
    for motion in (a.between(b) for a, b in pairwise(true)):
        turn = math.radians(deg_per_m) * math.hypot(motion.x, motion.y)
        off = Pose2D(metres * motion.x, metres * motion.y, motion.theta + turn)
        poses.append(poses[-1].compose(off))
    return poses


def trajectory_of(tracked: list[Pose2D], seen: list[Perception]) -> TrackedTrajectory:
    """A trajectory of which every scan is a keyframe."""
    trajectory = TrackedTrajectory()
    for pose, perception in zip(tracked, seen, strict=True):
        trajectory.add(pose, voxel_filtered(perception.hits, MAP.resolution))
        trajectory.add_keyframe(perception, MATCH, ODOMETRY)
    return trajectory


def winding(count: int, every: int = 1) -> TrackedTrajectory:
    """A trajectory through curves; every so many scans one is a keyframe."""
    trajectory, pose = TrackedTrajectory(), Pose2D(2, -1, 0.5)
    for k in range(count):
        trajectory.add(pose, np.empty((0, 2)))
        if k % every == 0:
            trajectory.add_keyframe(NOTHING, None, ODOMETRY)
        pose = pose.compose(Pose2D(0.25, 0.02, 0.2 * math.sin(k / 5)))
    return trajectory


@cache
def ring_trajectory(
    drift: float, start: Pose2D = IDENTITY
) -> tuple[TrackedTrajectory, list[Pose2D]]:
    """A trajectory of a lap and a half that drifts by so many degrees per metre; the true poses."""
    world, true = ring(), laps(52)
    seen = [see(world, pose) for pose in true]
    away = start.compose(true[0].inverse())
    tracked = [away.compose(pose) for pose in drifted(true, 1.0, drift)]
    return trajectory_of(tracked, seen), true


def worst(found: list[Pose2D], true: list[Pose2D]) -> float:
    """The largest error of position, seen from the first pose."""
    pairs = zip(found, true, strict=True)
    return max(found[0].between(a).distance(true[0].between(b)) for a, b in pairs)


@cache
def around_the_ring(metres: float) -> tuple[list[Pose2D], list[Perception]]:
    world, poses = ring(), laps(metres)
    return poses, [see(world, pose) for pose in poses]


def closer_of(tracked: list[Pose2D], seen: list[Perception]) -> LoopCloser:
    return LoopCloser(trajectory_of(tracked, seen).keyframes, MAP, LoopParameters())


PERIOD_NS = 200_000_000


def scan_at(edges: Edges, pose: Pose2D, index: int, reach: float = REACH) -> RangeScan:
    """The same as a record of a log."""
    step = math.tau / BEAMS
    ranges = cast(edges, pose, -math.pi, step, BEAMS, reach).astype(np.float32)
    return RangeScan(index * PERIOD_NS, -math.pi, step, ranges, 0.0, reach)


def log_of(scans: list[RangeScan], odom: list[Pose2D]) -> list[Record]:
    """A log of scans and of what odometry counted."""
    records: list[Record] = []
    for scan, pose in zip(scans, odom, strict=True):
        records += [Odometry(scan.stamp_ns, pose), scan]
    return records


def blind(scan: RangeScan) -> RangeScan:
    """Nothing comes back."""
    return replace(scan, ranges=np.full_like(scan.ranges, np.inf))
