"""Logs that do not tell where the laser sits, and what is found out about it.

    python benchmarks/unknown_mounts.py [--only KIND] [--worlds N] [--draw N] [--log FILE]...

The worlds of `worlds.py` with lasers in random places, two at the robot's centre for one elsewhere;
then the mount is left out. Printed are what was true and what is told, if anything, with its errors
in standard deviations. With `--log`, logs are read as if they told no mount.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from worlds import KINDS, simulation_of

from mapcli import Pose2D, open_log
from mapcli.algorithms.evaluation.log_check import check_log
from mapcli.algorithms.slam.laser_calibration import LaserCalibration
from mapcli.model.log import LogOptions
from mapcli.model.scan import Mount, RangeScan, Record


def mount_of(rng: np.random.Generator) -> Mount:
    """Mostly ahead or behind, some elsewhere, turned or upside down."""
    x, y = rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.2) * (rng.random() < 0.5)
    yaw = rng.choice([0, 0, 0, math.pi, math.pi / 2]) + math.radians(rng.choice([0, 0, 5, -8]))
    return Mount(Pose2D(x, y, yaw), bool(rng.random() < 0.2))


def without_mounts(records: Iterable[Record], flipped: bool) -> Iterator[Record]:
    """The simulator's lasers all stand upright; bearings run the other way of one that hangs."""
    side = -1 if flipped else 1
    for record in records:
        if isinstance(record, RangeScan):
            first, step = side * record.angle_min, side * record.angle_increment
            yield replace(record, mount=Mount(), angle_min=first, angle_increment=step)
        else:
            yield record


def told(records: Iterable[Record], true: Mount | None) -> str:
    flipped = true is not None and true.flipped
    check = check_log(without_mounts(records, flipped), LaserCalibration(lambda: True))
    found = check.laser
    if found is None:
        return "nothing"
    pose, errors = found.mount.pose, found.errors
    text = f"{pose.x:.3f}, {pose.y:.3f}, {math.degrees(pose.theta):.1f} deg"
    text += ", flipped" if found.mount.flipped else ""
    text += f" (+- {errors[0]:.3f}, {errors[1]:.3f}, {math.degrees(errors[2]):.1f})"
    if true is not None:
        off = np.array(found.found) - (true.pose.x, true.pose.y, true.pose.theta)
        off[2] = (off[2] + math.pi) % math.tau - math.pi
        text += f" | {np.abs(off / errors).max():.1f}"
        text += "" if found.mount.flipped == true.flipped else " MIRRORED"
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", metavar="KIND", default="", help="kinds whose names contain this")
    parser.add_argument("--worlds", type=int, default=3, help="of each kind")
    parser.add_argument("--draw", type=int, default=0, help="of the random numbers")
    parser.add_argument("--log", action="append", default=[], help="a log instead")
    given = parser.parse_args()
    for log in given.log:
        options = LogOptions(laser_pose=Mount(), one_recording=True)
        print(f"| {log.rpartition('/')[2]} | | {told(open_log(log, options).records(), None)} |")
    if given.log:
        return
    print("| world | true | told (+- errors) | off by so many of them |\n|---|---|---|---|")
    for k, kind in enumerate(KINDS):
        if given.only not in kind or kind == "two lasers":
            continue
        for world in range(given.worlds):
            simulation = simulation_of(kind, world, 0, given.draw)
            rng = np.random.default_rng([k, world, given.draw, 1])
            mount = Mount() if world % 3 < 2 else mount_of(rng)
            simulation = replace(simulation, laser=replace(simulation.laser, mount=mount))
            pose = mount.pose
            true = f"{pose.x:.3f}, {pose.y:.3f}, {math.degrees(pose.theta):.1f} deg"
            true += ", flipped" if mount.flipped else ""
            text = told(simulation.records(), mount)
            print(f"| {kind} {world}, {simulation.duration:.0f} s | {true} | {text} |", flush=True)


if __name__ == "__main__":
    main()
