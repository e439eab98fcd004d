"""Lines 4 and 6 of Algorithm 9.2 in their own form: what was seen, and what a map lets expect.

The perception p is a set of places in the robot's frame: those where beams end, obstacles, and the
middles of the cells that are empty. The expected map e at a test position t is the current map m as
a robot at t would see it, at these very places: so p stays as it is, e is looked up fifteen times,
and the two are compared place by place.

A robot sees no farther than the first wall. Where m knows a wall, and nothing of what lies behind
it, no beam is expected to end there: a wall is one cell thick (Sect. 9.5), so that an end in an
unknown cell right behind a known wall contradicts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.perception_map import perception_map, scan_outline
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]

SAME = 1e-9
"""Cells that two ends lie apart, at least, to show which way a wall runs."""


class PerceivedPlaces(NamedTuple):
    """A perception, in cells, in the robot's frame.

    Attributes:
        places: shape (n, 2), the ends of beams first; signs: shape (n,), +1 for these, obstacles,
            and -1 for the middles of empty cells.
        fronts: shape (k, 2), for each end the place one cell before it, square to the wall.
    """

    places: Floats
    signs: Signs
    fronts: Floats


def perceived_places(perception: Perception, cell: float, pose: Floats) -> PerceivedPlaces:
    """p, analysed at the pose by odometry: empty cells are those of the map as it lies there.

    Args:
        pose: (u, v, theta) in the map, in cells and radians.
    """
    parts = perception.parts()
    ends = perception.hits / cell
    lasers = np.repeat([part.laser / cell for part in parts], [len(p.hits) for p in parts], axis=0)
    empty = np.concatenate([_empty_cells(part, cell, pose) for part in parts])
    middles = np.unique(empty, axis=0) + 0.5
    places = np.concatenate([ends, (middles - pose[:2]) @ _rotation(pose[2])])
    signs = np.full(len(places), -1, np.int8)
    signs[: len(ends)] = 1
    return PerceivedPlaces(places, signs, ends + _towards(ends, lasers))


def _empty_cells(part: Perception, cell: float, pose: Floats) -> NDArray[np.int64]:
    """(u, v) of the cells that beams with one start show to be empty, shape (n, 2)."""
    drawn = perception_map(scan_outline(part, cell, walls="ends"), pose, compiled=True)
    rows, columns = np.nonzero(drawn.values < 0)
    return np.column_stack([columns + drawn.left, rows + drawn.bottom])


def perception_signs(
    perception: Perception, cell: float, pose: Floats, shape: tuple[int, int]
) -> Signs:
    """p as a matrix, drawn at a pose into the cells of a map of this shape, bottom-up."""
    places = perceived_places(perception, cell, pose).places
    cells = np.floor(places @ _rotation(pose[2]).T + pose[:2]).astype(np.int64)
    inside = ((cells >= 0) & (cells < shape[::-1])).all(axis=1)
    ends = np.arange(len(cells)) < len(perception.hits)
    signs = np.zeros(shape, np.int8)
    for which, sign in ((~ends, -1), (ends, 1)):  # an end outweighs an empty middle
        u, v = cells[inside & which].T
        signs[v, u] = sign
    return signs


def expected_places(grid: OccupancyGrid, p: PerceivedPlaces, pose: Floats) -> Signs:
    """e <- expected(m, t): what the map lets expect at each place of p, seen from a pose."""
    e = _look_up(grid, p.places, pose)
    ends = e[: len(p.fronts)]  # a view
    ends[(ends == 0) & (_look_up(grid, p.fronts, pose) > 0)] = -1
    return e


def _look_up(grid: OccupancyGrid, places: Floats, pose: Floats) -> Signs:
    u, v = np.floor(places @ _rotation(pose[2]).T + pose[:2]).astype(np.int64).T
    signs: Signs = np.sign(grid.log_odds[v, u]).astype(np.int8)
    return signs


def _rotation(theta: float) -> Floats:
    """The matrix that turns columns counter-clockwise."""
    cos, sin = math.cos(theta), math.sin(theta)
    return np.array([[cos, -sin], [sin, cos]])


def _towards(ends: Floats, lasers: Floats) -> Floats:
    """Unit vectors from ends of beams to the side that their laser is on, square to the wall: to
    the line to the nearer one of the neighbouring ends."""
    rays = ends - lasers
    order = np.argsort(np.arctan2(rays[:, 1], rays[:, 0]), kind="stable")
    after = np.roll(ends[order], -1, axis=0) - ends[order]
    before = np.roll(after, 1, axis=0)
    along = np.where((_length(before) < _length(after))[:, None], before, after)
    normal = np.empty_like(ends)
    normal[order] = np.column_stack([-along[:, 1], along[:, 0]])
    normal = np.where(_length(normal)[:, None] > SAME, normal, rays)
    away = np.sign((normal * rays).sum(axis=1))
    towards: Floats = -normal * (away / np.maximum(_length(normal), SAME))[:, None]
    return towards


def _length(vectors: Floats) -> Floats:
    length: Floats = np.hypot(vectors[:, 0], vectors[:, 1])
    return length
