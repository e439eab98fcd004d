"""From what drivers write into a scan to REP 117: +inf no return, -inf too close, NaN invalid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapcli.model.log import BeamCounts


def single(value: float) -> float:
    """The value as a 32-bit float holds it, as LaserScan messages do: every reader rounds its
    angles and limits so, and a scan stays the same whichever format it went through."""
    with np.errstate(over="ignore"):
        return float(np.float32(value))


def sensible_limits(range_min: float, range_max: float) -> tuple[float, float]:
    """The sensor's limits; nonsense (0, NaN, crossed) becomes what limits nothing."""
    low = range_min if math.isfinite(range_min) and range_min > 0 else 0.0
    return low, range_max if range_max > low else math.inf


def rep117(
    ranges: NDArray[np.float32], range_min: float, range_max: float, beams: BeamCounts
) -> NDArray[np.float32]:
    """The ranges as REP 117 has them, in a new array.

    Zero and negative readings are what older drivers write for "no reading" and become NaN.
    Readings below `range_min` become -inf. Readings of `range_max` and beyond become +inf, also
    the exact maximum, which many drivers report instead of no return.

    Args:
        ranges: shape (n,), metres, as recorded.
        range_min, range_max: limits that make sense (see `sensible_limits`).
        beams: counts what became of them.

    Source: https://www.ros.org/reps/rep-0117.html
    """
    result = ranges.astype(np.float32)
    beams.total += len(result)
    far = result >= np.float32(range_max)
    no_return = int(np.count_nonzero(far))
    if no_return:
        result[far] = np.inf
        beams.no_return += no_return
    odd = ~(result >= np.float32(range_min)) | (result == 0)
    if odd.any():
        values = result[odd]
        invalid = np.isnan(values) | ((values <= 0) & (values != -np.inf))
        result[odd] = np.where(invalid, np.float32(np.nan), np.float32(-np.inf))
        beams.invalid += (count := int(np.count_nonzero(invalid)))
        beams.too_close += len(values) - count
    return result
