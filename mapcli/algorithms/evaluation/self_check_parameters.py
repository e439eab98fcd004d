"""When two scans tell whether a trace is right."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SelfCheckParameters:
    """Which pairs of scans are matched, and when a match is accepted.

    Attributes:
        near_m: positions of a pair are at most so far from each other in the trace, metres.
        apart_m: between them the robot drove at least so far.
        most: pairs, at even intervals over the log.
        window_m, window_deg: half-widths of the search around the trace's relative pose.
        agreement: least agreement of the one scan with the map of the other, 0 to 1.
        shared: least share of the points of a scan that lie in known cells of the other's map.
        reverse_m, reverse_deg: largest difference of the two directions of matching.
        slide_m: the agreement must fall by `slide_loss` when a scan is shifted so far in any
            direction; in a corridor, an unconstrained direction, it does not.
    """

    near_m: float = 2.0
    apart_m: float = 10.0
    most: int = 200
    window_m: float = 2.0
    window_deg: float = 30.0
    agreement: float = 0.75
    shared: float = 0.5
    reverse_m: float = 0.03
    reverse_deg: float = 0.5
    slide_m: float = 0.25
    slide_loss: float = 0.15
