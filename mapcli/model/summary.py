"""What became of a log's scans: the end report of a replay, and limits on it."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from mapcli.errors import DataError, QualityError
from mapcli.model.reason import Reason


@dataclass(frozen=True)
class ReplaySummary:
    """Every scan accounted for.

    Attributes:
        scans: scans asked for; each is either used or skipped.
        used: scans with a pose; of these `matched` were found in the map and `odometry` had to
            rely on odometry alone.
        skipped: reason -> scans, those included that were in the log and could not be read.
        distance_m: driven, along the poses.
        duration_s: of the log, from the first to the last used scan.
        loops: loops closed.
        mean_score: of the matched scans; None when none was.
        odometry_jumps: steps in which the odometry jumped and was not used; odometry_faults:
            scans at which the wheels were taken to count backwards, or to have stopped counting;
            odometry_catch_ups: steps in which odometry that had stood still delivered the way
            since, all at once.
        damage: what was wrong with the log -> how often.
        lost_share: share of the scans asked for that were lost to damage, as far as the log tells
            how many it held.
        interrupted: the replay was stopped early; the result is of the part before.
        reasons: what makes the result doubtful.
        seconds: what the replay took; left out of files, which must not depend on the machine.
    """

    scans: int
    used: int
    matched: int
    odometry: int
    skipped: Mapping[str, int]
    distance_m: float
    duration_s: float
    loops: int
    mean_score: float | None
    odometry_jumps: int
    odometry_faults: int
    odometry_catch_ups: int
    damage: Mapping[str, int]
    interrupted: bool
    lost_share: float = field(default=0.0)
    reasons: tuple[Reason, ...] = ()
    seconds: float = field(default=0.0)

    @property
    def used_share(self) -> float:
        return self.used / self.scans if self.scans else 0.0

    @property
    def times_real_time(self) -> float:
        """How much faster than the robot drove."""
        return self.duration_s / self.seconds if self.seconds > 0 else 0.0

    def document(self) -> dict[str, Any]:
        """For a file: all that depends on the log and the parameters only."""
        return {
            "scans": self.scans,
            "used": self.used,
            "used_share": round(self.used_share, 6),
            "lost_share": round(self.lost_share, 6),
            "matched": self.matched,
            "odometry": self.odometry,
            "skipped": dict(self.skipped),
            "distance_m": round(self.distance_m, 3),
            "duration_s": round(self.duration_s, 3),
            "loops": self.loops,
            "mean_score": None if self.mean_score is None else round(self.mean_score, 4),
            "odometry_jumps": self.odometry_jumps,
            "odometry_faults": self.odometry_faults,
            "odometry_catch_ups": self.odometry_catch_ups,
            "damage": dict(self.damage),
            "interrupted": self.interrupted,
            "reasons": [reason.document() for reason in self.reasons],
        }

    def numbers(self) -> dict[str, float]:
        """What limits may be set on: all numbers, and those of this run."""
        numbers = {
            key: float(value)
            for key, value in self.document().items()
            if isinstance(value, int | float)
        }
        return {
            **numbers,
            "mean_score": self.mean_score or 0.0,
            "skipped": float(sum(self.skipped.values())),
            "damage": float(sum(self.damage.values())),
            "seconds": self.seconds,
            "times_real_time": self.times_real_time,
        }


NOTHING = ReplaySummary(0, 0, 0, 0, {}, 0.0, 0.0, 0, None, 0, 0, 0, {}, interrupted=False)
LIMIT_FIELDS = tuple(NOTHING.numbers())
"""What `--fail-if` can be about."""

COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}


@dataclass(frozen=True, slots=True)
class Limit:
    """One comparison of `--fail-if`: fail when `field` compares so to `value`."""

    field: str
    comparison: str
    value: float

    @classmethod
    def parse(
        cls, text: str, fields: Sequence[str] = LIMIT_FIELDS, example: str = "used_share<0.95"
    ) -> Limit:
        """`used_share<0.95`, about one of these fields.

        Raises:
            DataError: not of that form, or about nothing that the summary has.
        """
        match = re.fullmatch(r"\s*(\w+)\s*(<=|>=|==|!=|<|>)\s*([-+.\deE]+)\s*", text)
        try:
            if match is None:
                raise ValueError
            limit = cls(match[1], match[2], float(match[3]))
        except ValueError:
            raise DataError(f"{text!r}", expected=f"a limit such as '{example}'") from None
        if limit.field not in fields:
            expected = f"one of {', '.join(fields)}"
            raise DataError(f"{text!r}: no {limit.field!r} in the summary", expected=expected)
        return limit

    def check(self, numbers: Mapping[str, float], name: str) -> None:
        """Fail if the limit is not met.

        Raises:
            QualityError: the comparison holds.
        """
        found = numbers[self.field]
        if COMPARISONS[self.comparison](found, self.value):
            raise QualityError(
                f"{self.field} is {found:g}",
                file=name,
                expected=f"not {self.field}{self.comparison}{self.value:g} (--fail-if)",
            )
