"""Writing a scan into the map: the beams through the log-odds grid, the field around its walls.

Grids here are bottom-up: `[v, u]` with u along x and v along y, in cells. Callers see to it that
every beam, and every wall's surroundings, lie inside the arrays.
"""

from __future__ import annotations

from math import floor, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

SEEN = 1 << 14
"""Added to the log-odds of a cell that the current scan has already touched."""
IS_SEEN = 1 << 13


WALL = 255
"""The likelihood field's value on a wall."""


@njit(cache=True)
def integrate_beams(
    log_odds: NDArray[np.int16],
    field: NDArray[np.uint8],
    laser: NDArray[np.float64],
    ends: NDArray[np.float64],
    hits: int,
    rules: tuple[int, int, int, int],
    changed: NDArray[np.int32],
) -> int:
    """Write one scan into the map: what its beams hit, then what they passed through.

    A cell is written at most once a scan, and being hit goes before being passed, so that beams
    that graze a wall do not wear it away.

    Args:
        log_odds: the map, changed in place; 0 is unknown, more than 0 occupied.
        field: its likelihood field as it is before.
        laser: (u, v) where the beams start, in cells.
        ends: shape (n, 2), where they end, in cells.
        hits: the first `hits` beams end at an obstacle, the others in the open.
        rules: (hit, miss, highest, lowest): what a hit adds, what a pass takes, the limits.
        changed: filled with the (v, u) of the cells that became occupied or ceased to be, or to
            be taken for wall by `bridges`; room for all cells that the beams may touch.

    Returns:
        How many there are in `changed`.
    """
    hit, miss, highest, lowest = rules
    columns = log_odds.shape[1]
    cells = log_odds.reshape(-1)  # one index to move along a beam, not two
    likelihood = field.reshape(-1)
    touched = np.empty(len(changed), np.int64)
    n_touched = 0
    n_changed = 0
    for beam in range(hits):
        at = floor(ends[beam, 1]) * columns + floor(ends[beam, 0])
        old = cells[at]
        if old >= IS_SEEN:
            continue
        new = min(highest, old + hit)
        if new == 0:
            new = 1  # known, so never again the sign of unknown
        if old <= 0 and new > 0:
            changed[n_changed, 0] = at // columns
            changed[n_changed, 1] = at % columns
            n_changed += 1
        cells[at] = new + SEEN
        touched[n_touched] = at
        n_touched += 1
    for beam in range(len(ends)):
        u, v = floor(laser[0]), floor(laser[1])
        at = v * columns + u
        du, dv = ends[beam, 0] - laser[0], ends[beam, 1] - laser[1]
        step_u, step_v = (1 if du > 0 else -1), (columns if dv > 0 else -columns)
        # Lengths along the beam, as shares of it, between and to the next cell boundaries.
        share_u = abs(1.0 / du) if du != 0 else np.inf
        share_v = abs(1.0 / dv) if dv != 0 else np.inf
        next_u = (u + 1 - laser[0] if du > 0 else laser[0] - u) * share_u if du != 0 else np.inf
        next_v = (v + 1 - laser[1] if dv > 0 else laser[1] - v) * share_v if dv != 0 else np.inf
        for _ in range(abs(floor(ends[beam, 0]) - u) + abs(floor(ends[beam, 1]) - v)):
            old = cells[at]
            if lowest < old < IS_SEEN:
                new = max(lowest, old - miss)
                if new == 0:
                    new = -1
                if (old > 0 and new < 0) or (old == 0 and likelihood[at] == WALL):
                    changed[n_changed, 0] = at // columns
                    changed[n_changed, 1] = at % columns
                    n_changed += 1
                cells[at] = new + SEEN
                touched[n_touched] = at
                n_touched += 1
            if next_u < next_v:
                next_u += share_u
                at += step_u
            else:
                next_v += share_v
                at += step_v
    for k in range(n_touched):
        cells[touched[k]] -= SEEN
    return n_changed


@njit(cache=True)
def update_field(
    fields: NDArray[np.uint8],
    widths: NDArray[np.int64],
    log_odds: NDArray[np.int16],
    changed: NDArray[np.int32],
    bump: NDArray[np.uint8],
) -> None:
    """Bring the likelihood field up to date around cells that changed.

    `fields[0]` holds, for every cell, the highest `bump` of the occupied cells around it;
    `fields[k][v, u]` bounds `fields[0]` over the `widths[k]` x `widths[k]` cells from (v, u) up
    and right. Where a wall vanishes the bounds stay: still bounds, only less tight, and walls
    vanish seldom.

    Args:
        fields: shape (levels, rows, columns), changed in place.
        widths: shape (levels,), the first is 1.
        log_odds: the map, already changed.
        changed: shape (n, 2), the (v, u) of the cells.
        bump: shape (2 r + 1, 2 r + 1), falling from its centre outward.
    """
    r = len(bump) // 2
    for k in range(len(changed)):
        if log_odds[changed[k, 0], changed[k, 1]] > 0:
            raise_field(fields, widths, changed[k, 0], changed[k, 1], bump)
    for k in range(len(changed)):
        v, u = changed[k, 0], changed[k, 1]
        if log_odds[v, u] <= 0:
            for y in range(v - r, v + r + 1):
                for x in range(u - r, u + r + 1):
                    fields[0, y, x] = highest_bump(log_odds, y, x, bump)


@njit(cache=True)
def highest_bump(log_odds: NDArray[np.int16], v: int, u: int, bump: NDArray[np.uint8]) -> np.uint8:
    """The field at one cell, from the occupied cells around it."""
    r = len(bump) // 2
    best = np.uint8(0)
    for dv in range(-r, r + 1):
        for du in range(-r, r + 1):
            if log_odds[v + dv, u + du] > 0:
                best = max(best, bump[dv + r, du + r])
    return best


@njit(cache=True)
def raise_field(
    fields: NDArray[np.uint8], widths: NDArray[np.int64], v: int, u: int, bump: NDArray[np.uint8]
) -> None:
    """Put the bump of one wall cell into the field and its bounds."""
    r = len(bump) // 2
    for level in range(len(widths)):
        reach = r + widths[level] - 1
        for dv in range(-reach, r + 1):
            near_v = min(max(dv, 0), dv + widths[level] - 1)
            for du in range(-reach, r + 1):
                near_u = min(max(du, 0), du + widths[level] - 1)
                value = bump[near_v + r, near_u + r]
                if fields[level, v + dv, u + du] < value:
                    fields[level, v + dv, u + du] = value


LONGEST_BRIDGE = 12.0
"""Cells between two beams' ends that may be one wall."""
STRAIGHT = 0.97
"""Cosine of the largest turn that a wall makes from one beam's end to the next."""


@njit(cache=True)
def bridge_walls(
    fields: NDArray[np.uint8],
    widths: NDArray[np.int64],
    log_odds: NDArray[np.int16],
    ends: NDArray[np.float64],
    bump: NDArray[np.uint8],
) -> None:
    """Raise the field between neighbouring ends of beams that lie on a straight wall.

    Far walls are hit here and there only. In a field of dots a scan fits best where its own dots
    fall on those of the scan before, that is where the robot has not moved. Only cells of which
    nothing is known are taken for wall, and a beam that passes there undoes it.

    Args:
        ends: shape (n, 2), the (u, v) of hits, in the order of the beams.
    """
    n = len(ends)
    for k in range(n - 1):
        du, dv = ends[k + 1, 0] - ends[k, 0], ends[k + 1, 1] - ends[k, 1]
        length = sqrt(du * du + dv * dv)
        if length < 1.5 or length > LONGEST_BRIDGE:
            continue
        if not (goes_on(ends, k - 1, du, dv, length) or goes_on(ends, k + 1, du, dv, length)):
            continue
        steps = floor(length)
        for i in range(1, steps + 1):
            share = i / (steps + 1)
            u, v = floor(ends[k, 0] + share * du), floor(ends[k, 1] + share * dv)
            if log_odds[v, u] == 0 and fields[0, v, u] < WALL:
                raise_field(fields, widths, v, u, bump)


@njit(cache=True)
def goes_on(ends: NDArray[np.float64], k: int, du: float, dv: float, length: float) -> bool:
    """Whether the way from end k to the next is straight on with (du, dv), and about as long."""
    if k < 0 or k + 1 >= len(ends):
        return False
    on_u, on_v = ends[k + 1, 0] - ends[k, 0], ends[k + 1, 1] - ends[k, 1]
    on = sqrt(on_u * on_u + on_v * on_v)
    alike = on <= 2 * length and length <= 2 * on
    return alike and on_u * du + on_v * dv >= STRAIGHT * on * length
