"""How similar a perception is to a map: S of Sect. 9.5, and five other measures.

Matrices hold -1 (empty), +1 (obstacle) and 0 (unknown), and only cells that both the map m and the
perception p know are compared (Sect. 9.7); the book's S(i, j) = m(i, j) p(i, j) is 0 for all
others. So four counts of cells say everything: empty or obstacle in p, times empty or obstacle in m
(`TernaryMap.pair_counts`). Where `agree` of these cells are equal and `differ` are not,

    product      S = sum of S(i, j) = agree - differ
    agreement    agree / (agree + differ)
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

Floats = NDArray[np.float64]

Similarity = Literal["product", "agreement", "jaccard", "correlation", "l1", "l2"]
SIMILARITIES: tuple[Similarity, ...] = get_args(Similarity)

LOWER_IS_BETTER: frozenset[Similarity] = frozenset({"l1", "l2"})


def higher_is_better(similarity: Similarity, scores: Floats) -> Floats:
    """The scores, turned so that the highest is the best; -inf where there is none (NaN)."""
    signed = -scores if similarity in LOWER_IS_BETTER else scores
    return np.where(np.isnan(signed), -np.inf, signed)


def similarity_of_counts(similarity: Similarity, counts: NDArray[np.int64]) -> Floats:
    """The similarity of perceptions to a map, see the module.

    Args:
        counts: shape (..., 2, 2), as of `TernaryMap.pair_counts`.

    Returns:
        shape (...), NaN where it is not defined; `product` of nothing is 0.
    """
    empty, only_m, only_p, obstacle = (
        counts[..., p, m].astype(np.float64) for p, m in ((0, 0), (0, 1), (1, 0), (1, 1))
    )
    agree, differ = empty + obstacle, only_m + only_p
    if similarity == "product":  # S of Sect. 9.5, the sum of products: 1 where they agree, else -1
        return agree - differ
    if similarity == "agreement":
        return _share(agree, agree + differ)
    if similarity == "jaccard":
        return _share(obstacle, obstacle + differ)
    if similarity == "correlation":
        in_p = (empty + only_m) * (only_p + obstacle)
        margins = in_p * (empty + only_p) * (only_m + obstacle)
        return _share(empty * obstacle - only_m * only_p, np.sqrt(margins))
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
    scale = np.sqrt((de**2).sum(axis=(1, 2)) * (dm**2).sum(axis=(1, 2)))
    return _share((de * dm).sum(axis=(1, 2)), np.where(scale < 1e-12, 0.0, scale))


def _share(part: NDArray[np.number], whole: NDArray[np.number]) -> Floats:
    return np.where(whole > 0, part / np.where(whole > 0, whole, 1), np.nan)
