"""Logs of a robot that turns while its laser sweeps, in a hall with pillars, for tests."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from mapcli import Pose2D, World
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.model.scan import Mount, Odometry, RangeScan, Record
from mapcli.model.sweep import BeamTiming

HALL = edges_of(
    World.of(
        [
            [[-6, -4], [6, -4], [6, 4], [-6, 4]],
            [[-2.2, -0.4], [-1.4, -0.4], [-1.4, 0.4], [-2.2, 0.4]],
            [[1.5, -0.2], [2.5, 0.3], [2.2, 0.9], [1.2, 0.4]],
            [[-6, 2.5], [-4.8, 2.5], [-4.8, 4], [-6, 4]],
            [[4.5, -4], [6, -4], [6, -3.2], [4.5, -3.2]],
        ]
    )
)
"""12 m by 8 m."""

START_NS, SECOND = 10**18, 10**9
MOUNT = Mount(Pose2D(0.1, -0.05, 2.0))


def drive(t: float) -> Pose2D:
    """Round the pillars at about 0.6 m/s, now and then turning at 1.5 radians a second."""
    a = 0.17 * t
    x, y = 4.0 * math.cos(a), 2.2 * math.sin(a)
    tangent = math.atan2(2.2 * math.cos(a), -4.0 * math.sin(a))
    return Pose2D(x, y, tangent + 0.9 * math.sin(1.6 * t))


@dataclass(frozen=True)
class SweepingRobot:
    """What is recorded.

    Attributes:
        seconds: of the drive; period_s: from sweep to sweep; share: of it that a sweep takes.
        pose_at: where the robot is; noise: of odometry, per root of a metre and of a radian.
        flipped: the array holds the last beam first.
        mid: share of the sweep that is over at the stamp.
    """

    seconds: float = 16.0
    period_s: float = 0.2
    share: float = 0.9
    beams: int = 180
    pose_at: Callable[[float], Pose2D] = drive
    noise: float = 0.02
    flipped: bool = False
    mid: float = 0.0
    mount: Mount = MOUNT

    @property
    def increment(self) -> float:
        return self.share * self.period_s / (self.beams - 1)

    def records(self, timing: BeamTiming) -> list[Record]:
        """The log, its scans with what it says about the times of their beams."""
        scans = (self.scan(k, timing) for k in range(1, int(self.seconds / self.period_s)))
        return list(heapq.merge(self.odometry(), scans, key=lambda record: record.stamp_ns))

    def odometry(self) -> list[Odometry]:
        rng, pose, records = np.random.default_rng(3), Pose2D(), []
        for k in range(int(self.seconds * 25) + 25):
            if k:
                step = self.pose_at((k - 1) / 25).between(self.pose_at(k / 25))
                error = self.noise * rng.standard_normal(2)
                metres = error[0] * math.sqrt(abs(step.x))
                turn = error[1] * math.sqrt(abs(step.x) + abs(step.theta))
                pose = pose.compose(Pose2D(step.x + metres, step.y, step.theta + turn))
            records.append(Odometry(START_NS + k * SECOND // 25, pose))
        return records

    def stamp_s(self, k: int) -> float:
        return k * self.period_s + self.mid * self.share * self.period_s

    def scan(self, k: int, timing: BeamTiming) -> RangeScan:
        step = math.tau / self.beams
        bearings = -math.pi + step * np.arange(self.beams)
        poses = [
            self.pose_at(k * self.period_s + beam * self.increment).compose(self.mount.pose)
            for beam in range(self.beams)
        ]
        ranges = cast_each(poses, bearings)
        ranges += 0.005 * np.random.default_rng(k).standard_normal(self.beams)
        first, step = (float(bearings[-1]), -step) if self.flipped else (float(bearings[0]), step)
        ranges = ranges[::-1] if self.flipped else ranges
        stamp = START_NS + round(self.stamp_s(k) * SECOND)
        ranges = ranges.astype(np.float32)
        return RangeScan(stamp, first, step, ranges, 0.0, 30.0, self.mount, timing)

    def truth(self) -> list[Pose2D]:
        """Where the robot was at the stamps."""
        return [self.pose_at(self.stamp_s(k)) for k in range(1, int(self.seconds / self.period_s))]


def cast_each(lasers: Iterable[Pose2D], bearings: np.ndarray) -> np.ndarray:
    """Metres that beams go, each from a pose of its own, to the first edge of the hall."""
    x, y, theta = np.array([(one.x, one.y, one.theta) for one in lasers]).T
    dx, dy = np.cos(theta + bearings)[:, None], np.sin(theta + bearings)[:, None]
    (ax, ay), (bx, by) = HALL[:, 0].T, HALL[:, 1].T
    ax, ay, ex, ey = ax - x[:, None], ay - y[:, None], bx - ax, by - ay
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        length, along = (ax * ey - ay * ex) / cross, (ax * dy - ay * dx) / cross
    hit = (length > 0) & (along >= 0) & (along <= 1)
    return np.where(hit, length, np.inf).min(axis=1)


def ate(found: Iterable[Pose2D], true: Iterable[Pose2D]) -> float:
    """Root mean square of the distances, metres, after rigid alignment."""
    a, b = (np.array([(pose.x, pose.y) for pose in poses]) for poses in (found, true))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    turn = v.T @ np.diag([1, np.linalg.det(v.T @ u.T)]) @ u.T
    return float(np.sqrt(((a @ turn.T - b) ** 2).sum(axis=1).mean()))
