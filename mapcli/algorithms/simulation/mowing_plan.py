"""The path of a mower over a lawn, back and forth, and tape marks beside it (Fig. 9.12, 9.14)."""

from __future__ import annotations

import math

import numpy as np
import shapely

from mapcli.algorithms.maps.polygons import Area, polygon_areas
from mapcli.errors import DataError
from mapcli.model.mowing import Floats, MowingPlan
from mapcli.model.world import World

MOST_LANES = 10_000


def plan_mowing(world: World, width: float, landmarks: int = 0) -> MowingPlan:
    """Lanes along the longer side of the lawn, from the charging station and back to it.

    Args:
        world: the lawn is its only polygon, the station its first point, if it has one; else the
            mower starts where the first lane does.
        width: metres that a lane is cut wide.
        landmarks: number of tape marks, evenly along the outline, each moved to the nearest point
            of the path, where a robot can notice it.

    Raises:
        DataError: no lawn or several, a lawn that is no area, too narrow for a lane, or with bays
            that a straight lane would cross.
    """
    if len(world.polygons) != 1:
        raise DataError(f"{len(world.polygons)} polygons", expected="one polygon, the lawn")
    lawn = polygon_areas(world)[0]
    lanes = _lanes(lawn, width)
    ends = [lane[:: 1 if k % 2 == 0 else -1] for k, lane in enumerate(lanes)]
    station = world.points[0] if len(world.points) else ends[0][0]
    waypoints = _distinct(np.concatenate([[station], *ends, [station]]))
    marks = _marks(lawn, waypoints, landmarks)
    return MowingPlan(world.polygons[0], waypoints, len(lanes), width, marks)


def _lanes(lawn: Area, width: float) -> list[Floats]:
    """Both ends of each lane, shape (2, 2), from the bottom up (or from the left)."""
    x0, y0, x1, y1 = lawn.bounds
    upright = y1 - y0 > x1 - x0
    low, high = (x0, x1) if upright else (y0, y1)
    count = math.ceil((high - low) / width - 1e-9)
    if not count <= MOST_LANES:
        raise DataError(f"the lawn would have {count:,} lanes", expected=f"at most {MOST_LANES:,}")
    # As many as needed, spread evenly: the last one does not leave the lawn.
    places = (
        np.linspace(low + width / 2, high - width / 2, count) if count > 1 else [low + width / 2]
    )
    lanes = [_lane(lawn, place, width, upright=upright) for place in places]
    found = [lane for lane in lanes if lane is not None]
    if not found or high - low < width:
        size = f"{x1 - x0:g} m x {y1 - y0:g} m"
        raise DataError(f"the lawn, {size}, is too narrow", expected=f"room for {width:g} m lanes")
    return found


def _lane(lawn: Area, place: float, width: float, *, upright: bool) -> Floats | None:
    """The lane at a height (or at an x, upright), half its width inside the outline."""
    x0, y0, x1, y1 = lawn.bounds
    ends = [(place, y0), (place, y1)] if upright else [(x0, place), (x1, place)]
    across = shapely.intersection(lawn, shapely.LineString(ends))
    parts = [part for part in shapely.get_parts(across) if part.length > width]
    if len(parts) > 1:
        axis = "x" if upright else "y"
        raise DataError(
            f"the lane at {axis} = {place:.2f} m would leave the lawn and enter it again",
            expected="a lawn without bays across the lanes",
        )
    if not parts:
        return None
    line = parts[0]
    inside = [line.interpolate(width / 2), line.interpolate(line.length - width / 2)]
    return np.array(sorted((point.x, point.y) for point in inside))


def _distinct(points: Floats) -> Floats:
    """The points without those at the place of the one before."""
    fresh = np.ones(len(points), dtype=bool)
    fresh[1:] = np.hypot(*np.diff(points, axis=0).T) > 1e-9
    return points[fresh]


def _marks(lawn: Area, waypoints: Floats, count: int) -> Floats:
    path = shapely.LineString(waypoints)
    evenly = [lawn.exterior.interpolate((k + 0.5) / count, normalized=True) for k in range(count)]
    near = [path.interpolate(path.project(point)) for point in evenly]
    return np.array([(point.x, point.y) for point in near]).reshape(-1, 2)
