"""Point clouds of any dress, and the scan along the floor that is in one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.ros.decode import LaserScan

BEARINGS = 1440
"""Bearings that a cloud is sorted into, a quarter of a degree each: those of spinning 2D lasers are
among them, and others are moved by an eighth of a degree at most."""

NUMBER_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField: `datatype` -> numpy's name for it."""


class Band(NamedTuple):
    """Heights of the points of a cloud that count, metres in the frame of the sensor."""

    low: float
    high: float


class Points(NamedTuple):
    """Coordinates of points, shape (n,), metres."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """The fields of a cloud that matter here; `origin` as of `LaserScan`."""

    stamp_ns: int
    frame: str
    points: Points
    origin: tuple[float, ...] = ()


class Layout(NamedTuple):
    """Where the numbers of a cloud's points are in its bytes.

    Attributes:
        fields: (name, numpy's name of the type, offset in the point), one number each.
        point_step, row_step: bytes from point to point, and from row to row.
        order: of the bytes of a number, `<` or `>`.
    """

    fields: list[tuple[str, str, int]]
    height: int
    width: int
    point_step: int
    row_step: int
    order: str = "<"

    def points(self, data: bytes | memoryview) -> Points:
        """x, y and z of the points.

        Raises:
            ValueError, KeyError, TypeError: the bytes are not laid out so.
        """
        used = [field for field in self.fields if field[0] in ("x", "y", "z")]
        point = np.dtype({
            "names": [name for name, _, _ in used],
            "formats": [f"{self.order}{number}" for _, number, _ in used],
            "offsets": [offset for _, _, offset in used],
            "itemsize": self.point_step,
        })  # fmt: skip
        rows = np.frombuffer(data, np.uint8).reshape(self.height, self.row_step)
        packed = np.ascontiguousarray(rows[:, : self.width * self.point_step]).reshape(-1)
        points = packed.view(point)
        return Points(*(points[axis].astype(np.float64) for axis in "xyz"))


def scan_of_cloud(cloud: PointCloud, band: Band) -> LaserScan:
    """Of the points in a band of heights, the nearest of each bearing.

    A bearing without one says nothing (NaN): a cloud does not tell what was looked at in vain.
    """
    x, y, z = cloud.points
    used = (z >= band.low) & (z <= band.high) & np.isfinite(x) & np.isfinite(y)
    ranges, step = _nearest(x[used], y[used]), math.tau / BEARINGS
    return LaserScan(
        cloud.stamp_ns,
        cloud.frame,
        -math.pi,
        math.pi - step,
        step,
        0.0,
        0.0,
        math.inf,
        ranges,
        cloud.origin,
    )


def _nearest(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float32]:
    """Distance of the nearest point of each bearing from -180 degrees on; NaN without one."""
    away, bearing = np.hypot(x, y), np.arctan2(y, x)
    place = np.rint((bearing + math.pi) * (BEARINGS / math.tau)).astype(np.int64) % BEARINGS
    ranges = np.full(BEARINGS, np.inf)
    np.minimum.at(ranges, place[away > 0], away[away > 0])
    ranges[np.isinf(ranges)] = np.nan
    return ranges.astype(np.float32)
