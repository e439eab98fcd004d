"""The points of a scan as they are matched."""

from __future__ import annotations

import numpy as np

from mapcli.algorithms.slam.scan_points import voxel_filtered


def test_thinned_keeps_the_first_of_each_square() -> None:
    points = np.array([[0.01, 0.01], [0.02, 0.03], [0.06, 0.01], [-0.01, 0.01]])
    assert voxel_filtered(points, 0.05).tolist() == points[[0, 2, 3]].tolist()
    assert voxel_filtered(np.empty((0, 2)), 0.05).shape == (0, 2)
