"""Small random maps, their likelihood pyramid, and scans in them, for the twins of kernels."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.likelihood_field import update_likelihood_field
from mapcli.algorithms.slam.likelihood_field import LEVEL_WIDTHS
from mapcli.algorithms.slam.map_parameters import MapParameters

Floats = NDArray[np.float64]

GAUSSIAN = MapParameters(resolution=0.05, blur=0.05).gaussian_kernel()
SIZE = 120
MIDDLE = SIZE / 2


def place(point: Floats, pose: Floats) -> tuple[float, float]:
    """(u, v) of a point of the robot at a pose."""
    c, s = cos(pose[2]), sin(pose[2])
    return pose[0] + c * point[0] - s * point[1], pose[1] + s * point[0] + c * point[1]


def walls(rng: np.random.Generator, count: int) -> NDArray[np.int16]:
    """A map with some walls around its middle, some open cells and much that is unknown."""
    log_odds = np.zeros((SIZE, SIZE), np.int16)
    for _ in range(count):
        v, u = rng.integers(46, SIZE - 56, 2)
        length = rng.integers(1, 12)
        part = log_odds[v, u : u + length] if rng.random() < 0.5 else log_odds[v : v + length, u]
        part[:] = rng.choice([-100, 100])
    return log_odds


def fields_of(log_odds: NDArray[np.int16]) -> NDArray[np.uint8]:
    pyramid = np.zeros((len(LEVEL_WIDTHS), *log_odds.shape), np.uint8)
    update_likelihood_field(pyramid, LEVEL_WIDTHS, log_odds, np.flatnonzero(log_odds > 0), GAUSSIAN)
    return pyramid


def scan_around(rng: np.random.Generator, log_odds: NDArray[np.int16], n: int) -> Floats:
    """Points as a robot in the middle would see some of the walls, and some others."""
    points = rng.uniform(-15, 15, (n, 2))
    v, u = np.nonzero(log_odds > 0)
    if len(v) and n:
        some = rng.integers(0, len(v), n // 2)
        points[: n // 2] = np.column_stack([u[some], v[some]]) + 0.5 - MIDDLE
    return points
