"""Pieces of the trajectory: between two of them tracking was lost, so that one hangs on the other
by odometry alone (`lost_track`), until a loop joins them.

Within a piece the robot was tracked, and windows that follow the graph's uncertainty find a loop.
From piece to piece nobody knows the way: there the search is as wide as the uncertainty
(`wide_search`), and loops are consistent only with loops between the same two pieces.
"""

from __future__ import annotations

from itertools import accumulate

from mapcli.algorithms.slam.keyframes import Keyframe
from mapcli.algorithms.slam.submaps import Submap


def merged(groups: list[int], one: int, other: int) -> list[int]:
    """The groups of all members when those of two of them become one, the earlier of both."""
    first, second = sorted((groups[one], groups[other]))
    return [first if group == second else group for group in groups]


class Pieces:
    """The pieces of a trajectory's submaps, and which have been joined (stateful: `join`).

    Attributes:
        of: the piece of each submap; pieces are numbered in time order.
    """

    def __init__(self, keyframes: list[Keyframe], submaps: list[Submap]) -> None:
        self.of = list(accumulate(int(keyframes[one.first].is_first) for one in submaps))
        self._group = list(range(1 + max(self.of, default=0)))

    def group(self, submap: int) -> int:
        """The earliest of the pieces that are joined with a submap's."""
        return self._group[self.of[submap]]

    def are_joined(self, one: int, other: int) -> bool:
        """Whether tracking and loops lead from a submap to another one."""
        return self.group(one) == self.group(other)

    def join(self, one: int, other: int) -> None:
        """A loop leads from a submap to another one."""
        self._group = merged(self._group, self.of[one], self.of[other])

    def others(self, submap: int) -> list[int]:
        """Groups that begin before a submap's piece, and that it is not joined with."""
        return sorted(set(self._group[: self.of[submap]]) - {self.group(submap)})

    def members(self, group: int, until: int) -> list[int]:
        """Submaps of a group, of those before `until`."""
        return [k for k in range(until) if self.group(k) == group]

    def with_all_that_hangs_on(self, submap: int) -> list[int]:
        """Submaps of a group, and of the pieces after one of its own that hang on it: those that
        are joined with none before."""
        group = before = self.group(submap)
        moved = []
        for k in range(len(self.of)):
            is_alone = self.group(k) == self.of[k] > group
            if self.group(k) == group or (is_alone and before == group):
                moved.append(k)
                before = group
            else:
                before = self.group(k)
        return moved

    def unjoined(self) -> list[int]:
        """The first submaps of the pieces that are not joined with the first piece."""
        begins = [k for k in range(1, len(self.of)) if self.of[k] != self.of[k - 1]]
        return [k for k in begins if self.group(k)]
