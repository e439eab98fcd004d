"""What a replay tells of its loops: are the beams explained better with them?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class LoopCheck:
    """What loops were worth: mean log-likelihoods of the ends of beams, by what other visits saw.

    Attributes:
        without: nats, without any loop.
        found: with all loops that were found; kept: with those that were kept.
        dropped: loops without which the beams are explained better.
    """

    without: float
    found: float
    kept: float
    dropped: int

    def document(self) -> dict[str, Any]:
        """For a file."""
        return {
            "likelihood_without": round(self.without, 4),
            "likelihood_found": round(self.found, 4),
            "likelihood_kept": round(self.kept, 4),
            "dropped": self.dropped,
        }

    def text(self) -> str:
        """For a person."""
        text = f"a beam's log-likelihood is {self.kept:.2f}, without loops {self.without:.2f}"
        if not self.dropped:
            return text
        return f"{text}; {self.dropped:,} more were dropped, with which it was {self.found:.2f}"
