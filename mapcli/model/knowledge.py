"""What a person knows of a drive, and the robot does not: constraints for the back end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.model.pose import Pose2D
from mapcli.model.scan import NANOSECONDS


@dataclass(frozen=True, slots=True)
class Moment:
    """A time in a drive.

    Attributes:
        seconds: after its first scan.
        drive: its name, where there are several; empty of the only one.
    """

    seconds: float
    drive: str = ""

    def __str__(self) -> str:
        return f"{self.drive}:{self.seconds:g}" if self.drive else f"{self.seconds:g}"


@dataclass(frozen=True, slots=True)
class SamePlace:
    """The robot was at the same place at two times.

    Attributes:
        pose: of the robot at the second one, seen from the first one; None is about the same place,
            whichever way it looked.
    """

    one: Moment
    other: Moment
    pose: Pose2D | None = None

    def __str__(self) -> str:
        told = ""
        if self.pose is not None:
            told = f",{self.pose.x:g},{self.pose.y:g},{np.degrees(self.pose.theta):g}"
        return f"--same-place {self.one},{self.other}{told}"


@dataclass(frozen=True, slots=True)
class NotSamePlace:
    """The robot was at different places, which may look alike."""

    one: Moment
    other: Moment


@dataclass(frozen=True, slots=True)
class TrustedOdometry:
    """From one time to another the wheels were right, whatever scans seem to say."""

    first: Moment
    last: Moment

    def __str__(self) -> str:
        return f"--trust-odometry {self.first}-{self.last}"


@dataclass(frozen=True, slots=True)
class Knowledge:
    """All that a person knows."""

    same: tuple[SamePlace, ...] = ()
    apart: tuple[NotSamePlace, ...] = ()
    trusted: tuple[TrustedOdometry, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.same or self.apart or self.trusted)


NOTHING_KNOWN = Knowledge()


def scan_at(moment: Moment, stamps_ns: Sequence[int] | NDArray[np.int64]) -> int:
    """The number of the scan nearest to a time.

    Args:
        stamps_ns: of the scans of its drive.

    Raises:
        DataError: the drive does not last so long.
    """
    seconds = (np.asarray(stamps_ns, np.int64) - stamps_ns[0]) / NANOSECONDS
    if not 0 <= moment.seconds <= seconds[-1] + 0.5:
        raise DataError(
            f"{moment} s is not a time of the drive", expected=f"0 to {seconds[-1]:.1f} s"
        )
    return int(np.argmin(np.abs(seconds - moment.seconds)))
