"""What the lines of a CARMEN log tell before it is read: counts, stamps, and where lasers sit."""

from __future__ import annotations

import math
from collections.abc import Iterable

from mapcli.formats.logs.carmen_messages import GFS_ODOM_WORDS, SHORT, LaserMessage
from mapcli.formats.logs.clock_faults import LineStamps
from mapcli.model.pose import Pose2D, rounded_angle, wrap_angle
from mapcli.model.scan import Mount, Odometry

FIRST_SCANS = 50
"""Of each laser; their mounts and ranges are looked at."""

MOUNT_TOLERANCE_M, MOUNT_TOLERANCE_RAD = 0.002, math.radians(0.1)

PLACES = {"FLASER": "front", "RAWLASER1": "front", "ROBOTLASER1": "front",
          "RLASER": "rear", "RAWLASER2": "rear", "ROBOTLASER2": "rear"}  # fmt: skip
"""Message -> which laser of the robot it is from, as parameters call it."""

TAIL_WORDS = 3
"""Of a line: the time of its message, the host, the time of its logging."""


class CarmenSurvey:
    """The first pass over a log (stateful).

    Attributes:
        counts: messages by name, whether they are well formed or not.
        stamps: for each file, name of a message -> the stamps on its lines.
        parameters: of the robot, by name.
    """

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        self.stamps: list[dict[str, LineStamps]] = []
        self.parameters: dict[str, str] = {}
        self._offsets: dict[str, list[Pose2D]] = {}
        self._farthest: dict[str, float] = {}
        self._looked_at: dict[str, int] = {}

    def add_parameter(self, line: bytes) -> None:
        words = line.decode("ascii", "replace").split(None, 3)
        if len(words) > 2:
            self.parameters[words[1]] = words[2]

    def add_stamps(self, name: str, number: int, line: bytes) -> None:
        """Note when a line is from, if it tells."""
        words = line.rsplit(None, TAIL_WORDS)
        is_short = name.encode() in SHORT or (
            name == "ODOM" and len(line.split(None, GFS_ODOM_WORDS)) == GFS_ODOM_WORDS
        )
        try:
            log = float(words[-1])
            header = log if is_short else float(words[-TAIL_WORDS]) or log
        except (ValueError, IndexError):
            return
        if math.isfinite(header) and math.isfinite(log):
            self.stamps[-1].setdefault(name, LineStamps()).add(number, header, log)

    def wants(self, name: str) -> bool:
        """Whether the next message of this name is to be parsed."""
        return self._looked_at.get(name, 0) <= FIRST_SCANS

    def add(self, name: str, message: LaserMessage | Odometry) -> None:
        self._looked_at[name] = self._looked_at.get(name, 0) + 1
        if not isinstance(message, LaserMessage):
            return
        if message.robot is not None and message.laser is not None:
            self._offsets.setdefault(name, []).append(message.robot.between(message.laser))
        farthest = float(message.ranges.max(initial=0.0, where=message.ranges < math.inf))
        self._farthest[name] = max(self._farthest.get(name, 0.0), farthest)

    def mount(self, name: str) -> Mount | None:
        """The laser's pose on the robot, by the poses in its messages or else by the parameters;
        None if the poses do not agree about it, and no parameter tells."""
        found = _agreed(self._offsets.get(name, ()))
        told = self._told_mount(PLACES.get(name, ""))
        return told if told is not None and found in (None, Mount()) else found

    def _told_mount(self, place: str) -> Mount | None:
        """By the parameters."""
        names = [f"robot_{place}laser_{what}offset" for what in ("", "side_", "angular_")]
        if names[0] not in self.parameters:
            return None
        x, y, degrees = (self._number(name) for name in names)
        return Mount(Pose2D(x, y, rounded_angle(wrap_angle(math.radians(degrees)))))

    def max_range(self, name: str) -> float:
        """Of a laser, as a parameter has it, metres; 0 where none does, or readings deny it."""
        told = self._number(f"robot_{PLACES.get(name, '')}_laser_max")
        return told if self._farthest.get(name, 0.0) <= told else 0.0

    def _number(self, name: str) -> float:
        """The value of a parameter; 0 where it has none."""
        try:
            value = float(self.parameters.get(name, "0"))
        except ValueError:
            return 0.0
        return value if math.isfinite(value) else 0.0


def _agreed(offsets: Iterable[Pose2D]) -> Mount | None:
    """The pose of a laser on the robot; None if the first scans do not agree about it."""
    first, *others = list(offsets) or [Pose2D()]
    for other in others:
        turn = abs(wrap_angle(other.theta - first.theta))
        if first.distance(other) > MOUNT_TOLERANCE_M or turn > MOUNT_TOLERANCE_RAD:
            return None
    # The log's six decimals carry no more than this.
    x, y, theta = (round(value, 4) + 0.0 for value in (first.x, first.y, first.theta))
    return Mount(Pose2D(x, y, rounded_angle(theta)))
