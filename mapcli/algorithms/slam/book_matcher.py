"""Lines 5 to 8 of Algorithm 9.2 in their own form: the fifteen test positions of Sect. 9.5.

They are five positions, the predicted one and the next cells along both axes of the map, at three
headings each. Each is compared with the odometry's pose, on the places of the perception that both
let expect something (`similarity.shared_cells`); ties and near-ties go to the odometry.

A majority of the votes that may still be chance makes a test position suspected only: odometry is
believed, and the next comparison tries the test positions around the suspected one first. While one
of them has a majority again the votes add up, until they are believed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.candidate_poses import Candidates, neighbour_candidates
from mapcli.algorithms.similarity.measures import Similarity
from mapcli.algorithms.similarity.shared_cells import (
    BELIEVED_SIGMAS,
    Comparison,
    Signs,
    Votes,
    compare,
)
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.book_perception import (
    PerceivedPlaces,
    expected_places,
    perceived_places,
)
from mapcli.algorithms.slam.match import Alternative, Match, MatchParameters
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
        candidates: T, around `centre`: the odometry's pose, or one that was suspected.
        comparisons: of each, by position and turn; chosen: position and turn of the best.
        is_believed: whether that becomes the pose, and is not suspected only.
    """

    map: GridMap
    perception: Perception
    predicted: Pose2D
    candidates: Candidates
    centre: Pose2D
    comparisons: tuple[tuple[Comparison, ...], ...]
    chosen: tuple[int, int]
    is_believed: bool


def best_of_fifteen(
    grid: OccupancyGrid,
    perception: Perception,
    predicted: Pose2D,
    parameters: MatchParameters,
    suspected: Alternative | None = None,
) -> Match:
    """The best of the test positions: the predicted one, unless another is plainly better.

    Args:
        suspected: by the comparison before, and moved by odometry since.
    """
    turns = dict.fromkeys((0.0, *parameters.turns_deg))  # odometry's heading, first of all
    candidates = neighbour_candidates(parameters.book_steps, tuple(turns))
    cell = grid.parameters.resolution
    reach = float(np.hypot(*perception.beams().T).max())
    reach += (float(np.abs(candidates.offsets).max()) + ROOM) * cell
    tried = [] if suspected is None else [suspected]
    tried.append(Alternative(predicted))
    for one in tried:
        middle = np.array([one.pose.x, one.pose.y])
        grid.extend_to(middle - reach, middle + reach)
    n = grid.pose_to_cells(predicted)
    p = perceived_places(perception, cell, n)  # 4
    by_odometry = expected_places(grid, p, n)
    for one in tried:
        centre = grid.pose_to_cells(one.pose)
        comparisons = _compared(grid, p, by_odometry, centre, candidates, parameters.similarity)
        i, j = chosen = _best(comparisons)  # 8
        best, votes = comparisons[i][j], comparisons[i][j].votes.plus(one.votes)
        if best.is_better:
            break
    search = BookSearch(
        _part(grid, centre, reach / cell), perception, predicted, candidates, one.pose, comparisons,
        chosen, is_believed=not best.is_better or votes.is_majority(BELIEVED_SIGMAS),
    )  # fmt: skip
    return _match(grid, centre, search, votes)


def _compared(
    grid: OccupancyGrid,
    p: PerceivedPlaces,
    by_odometry: Signs,
    centre: Floats,
    candidates: Candidates,
    similarity: Similarity,
) -> tuple[tuple[Comparison, ...], ...]:
    """Each of the test positions around a pose, compared with the odometry's pose."""
    rows = []
    for offset in candidates.offsets:  # 5
        row = []
        for turn in candidates.turns_deg:
            t = centre + np.append(offset, math.radians(turn))
            e = expected_places(grid, p, t)  # 6
            row.append(compare(p.signs, e, by_odometry, p.witnesses, similarity))  # 7
        rows.append(tuple(row))
    return tuple(rows)


def _best(comparisons: tuple[tuple[Comparison, ...], ...]) -> tuple[int, int]:
    """Position and turn of the best; the first of equals, and of all if none is better than the
    odometry's pose."""
    best, lead = (0, 0), 0.0
    for i, row in enumerate(comparisons):
        for j, one in enumerate(row):
            if one.is_better and one.lead > lead:
                best, lead = (i, j), one.lead
    return best


def _match(grid: OccupancyGrid, centre: Floats, search: BookSearch, votes: Votes) -> Match:
    position, turn = search.chosen
    move = [*search.candidates.offsets[position], math.radians(search.candidates.turns_deg[turn])]
    is_odometry = search.centre is search.predicted and not any(move)
    best = search.predicted if is_odometry else grid.pose_from_cells(centre + np.array(move))
    pose = best if search.is_believed else search.predicted
    hits = search.perception.hits / grid.parameters.resolution
    score, known, conflicts = agreement(grid, hits, grid.pose_to_cells(pose))
    return Match(
        pose, score, known, known > 0, free_space_conflicts=conflicts, search=search,
        alternative=None if search.is_believed else Alternative(best, votes=votes),
    )  # fmt: skip


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
