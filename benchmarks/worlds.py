"""Worlds that nobody has seen, each with its trouble, and whether the map knows of it.

    python benchmarks/worlds.py [--only KIND] [--seeds N] [--draw N] [--jobs N]

Five worlds of each kind of trouble, which in all but the last kind is the only one, are drawn from
random numbers (`floor_plans.py`) and toured three times each (`mapcli.simulate`), and `mapcli
slam-replay` maps the logs. Printed are, as a map's and as odometry's: ATE (root mean square after
the best rigid alignment) and the worst error over 10 m of way, in metres, and the verdict of the
report. Truth is the simulator's; the errors are computed here, with nothing of mapcli's.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from floor_plans import PLANS, Plan, aisles, corridor, hall, rooms
from numpy.typing import NDArray

from mapcli import (
    LaserModel,
    MotionLimits,
    Pose2D,
    Simulation,
    WheelModel,
    plan_drive,
    plan_tour,
    save_log,
    simulate,
)
from mapcli.algorithms.simulation.sensors import Fault
from mapcli.formats.logs.topics import LogNames
from mapcli.model.scan import Mount, Odometry, Record

Floats = NDArray[np.float64]
Random = np.random.Generator

WORLDS_OF_A_KIND = 5

SHORTEST_S = 60.0
"""A tour goes on to another place until it takes so long."""

DRIVES_OF_A_DRAW = 1000
"""More than anybody has driven through each world of a draw."""

OVER_M = 10.0
"""Metres of way over which the worst error is looked for."""

SLACK_M = 0.02, 0.05
"""By so much ATE and worst error may exceed those of odometry alone."""


@dataclass(frozen=True)
class Robot:
    """What drives through a world."""

    limits: MotionLimits
    wheels: WheelModel
    laser: LaserModel
    more: dict[str, Any] = field(default_factory=dict)
    """Of `Simulation`."""

    def with_laser(self, **values: Any) -> Robot:
        return replace(self, laser=replace(self.laser, **values))

    def with_wheels(self, **values: Any) -> Robot:
        return replace(self, wheels=replace(self.wheels, **values))

    def failing(self, kind: Any, count: int, seconds: tuple[float, float], rng: Random) -> Robot:
        """Odometry that fails so often, for so long, within the shortest drive."""
        faults = []
        for k in range(count):
            begin = 10 + (SHORTEST_S - 15) / count * (k + 0.3 * rng.random())
            faults.append(Fault(kind, begin, begin + rng.uniform(*seconds)))
        return self.with_wheels(faults=tuple(faults))


ROBOT = Robot(
    MotionLimits(speed=0.7),
    WheelModel(scale=1.01, turn_scale=0.98),
    LaserModel(rate=8, beams=360),
)
WHEEL_FAULTS = "reverse-sign", "freeze", "slip", "slip-left", "slip-right"
CODES = ((65.535,), (13.0,), (51.14, 51.15), (0.0,), (11.9, 11.91, 11.92))


class Kind(NamedTuple):
    """A kind of trouble: the robot in the world of a number, and where it drives."""

    robot: Callable[[int, Random], Robot]
    plans: tuple[Plan, ...] = PLANS
    options: tuple[str, ...] = ()
    """Of slam-replay."""


def _two_lasers(number: int, rng: Random) -> Robot:
    front, rear = (Mount(Pose2D(x, 0, turn)) for x, turn in ((0.2, 0.0), (-0.2, np.pi)))
    robot = ROBOT.with_laser(fov_deg=190.0, mount=front)
    return replace(robot, more={"rear": replace(robot.laser, mount=rear)})


def _everything(number: int, rng: Random) -> Robot:
    """Wheels that fail where the laser, which spins, hardly sees a wall for all the people."""
    robot = ROBOT.failing(WHEEL_FAULTS[number], 2, (3.0, 8.0), rng)
    robot = robot.with_laser(range_max=rng.uniform(2.5, 4), turn_time=0.1, fov_deg=180.0)
    return replace(robot, more={"people": 6, "glass": 0.1})


KINDS = {
    "clean": Kind(lambda _, rng: ROBOT),
    "spinning laser": Kind(lambda _, rng: ROBOT.with_laser(turn_time=rng.uniform(0.06, 0.125))),
    "people": Kind(lambda _, rng: replace(ROBOT, more={"people": int(rng.integers(4, 13))})),
    "glass": Kind(lambda _, rng: replace(ROBOT, more={"glass": rng.uniform(0.1, 0.3)})),
    "stale odometry": Kind(lambda _, rng: ROBOT.failing("stale", 4, (0.5, 2.5), rng)),
    "late odometry": Kind(lambda _, rng: ROBOT.with_wheels(delay=rng.uniform(0.1, 0.4))),
    "wheels": Kind(lambda k, rng: ROBOT.failing(WHEEL_FAULTS[k], 2, (3.0, 8.0), rng)),
    "short sight": Kind(
        lambda _, rng: ROBOT.with_laser(range_max=rng.uniform(3, 5), fov_deg=rng.uniform(180, 270))
    ),
    "no-return codes": Kind(
        lambda k, rng: ROBOT.with_laser(no_return=CODES[k], range_max=rng.uniform(5, 8)),
    ),
    "aisles": Kind(lambda _, rng: ROBOT.with_laser(range_max=rng.uniform(5, 8)), (aisles,)),
    "long corridor": Kind(lambda _, rng: ROBOT.with_laser(range_max=8.0), (corridor,)),
    "two lasers": Kind(_two_lasers, options=("--scan-topic", "all")),
    "fast robot": Kind(
        lambda _, rng: replace(
            ROBOT, limits=MotionLimits(speed=rng.uniform(2, 3), acceleration=1.5, turn_rate_deg=120)
        ),
        (hall, aisles),
    ),
    "everything at once": Kind(_everything, (hall, corridor, rooms, hall, aisles)),
}


class Result(NamedTuple):
    """Errors in metres, (ATE, worst over 10 m), of the map's poses and of odometry."""

    kind: str
    world: int
    seed: int
    seconds: float
    mapped: tuple[float, float]
    odometry: tuple[float, float]
    verdict: str

    @property
    def is_worse(self) -> bool:
        """Worse than odometry alone."""
        pairs = zip(self.mapped, self.odometry, SLACK_M, strict=True)
        return any(mine > odometry + slack for mine, odometry, slack in pairs)


def simulation_of(kind: str, world: int, seed: int, draw: int = 0) -> Simulation:
    """The drive of a seed through a world of a kind, which is the same for all seeds.

    Args:
        draw: of the random numbers, for worlds (and drives) other than those one has looked at.
    """
    rng = np.random.default_rng([list(KINDS).index(kind), world, draw])
    seed += DRIVES_OF_A_DRAW * draw
    plans = KINDS[kind].plans
    grid, robot = plans[world % len(plans)](rng), KINDS[kind].robot(world, rng)
    radius, places, duration, ways = 0.2, 0, 0.0, []
    while duration < SHORTEST_S:
        places += 1
        ways = plan_tour(grid, places, radius, robot.limits, seed)
        duration = plan_drive(ways, robot.limits).duration
    simulation = simulate(
        grid, ways, limits=robot.limits, wheels=robot.wheels, laser=robot.laser,
        robot_radius=radius, seed=seed,
    )  # fmt: skip
    return replace(simulation, **robot.more)


def run(task: tuple[str, int, int, int]) -> Result:
    """Drive, map, measure: of `simulation_of`."""
    kind, world, seed, draw = task
    simulation, readings = simulation_of(kind, world, seed, draw), []

    def records() -> Iterator[Record]:
        for record in simulation.records():
            if isinstance(record, Odometry):
                readings.append((record.stamp_ns, *row(record.pose)))
            yield record

    with tempfile.TemporaryDirectory() as folder:
        log, out = Path(folder) / "log.mcap", Path(folder) / "trace.json"
        save_log(records(), log, LogNames(topic_per_mount=True))
        command = [sys.executable, "-m", "mapcli", "slam-replay", "-q", log, "--json", out]
        done = subprocess.run(
            [*map(str, command), *KINDS[kind].options], capture_output=True, text=True, check=False
        )
        if done.returncode:
            lost = (np.inf, np.inf)
            return Result(kind, world, seed, simulation.duration, lost, lost, done.stderr.strip())
        trace = json.loads(out.read_text())
    poses = [(p["stamp_ns"], p["x"], p["y"], p["theta"]) for p in trace["poses"]]
    times = [(stamp - simulation.start_ns) / 1e9 for stamp, *_ in poses]
    truth = np.array([row(simulation.true_pose(time)) for time in times])
    odometry = at(np.array(readings) - (simulation.start_ns, 0, 0, 0), np.array(times) * 1e9)
    mapped = np.array(poses)[:, 1:]
    verdict = trace["summary"].get("verdict", "-")
    measured = errors(mapped, truth), errors(odometry, truth)
    return Result(kind, world, seed, simulation.duration, *measured, verdict)


def row(pose: Pose2D) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.theta


def at(readings: Floats, stamps: Floats) -> Floats:
    """Odometry, rows of (stamp, x, y, theta), between its readings, shape (n, 3)."""
    stamp, x, y, theta = readings.T
    return np.stack([np.interp(stamps, stamp, v) for v in (x, y, np.unwrap(theta))], axis=1)


def errors(poses: Floats, truth: Floats) -> tuple[float, float]:
    """ATE after the best rigid alignment, and the worst error over 10 m of way (0 on less)."""
    a, b = (each[:, :2] - each[:, :2].mean(axis=0) for each in (poses, truth))
    u, _, v = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1, np.linalg.det(u @ v)]) @ v
    ate = float(np.sqrt(((a @ turn - b) ** 2).sum(axis=1).mean()))
    way = np.append(0, np.cumsum(np.linalg.norm(np.diff(b, axis=0), axis=1)))
    end = np.searchsorted(way, way + OVER_M)
    begin = np.flatnonzero(end < len(way))
    moved = (between(each[begin], each[end[begin]]) for each in (poses, truth))
    error = between(*moved)[:, :2]
    return ate, float(np.linalg.norm(error, axis=1).max(initial=0.0))


def between(a: Floats, b: Floats) -> Floats:
    """The poses b seen from the poses a, shape (n, 3)."""
    cos, sin = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy = (b - a)[:, :2].T
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx, b[:, 2] - a[:, 2]], axis=1)


def line(result: Result) -> str:
    mapped, odometry = (
        f"{ate:.3f}, {worst:.3f}" for ate, worst in (result.mapped, result.odometry)
    )
    mark = " (worse than odometry)" if result.is_worse else ""
    name = f"{result.kind} {result.world}, seed {result.seed}, {result.seconds:.0f} s"
    return f"| {name} | {mapped}{mark} | {odometry} | {result.verdict} |"


def summary(results: list[Result]) -> Iterator[str]:
    """A row for each kind, and what verdicts are worth."""
    heads = ("kind", "runs", "ATE median", "ATE worst", "worst over 10 m", "of odometry",
             "worse", "verdicts")  # fmt: skip
    yield f"\n| {' | '.join(heads)} |\n{'|---' * len(heads)}|"
    for kind in dict.fromkeys(result.kind for result in results):
        own = [result for result in results if result.kind == kind]
        ates, tens = np.array([result.mapped for result in own]).T
        odometry = np.array([result.odometry for result in own]).max(axis=0)
        verdicts = ", ".join(f"{n} {verdict}" for verdict, n in verdicts_of(own))
        yield (f"| {kind} | {len(own)} | {np.median(ates):.3f} | {ates.max():.3f} | "
               f"{tens.max():.3f} | {odometry[0]:.3f}, {odometry[1]:.3f} | "
               f"{sum(result.is_worse for result in own)} | {verdicts} |")  # fmt: skip
    yield ""
    for text, low, high in (("under 0.1 m", 0.0, 0.1), ("0.1 to 0.5 m", 0.1, 0.5),
                            ("0.5 to 1 m", 0.5, 1.0), ("over 1 m", 1.0, np.inf)):  # fmt: skip
        own = [result for result in results if low <= result.mapped[0] < high]
        yield f"{text}: {len(own)} maps, {dict(verdicts_of(own))}"


def verdicts_of(results: Iterable[Result]) -> list[tuple[str, int]]:
    return Counter(result.verdict for result in results).most_common()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", metavar="KIND", help="kinds whose names contain this")
    parser.add_argument("--worlds", type=int, default=WORLDS_OF_A_KIND, help="of each kind")
    parser.add_argument("--seeds", type=int, default=3, help="drives through each world")
    parser.add_argument("--draw", type=int, default=0, help="of the random numbers: other worlds")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    given = parser.parse_args()
    tasks = [
        (kind, world, seed, given.draw)
        for kind in KINDS
        if (given.only or "") in kind
        for world in range(given.worlds)
        for seed in range(given.seeds)
    ]
    if not tasks:
        parser.error(f"no kind like {given.only}; there are {', '.join(KINDS)}")
    print("| world | map: ATE, worst over 10 m | odometry | verdict |\n|---|---|---|---|")
    results = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for result in pool.map(run, tasks):
            results.append(result)
            print(line(result), flush=True)
    print("\n".join(summary(results)))


if __name__ == "__main__":
    main()
