"""Straight pieces of a trace."""

from __future__ import annotations

import numpy as np

from mapcli.algorithms.maps.wall_segments import straight_segments


def test_a_corner_parts_two_pieces() -> None:
    ahead = [(x, 0.0, 0.0) for x in np.arange(0.0, 5.01, 0.5)]
    left = [(5.0, y, 1.57) for y in np.arange(0.5, 3.01, 0.5)]
    pieces = straight_segments(np.array([*ahead, *left]), 0.1)
    assert [(piece.first, piece.last) for piece in pieces] == [(0, 10), (10, 16)]


def test_poses_too_near_each_other_for_their_squares() -> None:
    # Warnings are errors in tests: simplifying these divides 0 by 0.
    poses = np.array([(0, 0, 0), (1e-200, 0, 0), (5e-201, 1e-200, 0)], float)
    pieces = straight_segments(poses, 0.1)
    assert (pieces[0].first, pieces[-1].last) == (0, 2)
