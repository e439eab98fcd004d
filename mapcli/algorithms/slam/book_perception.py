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
from mapcli.algorithms.similarity.perception_map import (
    CLEAR,
    CLEAR_M,
    perception_map,
    scan_outline,
)
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid

Floats = NDArray[np.float64]
Signs = NDArray[np.int8]
Numbers = NDArray[np.int64]

SAME = 1e-9
"""Cells that two ends lie apart, at least, to show which way a wall runs."""


class PerceivedPlaces(NamedTuple):
    """A perception, in cells, in the robot's frame.

    Attributes:
        places: shape (n, 2), the ends of beams first; signs: shape (n,), +1 for these, obstacles,
            and -1 for the middles of empty cells.
        witnesses: shape (n,), which beam saw the place; of a few sensors, which sensor.
        fronts: shape (k, 2), for each end the place one cell before it, square to the wall.
    """

    places: Floats
    signs: Signs
    witnesses: Numbers
    fronts: Floats


def perceived_places(perception: Perception, cell: float, pose: Floats) -> PerceivedPlaces:
    """p, analysed at the pose by odometry: empty cells are those of the map as it lies there.

    Args:
        pose: (u, v, theta) in the map, in cells and radians.
    """
    parts = perception.parts()
    ends = perception.hits / cell
    lasers = np.repeat([part.laser / cell for part in parts], [len(p.hits) for p in parts], axis=0)
    if perception.readings:
        empty, witnesses = _passed(perception, cell)
    else:
        empty = _empty_middles(perception, cell, pose)
        witnesses = np.append(np.arange(len(ends)), _nearest_beams(perception, cell, empty))
    signs = np.full(len(ends) + len(empty), -1, np.int8)
    signs[: len(ends)] = 1
    fronts = ends + _towards(ends, lasers)
    return PerceivedPlaces(np.concatenate([ends, empty]), signs, witnesses, fronts)


def _passed(perception: Perception, cell: float) -> tuple[Floats, Numbers]:
    """Of a few sensors: places along their beams, a cell apart, since what lies between the beams
    nobody saw; and the witnesses, of the ends first."""
    passed = [_along_beams(one, cell) for one in perception.readings]
    sensors = np.array(perception.sensors, np.int64)
    of_ends = np.repeat(sensors, [len(one.hits) for one in perception.readings])
    of_empty = np.repeat(sensors, [len(one) for one in passed])
    return np.concatenate(passed), np.append(of_ends, of_empty)


def _along_beams(reading: Perception, cell: float) -> Floats:
    """Places that beams with one start passed, in cells, shape (n, 2): up to where they ended."""
    places = [np.empty((0, 2))]
    clear = CLEAR + CLEAR_M / cell, 0.0
    for far, before in zip((reading.hits, reading.open_ends), clear, strict=True):
        for ray in (far - reading.laser) / cell:
            length = math.hypot(*ray)
            steps = np.arange(0.5, length - before)
            places.append(reading.laser / cell + steps[:, None] * (ray / max(length, SAME)))
    return np.concatenate(places)


def _empty_middles(scan: Perception, cell: float, pose: Floats) -> Floats:
    """Middles of the cells that a scan shows to be empty, in the robot's frame, shape (n, 2)."""
    drawn = perception_map(scan_outline(scan, cell, walls="ends"), pose, compiled=True)
    rows, columns = np.nonzero(drawn.values < 0)
    middles = np.column_stack([columns + drawn.left, rows + drawn.bottom]) + 0.5
    return (middles - pose[:2]) @ _rotation(pose[2])


def _nearest_beams(scan: Perception, cell: float, places: Floats) -> Numbers:
    """For each place the number of the beam that points there best, hits first."""
    bearings = _bearings(scan.beams()[:-1] - scan.laser)
    if not len(bearings):
        return np.zeros(len(places), np.int64)
    order = np.argsort(bearings, kind="stable")
    around = bearings[order]
    around = np.concatenate([around[-1:] - math.tau, around, around[:1] + math.tau])
    middles = (around[1:] + around[:-1]) / 2
    found = np.searchsorted(middles, _bearings(places - scan.laser / cell)) - 1
    nearest: Numbers = order[found % len(order)]
    return nearest


def _bearings(rays: Floats) -> Floats:
    bearings: Floats = np.arctan2(rays[:, 1], rays[:, 0])
    return bearings


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
    order = np.argsort(_bearings(rays), kind="stable")
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
