"""Arrays that grow with what the robot sees, and maps that would be too large for any."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError


def grow_interval(
    first: int, last: int, start: int, length: int, min_growth: int
) -> tuple[int, int]:
    """The first and the last index along one axis of an array that is to hold `first` to `last`.

    Args:
        start, length: what the array holds until now, and goes on holding.
        min_growth: a side that must grow gets a quarter of the length more, but no less than this:
            as few copies as an array that doubles.
    """
    if length == 0:
        return first, last
    stop, spare = start + length, max(length // 4, min_growth)
    return (
        min(first, start - spare) if first < start else start,
        max(last, stop + spare) if last >= stop else stop - 1,
    )


def map_too_large(metres: NDArray[np.float64]) -> DataError:
    """The error of a map larger than any plausible log makes; `metres` is its width and height."""
    return DataError(
        f"the map would be {metres[0]:,.0f} m x {metres[1]:,.0f} m",
        expected="sane odometry and ranges, or a coarser resolution",
    )
