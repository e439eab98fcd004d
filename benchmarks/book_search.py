"""Algorithm 9.2 in its own form, `--search book`, with few sensors: does it leave odometry alone
that is perfect, and does it follow a robot whose wheels slip?

    python benchmarks/book_search.py [--only WORLD] [--similarity S ...]

Printed are, for each world and robot, the farthest that a pose is from the true one where odometry
is perfect, and where the wheels slip for two seconds the root mean square of it; the worst of the
similarities, in cells, with that of odometry alone in brackets. Nothing is aligned.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mapcli import (
    LaserModel,
    MotionLimits,
    Pose2D,
    Simulation,
    WheelModel,
    World,
    load_waypoints,
    load_world,
    replay,
    simulate,
)
from mapcli.algorithms.similarity.measures import SIMILARITIES, Similarity
from mapcli.algorithms.simulation.sensors import Fault
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.match import MatchParameters
from mapcli.algorithms.slam.slam_parameters import SlamParameters
from mapcli.model.scan import Mount
from mapcli.model.waypoint import Waypoint

FIXTURES = Path(__file__).parent.parent / "fixtures"

CORNER = World.of([
    [[1, -6], [2.1, -6], [2.1, 8], [1, 8]], [[2.1, 3.1], [4.2, 3.1], [4.2, 4.9], [2.1, 4.9]],
    [[2.1, 6.9], [14, 6.9], [14, 8], [2.1, 8]], [[13.4, -6], [14, -6], [14, 6.9], [13.4, 6.9]],
    [[2.1, -6], [13.4, -6], [13.4, -5.2], [2.1, -5.2]],
])  # fmt: skip
"""The room of Sect. 9.5, where a unit is a cell."""


def sheds() -> World:
    """Huts with walls at all angles, on a square of 5 m with a fence."""
    fences = [[[0, -1], [5, -1], [5, 0], [0, 0]], [[0, 5], [5, 5], [5, 6], [0, 6]],
              [[-1, -1], [0, -1], [0, 6], [-1, 6]], [[5, -1], [6, -1], [6, 6], [5, 6]]]  # fmt: skip
    square = np.array([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]])
    huts = [(1.5, 1.4, 20), (3.4, 1.5, 65), (1.6, 3.5, 110), (3.5, 3.4, -35)]
    return World.of([*fences, *(
        Pose2D(x, y, math.radians(turn)).apply(square).tolist() for x, y, turn in huts
    )])  # fmt: skip


def way(*places: tuple[float, float]) -> list[Waypoint]:
    return [Waypoint(x, y) for x, y in places]


class Place(NamedTuple):
    """A world, a way through it, the size of a cell, and how far sensors see in it."""

    world: World
    way: list[Waypoint]
    cell: float
    ranges: tuple[float, ...]
    speed: float = 0.25


def places() -> dict[str, Place]:
    def fixture(name: str) -> World:
        world = load_world(str(FIXTURES / f"{name}.yaml")).world
        assert isinstance(world, World)
        return world

    def path(name: str) -> list[Waypoint]:
        return load_waypoints(str(FIXTURES / f"{name}-path.txt"))

    around = way((0.6, 0.7), (2.5, 0.6), (4.4, 0.6), (4.3, 2.5), (4.4, 4.4), (2.4, 4.4),
                 (2.5, 2.4), (0.6, 2.4), (0.6, 0.7))  # fmt: skip
    return {
        "corridor": Place(fixture("corridor"), path("corridor"), 0.05, (1, 2), 0.2),
        "apartment": Place(fixture("apartment"), path("apartment"), 0.05, (1, 2, 3)),
        "apartment, back": Place(fixture("apartment"), path("apartment")[::-1], 0.05, (1, 3)),
        "room": Place(fixture("room"), path("room"), 0.05, (1,)),
        "sheds": Place(sheds(), around, 0.05, (1, 2)),
        "corner": Place(CORNER, way((6.5, -0.5), (6.5, 5.5), (11.5, 5.5)), 1, (5,), 0.5),
    }


def robots(size: float, reach: float) -> dict[str, dict[str, LaserModel]]:
    """Sensors by the name of the robot: where they sit, and where they look.

    Args:
        size: of the robot, metres.
    """

    def ring(*bearings: float) -> dict[str, LaserModel]:
        return {
            f"r{turn:g}": LaserModel(
                beams=1, fov_deg=1, range_max=reach,
                mount=Mount(Pose2D(size * math.cos(math.radians(turn)),
                            size * math.sin(math.radians(turn)), math.radians(turn))),
            ) for turn in bearings
        }  # fmt: skip

    return {
        "one to the side": ring(90),
        "three ahead": ring(45, 0, -45),
        "five ahead": ring(-90, -45, 0, 45, 90),
        "ring of 8": ring(*range(0, 360, 45)),
        "ring of 12": ring(*range(0, 360, 30)),
    }


def drives(place: Place, faults: Sequence[Fault]) -> Iterator[tuple[str, Simulation]]:
    """What each robot measures on its way."""
    wheels = WheelModel(noise=(0, 0, 0, 0), faults=tuple(faults))
    limits = MotionLimits(speed=place.speed)
    drive = simulate(place.world, place.way, limits=limits, wheels=wheels)
    for reach in place.ranges:
        for name, sensors in robots(place.cell, reach).items():
            yield f"{name}, {reach:g} m", replace(drive, sensors=sensors)
        laser = LaserModel(beams=61, fov_deg=180, range_max=reach)
        yield f"laser, {reach:g} m", replace(drive, laser=laser)


def errors(drive: Simulation, cell: float, similarity: Similarity) -> tuple[float, float, float]:
    """The farthest of a pose from the true one, the root mean square, and that of odometry alone,
    in cells."""
    match = MatchParameters(similarity=similarity)
    parameters = SlamParameters(map=MapParameters(resolution=cell), match=match).as_in_the_book()
    poses = replay(drive.records(), parameters).trace.poses
    start, begin = drive.true_pose(0), poses[0].stamp_ns
    true = [start.between(drive.true_pose((one.stamp_ns - begin) / 1e9)) for one in poses]
    off = np.array([one.pose.distance(t) for one, t in zip(poses, true, strict=True)]) / cell
    counted = [
        (one.odom or Pose2D()).distance(t) / cell for one, t in zip(poses, true, strict=True)
    ]
    return (
        float(off.max()),
        float(np.sqrt((off**2).mean())),
        float(np.sqrt(np.mean(np.square(counted)))),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--similarity", nargs="*", default=SIMILARITIES, choices=SIMILARITIES)
    asked = parser.parse_args()
    print(f"{'':38}{'perfect':>8}   slip@3-5")
    for title, place in places().items():
        if not title.startswith(asked.only):
            continue
        slipping = drives(place, [Fault("slip", 3, 5)])
        for (name, drive), (_, slip) in zip(drives(place, ()), slipping, strict=True):
            worst = max(errors(drive, place.cell, s)[0] for s in asked.similarity)
            runs = [errors(slip, place.cell, s)[1:] for s in asked.similarity]
            rms, alone = max(runs)
            print(f"{title + ': ' + name:38}{worst:8.2f}   {rms:.2f} ({alone:.2f})", flush=True)


if __name__ == "__main__":
    main()
