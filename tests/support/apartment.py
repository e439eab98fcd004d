"""The apartment of the fixtures, and ways through it."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np
from conftest import FIXTURES
from support.looping import Edges

from mapcli import Pose2D, load_world
from mapcli.algorithms.scans.ray_casting import edges_of


def way(*corners: tuple[float, float], step: float = 0.25) -> list[Pose2D]:
    """From corner to corner, looking ahead; turns on the spot."""
    poses = []
    for (x, y), (to_x, to_y) in pairwise(corners):
        heading, metres = math.atan2(to_y - y, to_x - x), math.hypot(to_x - x, to_y - y)
        for along in np.arange(0.0, metres, step).tolist():
            poses.append(Pose2D(x, y, heading).compose(Pose2D(along)))
    return poses


@cache
def apartment() -> Edges:
    return edges_of(load_world(FIXTURES / "apartment.yaml").world)


HALL, BEDROOM, STUDY, LIVING, KITCHEN = (
    (0.8, 5.0), (3.05, 7.4), (9.2, 7.2), (1.65, 3.0), (9.9, 2.6)
)  # fmt: skip
