"""The room of Sect. 9.5: a corner, with a projection from the wall on the robot's left, and a robot
that sees five cells far. A unit is a cell."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from mapcli import Pose2D, World
from mapcli.algorithms.scans.ray_casting import cast, edges_of
from mapcli.algorithms.similarity.measures import Similarity
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.slam import Slam
from mapcli.algorithms.slam.slam_parameters import SlamParameters
from mapcli.model.scan import NANOSECONDS, RangeScan

WALLS = edges_of(
    World.of([
        [[2.1, -5.2], [13.4, -5.2], [13.4, 6.9], [2.1, 6.9], [2.1, 4.9], [4.2, 4.9], [4.2, 3.1],
         [2.1, 3.1]],
    ])
)  # fmt: skip
START = Pose2D(6.5, -0.5, math.pi / 2)
"""In the middle of a cell, looking up."""

BEAMS, RANGE = 72, 5.0


def scan_at(pose: Pose2D, second: int, noise: np.random.Generator | None = None) -> RangeScan:
    """What the robot sees: a beam every five degrees."""
    ranges = cast(WALLS, pose, -math.pi, math.tau / BEAMS, BEAMS, RANGE)
    if noise is not None:
        ranges = ranges + 0.02 * noise.standard_normal(BEAMS)
    ranges[ranges > RANGE] = np.inf
    return RangeScan(
        second * NANOSECONDS, -math.pi, math.tau / BEAMS, ranges.astype(np.float32), 0.0, RANGE
    )


def driven(
    truth: Sequence[Pose2D], odometry: Iterable[Pose2D], similarity: Similarity, start: Pose2D
) -> list[Pose2D]:
    """Where a run of the book's algorithm takes the robot to be, which starts there in its map."""
    parameters = SlamParameters(
        map=MapParameters(resolution=1.0), match=MatchParameters(similarity=similarity)
    ).as_in_the_book()
    slam, noise = Slam(parameters, start), np.random.default_rng(1)
    return [
        slam.step(scan_at(pose, second, noise), counted).pose
        for second, (pose, counted) in enumerate(zip(truth, odometry, strict=True))
    ]
