"""Beams of a laser that sweeps while its robot moves: each from its own place."""

from __future__ import annotations

from math import cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

from mapcli.algorithms.compiling import kernel

Floats = NDArray[np.float64]

SLACK = 1e-6
"""Share of an edge's length by which it is longer at both ends, so that no beam slips between two
edges that share a corner."""


@kernel
def sweep(
    edges: Floats, origins: Floats, bearings: Floats, squareness: float, ranges: Floats
) -> None:
    """Shorten every beam to its first edge.

    Args:
        edges: shape (k, 2, 2), edge, end, coordinate.
        origins, bearings: shape (n, 2) and (n,), of the beams.
        squareness: cosine of the flattest angle to an edge's normal under which a beam returns.
        ranges: shape (n,), the lengths of the beams, written in place.
    """
    for beam in range(len(bearings)):
        x, y = cos(bearings[beam]), sin(bearings[beam])
        for edge in range(len(edges)):
            ax = edges[edge, 0, 0] - origins[beam, 0]
            ay = edges[edge, 0, 1] - origins[beam, 1]
            ex = edges[edge, 1, 0] - edges[edge, 0, 0]
            ey = edges[edge, 1, 1] - edges[edge, 0, 1]
            across = x * ey - y * ex
            if across == 0.0 or abs(across) < squareness * hypot(ex, ey):
                continue
            along_edge = (ax * y - ay * x) / across
            length = (ax * ey - ay * ex) / across
            if -SLACK <= along_edge <= 1 + SLACK and 0.0 < length < ranges[beam]:
                ranges[beam] = length
