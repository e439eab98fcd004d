"""Normal equations of chains of poses, for tests."""

from __future__ import annotations

import numpy as np

from mapcli.algorithms.slam._kernels.pose_chain import BAND, ChainEquations


def dense(equations: ChainEquations) -> np.ndarray:
    n = len(equations.right)
    full = np.zeros((n, n))
    for i in range(n):
        for a in range(min(BAND, n - i)):
            full[i, i + a] = full[i + a, i] = equations.matrix[i, a]
    return full


def empty(poses: int) -> ChainEquations:
    return ChainEquations(np.zeros((3 * poses, BAND)), np.zeros(3 * poses))
