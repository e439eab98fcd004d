"""How arrays grow."""

from __future__ import annotations

import pytest

from mapcli.algorithms.slam.growing_array import grow_interval


@pytest.mark.parametrize(
    ("first", "last", "start", "length", "expected"),
    [
        (-7, 12, 0, 0, (-7, 12)),  # the first time nothing to spare
        (3, 39, 0, 40, (0, 39)),  # held already
        (-1, 20, 0, 40, (-10, 39)),  # a quarter more on the one side
        (5, 40, 0, 40, (0, 50)),  # on the other
        (-90, 90, 0, 40, (-90, 90)),  # as much as is asked for
        (-1, 8, 0, 8, (-4, 12)),  # but not less than 4
    ],
)
def test_how_an_axis_grows(
    first: int, last: int, start: int, length: int, expected: tuple[int, int]
) -> None:
    assert grow_interval(first, last, start, length, 4) == expected
