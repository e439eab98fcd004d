"""e <- expected(m, t): what a robot would perceive at each candidate pose (Activity 9.5).

This is line 6 of the discrete Algorithm 9.2, Sect. 9.5 to 9.7, as `mapcli perceive` runs it: kept
for all candidates, that is the database of perceptions of Activity 9.5, which `mapcli
similarity-table --database` scores. `slam` never comes here: there line 6 is a look-up in the
likelihood field (`slam/scan_matcher.py`) or a comparison in cells (`slam/book_matcher.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.ray_casting import cast, edges_of, is_inside
from mapcli.algorithms.similarity.candidate_poses import (
    CandidateFrame,
    Candidates,
    neighbour_candidates,
)
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.perception import (
    STEPS,
    TURNS_DEG,
    ExpectedReadings,
    IntendedPose,
    LandmarkPerception,
    PerceptionDatabase,
    ScanPerception,
)
from mapcli.model.pose import Pose2D
from mapcli.model.world import World

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RangeSensor:
    """The beams of a range sensor.

    Attributes:
        beams: how many; fov_deg: degrees that they cover, centred ahead (all around, the last
            beam is one step before the first).
        range_max: in the map's unit.
    """

    beams: int = 24
    fov_deg: float = 360.0
    range_max: float = 5.0

    @property
    def increment(self) -> float:
        """Radians from one beam to the next."""
        around = self.fov_deg >= 360
        return math.radians(self.fov_deg) / max(self.beams if around else self.beams - 1, 1)

    @property
    def first(self) -> float:
        """Bearing of the first beam, radians."""
        return -math.radians(self.fov_deg) / 2 if self.beams > 1 else 0.0


def expect_perceptions(
    world: World | GridMap,
    intended: IntendedPose,
    steps: tuple[float, ...] = STEPS,
    turns_deg: tuple[float, ...] = TURNS_DEG,
    sensor: RangeSensor | None = None,
) -> PerceptionDatabase:
    """The database of Activity 9.5: what is expected at a pose and at the candidates around it.

    Landmarks of a points map, else scans; the first is of the intended pose itself.

    Args:
        intended: the pose in the map.
        steps: lengths of the steps to neighbouring positions, in cells (units without cells).
        turns_deg: headings of the candidates; that of the intended pose, 0, is always there.
        sensor: of the scans.

    Raises:
        DataError: the intended pose is outside the map or in an obstacle.
    """
    pose = intended.pose(world if isinstance(world, GridMap) else None)
    candidates = neighbour_candidates(steps, tuple(dict.fromkeys((0.0, *turns_deg))))
    if isinstance(world, World) and len(world.points):
        return landmark_database(world, pose, candidates)
    return scan_database(world, pose, candidates, sensor or RangeSensor())


def perception_at_intended(
    database: PerceptionDatabase,
    intended: IntendedPose,
    steps: tuple[float, ...] = STEPS,
    turns_deg: tuple[float, ...] = TURNS_DEG,
) -> LandmarkPerception | ScanPerception:
    """The one perception at the intended pose, out of the database of `expect_perceptions`."""
    readings = database.expectations[0].readings
    if database.of == "landmarks":
        return LandmarkPerception(intended, readings, steps, turns_deg)
    return ScanPerception(intended, readings, database.range_max, steps=steps, turns_deg=turns_deg)


def expected_ranges(edges: Floats, pose: Pose2D, sensor: RangeSensor) -> Floats:
    """Bearing and range of each beam, shape (n, 2); inf where nothing is in range.

    `edges` are of `ray_casting.edges_of`.
    """
    ranges = cast(edges, pose, sensor.first, sensor.increment, sensor.beams, sensor.range_max)
    return np.column_stack([sensor.first + sensor.increment * np.arange(sensor.beams), ranges])


def expected_landmarks(points: Floats, poses: Floats) -> Floats:
    """Distance and bearing (radians, from the heading) of each point at each pose.

    Args:
        points: shape (n, 2); poses: shape (k, 3), x, y, theta.

    Returns:
        shape (k, n, 2).
    """
    ahead = points[None] - poses[:, None, :2]
    bearing = np.arctan2(ahead[..., 1], ahead[..., 0]) - poses[:, 2:]
    wrapped = (bearing + math.pi) % math.tau - math.pi
    return np.stack([np.hypot(ahead[..., 0], ahead[..., 1]), wrapped], axis=2)


def scan_database(
    world: World | GridMap, intended: Pose2D, candidates: Candidates, sensor: RangeSensor
) -> PerceptionDatabase:
    """The scans expected at all candidates. Those inside an obstacle or outside a grid map are
    left out.

    Raises:
        DataError: the intended pose is one of these.
    """
    edges = edges_of(world)
    cell = world.resolution if isinstance(world, GridMap) else 1.0
    expectations = []
    for name, turn_deg, pose in _poses(world, intended, candidates):
        if _can_stand(world, pose):
            ranges = expected_ranges(edges, pose, sensor)
            expectations.append(ExpectedReadings(name, turn_deg, pose, ranges))
        elif pose == intended:
            raise DataError(
                f"pose: x {pose.x:g}, y {pose.y:g} is in an obstacle or outside the map",
                expected="a place where a robot can stand",
            )
    return PerceptionDatabase(
        "scan", tuple(expectations), sensor.range_max, _step(candidates) * cell
    )


def landmark_database(world: World, intended: Pose2D, candidates: Candidates) -> PerceptionDatabase:
    """The distances and bearings expected at all candidates."""
    expectations = [
        ExpectedReadings(
            name, turn_deg, pose,
            expected_landmarks(world.points, np.array([[pose.x, pose.y, pose.theta]]))[0],
        )
        for name, turn_deg, pose in _poses(world, intended, candidates)
    ]  # fmt: skip
    return PerceptionDatabase("landmarks", tuple(expectations), step=_step(candidates))


def _poses(
    world: World | GridMap, intended: Pose2D, candidates: Candidates
) -> list[tuple[str, float, Pose2D]]:
    frame = CandidateFrame(intended)
    if isinstance(world, GridMap):
        frame = CandidateFrame(intended, world.resolution, world.origin.theta)
    return [
        (name, turn_deg, candidates.pose(frame, r, c))
        for r, name in enumerate(candidates.names)
        for c, turn_deg in enumerate(candidates.turns_deg)
    ]


def _can_stand(world: World | GridMap, pose: Pose2D) -> bool:
    if isinstance(world, GridMap):
        row, column = world.cells_of_world([[pose.x, pose.y]])[0]
        if not world.contains(int(row), int(column)):
            return False
    return not is_inside(world, pose.x, pose.y)


def _step(candidates: Candidates) -> float:
    lengths = np.abs(candidates.offsets).max(axis=1)
    return float(lengths[lengths > 0].min()) if (lengths > 0).any() else 1.0


def obstacle_position(pose: Pose2D, distance: float, bearing: float) -> tuple[float, float]:
    """Where on the map an obstacle is that is perceived at a pose (Activity 9.4)."""
    angle = pose.theta + bearing
    return pose.x + distance * math.cos(angle), pose.y + distance * math.sin(angle)
