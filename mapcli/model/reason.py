"""What makes a map doubtful, and what may be done about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

Verdict = Literal["good", "doubtful", "bad"]
"""May a map be trusted?"""

VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

ReasonKind = Literal[
    "laser_mirrored",
    "laser_turned",
    "mount_unknown",
    "range_unit",
    "angle_unit",
    "clocks_differ",
    "odometry_wrong",
    "known_map",
    "walls_twice",
    "torn",
    "unjoined",
    "odometry_alone",
    "sliding",
    "unconfirmed",
    "wheels_failed",
    "not_so",
]
"""`laser_mirrored`: scans turn the other way than the wheels; `laser_turned`: the laser looks
elsewhere than the log says, backwards above all; `mount_unknown`: the log does not say where it
sits, and it is taken to be at the robot's centre; `range_unit`, `angle_unit`: readings are no
metres, angles are no radians; `clocks_differ`: the stamps of the scans and those of the odometry
are not of one clock; `odometry_wrong`: odometry is no metres or no radians, or turns the
other way, throughout; `known_map`: the map that was gone on from is of another place, or the robot
started elsewhere in it; `walls_twice`: places passed twice do not meet; `torn`: scans that those
taken just before and after contradict; `unjoined`: the robot was lost or carried, and came to no
place that it knew since; `odometry_alone`: no scan fitted the map; `sliding`: scans did not tell
how far the robot had come, along corridors above all; `unconfirmed`: a long way of which nothing
was seen on another visit; `wheels_failed`: odometry counted something else than the robot did for
a while, which the map was made without; `not_so`: what a person told, and scans contradict."""

DESCRIPTIONS = frozenset[ReasonKind](
    ("laser_mirrored", "laser_turned", "range_unit", "angle_unit", "clocks_differ")
)
"""Those that are faults of how the log is described, and are mended by an option."""

MAP_REASONS = frozenset[ReasonKind](
    ("walls_twice", "torn", "unjoined", "odometry_alone", "sliding", "unconfirmed")
)
"""Those that speak of a map, and are told anew when other scans are added to it."""

WRONG_THROUGHOUT: tuple[ReasonKind, ...] = "laser_mirrored", "laser_turned", "odometry_wrong"
"""Those by which wheels seem to fail all the time."""


@dataclass(frozen=True)
class Reason:
    """Something that is wrong, and when.

    Attributes:
        kind: of a list, for programs.
        from_s, to_s: seconds after the first scan.
        text: for a person.
        remedy: the option to try; `try` in documents. Empty where there is none.
        verdict: on the map, for this reason.
    """

    kind: ReasonKind
    from_s: float
    to_s: float
    text: str
    remedy: str = ""
    verdict: Verdict = "bad"

    def document(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "from_s": round(self.from_s, 3),
            "to_s": round(self.to_s, 3),
            "text": self.text,
            "try": self.remedy,
        }

    def line(self) -> str:
        """The reason and what to try, in one line."""
        return f"{self.text}; try {self.remedy}" if self.remedy else self.text
