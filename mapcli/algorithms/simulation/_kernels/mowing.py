"""One run of a mower: extended Kalman filter on odometry, corrected by tape marks (Activity 9.3).

Poses are (x, y, theta) in the frame of the lawn, metres and radians. The mower steers by its pose
estimate, a Gaussian with the covariance of an extended Kalman filter. A mark under the floor
sensor says that the position lies in an interval of x and of y, which truncates the Gaussian
there (Simon, Optimal State Estimation, 2006, Sect. 7.5.4).
"""

from __future__ import annotations

from math import atan2, cos, erf, exp, hypot, pi, sin, sqrt, tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import allocating_kernel

Floats = NDArray[np.float64]

ON_THE_SPOT = 0.35
"""Radians: a mower that must turn more than this stands still meanwhile."""

SQUARE_ON = 0.9
"""A mower comes over the edge of a mark that it faces when the cosine is at least this."""

GATE_SIGMAS = 3.0
"""Standard deviations of the gate: an edge farther from the estimate is not the one crossed."""

TAIL_SIGMAS = 5.0
"""Standard deviations: from here on the tail of a Gaussian is as good as its nearest point."""


class Lawn(NamedTuple):
    """What a mower drives over: waypoints, shape (m, 2), and centres of marks, shape (k, 2), whose
    side is `mark_size` metres, negative for marks that nobody notices."""

    waypoints: Floats
    marks: Floats
    mark_size: float


class Step(NamedTuple):
    """The largest step between two readings of wheels and floor sensor, metres and radians."""

    metres: float
    radians: float


class WheelErrors(NamedTuple):
    """What is wrong with the wheels: `noise`, shape (4,), as of `WheelModel.noise`; factors on
    metres and radians; `drift`, radians turned per metre that are not measured."""

    noise: Floats
    scale: float
    turn_scale: float
    drift: float


class RunRecord(NamedTuple):
    """Filled by a run: `path`, shape (limit, 2), the true position before each step; `measured`,
    shape (limit, 2), metres and radians by the wheels; `seen`, shape (k,), how often each mark was
    noticed."""

    path: Floats
    measured: Floats
    seen: NDArray[np.int64]


@allocating_kernel
def mow_once(
    lawn: Lawn, step: Step, wheels: WheelErrors, assumed_noise: Floats, normals: Floats,
    record: RunRecord,
) -> int:  # fmt: skip
    """Drive from the first waypoint to the last, or to where the pose estimate has them.

    Args:
        assumed_noise: shape (4,), the noise of the wheels in the robot's own motion model.
        normals: standard normal numbers, shape (limit, 2): two for each step, which bounds them.
        record: filled.

    Returns:
        The number of positions in `record.path`.
    """
    waypoints, marks = lawn.waypoints, lawn.marks
    first = waypoints[1] - waypoints[0]
    estimate = np.array([waypoints[0, 0], waypoints[0, 1], atan2(first[1], first[0])])
    true = estimate.copy()
    covariance = np.zeros((3, 3))
    target, over = 1, False
    for k in range(len(normals)):
        record.path[k] = true[:2]
        if target == len(waypoints):
            return k + 1
        distance, turn, arrives = steer(estimate, waypoints[target], step)
        target += arrives
        record.measured[k, 0], record.measured[k, 1] = distance, turn
        predict_covariance(covariance, estimate[2] + turn / 2, distance, turn, assumed_noise)
        move_pose(estimate, distance, turn)
        distance, turn = true_motion(distance, turn, wheels, normals[k])
        move_pose(true, distance, turn)
        mark = mark_under(true, marks, lawn.mark_size)
        if mark >= 0 and not over:
            record.seen[mark] += 1
            correct(estimate, covariance, marks[mark], lawn.mark_size, step.metres)
        over = mark >= 0
    return len(normals)


@allocating_kernel
def steer(pose: Floats, goal: Floats, step: Step) -> tuple[float, float, bool]:
    """Metres and radians towards a point within one step, and whether that reaches it."""
    left = hypot(goal[0] - pose[0], goal[1] - pose[1])
    if left < 1e-9:
        return 0.0, 0.0, True
    turn = (atan2(goal[1] - pose[1], goal[0] - pose[0]) - pose[2] + pi) % tau - pi
    rolls = abs(turn) <= ON_THE_SPOT
    turn = min(max(turn, -step.radians), step.radians)
    return (min(left, step.metres) if rolls else 0.0), turn, rolls and left <= step.metres


@allocating_kernel
def move_pose(pose: Floats, distance: float, turn: float) -> None:
    """Move a pose along a chord, half the turn before it, in place."""
    heading = pose[2] + turn / 2
    pose[0] += distance * cos(heading)
    pose[1] += distance * sin(heading)
    pose[2] += turn


@allocating_kernel
def odometry_sigmas(distance: float, turn: float, noise: Floats) -> tuple[float, float]:
    """Standard deviations of the distance and of the turn that wheels measure (`WheelModel`)."""
    distance, turn = abs(distance), abs(turn)
    return (
        sqrt(noise[2] ** 2 * distance + noise[3] ** 2 * turn),
        sqrt(noise[0] ** 2 * turn + noise[1] ** 2 * distance),
    )


@allocating_kernel
def true_motion(
    distance: float, turn: float, wheels: WheelErrors, normals: Floats
) -> tuple[float, float]:
    """What the robot really does while its wheels measure `distance` and `turn`: the inverse of
    `WheelModel.measured`."""
    distance_sigma, turn_sigma = odometry_sigmas(distance, turn, wheels.noise)
    really = (distance - normals[0] * distance_sigma) / wheels.scale
    turned = turn - normals[1] * turn_sigma + wheels.drift * abs(really)
    return really, turned / wheels.turn_scale


@allocating_kernel
def predict_covariance(
    covariance: Floats, heading: float, distance: float, turn: float, noise: Floats
) -> None:
    """The prediction of the extended Kalman filter, F P F' + Q, in place, shape (3, 3)."""
    ahead = np.array([cos(heading), sin(heading), 0.0])
    # F is the identity but for its last column; written out, without BLAS.
    shear = np.array([-distance * ahead[1], distance * ahead[0]])
    for axis in range(2):
        covariance[axis] += shear[axis] * covariance[2]
    for axis in range(2):
        covariance[:, axis] += shear[axis] * covariance[:, 2]
    distance_sigma, turn_sigma = odometry_sigmas(distance, turn, noise)
    covariance += distance_sigma**2 * np.outer(ahead, ahead)
    covariance[2, 2] += turn_sigma**2


@allocating_kernel
def mark_under(pose: Floats, marks: Floats, size: float) -> int:
    """The mark that the robot's middle is over, or -1."""
    for k in range(len(marks)):
        if max(abs(pose[0] - marks[k, 0]), abs(pose[1] - marks[k, 1])) <= size / 2:
            return k
    return -1


@allocating_kernel
def correct(estimate: Floats, covariance: Floats, mark: Floats, size: float, step: float) -> None:
    """The correction by a mark that came under the floor sensor, in place.

    The robot is over the mark. Where it faces an edge it came over that edge within the last step,
    unless the edge is outside the gate around the estimate: then it came in from the side.

    Args:
        mark: centre, shape (2,); size: its side; step: metres of the last step, at most.
    """
    facing = cos(estimate[2]), sin(estimate[2])
    for axis in range(2):
        low, high = mark[axis] - size / 2, mark[axis] + size / 2
        edge = low if facing[axis] > 0 else high
        if abs(facing[axis]) >= SQUARE_ON and (
            abs(estimate[axis] - edge) <= GATE_SIGMAS * sqrt(covariance[axis, axis]) + step
        ):
            low, high = min(edge, edge + step * facing[axis]), max(edge, edge + step * facing[axis])
        truncate_axis(estimate, covariance, axis, low, high)


@allocating_kernel
def truncate_axis(estimate: Floats, covariance: Floats, axis: int, low: float, high: float) -> None:
    """Condition estimate and covariance on a coordinate between two bounds, in place."""
    variance = covariance[axis, axis]
    if variance < 1e-12:
        return
    mean, share = truncated_gaussian(estimate[axis], sqrt(variance), low, high)
    gain = covariance[axis] / variance
    estimate += gain * (mean - estimate[axis])
    covariance -= np.outer(gain, gain) * (variance * (1 - share))


@allocating_kernel
def truncated_gaussian(mean: float, sigma: float, low: float, high: float) -> tuple[float, float]:
    """Mean of a Gaussian truncated at two bounds, and the share of its variance that is left."""
    a, b = (low - mean) / sigma, (high - mean) / sigma
    if b - a < 1e-3 or max(a, -b) > TAIL_SIGMAS:
        # As good as a point, or so far out that what is left is: the formula would divide zeros.
        nearest = min(max(mean, low), high)
        return nearest, min((b - a) ** 2 / 12, 1.0)
    inside = (erf(b / sqrt(2.0)) - erf(a / sqrt(2.0))) / 2
    at_a, at_b = exp(-a * a / 2) / sqrt(tau), exp(-b * b / 2) / sqrt(tau)
    shift = (at_a - at_b) / inside
    share = 1 + (a * at_a - b * at_b) / inside - shift**2
    return mean + sigma * shift, max(share, (b - a) ** 2 / 1000)
