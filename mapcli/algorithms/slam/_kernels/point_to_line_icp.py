"""Fitting a scan's pose to surfels: Gauss-Newton on the distances of its points to the walls.

Lengths are in metres; for surfels see `surfels`.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.surfel_map import Table, nearest_surfel

STILL, STILL_TURN = 5e-4, 1e-4
"""Metres and radians; a pose that moves less is at the same walls as before."""
STEPS, LAST_STEP = 3, 0.2
"""Of Gauss-Newton in a round at most; the last one moves this share of the above."""
LEAST = 1e-9
"""Information that is there anyway, so that every system can be solved."""

Pose = tuple[float, float, float]
System = tuple[float, float, float, float, float, float, float, float, float]
"""Normal equations of (x, y, theta): xx, xy, xt, yy, yt, tt of the matrix, then the gradient."""


@kernel
def fit_scans(
    table: Table,
    points: NDArray[np.float64],
    bounds: NDArray[np.int64],
    poses: NDArray[np.float64],
    predicted: NDArray[np.float64],
    prior: tuple[float, float, float],
    shape: tuple[float, float, float],
    rounds: int,
    partners: NDArray[np.int64],
    systems: NDArray[np.float64],
    fitted: NDArray[np.int64],
) -> None:
    """Fit scans, one by one, to the walls and to what odometry says.

    Args:
        points: of all scans, shape (n, 2), in the robot's frame; those of scan k are the ones
            from bounds[k] to bounds[k + 1] - 1.
        poses: shape (scans, 3), (x, y, theta) in the world; changed in place.
        predicted: the same as odometry says.
        prior: (information per squared metre, per squared radian, squared deviations at which
            the prediction's say has fallen to a quarter).
        shape: (cell, thickness of a wall, deviations at which a point's say is a quarter).
        rounds: how often at most each point looks for its wall anew.
        partners: as many as points, filled with their walls' slots, 0 for none.
        systems: shape (scans, 6), filled with the upper triangles of the normal matrices at the
            poses, from the points alone.
        fitted: filled with how many points of each scan have a wall.
    """
    for k in range(len(poses)):
        first, last = bounds[k], bounds[k + 1]
        pose = (poses[k, 0], poses[k, 1], poses[k, 2])
        guess = (predicted[k, 0], predicted[k, 1], predicted[k, 2])
        for _ in range(rounds):
            fitted[k] = associate(table, points, first, last, pose, shape, partners)
            begun = pose
            pose, system = settle(
                table[4], partners, points, first, last, pose, guess, prior, shape[2]
            )
            if is_still(begun, pose, 1.0):
                break
        for j in range(3):
            poses[k, j] = pose[j]
        for j in range(6):
            systems[k, j] = system[j]


@kernel
def settle(
    surfels: NDArray[np.float64],
    partners: NDArray[np.int64],
    points: NDArray[np.float64],
    first: int,
    last: int,
    pose: Pose,
    predicted: Pose,
    prior: tuple[float, float, float],
    doubt: float,
) -> tuple[Pose, System]:
    """The pose at which points fit the walls that they belong to, by Gauss-Newton, and the last
    system on the way there, from the points alone."""
    for _ in range(STEPS):
        system = linearise(surfels, partners, points, first, last, pose, doubt)
        before = pose
        pose = stepped(pose, with_prior(system, pose, predicted, prior))
        if is_still(before, pose, LAST_STEP):
            break
    return pose, system


@kernel
def is_still(before: Pose, after: Pose, share: float) -> bool:
    """Whether a pose has moved less than a share of STILL and STILL_TURN."""
    off = abs(after[0] - before[0]) + abs(after[1] - before[1])
    return off < share * STILL and abs(after[2] - before[2]) < share * STILL_TURN


@kernel
def associate(
    table: Table,
    points: NDArray[np.float64],
    first: int,
    last: int,
    pose: Pose,
    shape: tuple[float, float, float],
    partners: NDArray[np.int64],
) -> int:
    """Find the surfels of points `first` to `last` - 1 at a pose: fills `partners`, returns how
    many have one."""
    x, y, theta = pose
    c, s = cos(theta), sin(theta)
    fitted = 0
    for p in range(first, last):
        px, py = points[p, 0], points[p, 1]
        at = nearest_surfel(table, x + c * px - s * py, y + s * px + c * py, shape[0], shape[1])
        partners[p] = at
        fitted += at > 0
    return fitted


@kernel
def linearise(
    surfels: NDArray[np.float64],
    partners: NDArray[np.int64],
    points: NDArray[np.float64],
    first: int,
    last: int,
    pose: Pose,
    doubt: float,
) -> System:
    """How badly points `first` to `last` - 1 fit at a pose, as normal equations.

    Args:
        surfels, partners: the walls, and which one each point is at, 0 for none.
        doubt: deviations at which a point's say is a quarter.
    """
    x, y, theta = pose
    c, s = cos(theta), sin(theta)
    n_xx = n_xy = n_xt = n_yy = n_yt = n_tt = g_x = g_y = g_t = 0.0
    for p in range(first, last):
        at = partners[p]
        if at == 0:
            continue
        px, py = points[p, 0], points[p, 1]
        rx, ry = c * px - s * py, s * px + c * py
        ex, ey = surfels[at, 0] - x - rx, surfels[at, 1] - y - ry
        xx, xy, yy = heeded(surfels, at, ex, ey, doubt)
        # The columns of the information times how a turn moves the point, (-ry, rx).
        tx, ty = xy * rx - xx * ry, yy * rx - xy * ry
        gx, gy = xx * ex + xy * ey, xy * ex + yy * ey
        n_xx += xx
        n_xy += xy
        n_yy += yy
        n_xt += tx
        n_yt += ty
        n_tt += rx * ty - ry * tx
        g_x += gx
        g_y += gy
        g_t += rx * gy - ry * gx
    return n_xx, n_xy, n_xt, n_yy, n_yt, n_tt, g_x, g_y, g_t


@kernel
def heeded(
    surfels: NDArray[np.float64], at: int, ex: float, ey: float, doubt: float
) -> tuple[float, float, float]:
    """The information of a surfel for a point that is so far off it: the farther, the less."""
    xx, xy, yy = surfels[at, 2], surfels[at, 3], surfels[at, 4]
    square = xx * ex * ex + 2 * xy * ex * ey + yy * ey * ey
    say = doubt * doubt / (doubt * doubt + square)
    say *= say
    return say * xx, say * xy, say * yy


@kernel
def with_prior(
    system: System, pose: Pose, predicted: Pose, prior: tuple[float, float, float]
) -> System:
    """Add the pull of the prediction, which weakens where the pose is far from it."""
    n_xx, n_xy, n_xt, n_yy, n_yt, n_tt, g_x, g_y, g_t = system
    per_metre, per_radian, knee = prior
    x, y, turn = predicted[0] - pose[0], predicted[1] - pose[1], predicted[2] - pose[2]
    say_xy = knee / (knee + per_metre * (x * x + y * y))
    say_turn = knee / (knee + per_radian * turn * turn)
    xy, theta = per_metre * say_xy * say_xy, per_radian * say_turn * say_turn
    return (
        n_xx + xy, n_xy, n_xt, n_yy + xy, n_yt, n_tt + theta,
        g_x + xy * x, g_y + xy * y, g_t + theta * turn,
    )  # fmt: skip


@kernel
def stepped(pose: Pose, system: System) -> Pose:
    """A pose after one step of Gauss-Newton: the solution of the system, by Cramer's rule."""
    a00, a01, a02, a11, a12, a22, x, y, z = system
    a00 += LEAST
    a11 += LEAST
    a22 += LEAST
    c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    determinant = a00 * c00 + a01 * c01 + a02 * c02
    return (
        pose[0] + (c00 * x + c01 * y + c02 * z) / determinant,
        pose[1] + (c01 * x + c11 * y + c12 * z) / determinant,
        pose[2] + (c02 * x + c12 * y + c22 * z) / determinant,
    )
