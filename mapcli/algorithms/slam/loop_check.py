"""Loops that help: is the map with them a better explanation of the beams than without?

A wrong loop bends the map until two places lie on each other, and whatever the loop itself says,
the beams then see it: ends of one visit's beams lie where the other saw through. So each visit's
scans are held against what the other visits saw (`contradictions`), with the loops and without, and
the log-likelihood of their ends decides. Where scans are contradicted that were not before, groups
of loops are left out by way of trial, the one without which the beams are explained best first; and
if the map with all that are left is still worse than the one without any, none is kept.
"""

from __future__ import annotations

from typing import NamedTuple

from mapcli.algorithms.slam.contradictions import Explained, explain_scans
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.loop_closure import LoopCloser, ScoredLoop
from mapcli.algorithms.slam.pieces import merged
from mapcli.algorithms.slam.pose_graph import PoseGraph
from mapcli.algorithms.slam.scan_sample import SampledScan, sample_of_keyframes
from mapcli.algorithms.slam.submaps import apply_corrections
from mapcli.model.loop_check import LoopCheck

SUSPICIOUS = 0.3
"""Share of a scan's ends from which on others contradict it; more than people and doors."""

FEWEST = 3
"""Scans that must be contradicted for a trial: one may stand where something moved."""

MOST_TRIALS = 12
"""Groups of loops that are left out by way of trial, each time; those nearest to what is
contradicted."""

TOGETHER_M = 40.0
"""Metres of way up to which one loop follows another that says the same."""

LEAST_GAIN = 0.01
"""Nats an end by which a map must be better for loops to be left out: right ones that lie some
centimetres off, which the refinement mends, cost up to 0.007."""

MOST_SCANS = 200
"""Scans that are compared, at most: half of those that a verdict rests on, for half of the time."""


class Trial(NamedTuple):
    """A graph with some loops, and how well it explains the beams."""

    loops: list[ScoredLoop]
    graph: PoseGraph
    explained: list[Explained]

    @property
    def nats(self) -> float:
        """Mean log-likelihood of an end."""
        ends = sum(one.ends for one in self.explained)
        return sum(one.nats for one in self.explained) / max(1, ends)


def keep_loops_that_help(closer: LoopCloser, trajectory: TrackedTrajectory) -> LoopCheck | None:
    """Leave loops out of a graph without which the beams are explained better; None if there is no
    loop."""
    return _Check(closer, trajectory).run() if closer.accepted else None


class _Check:
    def __init__(self, closer: LoopCloser, trajectory: TrackedTrajectory) -> None:
        self.closer, self.trajectory = closer, trajectory
        sample = sample_of_keyframes(trajectory.keyframes)
        self.sample = sample[:: 1 + (len(sample) > MOST_SCANS)]

    def run(self) -> LoopCheck:
        closer = self.closer
        closed = best = self._trial(closer.accepted, closer.graph)
        without = self._trial([], PoseGraph(closer.tracked.poses))
        while best.loops:
            trials = [self._without(best, group) for group in self._suspects(best, without)]
            better = max(trials, key=lambda trial: trial.nats, default=best)
            if better.nats < best.nats + LEAST_GAIN:
                break
            best = better
        if without.nats > best.nats + LEAST_GAIN:
            best = without
        dropped = len(closed.loops) - len(best.loops)
        if dropped:
            closer.keep(best.loops, best.graph)
        return LoopCheck(without.nats, closed.nats, best.nats, dropped)

    def _trial(self, loops: list[ScoredLoop], graph: PoseGraph) -> Trial:
        poses = apply_corrections(self.trajectory, self.closer.submaps, graph.poses)
        explained = [
            one
            for scans in self._together(loops)
            for one in explain_scans(scans, poses, self.trajectory.begins)
        ]
        return Trial(loops, graph, explained)

    def _together(self, loops: list[ScoredLoop]) -> list[list[SampledScan]]:
        """The sample in parts: of drives that no loop leads between, nobody knows how they lie to
        each other, so that one says nothing of the other."""
        trajectory, submaps = self.trajectory, self.closer.submaps
        group = list(range(len(trajectory.begins)))
        for loop in loops:
            ends = (submaps[k].origin for k in (loop.edge.from_, loop.edge.to))
            drives = (trajectory.drive_of(trajectory.keyframes[k].scan) for k in ends)
            group = merged(group, *drives)
        parts: dict[int, list[SampledScan]] = {}
        for scan in self.sample:
            parts.setdefault(group[trajectory.drive_of(scan.scan)], []).append(scan)
        return list(parts.values())

    def _without(self, trial: Trial, group: list[ScoredLoop]) -> Trial:
        """The same without a group of loops."""
        loops = [one for one in trial.loops if one not in group]
        return self._trial(loops, self.closer.graph.with_loops({one.edge for one in loops}))

    def _suspects(self, trial: Trial, without: Trial) -> list[list[ScoredLoop]]:
        """Groups of loops next to scans that are contradicted, and were not without loops; those
        with the most such scans first."""
        before = {one.scan: one.contradicted for one in without.explained}
        scans = [
            one.scan
            for one in trial.explained
            if one.contradicted >= SUSPICIOUS * one.ends and one.contradicted > before[one.scan]
        ]
        if len(scans) < FEWEST:
            return []
        groups = groups_of(trial.loops, self.closer)
        return sorted(groups, key=lambda group: -self._near(group, scans))[:MOST_TRIALS]

    def _near(self, group: list[ScoredLoop], scans: list[int]) -> int:
        """How many of the scans are of the submaps that a group of loops leads between."""
        submaps = {k for one in group for k in (one.edge.from_, one.edge.to)}
        keyframes = self.trajectory.keyframes
        spans = [
            (keyframes[one.first].scan, keyframes[one.last].scan)
            for one in (self.closer.submaps[k] for k in submaps)
        ]
        return sum(any(first <= scan <= last for first, last in spans) for scan in scans)


def groups_of(loops: list[ScoredLoop], closer: LoopCloser) -> list[list[ScoredLoop]]:
    """Loops that say the same as the one before, group by group."""
    groups: list[list[ScoredLoop]] = []
    for one in loops:
        for group in groups:
            last = group[-1].edge
            apart = abs(closer.metres[one.edge.to] - closer.metres[last.to])
            if apart <= TOGETHER_M and closer.are_consistent(last, one.edge):
                group.append(one)
                break
        else:
            groups.append([one])
    return groups
