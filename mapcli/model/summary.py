"""What became of a log's scans: the end report of a replay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mapcli.model.clock import Clock
from mapcli.model.limit import limit_fields
from mapcli.model.loop_check import LoopCheck
from mapcli.model.reason import VERDICTS, Reason, Verdict
from mapcli.model.sweep_summary import SweepSummary


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
        verdict: may the map be trusted; reasons: why not, and when.
        clock: which times of the log were taken; None where there is no other than the stamps.
        loop_check: what loops were worth; None if none was found.
        unjoined: pieces of the drive, or drives, of which nobody knows how they lie to the first.
        sweep: of scans whose beams were taken one after another; None if all were taken at once.
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
    verdict: Verdict = "good"
    reasons: tuple[Reason, ...] = ()
    sweep: SweepSummary | None = None
    loop_check: LoopCheck | None = None
    unjoined: int = 0
    clock: Clock | None = None
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
            **({} if self.loop_check is None else {"loop_check": self.loop_check.document()}),
            "unjoined": self.unjoined,
            "mean_score": None if self.mean_score is None else round(self.mean_score, 4),
            "odometry_jumps": self.odometry_jumps,
            "odometry_faults": self.odometry_faults,
            "odometry_catch_ups": self.odometry_catch_ups,
            **({} if self.sweep is None else {"sweep": self.sweep.document()}),
            **({"clock": self.clock.document()} if self.clock and self.clock.why else {}),
            "damage": dict(self.damage),
            "interrupted": self.interrupted,
            "verdict": self.verdict,
            "reasons": [reason.document() for reason in self.reasons],
        }

    def values(self) -> dict[str, float | str]:
        """What limits may be set on: all numbers, those of this run, and the verdict."""
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
            "verdict": self.verdict,
        }


NOTHING = ReplaySummary(0, 0, 0, 0, {}, 0.0, 0.0, 0, None, 0, 0, 0, {}, interrupted=False)
LIMIT_FIELDS = limit_fields(NOTHING.values(), verdict=VERDICTS)
"""What limits may be set on."""

OF_THIS_RUN = "seconds", "times_real_time"
"""Of these, those that depend on the machine; no file has them."""
