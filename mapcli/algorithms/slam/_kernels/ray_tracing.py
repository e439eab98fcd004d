"""Ray tracing: one scan's beams written into the log-odds grid.

Grids here are bottom-up: `[v, u]` with u along x and v along y, in cells. Callers see to it that
every beam lies inside the arrays.
"""

from __future__ import annotations

from math import cos, floor, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.likelihood_field import MAX_LIKELIHOOD
from mapcli.algorithms.slam._kernels.pose import Pose

SEEN = 1 << 14
"""Added to the log-odds of a cell that the current scan has already touched."""
IS_SEEN = 1 << 13
WHOLE = 2.0**58
"""A whole beam, so that sums of shares up to 4 fit into 64 bits."""
FAR = 1 << 62
"""Beyond every cell."""


class GridFrame(NamedTuple):
    """Where a grid lies: (x, y) of the lower left corner of cell (0, 0), and metres per cell."""

    x: float
    y: float
    cell: float


class CellBox(NamedTuple):
    """The lowest and the highest (u, v) of some cells."""

    low_u: int
    low_v: int
    high_u: int
    high_v: int


NO_CELLS = CellBox(FAR, FAR, -FAR, -FAR)


class BeamExtent(NamedTuple):
    """What beams cover.

    Attributes:
        box: the cells of their ends and of their start.
        max_touched: upper bound of the number of cells that they touch.
    """

    box: CellBox
    max_touched: int


class Beams(NamedTuple):
    """The beams of one scan on a grid.

    Attributes:
        cells: shape (n + 1, 2), (u, v) in cells: where they end, and last where they start.
        hits: the first `hits` beams end at an obstacle, the others in open space.
    """

    cells: NDArray[np.float64]
    hits: int


class MapLayers(NamedTuple):
    """A map, row by row: cell (v, u) is at index v * columns + u.

    Attributes:
        log_odds: shape (rows * columns,), int16 counts; 0 is unknown, more than 0 occupied.
        field: its likelihood field, of the same shape.
    """

    log_odds: NDArray[np.int16]
    field: NDArray[np.uint8]
    columns: int


class LogOddsRules(NamedTuple):
    """How a cell changes, in counts of log-odds: what a hit adds, what a miss takes away, and the
    limits of a cell."""

    hit: int
    miss: int
    highest: int
    lowest: int


class CellLists(NamedTuple):
    """Room for indices of cells, each of length `BeamExtent.max_touched` at least.

    Attributes:
        touched: those that the scan has written.
        changed: those around which the likelihood field changes: they became occupied or ceased
            to be, or ceased to be taken for a wall by `interpolate_gaps`.
    """

    touched: NDArray[np.int64]
    changed: NDArray[np.int64]


class ListLengths(NamedTuple):
    """How many indices there are in each of `CellLists` so far; the first of those touched were
    hit, the others passed."""

    touched: int
    changed: int
    hit: int


@kernel
def place_beams(
    beams: NDArray[np.float64],
    pose: Pose,
    frame: GridFrame,
    world: NDArray[np.float64],
    cells: NDArray[np.float64],
) -> BeamExtent:
    """Where a scan's beams end, and start, in the world and in the grid.

    Args:
        beams: shape (n + 1, 2), metres in the robot's frame: ends, and last where they start.
        world, cells: filled with the same points, metres and (u, v) in cells.
    """
    c, s = cos(pose.theta), sin(pose.theta)
    low_u = low_v = FAR
    high_u = high_v = -FAR
    for k in range(len(beams)):
        world[k, 0] = c * beams[k, 0] - s * beams[k, 1] + pose.x
        world[k, 1] = s * beams[k, 0] + c * beams[k, 1] + pose.y
        cells[k, 0] = (world[k, 0] - frame.x) / frame.cell
        cells[k, 1] = (world[k, 1] - frame.y) / frame.cell
        u, v = floor(cells[k, 0]), floor(cells[k, 1])
        low_u, low_v = min(low_u, u), min(low_v, v)
        high_u, high_v = max(high_u, u), max(high_v, v)
    n = len(beams) - 1
    u, v = floor(cells[n, 0]), floor(cells[n, 1])
    touched = n
    for k in range(n):
        touched += abs(floor(cells[k, 0]) - u) + abs(floor(cells[k, 1]) - v)
    return BeamExtent(CellBox(low_u, low_v, high_u, high_v), touched)


@kernel
def integrate_beams(
    grid: MapLayers, beams: Beams, rules: LogOddsRules, lists: CellLists
) -> ListLengths:
    """Write one scan into the map: what its beams hit, then what they passed through.

    A cell is written at most once a scan, and being hit goes before being passed, so that beams
    that graze a wall do not wear it away.

    Args:
        grid: the log-odds are changed in place, the field is as it is before.
        lists: filled.

    Returns:
        How many cells there are in `lists`.
    """
    lengths = hit_cells(grid, beams, rules, lists)
    hit = lengths.touched
    for beam in range(len(beams.cells) - 1):
        lengths = pass_cells(grid, beams, beam, rules, lists, lengths)
    for k in range(lengths.touched):
        grid.log_odds[lists.touched[k]] -= SEEN
    return ListLengths(lengths.touched, lengths.changed, hit)


@kernel
def hit_cells(grid: MapLayers, beams: Beams, rules: LogOddsRules, lists: CellLists) -> ListLengths:
    """Write the cells in which a scan's beams hit something; how long the lists are then."""
    log_odds, touched, changed = grid.log_odds, lists.touched, lists.changed
    n_touched, n_changed = 0, 0
    for beam in range(beams.hits):
        at = floor(beams.cells[beam, 1]) * grid.columns + floor(beams.cells[beam, 0])
        old = log_odds[at]
        if old >= IS_SEEN:
            continue
        new = min(rules.highest, old + rules.hit)
        if new == 0:
            new = 1  # known, so never again the sign of unknown
        if old <= 0 and new > 0:
            changed[n_changed] = at
            n_changed += 1
        log_odds[at] = new + SEEN
        touched[n_touched] = at
        n_touched += 1
    return ListLengths(n_touched, n_changed, 0)


@kernel
def pass_cells(
    grid: MapLayers,
    beams: Beams,
    beam: int,
    rules: LogOddsRules,
    lists: CellLists,
    lengths: ListLengths,
) -> ListLengths:
    """Write the cells through which one beam passed; how long the lists are then."""
    log_odds, field, columns = grid.log_odds, grid.field, grid.columns
    touched, changed = lists.touched, lists.changed
    n_touched, n_changed = lengths.touched, lengths.changed
    miss, lowest, ends, n = rules.miss, rules.lowest, beams.cells, len(beams.cells) - 1
    start_u, start_v, end_u, end_v = ends[n, 0], ends[n, 1], ends[beam, 0], ends[beam, 1]
    u, v = floor(start_u), floor(start_v)
    at = v * columns + u
    du, dv = end_u - start_u, end_v - start_v
    step_u, step_v = (1 if du > 0 else -1), (columns if dv > 0 else -columns)
    next_u = u + 1 - start_u if du > 0 else start_u - u
    next_v = v + 1 - start_v if dv > 0 else start_v - v
    # To the next cell boundary in u less that in v, and between boundaries: shares of the beam.
    # In whole numbers each step is a few instructions without a guess which way it goes.
    ahead = share_of(next_u, du) - share_of(next_v, dv)
    across_u, across_v = share_of(1.0, du), share_of(1.0, dv)
    for _ in range(abs(floor(end_u) - u) + abs(floor(end_v) - v)):
        old = log_odds[at]
        if lowest < old < IS_SEEN:
            new = max(lowest, old - miss) or -1  # known, so never again the sign of unknown
            if (old > 0 and new < 0) or (old == 0 and field[at] == MAX_LIKELIHOOD):
                changed[n_changed] = at
                n_changed += 1
            log_odds[at] = new + SEEN
            touched[n_touched] = at
            n_touched += 1
        is_u = ahead < 0
        at += step_u if is_u else step_v
        ahead += across_u if is_u else -across_v
    return ListLengths(n_touched, n_changed, 0)


@kernel
def share_of(part: float, whole: float) -> int:
    """A part of a length as a share of it, in units of 2^-58; beyond 4, which no beam gets to,
    it is 4."""
    share = part / abs(whole) if whole != 0 else 4.0
    return int(min(share, 4.0) * WHOLE)
