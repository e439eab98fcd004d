"""Does a map agree with itself? Scans that see walls where other scans saw through.

Mean scores do not tell: a robot that is lost fits every scan well into the map that it makes just
then. But where it comes back to a place, beams of the two visits meet. In a right map the ends of
one visit's beams lie on walls that the other visit hit as well; in a torn one they lie where the
other saw nothing for metres. What moved, people and doors, is a small part of what a scan sees.

Each of some hundred scans, spread evenly over the way, is compared twice: with all scans taken
`APART_M` or more of way before or after (places passed twice), and with those taken nearer by
(tracking). Where a robot was carried, or tracking was lost, only few scans nearby are of the other
side; so those that begin with each are held, too, against those that end just before it. The
measure needs no parameter of the sensor, and no reference.

Agreement says nothing where it could not be otherwise: along a corridor, or where hardly anything
is seen, a scan agrees as well half a metre away. So it is asked, too, whether it would.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.slam._kernels.views import (
    Compared,
    ViewCounts,
    compare_view,
    count_view,
    least_loss,
)
from mapcli.algorithms.slam.scan_sample import CELL_M, SampledScan
from mapcli.model.pose import Pose2D

MOST_CELLS = 16_000_000
"""Of that grid; its cells grow where the map is larger."""

APART_M = 10.0
"""Metres of way between two visits."""

ONWARD_M, FEWEST_ONWARD = 4.0, 3
"""Metres of way, and scans at least, that are held together against those before."""

AWAY_CELLS, TELLING_ENDS = 5.0, 3
"""A scan fixes its place when so many of its ends, at least, agree less so far away, whichever way
it is: fewer may be people, or noise."""

TURNED = 0.1
"""Radians to either side that a scan is turned by, to see whether it fixes its heading: half a
metre in five."""

MARGIN = 2 + int(AWAY_CELLS)
"""Cells around all ends."""

LOG_CONTRADICTED, LOG_UNSEEN = math.log(0.05), math.log(0.5)
"""Log-likelihoods of an end that other visits contradict, for one in twenty is of something that
moved, and of one where none of them saw anything, beside one that they confirm: visits that have
nothing to do with each other confirm half of what they see."""

FEWEST_ENDS, LEAST_SHARE = 10, 0.3
"""Ends, and share of a scan's ends, that others must have seen for a comparison to count."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """How one scan agrees with the others.

    Attributes:
        scan: its number.
        apart: contradicted share of its ends, by scans of other visits; None where there were none.
        near: the same by scans nearby.
        fixed_apart, fixed_near: whether it would agree less with them if it were half a metre away,
            whichever way.
        onward: contradicted share of its ends and those of the next scans, by scans just before it.
        fixed_heading: whether it would agree less with scans nearby if it were turned, either way.
    """

    scan: int
    apart: float | None
    near: float | None
    fixed_apart: bool = True
    fixed_near: bool = True
    onward: float | None = None
    fixed_heading: bool = True


class Explained(NamedTuple):
    """How well other visits explain a scan.

    Attributes:
        scan: its number; ends: of its beams.
        nats: the log-likelihood of all of them.
        contradicted: those that others contradict.
    """

    scan: int
    ends: int
    nats: float
    contradicted: int


def compare_scans(
    scans: Sequence[SampledScan], poses: Sequence[Pose2D], begins: Sequence[int] = (0,)
) -> list[Agreement]:
    """How each of the scans agrees with the others in the map.

    Args:
        scans: of a `ScanSample`; poses: of every scan of the log, in the map.
        begins: numbers of the scans with which drives begin: another drive is another visit.
    """
    blind = [one.scan for one in scans if not len(one.ends)]
    found = [Agreement(scan, None, None, False, False, None, False) for scan in blind]
    placed = _Placed.of(scans, poses, begins)
    if placed is not None:
        both = zip(_views(placed), _onward(placed), strict=True)
        found += [_agreement(placed, *view, onward) for view, onward in both]
    return sorted(found, key=lambda one: one.scan)


def explain_scans(
    scans: Sequence[SampledScan], poses: Sequence[Pose2D], begins: Sequence[int] = (0,)
) -> list[Explained]:
    """How well other visits explain each of the scans, as of `compare_scans`."""
    explained = []
    placed = _Placed.of(scans, poses, begins)
    if placed is None:
        return []
    for k, apart, _ in _views(placed):
        scan, ends = placed.scans[k], placed.ends[k]
        confirmed, contradicted = compare_view(apart, ends)
        unseen = len(ends) - confirmed - contradicted
        nats = LOG_CONTRADICTED * contradicted + LOG_UNSEEN * unseen
        explained.append(Explained(scan, len(ends), nats, contradicted))
    return explained


def _views(placed: _Placed) -> Iterator[tuple[int, ViewCounts, ViewCounts]]:
    """Each scan, k of those placed, and what scans of other visits and scans nearby saw, until the
    next one."""
    apart, near = placed.nothing(), placed.nothing()
    for k in range(len(placed.ends)):
        placed.count(apart, k, 1)
    first = last = 0
    for k, way in enumerate(placed.way):
        while last < len(placed.way) and placed.way[last] <= way + APART_M:
            placed.count(near, last, 1)
            placed.count(apart, last, -1)
            last += 1
        while placed.way[first] < way - APART_M:
            placed.count(near, first, -1)
            placed.count(apart, first, 1)
            first += 1
        placed.count(near, k, -1)
        yield k, apart, near
        placed.count(near, k, 1)


def _onward(placed: _Placed) -> Iterator[float | None]:
    """`Agreement.onward` of each scan."""
    before, first = placed.nothing(), 0
    for k, way in enumerate(placed.way):
        if k:
            placed.count(before, k - 1, 1)
        while first < k and placed.way[first] < way - APART_M:
            placed.count(before, first, -1)
            first += 1
        until = max(bisect_right(placed.way, way + ONWARD_M), k + FEWEST_ONWARD)
        onward = placed.ends[k:until]
        sums = np.sum([compare_view(before, ends) for ends in onward], axis=0).tolist()
        yield _share(Compared(*sums), max(len(ends) for ends in onward))


def _agreement(
    placed: _Placed,
    k: int,
    apart: ViewCounts,
    near: ViewCounts,
    onward: float | None,
) -> Agreement:
    ends = placed.ends[k]
    turned = max(_net(compare_view(near, placed.turned(k, turn))) for turn in (TURNED, -TURNED))
    by_others, by_neighbours = compare_view(apart, ends), compare_view(near, ends)
    return Agreement(
        placed.scans[k],
        _share(by_others, len(ends)),
        _share(by_neighbours, len(ends)),
        least_loss(apart, ends, AWAY_CELLS) >= TELLING_ENDS,
        least_loss(near, ends, AWAY_CELLS) >= TELLING_ENDS,
        onward,
        _net(by_neighbours) - turned >= TELLING_ENDS,
    )


def _net(compared: Compared) -> int:
    return compared.confirmed - compared.contradicted


def _share(compared: Compared, size: int) -> float | None:
    seen = compared.confirmed + compared.contradicted
    if seen < max(FEWEST_ENDS, LEAST_SHARE * size):
        return None
    return compared.contradicted / seen


@dataclass(frozen=True, eq=False)
class _Placed:
    """Scans at their poses, in cells of the grid of comparison.

    Attributes:
        scans: their numbers; way: metres driven until each.
        ends: shape (n, 2) each, (u, v); starts: shape (2,) each.
        shape: rows and columns of the grid.
    """

    scans: list[int]
    way: list[float]
    ends: list[NDArray[np.float32]]
    starts: list[NDArray[np.float64]]
    shape: tuple[int, int]

    @classmethod
    def of(
        cls, scans: Sequence[SampledScan], poses: Sequence[Pose2D], begins: Sequence[int]
    ) -> _Placed | None:
        scans = [scan for scan in scans if len(scan.ends)]
        if not scans:
            return None
        xy = np.array([(pose.x, pose.y) for pose in poses])
        steps = np.hypot(*np.diff(xy, axis=0).T)
        steps[[begin - 1 for begin in begins[1:]]] = 2 * APART_M
        way = np.concatenate([[0.0], np.cumsum(steps)])
        ends = [poses[one.scan].apply(one.ends.astype(np.float64)) for one in scans]
        starts = [poses[one.scan].apply(one.laser[None])[0] for one in scans]
        low = np.min([np.minimum(e.min(axis=0), s) for e, s in zip(ends, starts, strict=True)], 0)
        high = np.max([np.maximum(e.max(axis=0), s) for e, s in zip(ends, starts, strict=True)], 0)
        width, height = (high - low).tolist()
        cell = max(CELL_M, math.sqrt(width * height / MOST_CELLS))
        corner = low - MARGIN * cell
        return cls(
            [one.scan for one in scans],
            [float(way[one.scan]) for one in scans],
            [((e - corner) / cell).astype(np.float32) for e in ends],
            [(s - corner) / cell for s in starts],
            (int(height / cell) + 2 * MARGIN + 1, int(width / cell) + 2 * MARGIN + 1),
        )

    def nothing(self) -> ViewCounts:
        return ViewCounts(np.zeros(self.shape, np.int16), np.zeros(self.shape, np.int16))

    def turned(self, k: int, angle: float) -> NDArray[np.float32]:
        """Ends of a scan turned about its laser, at the border of the grid, where nothing was
        seen, if they would leave it."""
        c, s = math.cos(angle), math.sin(angle)
        ends = (self.ends[k] - self.starts[k]) @ np.array([[c, s], [-s, c]]) + self.starts[k]
        rows, columns = self.shape
        return np.asarray(np.clip(ends, 1, (columns - 2, rows - 2)), np.float32)

    def count(self, counts: ViewCounts, k: int, sign: int) -> None:
        count_view(counts, self.ends[k], self.starts[k], sign)
