"""The true poses in a CARMEN log of its simulator."""

from __future__ import annotations

from operator import itemgetter

import numpy as np

from mapcli.formats.logs.carmen_messages import TRUEPOS_WORDS, Stamping, parse_pose
from mapcli.model.trajectory import Trajectory

TRUE_POSES = b"TRUEPOS"


def read_true_poses(data: bytes) -> Trajectory | None:
    """The poses on the TRUEPOS lines, in the order of their stamps; those that are malformed are
    passed over. None if there are none."""
    rows: list[tuple[int, float, float, float]] = []
    for line in data.splitlines():
        words = line.split()
        if not line.startswith(TRUE_POSES) or len(words) != TRUEPOS_WORDS:
            continue
        try:
            pose = parse_pose(words[1:4])
            rows.append((Stamping().read(words), pose.x, pose.y, pose.theta))
        except (ValueError, ArithmeticError):
            continue
    if not rows:
        return None
    rows.sort(key=itemgetter(0))
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    return Trajectory(np.array([row[1:] for row in rows]), stamps)
