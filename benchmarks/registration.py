"""How well a part of a map is found in another part, by how much they overlap.

    python benchmarks/registration.py

Maps fixtures/apartment.mcap with the installed command, cuts the map into a left and a right part
that overlap, moves the right one, and lets `register` find it.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mapcli import Pose2D, crop_to_box, load_map, move, register
from mapcli.algorithms.maps.transform import bake_yaw

FIXTURE = Path(__file__).parents[1] / "fixtures" / "apartment.mcap"
MIDDLE = 5.2
MOTIONS = (Pose2D(3, 4, 0.5), Pose2D(-7, 1, 2.2), Pose2D(0, 9, -1.3))


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        command = Path(sys.executable).parent / "mapcli"
        subprocess.run([command, "slam-replay", "-q", FIXTURE, "-o", scratch], check=True)
        grid = load_map(Path(scratch) / "map.yaml").grid
    print("overlap m   error m  error deg  score  seconds")
    for overlap in (6, 4, 3, 2.5, 2):
        left = crop_to_box(grid, -99, -99, MIDDLE + overlap / 2, 99)
        right = crop_to_box(grid, MIDDLE - overlap / 2, -99, 99, 99)
        for motion in MOTIONS:
            start = time.perf_counter()
            found = register(left, bake_yaw(move(right, motion.inverse())[0]))
            error = motion.between(found.motion)
            metres, degrees = math.hypot(error.x, error.y), abs(math.degrees(error.theta))
            seconds = time.perf_counter() - start
            print(f"{overlap:9} {metres:9.3f} {degrees:10.2f} {found.score:6.2f} {seconds:8.1f}")


if __name__ == "__main__":
    main()
