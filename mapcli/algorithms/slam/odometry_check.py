"""Whether odometry is what it should be: in metres and radians, ahead where the robot drives.

Scans are matched whatever odometry says, so that a map may be right with odometry in millimetres,
or with a heading that turns the other way; but then nothing helps where scans do not tell, and the
robot that the log is from is set up wrongly. Step by step the map's path is compared with the
odometry's: wheels that fail are off for a while, and what is said here is so throughout.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.model.reason import Reason, ReasonKind
from mapcli.model.trace import TracedPose

STEP_M = 0.3
"""Metres of a step, at least: more than odometry and map err by."""

LEAST_RAD, MOST_RAD = math.radians(1), math.radians(60)
"""Of a turn from scan to scan that is compared..."""

MOST_DEG_RAD = math.radians(5)
"""...and in degrees: beyond, they go round the circle as often as the map's turn errs."""

FEWEST_STEPS = 20
"""Steps that tell, at least."""

MOST_SCALE, MOST_YAW = 1.5, math.radians(15)
"""By what factor odometry may count too much or too little, and by what angle the robot may drive
past what the log says is ahead. In the middle of the drives that were measured it is 1.06 and 1.3
degrees at most (`benchmarks/RESULTS.md`)."""

THROUGHOUT = 0.9
"""Share of the steps that must be off the same way."""


class Steps(NamedTuple):
    """Motions between scans that were matched, by the map and by odometry.

    Attributes:
        mapped, counted: shape (n,), x + yi in the robot's frame before, metres.
        mapped_turns, counted_turns: shape (n,), radians within half a turn.
    """

    mapped: NDArray[np.complex128]
    counted: NDArray[np.complex128]
    mapped_turns: NDArray[np.float64]
    counted_turns: NDArray[np.float64]


def odometry_reasons(poses: Sequence[TracedPose], duration_s: float) -> Iterator[Reason]:
    """What is wrong with the odometry of a whole drive.

    Args:
        duration_s: from the first scan to the last one.
    """
    known = [pose for pose in poses if pose.odom is not None and pose.status != "odometry"]
    if len({pose.odom for pose in known}) < 2:  # there is none
        return
    steps = _steps(known)
    for kind, text in (*_distances(steps), *_turns(steps)):
        yield Reason(kind, 0.0, duration_s, text, verdict="doubtful")


def _steps(poses: Sequence[TracedPose]) -> Steps:
    mapped = np.array([(one.pose.x, one.pose.y, one.pose.theta) for one in poses])
    odoms = (one.odom for one in poses if one.odom is not None)
    counted = np.array([(odom.x, odom.y, odom.theta) for odom in odoms])
    far = [0]
    for k, pose in enumerate(mapped):
        if math.hypot(*(pose - mapped[far[-1]])[:2]) >= STEP_M:
            far.append(k)
    return Steps(
        _moved(mapped[far]),
        _moved(counted[far]),
        _wrapped(np.diff(mapped[:, 2])),
        _wrapped(np.diff(counted[:, 2])),
    )


def _moved(poses: NDArray[np.float64]) -> NDArray[np.complex128]:
    places = poses[:, 0] + 1j * poses[:, 1]
    moved = np.diff(places) * np.exp(-1j * poses[:-1, 2])
    return np.asarray(moved, dtype=np.complex128)


def _wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((angles + math.pi) % math.tau - math.pi)


def _distances(steps: Steps) -> Iterator[tuple[ReasonKind, str]]:
    """Odometry that counts too much or too little, and a robot that drives elsewhere than ahead."""
    if len(steps.mapped) < FEWEST_STEPS:
        return
    ratios = np.abs(steps.counted) / np.abs(steps.mapped)
    if _throughout(ratios > MOST_SCALE) or _throughout(ratios < 1 / MOST_SCALE):
        scale = float(np.median(ratios))
        metres = f"{scale:,.0f}" if scale > 10 else f"{scale:.2g}"
        yield "odometry_wrong", f"odometry counts {metres} m for every metre of the map"
    angles = np.angle(steps.mapped * steps.counted.conj())
    middle = float(np.angle(np.median(np.cos(angles)) + 1j * np.median(np.sin(angles))))
    if abs(middle) > MOST_YAW and _throughout(np.abs(_wrapped(angles - middle)) < MOST_YAW):
        way, other = ("left", "right") if middle > 0 else ("right", "left")
        deg = abs(math.degrees(middle))
        yield (
            "laser_turned",
            f"the robot drives {deg:.0f} deg to the {way} of ahead: the laser is mounted as far "
            f"to the {other} of where the log says",
        )


def _turns(steps: Steps) -> Iterator[tuple[ReasonKind, str]]:
    """Odometry whose heading is none, or in degrees, or turns the other way."""
    sizes = np.abs(steps.mapped_turns)
    large, small = sizes < MOST_RAD, sizes < MOST_DEG_RAD
    for text, expected, told in (
        ("odometry never turns", 0 * steps.mapped_turns, large),
        ("odometry turns the other way than the robot", -steps.mapped_turns, large),
        ("odometry's heading looks like degrees", np.degrees(steps.mapped_turns), small),
    ):
        chosen = told & (sizes > LEAST_RAD)
        if np.count_nonzero(chosen) < FEWEST_STEPS:
            continue
        off = np.abs(_wrapped(steps.counted_turns - steps.mapped_turns))[chosen]
        if _throughout(np.abs(_wrapped(steps.counted_turns - expected))[chosen] < off / 2):
            yield "odometry_wrong", text


def _throughout(steps: NDArray[np.bool_]) -> bool:
    return bool(np.mean(steps) > THROUGHOUT)
