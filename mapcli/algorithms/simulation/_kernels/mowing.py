"""One run of a mower: where it believes to be, where it is, and what tape marks tell it.

Poses are (x, y, theta), metres and radians. What the robot believes is a Gaussian with the
covariance of an extended Kalman filter; a mark says that the position lies in an interval of x
and of y, which cuts the Gaussian off there (Simon, Optimal State Estimation, 2006, Sect. 7.5.4).
"""

from __future__ import annotations

from math import atan2, cos, erf, exp, hypot, pi, sin, sqrt, tau

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import njit

Floats = NDArray[np.float64]

ON_THE_SPOT = 0.35
"""Radians: a mower that must turn more than this stands still meanwhile."""

SQUARE_ON = 0.9
"""A mower comes over the edge of a mark that it faces when the cosine is at least this."""

BELIEVED = 3.0
"""Standard deviations: what is farther off is not believed."""

SURPRISE = 5.0
"""Standard deviations: from here on the tail of a Gaussian is as good as its nearest point."""


@njit(cache=True)
def mow_once(
    waypoints: Floats, marks: Floats, size: float, steps: tuple[float, float], wheels: Floats,
    expected: Floats, normals: Floats, path: Floats, counted: Floats, seen: NDArray[np.int64],
) -> int:  # fmt: skip
    """Drive from the first waypoint to the last, or to where the robot believes them to be.

    Args:
        waypoints: shape (m, 2); marks: centres, shape (k, 2); size: their side, negative for none.
        steps: metres and radians between two readings.
        wheels: four deviations as of `OdometryModel.noise`, the factors on metres and radians,
            unnoticed radians per metre; expected: the four that the robot reckons with.
        normals: standard normal numbers, shape (limit, 2): two for each step, which bounds them.
        path, counted: shape (limit, 2), filled with the true position before each step and with
            the metres and radians that the wheels counted; seen: times that each mark was noticed.

    Returns:
        The number of positions in `path`.
    """
    first = waypoints[1] - waypoints[0]
    believed = np.array([waypoints[0, 0], waypoints[0, 1], atan2(first[1], first[0])])
    true = believed.copy()
    covariance = np.zeros((3, 3))
    target, over = 1, False
    for k in range(len(normals)):
        path[k] = true[:2]
        if target == len(waypoints):
            return k + 1
        way, turn, arrives = steer(believed, waypoints[target], steps)
        target += arrives
        counted[k, 0], counted[k, 1] = way, turn
        spread(covariance, believed[2] + turn / 2, way, turn, expected)
        advance(believed, way, turn)
        way, turn = driven(way, turn, wheels, normals[k])
        advance(true, way, turn)
        mark = mark_under(true, marks, size)
        if mark >= 0 and not over:
            seen[mark] += 1
            correct(believed, covariance, marks[mark], size, steps[0])
        over = mark >= 0
    return len(normals)


@njit(cache=True)
def steer(pose: Floats, goal: Floats, steps: tuple[float, float]) -> tuple[float, float, bool]:
    """Metres and radians towards a point within one step, and whether that reaches it."""
    left = hypot(goal[0] - pose[0], goal[1] - pose[1])
    if left < 1e-9:
        return 0.0, 0.0, True
    turn = (atan2(goal[1] - pose[1], goal[0] - pose[0]) - pose[2] + pi) % tau - pi
    rolls = abs(turn) <= ON_THE_SPOT
    turn = min(max(turn, -steps[1]), steps[1])
    return (min(left, steps[0]) if rolls else 0.0), turn, rolls and left <= steps[0]


@njit(cache=True)
def advance(pose: Floats, way: float, turn: float) -> None:
    """Move a pose, in place."""
    heading = pose[2] + turn / 2
    pose[0] += way * cos(heading)
    pose[1] += way * sin(heading)
    pose[2] += turn


@njit(cache=True)
def deviations(way: float, turn: float, noise: Floats) -> tuple[float, float]:
    """Standard deviations of what wheels count on a way and a turn (see `OdometryModel`)."""
    way, turn = abs(way), abs(turn)
    return (
        sqrt(noise[2] ** 2 * way + noise[3] ** 2 * turn),
        sqrt(noise[0] ** 2 * turn + noise[1] ** 2 * way),
    )


@njit(cache=True)
def driven(way: float, turn: float, wheels: Floats, normals: Floats) -> tuple[float, float]:
    """What the robot really does while its wheels count `way` and `turn`: the inverse of
    `OdometryModel.measured`."""
    way_sigma, turn_sigma = deviations(way, turn, wheels)
    really = (way - normals[0] * way_sigma) / wheels[4]
    return really, (turn - normals[1] * turn_sigma + wheels[6] * abs(really)) / wheels[5]


@njit(cache=True)
def spread(covariance: Floats, heading: float, way: float, turn: float, noise: Floats) -> None:
    """How much less a robot knows after a step, in place: F P F' + Q."""
    ahead = np.array([cos(heading), sin(heading), 0.0])
    # F is the identity but for its last column; written out, without BLAS.
    shear = np.array([-way * ahead[1], way * ahead[0]])
    for axis in range(2):
        covariance[axis] += shear[axis] * covariance[2]
    for axis in range(2):
        covariance[:, axis] += shear[axis] * covariance[:, 2]
    way_sigma, turn_sigma = deviations(way, turn, noise)
    covariance += way_sigma**2 * np.outer(ahead, ahead)
    covariance[2, 2] += turn_sigma**2


@njit(cache=True)
def mark_under(pose: Floats, marks: Floats, size: float) -> int:
    """The mark that the robot's middle is over, or -1."""
    for k in range(len(marks)):
        if max(abs(pose[0] - marks[k, 0]), abs(pose[1] - marks[k, 1])) <= size / 2:
            return k
    return -1


@njit(cache=True)
def correct(believed: Floats, covariance: Floats, mark: Floats, size: float, step: float) -> None:
    """The robot has come upon a mark, in place.

    It is over the mark. Where it faces an edge it came over that edge within the last step,
    unless it cannot believe to be there: then it came in from the side.
    """
    facing = cos(believed[2]), sin(believed[2])
    for axis in range(2):
        low, high = mark[axis] - size / 2, mark[axis] + size / 2
        edge = low if facing[axis] > 0 else high
        if abs(facing[axis]) >= SQUARE_ON and (
            abs(believed[axis] - edge) <= BELIEVED * sqrt(covariance[axis, axis]) + step
        ):
            low, high = min(edge, edge + step * facing[axis]), max(edge, edge + step * facing[axis])
        cut_off(believed, covariance, axis, low, high)


@njit(cache=True)
def cut_off(believed: Floats, covariance: Floats, axis: int, low: float, high: float) -> None:
    """Learn that a coordinate lies between two bounds, in place."""
    variance = covariance[axis, axis]
    if variance < 1e-12:
        return
    mean, share = truncated(believed[axis], sqrt(variance), low, high)
    gain = covariance[axis] / variance
    believed += gain * (mean - believed[axis])
    covariance -= np.outer(gain, gain) * (variance * (1 - share))


@njit(cache=True)
def truncated(mean: float, sigma: float, low: float, high: float) -> tuple[float, float]:
    """Mean of a Gaussian cut off at two bounds, and its variance as a share of the whole one's."""
    a, b = (low - mean) / sigma, (high - mean) / sigma
    if b - a < 1e-3 or max(a, -b) > SURPRISE:
        # As good as a point, or so far out that what is left is: the formula would divide zeros.
        nearest = min(max(mean, low), high)
        return nearest, min((b - a) ** 2 / 12, 1.0)
    inside = (erf(b / sqrt(2.0)) - erf(a / sqrt(2.0))) / 2
    at_a, at_b = exp(-a * a / 2) / sqrt(tau), exp(-b * b / 2) / sqrt(tau)
    shift = (at_a - at_b) / inside
    share = 1 + (a * at_a - b * at_b) / inside - shift**2
    return mean + sigma * shift, max(share, (b - a) ** 2 / 1000)
