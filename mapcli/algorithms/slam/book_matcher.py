"""Lines 5 to 8 of Algorithm 9.2 in their own form: the fifteen test positions of Sect. 9.5.

They are five positions, the predicted one and the next cells along both axes of the map, at three
headings each. Each is compared with the odometry's pose, on the places of the perception that both
let expect something (`similarity.shared_cells`); ties and near-ties go to the odometry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.candidate_poses import Candidates, neighbour_candidates
from mapcli.algorithms.similarity.shared_cells import Comparison, compare
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.book_perception import expected_places, perceived_places
from mapcli.algorithms.slam.match import Match, MatchParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Floats = NDArray[np.float64]

ROOM = 3
"""Cells around all that is looked up: the place before an end, and rounding."""


@dataclass(frozen=True, eq=False)
class BookSearch:
    """One search of T, as it can be shown.

    Attributes:
        map: m, the part of the current map that is looked at, before it is updated: 0 empty, 1
            obstacle, NaN unknown.
        perception: p; predicted: n, the pose by odometry.
        candidates: T; votes: of each, by position and turn; chosen: position and turn of the best.
    """

    map: GridMap
    perception: Perception
    predicted: Pose2D
    candidates: Candidates
    votes: tuple[tuple[Comparison, ...], ...]
    chosen: tuple[int, int]


def best_of_fifteen(
    grid: OccupancyGrid, perception: Perception, predicted: Pose2D, parameters: MatchParameters
) -> Match:
    """The best of the test positions: the predicted one, unless another is plainly better."""
    turns = dict.fromkeys((0.0, *parameters.turns_deg))  # odometry's heading, first of all
    candidates = neighbour_candidates(parameters.book_steps, tuple(turns))
    cell = grid.parameters.resolution
    reach = float(np.hypot(*perception.beams().T).max())
    reach += (float(np.abs(candidates.offsets).max()) + ROOM) * cell
    middle = np.array([predicted.x, predicted.y])
    grid.extend_to(middle - reach, middle + reach)
    n = grid.pose_to_cells(predicted)
    p = perceived_places(perception, cell, n)  # 4
    similarity, independent = parameters.similarity, perception.independent
    by_odometry, votes = expected_places(grid, p, n), []
    for offset in candidates.offsets:  # 5
        row = []
        for turn in candidates.turns_deg:
            t = n + np.append(offset, math.radians(turn))
            e = expected_places(grid, p, t)  # 6
            row.append(compare(p.signs, e, by_odometry, similarity, independent))  # 7
        votes.append(tuple(row))
    chosen = _best(votes)  # 8
    search = BookSearch(
        _part(grid, n, reach / cell), perception, predicted, candidates, tuple(votes), chosen
    )
    return _match(grid, n, search)


def _best(votes: list[tuple[Comparison, ...]]) -> tuple[int, int]:
    """Position and turn of the best; the first of equals, and the odometry's pose if no other is
    better."""
    best, lead = (0, 0), 0.0
    for i, row in enumerate(votes):
        for j, one in enumerate(row):
            if one.is_better and one.lead > lead:
                best, lead = (i, j), one.lead
    return best


def _match(grid: OccupancyGrid, n: Floats, search: BookSearch) -> Match:
    position, turn = search.chosen
    move = [*search.candidates.offsets[position], math.radians(search.candidates.turns_deg[turn])]
    best = n + np.array(move)
    hits = search.perception.hits / grid.parameters.resolution
    score, known, conflicts = agreement(grid, hits, best)
    pose = grid.pose_from_cells(best) if any(move) else search.predicted
    return Match(pose, score, known, known > 0, free_space_conflicts=conflicts, search=search)


def _part(grid: OccupancyGrid, n: Floats, reach: float) -> GridMap:
    """What the map holds around a pose, both in cells."""
    low, high = (np.floor(n[:2] + far).astype(np.int64) for far in (-reach, reach))
    corner = grid.pose_from_cells(np.append(low, 0.0))
    return map_part(grid, (corner.x, corner.y), (int(high[1] - low[1]), int(high[0] - low[0])))


def map_part(grid: OccupancyGrid, corner: tuple[float, float], shape: tuple[int, int]) -> GridMap:
    """A part of the map as a matrix of Sect. 9.5: 0 empty, 1 obstacle, NaN unknown.

    Args:
        corner: of its lower left cell, metres; shape: rows and columns.
    """
    u, v = np.rint(grid.to_cells(np.array([corner]))[0]).astype(np.int64)
    signs = np.sign(grid.log_odds[v : v + shape[0], u : u + shape[1]]).astype(np.float32)
    cells = np.where(signs == 0, np.float32(np.nan), (signs + 1) / 2)
    return GridMap.from_bottom_up(cells, grid.parameters.resolution, corner)
