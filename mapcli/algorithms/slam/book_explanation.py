"""One turn of Algorithm 9.2's loop, laid out as Sect. 9.5 does: the table of the test positions,
the two matrices and their product at the best of them, and the map before and after."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.candidate_poses import CandidateFrame
from mapcli.algorithms.similarity.grid_table import pose_in_cells, table_of
from mapcli.algorithms.similarity.map_excerpt import crop_to_perception
from mapcli.algorithms.similarity.measures import Similarity, similarity_of_counts
from mapcli.algorithms.similarity.perception_map import PerceptionMap
from mapcli.algorithms.similarity.ternary_map import ternary_cells
from mapcli.algorithms.slam.book_matcher import BookSearch, map_part
from mapcli.algorithms.slam.book_perception import perception_signs
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.model.similarity import ScoredCandidate, SimilarityTable

Signs = NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class BookExplanation:
    """One turn of the loop.

    Attributes:
        search: what was compared; table: the score of every test position on all that map and
            perception have in common, as `mapcli similarity-table` gives it.
        before, after, perceived: the same cells of the map before and after line 10, and of the
            perception at the best position: shape (rows, columns), top row first, -1 empty, +1
            obstacle, 0 unknown.
        robot: row and column (fractions) and heading at the best position.
    """

    search: BookSearch
    table: SimilarityTable
    before: Signs
    after: Signs
    perceived: Signs
    robot: tuple[float, float, float]

    @property
    def best(self) -> ScoredCandidate:
        """The position that was chosen, or is suspected."""
        return self.table[self.search.chosen]


def explain(search: BookSearch, grid: OccupancyGrid, similarity: Similarity) -> BookExplanation:
    """Lay out a search, with the map as it is now that line 10 is done."""
    map_ = search.map
    m, centre = ternary_cells(map_), pose_in_cells(map_, search.centre)
    after = ternary_cells(map_part(grid, (map_.origin.x, map_.origin.y), m.shape))
    candidates, cell = search.candidates, map_.resolution
    shape = len(candidates.names), len(candidates.turns_deg)
    counts = np.zeros((*shape, 2, 2), np.int64)
    best = np.zeros_like(m)
    for i, j in np.ndindex(shape):
        move = np.append(candidates.offsets[i], math.radians(candidates.turns_deg[j]))
        p = perception_signs(search.perception, cell, centre + move, m.shape)
        both = (p != 0) & (m != 0)
        codes = 2 * (p[both] > 0) + (m[both] > 0)
        counts[i, j] = np.bincount(codes, minlength=4).reshape(2, 2)
        if (i, j) == search.chosen:
            best, robot = p, centre + move
    table = table_of(
        similarity, candidates, similarity_of_counts(similarity, counts),
        counts.sum(axis=(2, 3)), CandidateFrame(search.centre, cell),
    )  # fmt: skip
    before, perceived, (left, bottom) = crop_to_perception(m, PerceptionMap(best, 0, 0))
    cropped = after[bottom : bottom + len(before), left : left + before.shape[1]][::-1]
    place = (bottom + len(before) - robot[1] - 0.5, robot[0] - left - 0.5, robot[2])
    return BookExplanation(search, table, before, cropped, perceived, place)
