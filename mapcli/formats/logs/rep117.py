"""Ranges as drivers write them -> REP 117: +inf no return, -inf too close, NaN invalid."""

from __future__ import annotations

import math
from ctypes import c_float

import numpy as np
from numpy.typing import NDArray

from mapcli.model.log import BeamCounts


def single(value: float) -> float:
    """The value as a 32-bit float holds it, as LaserScan messages do: every reader rounds its
    angles and limits so, and a scan stays the same whichever format it went through."""
    return c_float(value).value  # as numpy's float32, without its warning of what becomes infinite


def sensible_limits(range_min: float, range_max: float) -> tuple[float, float]:
    """(range_min, range_max), metres; 0 and infinity where they are 0, NaN or crossed."""
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
    if not len(result):
        return result
    # NaN if there is any; argmin and argmax are several times as fast as min and max.
    nearest, farthest = result[result.argmin()], result[result.argmax()]
    if not farthest < range_max:
        far = result >= np.float32(range_max)
        np.putmask(result, far, np.inf)
        beams.no_return += int(np.count_nonzero(far))
    if not (nearest > 0 and nearest >= range_min):
        _classify_near(result, np.float32(range_min), beams)
    return result


def _classify_near(result: NDArray[np.float32], range_min: np.float32, beams: BeamCounts) -> None:
    """Sort the readings below the limit into invalid and too close, in place."""
    invalid = ~(result > 0) & (result != -np.inf)  # NaN is not more than 0 either
    close = (result < range_min) & ~invalid
    np.putmask(result, invalid, np.nan)
    np.putmask(result, close, -np.inf)
    beams.invalid += int(np.count_nonzero(invalid))
    beams.too_close += int(np.count_nonzero(close))
