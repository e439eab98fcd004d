"""The verdict on a map: may it be trusted, and if not, why and where.

What counts against a map is evidence, not a low score: scans that other scans contradict
(`contradictions`), stretches by odometry alone, a long way on which nothing was seen twice. Each
is a reason with its time span; the worst decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby, pairwise

from mapcli.algorithms.slam.contradictions import APART_M, Agreement
from mapcli.algorithms.slam.sliding import (
    error_over,
    headings_are_fixed,
    odometry_error,
    sliding_stretches,
)
from mapcli.model.reason import VERDICTS, Reason, ReasonKind, Verdict
from mapcli.model.scan import NANOSECONDS
from mapcli.model.trace import TracedPose

CONTRADICTED = 0.3
"""Share of a scan's ends from which on it contradicts the others. People and doors are less of
what a scanner sees; a tear of more than its walls' thickness is more."""

FEW, MANY = 0.025, 0.05
"""Shares of the compared scans that contradict: from the first on a map is doubtful, from the
second on bad. People and doors are good for half of the first; a piece of a map that is torn shows
in the scans of both visits."""

TORN = 0.5
"""The share, of what scans see of the place that others saw just before, from which on a map is bad
where it is contradicted; it is doubtful from `CONTRADICTED` on. In right maps it is 0.17 at most,
and 0.25 among many people."""

FEWEST = 3
"""Scans that must contradict for a reason: one may stand where something moved."""

ALONE_M = 2.0
"""Metres by odometry alone, at a stretch, that make a map doubtful: wheels err by a tenth of what
they count, so that the map is off by more than a wall's thickness."""

OFF_M, FAR_OFF_M = 0.5, 1.0
"""Metres that a map may be off by where scans do not fix the robot's position, from which on it is
doubtful, and bad."""

UNSEEN_M = 150.0
"""Metres of way, at a stretch, of which nothing was seen on another visit. Tracking drifts by some
tenths of a percent of the way, mostly by its heading: what is so long may be off by half a metre,
and nothing would tell."""

APART_S = 10.0
"""Seconds between contradicting scans that are told as one span."""

SEEN_M = 5.0
"""Metres at which a place of another visit may be the same, in a map that is off."""

MEET_NOT = "walls that another visit saw through: the places do not meet"
LOST = "walls that scans nearby saw through: tracking was lost"
CARRIED = "walls that scans just before saw through: the robot was carried, or tracking was lost"
"""What contradicting scans say, of other visits, of scans just before and after, and of those just
before."""

ELSEWHERE = (
    "lost, or carried, and came to no place known before: how this lies to the rest is unknown"
)
"""What is said of a piece that was not joined."""

MOST_SPANS = 20
"""Reasons of a kind that are told, the longest ones."""


def map_reasons(
    poses: Sequence[TracedPose],
    agreements: Sequence[Agreement],
    remedy: str = "",
    unjoined: Sequence[tuple[int, int]] = (),
    begins: Sequence[int] = (),
    *,
    may_be_told: bool = True,
    is_searched: bool = True,
) -> tuple[Reason, ...]:
    """What makes a map doubtful or bad, of the map itself.

    Args:
        poses: of every scan, as they are in the map.
        agreements: of some of the scans, in time order.
        remedy: the option to try where places passed twice do not meet, if it is not what a person
            knows of them.
        unjoined: first and last scans of pieces that hang on the rest by odometry alone.
        begins: first scans of the pieces that begin after one was lost: the robot did not drive
            there from the scan before.
        may_be_told: a person may tell what the robot does not know (`slam.known_places`).
        is_searched: whether scans were matched at all, or poses are odometry's.
    """
    if not poses:
        return ()
    run = _Run(poses, agreements, frozenset(begins), may_be_told)
    return (
        *run.contradicting("walls_twice", MEET_NOT, lambda one: one.apart, remedy),
        *run.contradicting("torn", LOST, lambda one: one.near),
        *run.torn(),
        *run.unjoined(unjoined),
        *run.by_odometry_alone(is_searched=is_searched),
        *run.sliding(),
        *run.never_seen_again(),
    )


def wrong_lines(lines: Iterable[str], duration_s: float) -> Iterator[Reason]:
    """What a person told and scans contradict; the map is made without it."""
    for line in lines:
        text = f"{line} is not so: scans contradict it, and the map is made without it"
        yield Reason("not_so", 0.0, duration_s, text, verdict="doubtful")


def verdict_of(reasons: Iterable[Reason]) -> Verdict:
    """The worst that a reason says."""
    return max((one.verdict for one in reasons), key=VERDICTS.index, default="good")


class _Run:
    """Poses with the seconds and metres until each."""

    def __init__(
        self,
        poses: Sequence[TracedPose],
        agreements: Sequence[Agreement],
        begins: frozenset[int],
        may_be_told: bool,
    ) -> None:
        self.may_be_told = may_be_told
        self.poses, self.agreements = poses, agreements
        self.seconds = [(pose.stamp_ns - poses[0].stamp_ns) / NANOSECONDS for pose in poses]
        self.metres = [0.0]
        for k, (last, pose) in enumerate(pairwise(poses), 1):
            driven = 0.0 if k in begins else last.pose.distance(pose.pose)
            self.metres.append(self.metres[-1] + driven)

    def contradicting(
        self,
        kind: ReasonKind,
        text: str,
        share: Callable[[Agreement], float | None],
        remedy: str = "",
    ) -> Iterator[Reason]:
        """Spans of scans that others contradict, if they are more than a few."""
        compared = [one for one in self.agreements if share(one) is not None]
        against = [one.scan for one in compared if (share(one) or 0.0) > CONTRADICTED]
        if len(against) < max(FEWEST, FEW * len(compared)):
            return
        verdict: Verdict = "bad" if len(against) >= MANY * len(compared) else "doubtful"
        for first, last in _longest(self._spans(against)):
            told = self._same_place(first) if kind == "walls_twice" else self._trust(first, last)
            yield self._reason(kind, verdict, first, last, text, remedy or told)

    def _trust(self, first: int, last: int) -> str:
        """What a person may tell of a span in which the wheels were right."""
        if not self.may_be_told or self.poses[first].odom is None:
            return ""
        begin, end = math.floor(self.seconds[first]), math.ceil(self.seconds[last] + 0.001)
        return f"--trust-odometry {begin}-{min(end, math.floor(self.seconds[-1]))}"

    def _same_place(self, scan: int) -> str:
        """What a person may tell of a scan: when, on another visit, the robot seems to have been
        at the same place; T where nobody knows."""
        if not self.may_be_told:
            return ""
        here = self.poses[scan].pose
        others = [k for k in range(len(self.poses)) if self._is_apart(k, scan)]
        nearest = min(others, key=lambda k: self.poses[k].pose.distance(here), default=None)
        if nearest is None or self.poses[nearest].pose.distance(here) > SEEN_M:
            return f"--same-place T,{self.seconds[scan]:.1f}"
        return f"--same-place {self.seconds[nearest]:.1f},{self.seconds[scan]:.1f}"

    def _is_apart(self, one: int, other: int) -> bool:
        return abs(self.metres[one] - self.metres[other]) > APART_M

    def torn(self) -> Iterator[Reason]:
        """Where scans contradict those just before, as they do where a robot was put elsewhere."""
        against = {one.scan: one.onward for one in self.agreements if one.onward is not None}
        torn = [scan for scan, share in against.items() if share > CONTRADICTED]
        for first, last in _longest(self._spans(torn)) if torn else ():
            most = max(share for scan, share in against.items() if first <= scan <= last)
            verdict: Verdict = "bad" if most > TORN else "doubtful"
            yield self._reason("torn", verdict, first, last, CARRIED)

    def _spans(self, scans: Sequence[int]) -> list[tuple[int, int]]:
        """Scans as spans, first and last, parted where nothing contradicts for a while."""
        spans = [(scans[0], scans[0])]
        for scan in scans[1:]:
            first, last = spans[-1]
            if self.seconds[scan] - self.seconds[last] <= APART_S:
                spans[-1] = first, scan
            else:
                spans.append((scan, scan))
        return spans

    def unjoined(self, spans: Sequence[tuple[int, int]]) -> Iterator[Reason]:
        """Pieces of which nobody knows how they lie to the rest."""
        for first, last in spans:
            told = f"--same-place T,{self.seconds[first]:.1f}" if self.may_be_told else ""
            yield self._reason("unjoined", "bad", first, last, ELSEWHERE, told)

    def by_odometry_alone(self, *, is_searched: bool) -> Iterator[Reason]:
        """Stretches at which the map said nothing of the robot's pose; where no scan was searched
        for, those that scans nearby do not confirm."""
        spans, why = self._stretches(lambda pose: pose.status == "odometry"), "fitted the map"
        if not is_searched:
            spans, why = self._unconfirmed(), "nearby fixes it"
        for first, last in _longest([span for span in spans if self._way(*span) > ALONE_M]):
            text = f"{self._way(first, last):.0f} m by odometry alone: no scan {why}"
            told = self._same_place(last)
            yield self._reason("odometry_alone", "doubtful", first, last, text, told)

    def _unconfirmed(self) -> list[tuple[int, int]]:
        """The way between scans that agree with those nearby, and would not elsewhere."""
        confirmed = [
            one.scan
            for one in self.agreements
            if one.fixed_near and one.near is not None and one.near <= CONTRADICTED
        ]
        return list(pairwise([0, *confirmed, len(self.poses) - 1]))

    def sliding(self) -> Iterator[Reason]:
        """Stretches where scans do not tell how far the robot has come, and odometry is not to be
        trusted for so long."""
        errors = dict[bool, float]()
        for spans in sliding_stretches(self.agreements):
            by_map = headings_are_fixed(self.agreements, spans)
            if by_map not in errors:
                path = self.poses, self.metres
                errors[by_map] = odometry_error(*path, with_headings=not by_map)
            total = sum(self._way(*span) for span in spans)
            off = error_over(total, errors[by_map])
            if off <= OFF_M:
                continue
            verdict: Verdict = "bad" if off > FAR_OFF_M else "doubtful"
            for first, last in _longest(spans):
                way, part = self._way(first, last), f" of {total:.0f} m" if spans[1:] else ""
                text = f"{way:.0f} m{part} on which scans fit half a metre away as well"
                text += f": the map may be off by {off:.1f} m"
                told = self._same_place(last)
                yield self._reason("sliding", verdict, first, last, text, told)

    def never_seen_again(self) -> Iterator[Reason]:
        """Stretches of way that no other visit confirms."""
        seen = [one.scan for one in self.agreements if one.apart is not None]
        spans = zip([0, *seen], [*seen, len(self.poses) - 1], strict=True)
        for first, last in _longest([s for s in spans if self._way(*s) > UNSEEN_M]):
            text = f"{self._way(first, last):.0f} m on which nothing was seen twice"
            told = self._same_place(last)
            yield self._reason("unconfirmed", "doubtful", first, last, text, told)

    def _stretches(self, is_one: Callable[[TracedPose], bool]) -> list[tuple[int, int]]:
        """Stretches of such scans: the scan before each, from where the robot came, and its last
        one."""
        scans = groupby(range(len(self.poses)), key=lambda k: is_one(self.poses[k]))
        groups = [list(group) for such, group in scans if such]
        return [(max(group[0] - 1, 0), group[-1]) for group in groups]

    def _way(self, first: int, last: int) -> float:
        return self.metres[last] - self.metres[first]

    def _reason(
        self,
        kind: ReasonKind,
        verdict: Verdict,
        first: int,
        last: int,
        text: str,
        remedy: str = "",
    ) -> Reason:
        return Reason(kind, self.seconds[first], self.seconds[last], text, remedy, verdict)


def _longest(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The longest spans, in time order."""
    chosen = sorted(spans, key=lambda span: (span[0] - span[1], span[0]))[:MOST_SPANS]
    return sorted(chosen)
