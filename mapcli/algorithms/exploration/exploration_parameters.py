"""How robots explore: strategy, sensor, body and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from mapcli.errors import DataError
from mapcli.model.grid import OCCUPIED_THRESHOLD

Strategy = Literal["nearest", "priority", "gain", "random"]
STRATEGIES: tuple[Strategy, ...] = get_args(Strategy)

LARGEST_SEED = 2**31 - 1
"""Seeds are below this prime, by which random numbers are taken modulo."""


@dataclass(frozen=True)
class ExplorationParameters:
    """How robots explore.

    Attributes:
        strategy: which frontier cell comes next, see `goal_selection`.
        low: a known cell is open when its probability is below this, in (0, 1].
        sensor_range: cells; 1 is the eight neighbours, more is the field of view, see
            `field_of_view`.
        connectivity: 4 or 8 neighbours to move to.
        robot_radius: metres; 0 is a point.
        max_steps, max_distance: of all robots together; metres, the way home not counted.
        coverage: share of the explorable cells, see `ExplorationSummary`.
        return_home: go back to where they started.
        seed: of the strategy `random`.

    Raises:
        DataError: a value outside its range.
    """

    strategy: Strategy = "nearest"
    low: float = OCCUPIED_THRESHOLD
    sensor_range: int = 1
    connectivity: Literal[4, 8] = 4
    robot_radius: float = 0.0
    max_steps: int | None = None
    max_distance: float | None = None
    coverage: float | None = None
    return_home: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        steps, metres, share = self.max_steps, self.max_distance, self.coverage
        ranges: tuple[tuple[str, float | None, bool, str], ...] = (
            ("low", self.low, 0 < self.low <= 1, "more than 0 and at most 1"),
            ("sensor range", self.sensor_range, self.sensor_range >= 1, "1 cell or more"),
            ("connectivity", self.connectivity, self.connectivity in (4, 8), "4 or 8"),
            ("robot radius", self.robot_radius, 0 <= self.robot_radius < math.inf, "0 m or more"),
            ("max steps", steps, steps is None or steps >= 0, "0 or more"),
            ("max distance", metres, metres is None or metres >= 0, "0 m or more"),
            ("seed", self.seed, 0 <= self.seed < LARGEST_SEED, f"0 to {LARGEST_SEED - 1}"),
            ("coverage", share, share is None or 0 < share <= 1, "more than 0 and at most 1"),
        )
        for name, value, fine, expected_gain in ranges:
            if not fine:
                raise DataError(f"{name} {value:g}", expected=expected_gain)
        if self.strategy not in STRATEGIES:
            raise DataError(f"strategy {self.strategy!r}", expected=", ".join(STRATEGIES))
