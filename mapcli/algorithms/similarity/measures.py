"""How similar a perception is to a map: S of Sect. 9.5, and five others to experiment with.

Matrices hold -1 (empty), +1 (obstacle) and 0 (unknown), and only cells that both matrices know
are compared (Sect. 9.7). So four counts say everything: how many cells are obstacle or empty in
the map m, and obstacle or empty in the perception p. With `agree` and `differ` of `overlap` cells,

    product      S = sum of m(i, j) p(i, j) = agree - differ
    agreement    agree / overlap
    jaccard      cells that are obstacle in both / cells that are obstacle in one of the two
    correlation  of m and p (Pearson); none where one of them is the same everywhere
    l1           sum of |m - p| = 2 differ                     lower is better
    l2           root of the sum of (m - p)^2                  lower is better

Readings (distances, or distances and bearings) are compared element by element, r as expected
with r' as measured; an element is equal when it differs by no more than its tolerance:

    product      sum of r r'
    agreement    readings equal in every element / readings
    jaccard      the same / readings in either set (twice the readings less the equal ones)
    correlation  of r and r'
    l1, l2       of r - r'                                      lower is better
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.similarity.perception_map import PerceptionMap

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]

Similarity = Literal["product", "agreement", "jaccard", "correlation", "l1", "l2"]
SIMILARITIES: tuple[Similarity, ...] = get_args(Similarity)

LOWER_IS_BETTER: frozenset[Similarity] = frozenset({"l1", "l2"})

_AT_ONCE = 2_000_000
"""Places looked up at a time, which bounds the memory."""


def higher_is_better(similarity: Similarity, scores: Floats) -> Floats:
    """Scores of which the highest is the best; -inf where there is none."""
    signed = -scores if similarity in LOWER_IS_BETTER else scores
    return np.where(np.isnan(signed), -np.inf, signed)


class TernaryMap:
    """The current map m, made ready for summing along its rows.

    Attributes:
        rows, columns: its size.
    """

    def __init__(self, signs: NDArray[np.int8]) -> None:
        """From -1, 0 and +1, shape (rows, columns), bottom-up."""
        self.rows, self.columns = signs.shape
        # Obstacles so far in a row are counted in the upper half of a number, empty cells in the
        # lower one. The last row is for everything above and below the map.
        steps = np.zeros((self.rows + 1, self.columns + 1), np.int64)
        steps[:-1, 1:] = (signs == 1) * np.int64(1 << 32) + (signs == -1)
        self._sums = np.cumsum(steps, axis=1)

    def counts(
        self, perceived: PerceptionMap, offsets: Counts, *, compiled: bool = False
    ) -> Counts:
        """How the perception compares with the map when it is moved by whole cells.

        Args:
            perceived: the perception map.
            offsets: shape (k, 2), cells to the right and up.
            compiled: sum with a loop compiled by numba, which takes longer to load.

        Returns:
            shape (k, 2, 2): cells by what p holds (empty, obstacle) and what m holds.
        """
        if compiled:
            from mapcli.algorithms.similarity._kernels.pair_counts import count, find_runs

            found = find_runs(perceived.values)
            counted: Counts = count(self._sums, *_placed_runs(found, perceived), offsets)
            return counted
        row, start, end, obstacle = _placed_runs(runs(perceived.values), perceived)
        result = np.zeros((len(offsets), 2, 2), np.int64)
        chunk = max(_AT_ONCE // max(len(row), 1), 1)
        for first in range(0, len(offsets), chunk):
            part = slice(first, first + chunk)
            sums = self._within(row, start, end, offsets[part])
            for p, of in enumerate((~obstacle, obstacle)):
                total = sums[:, of].sum(axis=1)
                result[part, p, 0] = total & 0xFFFFFFFF
                result[part, p, 1] = total >> 32
        return result

    def _within(self, row: Counts, start: Counts, end: Counts, offsets: Counts) -> Counts:
        """What each run covers at each offset, shape (k, runs)."""
        rows = row + offsets[:, 1:]
        rows[(rows < 0) | (rows >= self.rows)] = self.rows
        rows *= self.columns + 1
        flat = self._sums.ravel()
        right = np.clip(end + offsets[:, :1], 0, self.columns)
        left = np.clip(start + offsets[:, :1], 0, self.columns)
        covered: Counts = flat[rows + right] - flat[rows + left]
        return covered


def runs(values: NDArray[np.int8]) -> Counts:
    """Row, first and end column, and content of equal known cells side by side, shape (n, 4)."""
    framed = np.pad(values, ((0, 0), (1, 1)))
    row, column = np.nonzero(framed[:, 1:] != framed[:, :-1])
    begins, ends = framed[row, column + 1] != 0, framed[row, column] != 0
    row, start = row[begins], column[begins]
    return np.column_stack([row, start, column[ends], framed[row, start + 1]]).astype(np.int64)


def _placed_runs(
    found: Counts, perceived: PerceptionMap
) -> tuple[Counts, Counts, Counts, NDArray[np.bool_]]:
    """Rows, first and end columns in the map, and which runs are obstacles."""
    row, start, end, value = found.T
    left = perceived.left
    return row + perceived.bottom, start + left, end + left, value == 1


def similarity_of_counts(similarity: Similarity, counts: Counts) -> Floats:
    """The similarity of matrices from their counts, shape (..., 2, 2); see the module.

    NaN where it is not defined; `product` of nothing is 0.
    """
    empty, missed, wrong, wall = (
        counts[..., p, m].astype(np.float64) for p, m in ((0, 0), (0, 1), (1, 0), (1, 1))
    )
    agree, differ = empty + wall, missed + wrong
    if similarity == "product":
        return agree - differ
    if similarity == "agreement":
        return _share(agree, agree + differ)
    if similarity == "jaccard":
        return _share(wall, wall + differ)
    if similarity == "correlation":
        margins = (empty + missed) * (wrong + wall) * (empty + wrong) * (missed + wall)
        return _share(empty * wall - missed * wrong, np.sqrt(margins))
    distance = 2 * differ if similarity == "l1" else 2 * np.sqrt(differ)
    return np.where(agree + differ > 0, distance, np.nan)


def similarity_of_readings(
    similarity: Similarity, expected: Floats, measured: Floats, tolerance: Floats
) -> Floats:
    """The similarity of measured readings to those expected at each of k poses.

    Args:
        expected: shape (k, n, elements); measured: shape (n, elements). NaN is not known, and
            such a reading is left out.
        tolerance: shape (elements,), up to which readings count as equal.

    Returns:
        shape (k,), NaN where it is not defined.
    """
    difference = measured - expected
    known: NDArray[np.bool_] = ~np.isnan(difference).any(axis=2)  # type: ignore[assignment]
    count = known.sum(axis=1).astype(np.float64)
    difference = np.where(known[..., None], difference, 0.0)
    if similarity in LOWER_IS_BETTER:
        sums = np.abs(difference) if similarity == "l1" else difference**2
        total = sums.sum(axis=(1, 2))
        return np.where(count > 0, total if similarity == "l1" else np.sqrt(total), np.nan)
    e = np.where(known[..., None], expected, 0.0)
    m = e + difference
    if similarity == "product":
        return np.where(count > 0, (e * m).sum(axis=(1, 2)), np.nan)
    if similarity == "correlation":
        return _correlation(e, m, known)
    equal = ((np.abs(difference) <= tolerance + 1e-9).all(axis=2) & known).sum(axis=1)
    return _share(equal, count if similarity == "agreement" else 2 * count - equal)


def _correlation(e: Floats, m: Floats, known: NDArray[np.bool_]) -> Floats:
    count = np.maximum(known.sum(axis=1) * e.shape[2], 1)[:, None, None]
    weight = known[..., None]
    de = (e - e.sum(axis=(1, 2), keepdims=True) / count) * weight
    dm = (m - m.sum(axis=(1, 2), keepdims=True) / count) * weight
    spread = np.sqrt((de**2).sum(axis=(1, 2)) * (dm**2).sum(axis=(1, 2)))
    return _share((de * dm).sum(axis=(1, 2)), np.where(spread < 1e-12, 0.0, spread))


def _share(part: NDArray[np.number], whole: NDArray[np.number]) -> Floats:
    return np.where(whole > 0, part / np.where(whole > 0, whole, 1), np.nan)
