"""Several drives after loop closure: which belong together, and where their scans are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from mapcli.algorithms.sessions.drive import Drive
from mapcli.algorithms.sessions.joined_trajectory import joined_trajectory
from mapcli.algorithms.slam.back_end import loops_between_scans
from mapcli.algorithms.slam.keyframes import TrackedTrajectory
from mapcli.algorithms.slam.loop_check import keep_loops_that_help
from mapcli.algorithms.slam.loop_closure import LoopCloser, LoopParameters
from mapcli.algorithms.slam.persons_view import PersonsView
from mapcli.algorithms.slam.pieces import merged
from mapcli.algorithms.slam.slam_parameters import SlamParameters
from mapcli.algorithms.slam.submaps import apply_corrections
from mapcli.model.knowledge import Knowledge
from mapcli.model.pose import Pose2D
from mapcli.model.trace import Loop


@dataclass(frozen=True, slots=True)
class Link:
    """A loop, between scans of the same drive or of two."""

    from_drive: int
    to_drive: int
    loop: Loop


class Piece(NamedTuple):
    """A part of a drive that was tracked without a break: its first scan, and the earliest piece
    of all that loops join it with."""

    first: int
    group: int


class ClosedDrives:
    """All drives after loop closure.

    Attributes:
        drives: the oldest first; poses: of the scans of each, loops closed.
        links: the loops.
        wrong_lines: what a person told that is not so.
    """

    def __init__(
        self,
        drives: Sequence[Drive],
        parameters: SlamParameters,
        knowledge: Knowledge,
        progress: Callable[[int], None],
    ) -> None:
        trajectory = joined_trajectory(drives)
        loops = parameters.loops or LoopParameters()
        told = PersonsView.of(knowledge, [(one.name, one.poses) for one in drives])
        trajectory, wrong = told.followed(trajectory, parameters.odometry)
        closer = LoopCloser(trajectory.keyframes, parameters.map, loops, told.places)
        closer.run(progress)
        keep_loops_that_help(closer, trajectory)
        closed = closer.result()
        self.wrong_lines = [*wrong, *closer.wrong_lines()]
        self._pieces = _pieces_of(closer, trajectory)
        poses = apply_corrections(trajectory, closed.submaps, closed.origins)
        spans = trajectory.spans()
        self.drives = [
            _with_steps(drive, trajectory.steps[begin + 1 : end])
            for drive, (begin, end) in zip(drives, spans, strict=True)
        ]
        self.poses = [poses[begin:end] for begin, end in spans]
        loops_closed = loops_between_scans(trajectory, closed)
        self.links = [_link(loop, trajectory) for loop in loops_closed]

    def unjoined(self, drive: int, oldest: int) -> list[tuple[int, int]]:
        """First and last scans of the pieces of a drive that are joined with none of the oldest
        one's: nobody knows how they lie to the rest of the map."""
        known = {self._pieces[oldest][0].group}
        pieces = self._pieces[drive]
        ends = [*(one.first for one in pieces[1:]), len(self.poses[drive])]
        return [
            (one.first, end - 1)
            for one, end in zip(pieces, ends, strict=True)
            if one.group not in known
        ]

    def loops_to(self, drive: int) -> dict[str, int]:
        """How many loops lead from a drive to each other one, by name."""
        ends = [{link.from_drive, link.to_drive} - {drive} for link in self.links
                if drive in (link.from_drive, link.to_drive)]  # fmt: skip
        return dict(sorted(Counter(self.drives[k].name for other in ends for k in other).items()))

    def groups(self) -> list[list[int]]:
        """The drives that loops lead between, by their numbers, each group in order of age."""
        group = list(range(len(self.drives)))
        for link in self.links:
            group = merged(group, link.from_drive, link.to_drive)
        return [[k for k, own in enumerate(group) if own == g] for g in sorted(set(group))]


def _link(loop: Loop, trajectory: TrackedTrajectory) -> Link:
    """A loop between scans of all drives as one between those of each."""
    one, other = trajectory.drive_of(loop.from_), trajectory.drive_of(loop.to)
    from_, to = loop.from_ - trajectory.begins[one], loop.to - trajectory.begins[other]
    return Link(one, other, replace(loop, from_=from_, to=to))


def _pieces_of(closer: LoopCloser, trajectory: TrackedTrajectory) -> list[list[Piece]]:
    """The pieces of each drive."""
    pieces: list[list[Piece]] = [[] for _ in trajectory.begins]
    for k, submap in enumerate(closer.submaps):
        first = closer.keyframes[submap.first]
        if first.lost_since is not None or not k:
            scan = first.lost_since or 0
            drive = trajectory.drive_of(scan)
            pieces[drive].append(Piece(scan - trajectory.begins[drive], closer.pieces.group(k)))
    return pieces


def _with_steps(drive: Drive, steps: list[Pose2D | None]) -> Drive:
    """A drive that moved so from each scan to the next."""
    return replace(drive, trajectory=replace(drive.trajectory, steps=[None, *steps]))
