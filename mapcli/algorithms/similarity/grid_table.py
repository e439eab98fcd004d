"""Lines 5 to 8 of Algorithm 9.2, all scores kept: the similarity table of Sect. 9.5.

`scan_pair_counts` also serves `slam-replay --search book` (`slam/book_matcher.py`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.scans.perception import Perception
from mapcli.algorithms.similarity.candidate_poses import (
    CandidateFrame,
    Candidates,
    neighbour_candidates,
)
from mapcli.algorithms.similarity.measures import (
    LOWER_IS_BETTER,
    Similarity,
    similarity_of_counts,
)
from mapcli.algorithms.similarity.perception_map import (
    Box,
    PerceptionMap,
    ScanOutline,
    perception_map,
    scan_outline,
)
from mapcli.algorithms.similarity.ternary_map import (
    TernaryMap,
    ternary_cells,
)
from mapcli.errors import DataError
from mapcli.memory import require
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.perception import GridPerceptions, ScanPerception
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import SimilarityTable

CANDIDATE_BYTES = 120
"""Of a candidate pose: four counts, its score, overlap and place, and what these are made of."""

COMPILED_FROM = 1_000_000
"""Poses times beams from which on compiled loops are worth the second that loading them takes."""

Floats = NDArray[np.float64]


def perception_of_scan(scan: ScanPerception) -> Perception:
    """The ends of a scan's beams in the robot's frame, as `slam-replay` has them."""
    bearing, reach = scan.beams.T
    rays = np.column_stack([np.cos(bearing), np.sin(bearing)])
    hit = reach <= scan.range_max
    open_ = np.zeros(len(rays), bool) if scan.no_return == "ignore" else ~hit
    hits = scan.laser.apply(rays[hit] * reach[hit, None])
    far = scan.range_max if open_.any() else 0.0
    open_ends = scan.laser.apply(rays[open_] * far)
    return Perception(hits, open_ends, np.array([scan.laser.x, scan.laser.y]))


def pose_in_cells(grid: GridMap, pose: Pose2D) -> Floats:
    """(u, v, theta) of a pose in the map's frame: u in cells along its rows, v up its columns,
    theta in radians from its rows."""
    row, column = grid.fractional_cells_of_world([[pose.x, pose.y]])[0]
    return np.array([column + 0.5, grid.rows - row - 0.5, pose.theta - grid.origin.theta])


def scan_pair_counts(
    current: TernaryMap,
    scan: ScanOutline,
    start: Floats,
    turns: Floats,
    offsets: Floats,
    *,
    compiled: bool = False,
) -> NDArray[np.int64]:
    """Compare a scan with the map at every candidate pose (lines 6 and 7 of Algorithm 9.2).

    Moved by whole cells, a perception map stays the same, so one for each turn is enough.

    Args:
        current: m; scan: from `scan_outline`.
        start: (u, v, theta), the intended pose in cells.
        turns: radians; offsets: shape (k, 2), cells.
        compiled: with the loops compiled by numba.

    Returns:
        shape (turns, k, 2, 2), see `TernaryMap.pair_counts`.
    """
    poses = len(turns) * len(offsets)
    require(CANDIDATE_BYTES * poses, f"a table of {poses:,} candidate poses")
    result = np.zeros((len(turns), len(offsets), 2, 2), np.int64)
    whole = np.floor(offsets + 1e-9).astype(np.int64)
    parts, group = np.unique(np.round(offsets - whole, 9), axis=0, return_inverse=True)
    group = group.reshape(-1)  # numpy 2.0 gives it another shape
    for k, turn in enumerate(turns):
        for g, part in enumerate(parts):
            shifts = whole[group == g]
            low, high = shifts.min(axis=0), shifts.max(axis=0)
            within = (-int(high[0]), -int(high[1]), current.columns - int(low[0]),
                      current.rows - int(low[1]))  # fmt: skip
            pose = start + np.append(part, turn)
            perceived = perception_map(scan, pose, within, compiled=compiled)
            result[k, group == g] = current.pair_counts(perceived, shifts, compiled=compiled)
    return result


def scan_table(
    grid: GridMap,
    scan: ScanPerception,
    candidates: Candidates,
    similarity: Similarity,
    low: float = OCCUPIED_THRESHOLD,
) -> SimilarityTable:
    """Score a scan at every candidate.

    Raises:
        DataError: the intended pose is outside the map, the perception is absurdly large.
    """
    intended = scan.intended_pose.pose(grid)
    counts = scan_pair_counts(
        TernaryMap(ternary_cells(grid, low)),
        scan_outline(perception_of_scan(scan), grid.resolution, scan.walls),
        pose_in_cells(grid, intended),
        np.radians(candidates.turns_deg),
        candidates.offsets,
        compiled=len(candidates.offsets) * len(candidates.turns_deg) * len(scan.beams)
        > COMPILED_FROM,
    ).swapaxes(0, 1)
    values, overlap = similarity_of_counts(similarity, counts), counts.sum(axis=(2, 3))
    frame = CandidateFrame(intended, grid.resolution, grid.origin.theta)
    return table_of(similarity, candidates, values, overlap, frame)


def scan_perception_map(
    grid: GridMap, scan: ScanPerception, pose: Pose2D, within: Box | None = None
) -> PerceptionMap:
    """What a scan says about the cells of a map, and beyond, if it was taken at a world pose."""
    drawn = scan_outline(perception_of_scan(scan), grid.resolution, scan.walls)
    return perception_map(drawn, pose_in_cells(grid, pose), within)


def grid_table(
    grid: GridMap,
    perception: GridPerceptions,
    similarity: Similarity,
    low: float = OCCUPIED_THRESHOLD,
) -> SimilarityTable:
    """Score perception maps that are written out (Fig. 9.20).

    Raises:
        DataError: they do not fit into the map, or the intended pose is outside it.
    """
    current, here = TernaryMap(ternary_cells(grid, low)), np.zeros((1, 2), np.int64)
    given = perception.candidates
    rows = tuple(dict.fromkeys(c.position for c in given))
    columns = tuple(dict.fromkeys(c.turn_deg for c in given))
    values = np.full((len(rows), len(columns)), np.nan)
    overlap = np.zeros(values.shape, np.int64)
    for k, c in enumerate(given):
        place = rows.index(c.position), columns.index(c.turn_deg)
        counts = current.pair_counts(candidate_perception_map(grid, perception, k), here)[0]
        values[place], overlap[place] = similarity_of_counts(similarity, counts), counts.sum()
    usual = neighbour_candidates(perception.steps, columns)
    intended = None if perception.intended_pose is None else perception.intended_pose.pose(grid)

    def pose_at(row: int, column: int) -> Pose2D | None:
        if intended is None or rows[row] not in usual.names:
            return None
        place = usual.names.index(rows[row]), column
        frame = CandidateFrame(intended, grid.resolution, grid.origin.theta)
        return usual.pose(frame, *place)

    lower = similarity in LOWER_IS_BETTER
    missing = values.size - len(given)
    return SimilarityTable(similarity, lower, rows, columns, values, overlap, pose_at, missing)


def candidate_perception_map(
    grid: GridMap, perception: GridPerceptions, index: int
) -> PerceptionMap:
    """The perception map of one candidate, at its place in the map.

    Raises:
        DataError: it is not as large as the map, and where it lies is not told; or it lies partly
            outside.
    """
    cells = perception.candidates[index].cells
    rows, columns = cells.shape
    corner = perception.corner or (0, 0)
    size = f"{rows} rows of {columns} cells"
    if perception.corner is None and cells.shape != grid.cells.shape:
        raise DataError(
            f"candidates: {size}",
            expected=f"{grid.rows} rows of {grid.columns} as in the map, or `corner: [row, column]`"
            " to say where in the map they lie",
        )
    if min(corner) < 0 or corner[0] + rows > grid.rows or corner[1] + columns > grid.columns:
        raise DataError(
            f"corner: {size} from {corner[0]},{corner[1]} on do not lie in the map",
            expected=f"a place in its {grid.rows} rows and {grid.columns} columns",
        )
    return PerceptionMap(cells[::-1], corner[1], grid.rows - corner[0] - rows)


def table_of(
    similarity: Similarity,
    candidates: Candidates,
    values: Floats,
    overlap: NDArray[np.int64],
    frame: CandidateFrame,
) -> SimilarityTable:
    """The table of candidates around an intended pose."""
    return SimilarityTable(
        similarity, similarity in LOWER_IS_BETTER, candidates.names, candidates.turns_deg,
        values, overlap, lambda r, c: candidates.pose(frame, r, c),
    )  # fmt: skip
