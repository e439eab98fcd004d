"""How fast logs are read: processor time and memory of whole commands on a long log of many beams.

    python benchmarks/reading.py [SCANS] [--runs N]

Writes an MCAP log (zstd, as `mapcli import` does) of SCANS (60,000) scans of 1,080 beams, 40 a
second, with twice as many odometry messages, of a robot that drives around in a hall with pillars;
then runs `mapcli info` and `mapcli slam-replay --search none` on it N (3) times each, and prints
the least of their times.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mapcli.algorithms.scans.ray_casting import cast, edges_of
from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS, Odometry, RangeScan, Record
from mapcli.model.world import World

BEAMS, VIEW, REACH_M, NOISE_M = 1080, math.radians(270), 30.0, 0.01
START_NS, PERIOD_NS = 1_700_000_000 * NANOSECONDS, NANOSECONDS // 40
LAP_SCANS = 4000


def box(x: float, y: float, half_x: float, half_y: float) -> list[list[float]]:
    """The corners of a rectangle around a point."""
    return [[x + u * half_x, y + v * half_y] for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


PILLARS = [box(x, y, 0.4, 0.4) for x, y in ((3, 2), (-5, -2), (-9, 5), (9, -5), (0, 0))]
HALL = edges_of(World.of([box(0, 0, 12, 8), *PILLARS]))


def pose_at(scans: float) -> Pose2D:
    """Where the robot is after so many scans: on an ellipse."""
    phase = math.tau * scans / LAP_SCANS
    x, y = 7 * math.cos(phase), 4.5 * math.sin(phase)
    return Pose2D(x, y, math.atan2(4.5 * math.cos(phase), -7 * math.sin(phase)))


def records(scans: int) -> Iterator[Record]:
    rng, step = np.random.default_rng(1), VIEW / (BEAMS - 1)
    for k in range(scans):
        stamp_ns, pose = START_NS + k * PERIOD_NS, pose_at(k)
        yield Odometry(stamp_ns, pose)
        exact = cast(HALL, pose, -VIEW / 2, step, BEAMS, REACH_M)
        ranges = np.round(exact + rng.normal(0, NOISE_M, BEAMS), 3).astype(np.float32)
        yield RangeScan(stamp_ns, -VIEW / 2, step, ranges, 0.05, REACH_M)
        yield Odometry(stamp_ns + PERIOD_NS // 2, pose_at(k + 0.5))


def cost(*command: str) -> tuple[float, float]:
    """Seconds of user and system time, and megabytes at most, of a command of mapcli."""
    process = subprocess.Popen(
        [sys.executable, "-m", "mapcli", *command], stdout=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"exit status {status}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description="How fast logs are read.")
    parser.add_argument("scans", type=int, nargs="?", default=60_000)
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = str(Path(folder) / "hall.mcap")
        with open(log, "wb") as stream, McapLogWriter(stream) as writer:
            for record in records(arguments.scans):
                writer.write(record)
        print("| command | CPU s | scans a CPU second | MB |\n|---|---|---|---|")
        for command in (
            ("info", log),
            ("slam-replay", "-q", "--search", "none", log, "-o", f"{folder}/out"),
        ):
            seconds, megabytes = min(cost(*command) for _ in range(arguments.runs))
            name = " ".join(word for word in command[:4] if word.startswith("-") or "/" not in word)
            rate = arguments.scans / seconds
            print(f"| `{name}` | {seconds:.1f} | {rate:,.0f} | {megabytes:.0f} |")


if __name__ == "__main__":
    main()
