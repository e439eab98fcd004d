"""Mowers that localise by odometry and by tape marks on the lawn (Activity 9.3).

A mower steers by its pose estimate. Its wheels measure what it wants them to measure; its true
motion differs by the errors of the odometry. When its floor sensor comes upon a tape mark, the
estimate is corrected (an extended Kalman filter, `_kernels.mowing`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
import shapely

from mapcli.algorithms.simulation._kernels.mowing import (
    Lawn,
    RunRecord,
    Step,
    WheelErrors,
    mow_once,
)
from mapcli.algorithms.simulation.drive import arc
from mapcli.algorithms.simulation.sensors import WheelModel
from mapcli.algorithms.simulation.simulate import START_NS
from mapcli.errors import DataError
from mapcli.model.mowing import Floats, Mowing, MowingPlan, MowingRun
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, Record, TruePose

PATIENCE = 3.0
"""A run is given up after so many times the steps of the planned path: the mower is lost."""

MOST_STEPS = 2_000_000

AS_NOISE = 3.0
"""Noise per systematic error of the odometry: after 10 m both have the same size."""

SIZES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6)
"""Sides of the landmarks that are tried out, metres."""

RELIABLE_SHARE = 0.95
"""Landmarks are large enough when this share of them is noticed in a run."""

CELLS_A_WIDTH = 6
"""Fineness of the raster on which the mown area is measured."""


@dataclass(frozen=True)
class MowerModel:
    """What a mower can do.

    Attributes:
        wheels: its odometry; faults are not simulated.
        speed: metres per second, more than 0.
        turn_rate_deg: degrees per second, on the spot, more than 0. Speeding up takes no time.
    """

    wheels: WheelModel
    speed: float = 0.5
    turn_rate_deg: float = 60.0

    @property
    def step(self) -> Step:
        """The largest step between two readings of wheels and floor sensor."""
        rate = self.wheels.rate
        return Step(self.speed / rate, math.radians(self.turn_rate_deg) / rate)


def mow(
    plan: MowingPlan, mower: MowerModel, size: float | None, runs: int, seed: int,
    *, with_area: bool = True,
) -> Mowing:  # fmt: skip
    """Send mowers over the lawn.

    Run k meets the same noise whatever the landmarks and the number of runs.

    Args:
        size: side of the tape marks, metres; None for odometry alone.
        with_area: measure the share of the lawn that each run cut.

    Raises:
        DataError: a run that would take more than 2 million steps.
    """
    limit = _most_steps(plan, mower)
    seeds = np.random.SeedSequence(seed).spawn(runs)
    done = []
    for each in seeds:
        normals = np.random.Generator(np.random.PCG64(each)).standard_normal((limit, 2))
        done.append(_run(plan, mower, size, normals))
    return Mowing(
        size,
        np.array([run.path[-1] for run in done]) - plan.station,
        None if size is None else float(np.mean([run.seen > 0 for run in done])),
        np.array([_mown(plan, run.path) for run in done if with_area]),
        tuple(done),
    )


def _most_steps(plan: MowingPlan, mower: MowerModel) -> int:
    metres, radians = mower.step
    steps = PATIENCE * (plan.distance / metres + math.pi * len(plan.waypoints) / radians)
    if not steps <= MOST_STEPS:
        expected = f"at most {MOST_STEPS:,}; a wider lane, a higher speed or a lower rate"
        raise DataError(f"a run could take {steps:,.0f} steps", expected=expected)
    return math.ceil(steps)


def _run(plan: MowingPlan, mower: MowerModel, size: float | None, normals: Floats) -> MowingRun:
    w = mower.wheels
    errors = WheelErrors(np.array(w.noise), w.scale, w.turn_scale, math.radians(w.drift_deg))
    assumed_noise = np.hypot(w.noise, _systematic_as_noise(w))
    lawn = Lawn(plan.waypoints, plan.marks, -1.0 if size is None else float(size))
    seen = np.zeros(len(plan.marks), dtype=np.int64)
    record = RunRecord(np.empty_like(normals), np.empty_like(normals), seen)
    count = mow_once(lawn, mower.step, errors, assumed_noise, normals, record)
    return MowingRun(record.path[:count].copy(), record.measured[: count - 1].copy(), seen)


def _mown(plan: MowingPlan, path: Floats) -> float:
    """The share of the lawn that a blade of the plan's width cut along a path."""
    cell = plan.width / CELLS_A_WIDTH
    low, high = plan.outline.min(axis=0), plan.outline.max(axis=0)
    columns, rows = np.ceil((high - low) / cell).astype(int) + 1
    cut = np.zeros((rows, columns), dtype=bool)
    visited = np.unique(np.floor((path - low) / cell).astype(int), axis=0)
    reach = CELLS_A_WIDTH // 2
    for du, dv in np.ndindex(2 * reach + 1, 2 * reach + 1):
        if math.hypot(du - reach, dv - reach) <= reach:
            u, v = np.add(visited, (du - reach, dv - reach)).T
            inside = (u >= 0) & (v >= 0) & (u < columns) & (v < rows)
            cut[v[inside], u[inside]] = True
    y, x = np.mgrid[:rows, :columns] * cell + cell / 2
    lawn = shapely.contains_xy(shapely.Polygon(plan.outline), x + low[0], y + low[1])
    return float((cut & lawn).sum() / lawn.sum())


def landmark_sizes(plan: MowingPlan, size: float) -> list[float | None]:
    """The landmarks to mow with: none (odometry alone); then those asked for, then other sizes.

    Args:
        size: side of the landmarks asked for, metres.

    Raises:
        DataError: such landmarks would touch.
    """
    if not len(plan.marks):
        return [None]
    if size >= plan.largest_mark:
        raise DataError(
            f"{len(plan.marks)} landmarks of {size:g} m would touch",
            expected=f"less than {plan.largest_mark:.2f} m, or fewer of them",
        )
    return [None, size, *(other for other in SIZES if other < plan.largest_mark and other != size)]


def smallest_reliable(mowings: Sequence[Mowing], share: float = RELIABLE_SHARE) -> float | None:
    """The smallest landmarks from which on at least such a share of them is noticed in a run."""
    found = None
    for mowing in sorted(mowings, key=lambda each: -(each.landmark_size or 0)):
        if mowing.detected is None or mowing.detected < share:
            break
        found = mowing.landmark_size
    return found


def _systematic_as_noise(wheels: WheelModel) -> Floats:
    """The noise, shape (4,), in the order of `WheelModel.noise`, by which the mower's filter allows
    for systematic errors: these grow with the distance, noise with its square root."""
    turn, distance = abs(wheels.turn_scale - 1), abs(wheels.scale - 1)
    drift = abs(math.radians(wheels.drift_deg))
    return AS_NOISE * np.array([turn, drift, distance, 0.0])


def mower_log(plan: MowingPlan, run: MowingRun, rate: float) -> Iterator[Record]:
    """A run as a log: odometry from zero on, and true poses."""
    heading = math.atan2(*(plan.waypoints[1] - plan.waypoints[0])[::-1])
    steps = (arc(float(distance), float(turn)) for distance, turn in run.measured)
    poses = accumulate(steps, Pose2D.compose, initial=Pose2D())
    ahead = np.diff(run.path, axis=0, append=run.path[-1:])
    for k, (odometry, (x, y), (dx, dy)) in enumerate(zip(poses, run.path, ahead, strict=True)):
        # The path has no heading where the robot turns on the spot; it then keeps the last one.
        heading = math.atan2(dy, dx) if math.hypot(dx, dy) > 1e-6 else heading
        stamp = START_NS + round(k / rate * 1e9)
        yield TruePose(stamp, Pose2D(float(x), float(y), heading))
        yield Odometry(stamp, odometry)
