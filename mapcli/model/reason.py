"""What makes a map doubtful, and what may be done about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

ReasonKind = Literal["laser_mirrored", "laser_turned", "range_unit", "angle_unit"]
"""`laser_mirrored`: scans turn the other way than the wheels; `laser_turned`: the laser looks
elsewhere than the log says, backwards above all; `range_unit`, `angle_unit`: readings are no
metres, angles are no radians."""


@dataclass(frozen=True)
class Reason:
    """Something that is wrong, and when.

    Attributes:
        kind: of a list, for programs.
        from_s, to_s: seconds after the first scan.
        text: for a person.
        remedy: the option to try; `try` in documents. Empty where there is none.
    """

    kind: ReasonKind
    from_s: float
    to_s: float
    text: str
    remedy: str = ""

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
