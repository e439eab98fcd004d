"""Large worlds with wheels that are badly wrong, where the simulator knows the truth.

    python benchmarks/large_worlds.py [NAME...]

Makes each world, drives through it (`mapcli simulate`), replays the log with and without loop
closing, and prints how far the poses are from the truth (`mapcli evaluate`, ATE in metres, root
mean square and worst). The wheels count 3 % too many metres and 5 % too few turns, with noise of
8 % of every metre and 0.08 rad of every radian, unless the world says otherwise.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from mapcli import MotionLimits, plan_drive
from mapcli.model.waypoint import Waypoint

MAPCLI = Path(sys.executable).parent / "mapcli"

Point = tuple[float, float]
Polygon = list[Point]

BAD_WHEELS = [
    "--odom-noise", "0.08,0.02,0.08,0.02", "--odom-scale", "1.03", "--odom-turn-scale", "0.95",
]  # fmt: skip
SLOW_LASER = ["--scan-rate", "4", "--beams", "180", "--speed", "1"]


@dataclass
class World:
    """Polygons, waypoints and options of the simulator; waypoints that are reached in reverse,
    with wheels that count backwards then, by their index."""

    polygons: list[Polygon] = field(default_factory=list)
    path: list[Point] = field(default_factory=list)
    options: list[str] = field(default_factory=list)
    back: set[int] = field(default_factory=set)


def box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def wall(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    """Ten centimetres thick, along an axis."""
    low, high = (min(x0, x1), min(y0, y1)), (max(x0, x1), max(y0, y1))
    return box(low[0] - 0.05, low[1] - 0.05, high[0] + 0.05, high[1] + 0.05)


def with_niches(
    start: Point, end: Point, outward: Point, gaps: tuple[float, float], rng: random.Random
) -> list[Polygon]:
    """A wall with door niches of a metre, so far apart, 12 cm deep."""
    length = abs(end[0] - start[0]) + abs(end[1] - start[1])
    along = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    polygons, at = [], 0.0
    while at < length:
        until = min(length, at + rng.uniform(*gaps))
        a, b = ((start[0] + along[0] * s, start[1] + along[1] * s) for s in (at, until))
        polygons.append(wall(*a, *b))
        at = until + 1.0
    dx, dy = outward[0] * 0.22, outward[1] * 0.22
    return [*polygons, wall(start[0] + dx, start[1] + dy, end[0] + dx, end[1] + dy)]


def ring(
    width: float, height: float, gaps: tuple[float, float], laps: int, options: list[str], seed: int
) -> World:
    """A corridor of 2.4 m around a block, driven round and round."""
    rng, w, h, c = random.Random(seed), width, height, 2.4
    sides = [
        ((0, 0), (w, 0), (0, -1)), ((w, 0), (w, h), (1, 0)), ((0, h), (w, h), (0, 1)),
        ((0, 0), (0, h), (-1, 0)), ((c, c), (w - c, c), (0, 1)),
        ((w - c, c), (w - c, h - c), (-1, 0)), ((c, h - c), (w - c, h - c), (0, -1)),
        ((c, c), (c, h - c), (1, 0)),
    ]  # fmt: skip
    polygons = [p for a, b, out in sides for p in with_niches(a, b, out, gaps, rng)]
    m = c / 2
    lap = [(m, m), (w - m, m), (w - m, h - m), (m, h - m)]
    return World(polygons, [*lap * laps, (m, m), (w / 2, m)], [*SLOW_LASER, *options])


def rooms() -> World:
    """Twenty-four rooms that are all alike on both sides of a corridor of 60 m; twelve visited."""
    polygons = [wall(0, 0, 0, 2), wall(60, 0, 60, 2)]
    for x in range(0, 60, 5):
        for y, out in ((0, -1), (2, 1)):
            polygons += [wall(x, y, x + 2, y), wall(x + 3, y, x + 5, y)]
            polygons += [wall(x, y, x, y + 4 * out), wall(x, y + 4 * out, x + 5, y + 4 * out)]
            polygons += [wall(x + 5, y, x + 5, y + 4 * out)]
            low, high = sorted((y + 3 * out, y + 3.8 * out))
            polygons.append(box(x + 0.1, low, x + 1.5, high))
    visits = [(x, 3.5) for x in (0, 2, 3, 6, 7, 9, 11)] + [(x, -1.5) for x in (10, 8, 5, 4, 1)]
    path: list[Point] = [(1, 1)]
    for room, y in visits:
        path += [(5 * room + 2.5, 1), (5 * room + 2.5, y), (5 * room + 2.5, 1)]
        path += [(59, 1)] if room == 11 else []
    options = [
        *SLOW_LASER,
        *BAD_WHEELS,
        "--fov-deg",
        "180",
        "--range-max",
        "8",
        "--corner-cut",
        "0",
    ]
    return World(polygons, [*path, (1, 1), (30, 1)], options)


def campus() -> World:
    """Buildings and posts on 180 m by 120 m, 1.2 km of ways, a laser that sees 30 m."""
    rng, polygons = random.Random(5), []
    for i in range(6):
        for j in range(4):
            x, y, w, h = 30 * i, 30 * j, rng.uniform(8, 16), rng.uniform(8, 16)
            if rng.random() < 0.85:
                low = x + 7 + rng.uniform(0, 3), y + 7 + rng.uniform(0, 3)
                polygons.append(box(*low, x + 7 + w, y + 7 + h))
            for _ in range(2):
                px, py = x + rng.uniform(3, 6), y + rng.uniform(8, 26)
                polygons.append(box(px, py, px + 0.4, py + 0.4))
    path = [(0, 0), (150, 0), (150, 30), (0, 30), (0, 60), (150, 60), (150, 90), (0, 90), (0, 0),
            (60, 0), (60, 90), (120, 90), (120, 0), (30, 0)]  # fmt: skip
    fast = ["--scan-rate", "3", "--speed", "1.5", "--beams", "360", "--range-max", "30"]
    return World(polygons, path, [*fast, *BAD_WHEELS])


def corridor() -> World:
    """200 m of corridor with a niche every 8 to 25 m, there and back and there; 8 m of sight."""
    rng = random.Random(7)
    polygons = with_niches((0, 0), (200, 0), (0, -1), (8, 25), rng)
    polygons += with_niches((0, 2), (200, 2), (0, 1), (8, 25), rng)
    polygons += [wall(0, 0, 0, 2), wall(200, 0, 200, 2)]
    wheels = ["--odom-noise", "0.05,0.02,0.03,0.01", "--odom-scale", "1.02"]
    options = [*SLOW_LASER, *wheels, "--fov-deg", "180", "--range-max", "8"]
    return World(polygons, [(1, 1), (199, 1), (2, 1), (100, 1)], options)


def hall() -> World:
    """60 m by 40 m, of which the laser sees 10 m: nothing at all for half a minute at a time."""
    polygons = [wall(0, 0, 60, 0), wall(60, 0, 60, 40), wall(0, 40, 60, 40), wall(0, 0, 0, 40)]
    polygons += [box(x, y, x + 0.5, y + 0.5) for x, y in ((15, 12), (40, 25), (22, 33), (48, 9))]
    path = [(5, 5), (55, 5), (55, 20), (5, 20), (5, 35), (55, 35), (30, 20), (5, 5), (30, 5)]
    return World(polygons, path, [*SLOW_LASER, *BAD_WHEELS, "--range-max", "10"])


def backing_up() -> World:
    """A ring of 140 m; four times the robot backs up for 6 to 8 m."""
    world = ring(45, 25, (2, 8), 1, [*BAD_WHEELS, "--fov-deg", "180", "--range-max", "12"], 42)
    c, w, h = 1.2, 43.8, 23.8
    world.path = [
        (c, c), (20, c), (14, c), (w, c), (w, 15), (w, 8), (w, h), (20, h), (26, h), (c, h), (c, c),
        (30, c), (22, c), (w, c), (w, h), (c, h), (c, c), (20, c),
    ]  # fmt: skip
    world.back = {2, 5, 8, 12}
    return world


def dead_ends() -> World:
    """Buildings and posts; the robot backs out of three dead ends for 8, 13 and 20 m."""
    rng, polygons = random.Random(31), []
    for i in range(5):
        for j in range(3):
            x, y = 35 * i, 35 * j
            if rng.random() < 0.85:
                w, h = rng.uniform(8, 18), rng.uniform(8, 18)
                low = x + 8 + rng.uniform(0, 4), y + 8 + rng.uniform(0, 4)
                polygons.append(box(*low, low[0] + w, low[1] + h))
            for _ in range(3):
                px, py = x + rng.uniform(3, 7), y + rng.uniform(8, 30)
                polygons.append(box(px, py, px + 0.4, py + 0.4))
    path = [(0, 0), (60, 0), (70, 0), (62, 0), (70, 0), (105, 0), (105, 35), (105, 50), (105, 37),
            (105, 35), (70, 35), (35, 35), (0, 35), (0, 60), (0, 40), (0, 35), (0, 0), (35, 0),
            (35, 35), (35, 70), (105, 70), (105, 35), (70, 35)]  # fmt: skip
    options = ["--scan-rate", "4", "--speed", "1.2", "--beams", "360", "--range-max", "20"]
    return World(polygons, path, [*options, *BAD_WHEELS], {3, 8, 14})


def faults(*kinds: str) -> list[str]:
    return [word for kind in kinds for word in ("--odom-fault", kind)]


WORLDS: dict[str, Callable[[], World]] = {
    "ring of 200 m, twice": lambda: ring(
        60, 40, (4, 12), 2, [*BAD_WHEELS, "--fov-deg", "180", "--range-max", "20"], 1
    ),
    "ring of 320 m, once, 8 m of sight": lambda: ring(
        100, 60, (6, 20), 1, [*BAD_WHEELS, "--fov-deg", "180", "--range-max", "8"], 2
    ),
    "ring of 140 m, wheels backwards for 6 s and 5 s": lambda: ring(
        40, 30, (3, 9), 2,
        [*BAD_WHEELS, "--fov-deg", "270", "--range-max", "10",
         *faults("reverse-sign@30-36", "reverse-sign@120-125")], 11,
    ),
    "ring of 160 m, 30 m of sight, wheels backwards for 4 s, 3 s and 6 s": lambda: ring(
        50, 30, (2, 8), 2,
        [*BAD_WHEELS, "--fov-deg", "180", "--range-max", "30",
         *faults("reverse-sign@20-24", "reverse-sign@100-103", "reverse-sign@200-206")], 21,
    ),
    "ring of 140 m, wheels count nothing for 5 s and 3 s": lambda: ring(
        45, 25, (2, 8), 2,
        [*BAD_WHEELS, "--fov-deg", "180", "--range-max", "15",
         *faults("freeze@20-25", "freeze@150-153")], 24,
    ),
    "ring of 140 m, wheels slip for 5 s and 4 s": lambda: ring(
        45, 25, (2, 8), 2,
        [*BAD_WHEELS, "--fov-deg", "180", "--range-max", "15",
         *faults("slip@20-25", "slip@150-154")], 23,
    ),
    "ring of 140 m, wheels backwards while backing up": backing_up,
    "dead ends on a campus, wheels backwards while backing up": dead_ends,
    "rooms that are all alike": rooms,
    "campus of 1.2 km": campus,
    "corridor of 200 m, there and back": corridor,
    "hall of 60 m by 40 m": hall,
}  # fmt: skip


def backwards(ways: list[Waypoint], options: list[str]) -> list[str]:
    """Wheels that count backwards while the robot does."""
    speed = float(options[options.index("--speed") + 1])
    drive, kinds, begin = plan_drive(ways, MotionLimits(speed=speed)), [], 0.0
    for segment, profile in zip(drive.segments, drive.profiles, strict=True):
        end = begin + profile.duration
        if segment.distance < 0:
            kinds.append(f"reverse-sign@{begin:.2f}-{end:.2f}")
        begin = end
    return faults(*kinds)


def simulate(world: World, folder: Path) -> Path:
    """Drive through a world; its log."""
    log, text = folder / "log.mcap", folder / "world.yaml"
    text.write_text(
        "polygons:\n" + "".join(f"  - {[list(p) for p in q]}\n" for q in world.polygons)
    )
    path = folder / "path.txt"
    ways = [Waypoint(x, y, back=k in world.back) for k, (x, y) in enumerate(world.path)]
    path.write_text("".join(f"{w.x} {w.y}{' back' if w.back else ''}\n" for w in ways))
    options = [*world.options, *backwards(ways, world.options)]
    command = [MAPCLI, "simulate", "-q", text, "--path", path, *options, log]
    subprocess.run(command, check=True)
    return log


def errors(log: Path, *options: str) -> tuple[float, float, int]:
    """ATE of a replay: root mean square and worst, metres; and the loops closed."""
    trace, report = log.with_name("trace.json"), log.with_name("report.json")
    replay = [MAPCLI, "slam-replay", "-q", log, "--json", trace, *options]
    subprocess.run(replay, check=True)
    subprocess.run([MAPCLI, "evaluate", "-q", trace, log, "--json", report], check=True)
    ate = json.loads(report.read_text())["measures"]["ate"]["translation_m"]
    return ate["rmse"], ate["max"], json.loads(trace.read_text())["summary"]["loops"]


def main() -> None:
    parser = argparse.ArgumentParser(description="ATE in large simulated worlds.")
    parser.add_argument("names", nargs="*", help="worlds whose names contain these; all of none")
    names = parser.parse_args().names
    print(
        "| world | without loops: ATE, worst, m | with: ATE, worst, m | loops |\n|---|---|---|---|"
    )
    for name, make in WORLDS.items():
        if names and not any(part in name for part in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            log = simulate(make(), Path(folder))
            plain, closed = errors(log, "--no-loop-closing"), errors(log)
        row = f"{plain[0]:.3f}, {plain[1]:.2f} | {closed[0]:.3f}, {closed[1]:.2f} | {closed[2]}"
        print(f"| {name} | {row} |", flush=True)


if __name__ == "__main__":
    main()
