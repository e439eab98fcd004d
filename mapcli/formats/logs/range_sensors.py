"""Range sensors with one beam, as logs have them: sonars, infrared sensors, switches.

REP 117 holds for their readings: +inf is nothing seen, -inf something too close. A sensor whose
limits are the same is a switch: it tells only whether something is within its distance, and the
obstacle counts as being there (as in Nav2's range sensor layer). Ground sensors look at the floor;
their readings are counted, and are no scans.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.rep117 import rep117, sensible_limits, single
from mapcli.model.counting import counted
from mapcli.model.log import BeamCounts, SensorCounts, SensorKind
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Mount


@dataclass(frozen=True)
class RangeSensor:
    """A sensor of a log.

    Attributes:
        name: of its topic or column.
        mount: where it sits; None for one that looks at the floor, or up.
        range_min, range_max: metres, as the log tells them; the same for a switch.
        field_of_view: radians.
    """

    name: str
    mount: Mount | None
    range_min: float
    range_max: float
    field_of_view: float = 0.0

    @property
    def is_switch(self) -> bool:
        return 0 < self.range_min == self.range_max < math.inf

    @property
    def limits(self) -> tuple[float, float]:
        """Least and greatest reading, metres, as far as they make sense."""
        if self.is_switch:
            return self.range_min, self.range_max
        return sensible_limits(self.range_min, self.range_max)

    def counts(self) -> SensorCounts:
        """Of no reading yet."""
        kind: SensorKind = "switch" if self.is_switch else "distance"
        if self.mount is None:
            kind = "ground"
        return SensorCounts(self.name, kind, self.mount, *self.limits, self.field_of_view)

    def reading(
        self, value: float, stamp_ns: int, beams: BeamCounts, counts: SensorCounts
    ) -> RangeReading | None:
        """A reading, metres, as a record; None of a sensor that is not used. It is counted."""
        low, high = self.limits
        counts.add(value)
        if self.mount is None:
            return None
        ranges = np.array([single(value)], dtype=np.float32)
        if self.is_switch:
            ranges = _switched(ranges, high)
            beams.total += 1
            beams.no_return += int(np.isposinf(ranges[0]))
            beams.invalid += int(np.isnan(ranges[0]))
        else:
            ranges = rep117(ranges, low, high, beams)
        return RangeReading(
            stamp_ns, 0.0, 0.0, ranges, low, high, self.mount,
            sensor=self.name, field_of_view=self.field_of_view,
        )  # fmt: skip


def _switched(ranges: NDArray[np.float32], distance: float) -> NDArray[np.float32]:
    """What a switch says: something at its distance, or nothing until there."""
    limit = np.float32(distance)
    said = np.where(ranges <= limit, limit, np.float32(np.inf))
    return np.where(np.isnan(ranges), np.float32(np.nan), said).astype(np.float32)


def sensor_lines(sensors: Iterable[SensorCounts]) -> Iterator[str]:
    """How the sensors of a log are used, for a person."""
    sensors = list(sensors)
    used = [sensor for sensor in sensors if sensor.kind != "ground"]
    readings = sum(sensor.readings for sensor in used)
    if len({sensor.mount for sensor in used}) > 1:
        yield (
            f"{len(used)} range sensors, {counted(readings, 'readings')}: what they read over a "
            "short way is one scan (--gather)"
        )
    if idle := [sensor.name for sensor in sensors if sensor.kind == "ground"]:
        yield (
            f"{', '.join(idle)}: not used, as {'it looks' if len(idle) == 1 else 'they look'} "
            "at the floor or up"
        )
