"""Accuracy and speed of `mapcli slam-replay` on the real logs, as whole commands.

    python benchmarks/slam.py ../shared/datasets [NAME...]

Runs the installed command on every log (twice: the second run has the compiled kernels cached),
reads the trace it wrote, and compares:

- with the relations of Kuemmerle et al. 2009 where there are any (`NAME.relations.gz`): mean and
  standard deviation of the translation and of the rotation that are left between the measured
  relation and the one between the two poses; between scans, the pose is that of the scan before,
  composed with the odometry since;
- with a reference trajectory (`NAME.ref.txt`): root mean square distance of the positions after
  the best rigid alignment (ATE).
"""

from __future__ import annotations

import gzip
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from bisect import bisect_right
from pathlib import Path

import numpy as np

from mapcli.formats.logs import open_log
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry

SLACK_S = 2e-7
"""The relations' times are stamps of the log, which are at least a microsecond apart."""


def replay(log: Path, out: Path, options: list[str]) -> tuple[float, float, float]:
    """Run the command. Returns wall seconds, CPU seconds and the peak memory in MB."""
    command = [Path(sys.executable).parent / "mapcli", "slam-replay", log, "-q", "-o", out]
    start = time.perf_counter()
    process = subprocess.Popen([*command, *options])
    _, status, used = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status:
        raise SystemExit(f"{log}: exit status {status}")
    return wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def poses_of(out: Path) -> tuple[list[float], list[Pose2D]]:
    """Stamps in seconds and poses of a trace."""
    rows = json.loads((out / "trace.json").read_text())["poses"]
    return (
        [row["stamp_ns"] * 1e-9 for row in rows],
        [Pose2D(row["x"], row["y"], row["theta"]) for row in rows],
    )


def relation_errors(log: Path, relations: Path, out: Path) -> tuple[float, float, float, float]:
    """Mean and deviation of the translation error (m), the same of the rotation error (deg)."""
    stamps, poses = poses_of(out)
    odometry = [r for r in open_log([str(log)]).records() if isinstance(r, Odometry)]
    odometry_stamps = [record.stamp_ns * 1e-9 for record in odometry]

    def odometry_at(t: float) -> Pose2D:
        return odometry[bisect_right(odometry_stamps, t + SLACK_S) - 1].pose

    def pose_at(t: float) -> Pose2D:
        k = max(bisect_right(stamps, t + SLACK_S) - 1, 0)
        return poses[k].compose(odometry_at(stamps[k]).between(odometry_at(t)))

    with gzip.open(relations, "rt") as file:
        rows = [[float(x) for x in line.split()] for line in file if not line.startswith("#")]
    lengths, turns = [], []
    for t1, t2, x, y, _, _, _, yaw in rows:
        error = Pose2D(x, y, yaw).between(pose_at(t1).between(pose_at(t2)))
        lengths.append(math.hypot(error.x, error.y))
        turns.append(abs(math.degrees(error.theta)))
    return (
        float(np.mean(lengths)),
        float(np.std(lengths)),
        float(np.mean(turns)),
        float(np.std(turns)),
    )


def trajectory_error(reference: Path, out: Path) -> float:
    """ATE in metres after rigid alignment, over the poses that the reference knows."""
    stamps, poses = poses_of(out)
    rows = np.loadtxt(reference)
    nearest = [int(np.argmin(np.abs(rows[:, 0] - t))) for t in stamps]
    same = [k for k, n in enumerate(nearest) if abs(rows[n, 0] - stamps[k]) < 0.05]
    ours = np.array([(poses[k].x, poses[k].y) for k in same])
    theirs = rows[[nearest[k] for k in same], 1:3]
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    turn = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    moved = Pose2D(0.0, 0.0, turn).apply(a)
    return float(np.sqrt(((moved - b) ** 2).sum(axis=1).mean()))


def main() -> None:
    folder, *names = sys.argv[1:]
    options = [name for name in names if name.startswith("-")]
    names = [name for name in names if not name.startswith("-")]
    logs = sorted(Path(folder).glob("*.log.gz"))
    print(f"{'log':14} {'scans':>6} {'wall s':>7} {'CPU s':>6} {'MB':>5}  error")
    for log in logs:
        name = log.name.removesuffix(".log.gz")
        if names and name not in names:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            out = Path(scratch)
            replay(log, out, options)
            wall, cpu, memory = replay(log, out, options)
            relations = log.with_name(f"{name}.relations.gz")
            if relations.exists():
                x, dx, r, dr = relation_errors(log, relations, out)
                error = f"relations {x:.4f} +- {dx:.4f} m, {r:.2f} +- {dr:.2f} deg"
            else:
                ate = trajectory_error(log.with_name(f"{name}.ref.txt"), out)
                error = f"ATE {ate:.3f} m"
            scans = len(poses_of(out)[0])
        print(f"{name:14} {scans:6} {wall:7.2f} {cpu:6.2f} {memory:5.0f}  {error}", flush=True)


if __name__ == "__main__":
    main()
