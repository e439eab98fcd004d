"""Speed of the similarity table: a scan of 360 beams at 10,000 poses of a map of 2000 x 2000.

    python benchmarks/similarity.py

The map is a hall of 96 m with pillars at 5 cm a cell; the scan is what a laser of 30 m sees in
it, its perception map some 600,000 known cells. The window is 21 x 21 positions, 5 cm apart, with
23 headings. Times are wall and CPU seconds of five runs after a first one, which compiles.
"""

from __future__ import annotations

import math
import time

import numpy as np

from mapcli import GridMap, Pose2D
from mapcli.algorithms.scans.ray_casting import edges_of
from mapcli.algorithms.similarity.candidate_poses import CandidateWindow
from mapcli.algorithms.similarity.expected_perception import RangeSensor, expected_ranges
from mapcli.algorithms.similarity.grid_table import scan_table
from mapcli.algorithms.similarity.measures import SIMILARITIES
from mapcli.model.perception import IntendedPose, ScanPerception


def hall() -> GridMap:
    """Walls around, pillars every 7 m, a wall with doors across; unknown outside."""
    cells = np.full((2000, 2000), np.nan, np.float32)
    cells[40:-40, 40:-40] = 1
    cells[42:-42, 42:-42] = 0
    for row in range(150, 1900, 140):
        for column in range(150, 1900, 140):
            cells[row : row + 12, column : column + 12] = 1
    cells[700, 42:-42] = np.where(np.arange(1916) % 300 < 40, 0, 1)
    return GridMap(cells, 0.05)


def main() -> None:
    grid, pose = hall(), Pose2D(43.21, 47.65, 0.3)
    beams = expected_ranges(edges_of(grid), pose, RangeSensor(360, 360.0, 30.0))
    scan = ScanPerception(IntendedPose(pose.theta, (pose.x, pose.y)), beams, 30.0)
    candidates = CandidateWindow(0.5, 5.5, None, 0.5).candidates(grid.resolution)
    poses = len(candidates.names) * len(candidates.turns_deg)
    print(f"{poses:,} poses, 360 beams, 2000 x 2000 cells")
    table = scan_table(grid, scan, candidates, "product")
    print(f"{int(table.overlap.max()):,} cells compared at the most")
    for similarity in SIMILARITIES:
        wall, cpu = [], []
        for _ in range(5):
            start, used = time.perf_counter(), time.process_time()
            table = scan_table(grid, scan, candidates, similarity)
            wall.append(time.perf_counter() - start)
            cpu.append(time.process_time() - used)
        best = table.best()
        assert best is not None
        assert best.pose is not None
        off = best.pose.distance(pose), math.degrees(best.pose.theta - pose.theta)
        print(
            f"{similarity:12} wall {min(wall):.2f} to {max(wall):.2f} s, CPU {min(cpu):.2f} to "
            f"{max(cpu):.2f} s, best {off[0]:.3f} m, {abs(off[1]):.2f} deg off"
        )


if __name__ == "__main__":
    main()
