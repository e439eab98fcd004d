"""Writing a scan into the map: its beams through the log-odds grid.

Grids here are bottom-up: `[v, u]` with u along x and v along y, in cells. Callers see to it that
every beam lies inside the arrays.
"""

from __future__ import annotations

from math import cos, floor, sin

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel
from mapcli.algorithms.slam._kernels.likelihood_field import MAX_LIKELIHOOD

SEEN = 1 << 14
"""Added to the log-odds of a cell that the current scan has already touched."""
IS_SEEN = 1 << 13
WHOLE = 2.0**58
"""A whole beam, so that sums of shares up to 4 fit into 64 bits."""
FAR = 1 << 62
"""Beyond every cell."""


@kernel
def place_beams(
    beams: NDArray[np.float64],
    pose: tuple[float, float, float],
    frame: tuple[float, float, float],
    world: NDArray[np.float64],
    cells: NDArray[np.float64],
    box: NDArray[np.int64],
) -> int:
    """Where a scan's beams end, and start, in the world and in the map.

    Args:
        beams: shape (n + 1, 2), metres in the robot's frame: ends, and last where they start.
        pose: (x, y, theta) of the robot.
        frame: (x, y of the corner of cell 0, 0; metres a cell).
        world, cells: filled with the same points, metres and (u, v) in cells.
        box: filled with (lowest u, v, highest u, v) of cells.

    Returns:
        How many cells the beams touch at most.
    """
    x, y, theta = pose
    base_x, base_y, cell = frame
    c, s = cos(theta), sin(theta)
    box[0] = box[1] = FAR
    box[2] = box[3] = -FAR
    for k in range(len(beams)):
        world[k, 0] = c * beams[k, 0] - s * beams[k, 1] + x
        world[k, 1] = s * beams[k, 0] + c * beams[k, 1] + y
        cells[k, 0] = (world[k, 0] - base_x) / cell
        cells[k, 1] = (world[k, 1] - base_y) / cell
        u, v = floor(cells[k, 0]), floor(cells[k, 1])
        box[0], box[1] = min(box[0], u), min(box[1], v)
        box[2], box[3] = max(box[2], u), max(box[3], v)
    n = len(beams) - 1
    u, v = floor(cells[n, 0]), floor(cells[n, 1])
    touched = n
    for k in range(n):
        touched += abs(floor(cells[k, 0]) - u) + abs(floor(cells[k, 1]) - v)
    return touched


@kernel
def integrate_beams(
    log_odds: NDArray[np.int16],
    field: NDArray[np.uint8],
    columns: int,
    beams: NDArray[np.float64],
    hits: int,
    rules: tuple[int, int, int, int],
    touched: NDArray[np.int64],
    changed: NDArray[np.int64],
) -> int:
    """Write one scan into the map: what its beams hit, then what they passed through.

    A cell is written at most once a scan, and being hit goes before being passed, so that beams
    that graze a wall do not wear it away.

    Args:
        log_odds: the map, flattened, changed in place; 0 is unknown, more than 0 occupied.
        field: its likelihood field as it is before, flattened; columns: of both.
        beams: shape (n + 1, 2), (u, v) in cells: where they end, and last where they start.
        hits: the first `hits` beams end at an obstacle, the others in the open.
        rules: (hit, miss, highest, lowest): what a hit adds, what a pass takes, the limits.
        touched: room for all cells that the beams may touch.
        changed: as much room; filled with the cells (row times columns plus column) that became
            occupied or ceased to be, or to be taken for wall by `interpolate_gaps`.

    Returns:
        How many there are in `changed`.
    """
    counts = hit_cells(log_odds, columns, beams, hits, rules, touched, changed)
    for beam in range(len(beams) - 1):
        counts = pass_cells(log_odds, field, columns, beams, beam, rules, touched, changed, counts)
    for k in range(counts[0]):
        log_odds[touched[k]] -= SEEN
    return counts[1]


@kernel
def hit_cells(
    log_odds: NDArray[np.int16],
    columns: int,
    beams: NDArray[np.float64],
    hits: int,
    rules: tuple[int, int, int, int],
    touched: NDArray[np.int64],
    changed: NDArray[np.int64],
) -> tuple[int, int]:
    """Write what a scan's beams hit, see `integrate_beams`; how many cells are in `touched` and
    in `changed`."""
    hit, _, highest, _ = rules
    n_touched, n_changed = 0, 0
    for beam in range(hits):
        at = floor(beams[beam, 1]) * columns + floor(beams[beam, 0])
        old = log_odds[at]
        if old >= IS_SEEN:
            continue
        new = min(highest, old + hit)
        if new == 0:
            new = 1  # known, so never again the sign of unknown
        if old <= 0 and new > 0:
            changed[n_changed] = at
            n_changed += 1
        log_odds[at] = new + SEEN
        touched[n_touched] = at
        n_touched += 1
    return n_touched, n_changed


@kernel
def pass_cells(
    log_odds: NDArray[np.int16],
    field: NDArray[np.uint8],
    columns: int,
    beams: NDArray[np.float64],
    beam: int,
    rules: tuple[int, int, int, int],
    touched: NDArray[np.int64],
    changed: NDArray[np.int64],
    counts: tuple[int, int],
) -> tuple[int, int]:
    """Write what one beam passed through, see `integrate_beams`; the counts after it."""
    _, miss, _, lowest = rules
    n_touched, n_changed = counts
    n = len(beams) - 1
    start_u, start_v, end_u, end_v = beams[n, 0], beams[n, 1], beams[beam, 0], beams[beam, 1]
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
    return n_touched, n_changed


@kernel
def share_of(part: float, whole: float) -> int:
    """A part of a length as a share of it, in units of 2^-58; beyond 4, which no beam gets to,
    it is 4."""
    share = part / abs(whole) if whole != 0 else 4.0
    return int(min(share, 4.0) * WHOLE)
