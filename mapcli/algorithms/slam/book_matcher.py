"""The book's own search of T: the fifteen poses of Sect. 9.5, scored with S, the sum of products.

It is the table of `mapcli similarity-table` (`similarity.grid_table`) for the predicted pose and
its neighbours: five positions, the next cells along both axes, at three headings each.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.candidate_poses import neighbour_candidates
from mapcli.algorithms.similarity.grid_table import scan_pair_counts
from mapcli.algorithms.similarity.measures import (
    Similarity,
    higher_is_better,
    similarity_of_counts,
)
from mapcli.algorithms.similarity.perception_map import scan_outline
from mapcli.algorithms.similarity.ternary_map import TernaryMap
from mapcli.algorithms.slam.agreement import agreement
from mapcli.algorithms.slam.match import Match
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.perception import STEPS, TURNS_DEG
from mapcli.model.pose import Pose2D

FIFTEEN = neighbour_candidates(STEPS, TURNS_DEG)
"""The poses of Sect. 9.5."""


def best_of_fifteen(
    grid: OccupancyGrid,
    perception: Perception,
    predicted: Pose2D,
    similarity: Similarity = "product",
) -> Match:
    """The best of the fifteen poses; the first of equals, the predicted one first.

    Args:
        similarity: the measure by which perception and map are compared.
    """
    cell = grid.parameters.resolution
    reach = 3 * cell + float(np.hypot(*perception.beams().T).max())
    middle = np.array([predicted.x, predicted.y])
    grid.extend_to(middle - reach, middle + reach)
    start = grid.pose_to_cells(predicted)
    scores = _scores(grid, perception, start, reach / cell, similarity)
    position, turn = np.unravel_index(int(np.argmax(scores)), scores.shape)
    best = start + np.append(FIFTEEN.offsets[position], math.radians(FIFTEEN.turns_deg[turn]))
    score, known, conflicts = agreement(grid, perception.hits / cell, best)
    pose = grid.pose_from_cells(best)
    return Match(pose, score, known, found=known > 0, free_space_conflicts=conflicts)


def _scores(
    grid: OccupancyGrid,
    perception: Perception,
    start: NDArray[np.float64],
    reach: float,
    similarity: Similarity,
) -> NDArray[np.float64]:
    """The similarity of each pose, higher is better, shape (positions, turns); -inf where map and
    perception have no known cell in common.

    Args:
        start: (u, v, theta) of the predicted pose in the map, in cells and radians.
        reach: cells from there to the farthest that any pose perceives.
    """
    # Only the part of the map that can be reached is compared.
    low = np.floor(start[:2] - reach).astype(np.int64)
    high = np.ceil(start[:2] + reach).astype(np.int64)
    part = np.sign(grid.log_odds[low[1] : high[1], low[0] : high[0]]).astype(np.int8)
    counts = scan_pair_counts(
        TernaryMap(part),
        scan_outline(perception, grid.parameters.resolution, walls="ends"),
        start - np.append(low, 0),
        np.radians(FIFTEEN.turns_deg),
        FIFTEEN.offsets,
        compiled=True,
    ).swapaxes(0, 1)
    scores = higher_is_better(similarity, similarity_of_counts(similarity, counts))
    scores[counts.sum(axis=(2, 3)) == 0] = -np.inf
    return scores
