"""Straight pieces of a trace."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mapcli.algorithms.maps.rectify_trace import rectify_trace
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


def arc(start: np.ndarray, length: float, bend_deg: float) -> np.ndarray:
    """Poses a centimetre apart, of a drive in which the heading turns evenly."""
    s = np.linspace(0.01, length, round(length / 0.01))
    headings = start[2] + math.radians(bend_deg) * (s / length)
    middle = (headings + np.concatenate([[start[2]], headings[:-1]])) / 2
    steps = np.cumsum(0.01 * np.column_stack([np.cos(middle), np.sin(middle)]), axis=0)
    return np.column_stack([start[:2] + steps, headings])


@pytest.mark.parametrize("bends", [(8.0, 13.8), (-3.0, 5.0), (0.0, -12.0), (25.0, -25.0)])
def test_the_bend_of_a_wall_is_what_its_heading_turns_by(bends: tuple[float, float]) -> None:
    first = arc(np.zeros(3), 4.0, bends[0])
    corner = first[-1] + [0, 0, math.pi / 2]
    second = arc(corner, 3.0, bends[1])
    found = rectify_trace(np.vstack([np.zeros(3), first, second])).walls
    assert [math.degrees(wall.drift) for wall in found] == pytest.approx(bends, abs=0.4, rel=0.02)
