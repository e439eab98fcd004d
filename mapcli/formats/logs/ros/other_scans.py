"""Scans in other messages than LaserScan: MultiEchoLaserScan and PointCloud2, as a `LaserScan`.

Every decoder raises ValueError for bytes that do not hold its message.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.logs.ros.decode import (
    Buffer,
    LaserScan,
    header_at,
    opened,
    refuses,
    scan_without_ranges,
    string_at,
)

MAX_FIELDS, MAX_ECHOES = 64, 64
"""Of a cloud, and of a beam; what has more is no such message."""

BEARINGS = 1440
"""Bearings that a cloud is sorted into, a quarter of a degree each: those of spinning 2D lasers are
among them, and others are moved by an eighth of a degree at most."""

NUMBER_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField: `datatype` -> numpy's name for it."""


class Band(NamedTuple):
    """Heights of the points of a cloud that count, metres in the frame of the sensor."""

    low: float
    high: float


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """The fields of a cloud that matter here; x, y, z: of its points, shape (n,), metres."""

    stamp_ns: int
    frame: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]


@refuses
def scan_from_multi_echo_cdr(data: Buffer) -> LaserScan:
    """sensor_msgs/msg/MultiEchoLaserScan: the first echo of each beam, and no return without."""
    order, body = opened(data)
    scan, beams, at = scan_without_ranges(order, body)
    ranges = np.full(min(beams, len(body) // 4), np.inf, np.float32)
    for beam in range(len(ranges)):
        (echoes,) = struct.unpack_from(f"{order}I", body, at)
        if echoes > MAX_ECHOES:
            raise ValueError(f"{echoes} echoes of a beam")
        if echoes:
            (ranges[beam],) = struct.unpack_from(f"{order}f", body, at + 4)
        at += 4 + 4 * echoes
    if at > len(body) or len(ranges) < beams:
        raise ValueError("beams are missing")
    return LaserScan(*scan, ranges=ranges)


@refuses
def cloud_from_cdr(data: Buffer) -> PointCloud:
    """sensor_msgs/msg/PointCloud2."""
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    at += -at % 4
    height, width, fields = struct.unpack_from(f"{order}3I", body, at)
    at += 12
    if fields > MAX_FIELDS:
        raise ValueError(f"{fields} fields")
    names, formats, offsets = [], [], []
    for _ in range(fields):
        name, at = string_at(order, body, at + -at % 4)
        at += -at % 4
        offset, kind, _, count = struct.unpack_from(f"{order}IB3sI", body, at)
        at += 12
        if name in ("x", "y", "z") and count == 1:
            names.append(name)
            formats.append(NUMBER_TYPES[kind])
            offsets.append(offset)
    big_endian, point_step, row_step, size = struct.unpack_from(f"{order}B3x3I", body, at)
    at += 16
    end = ">" if big_endian else "<"
    point = np.dtype({"names": names, "formats": [f"{end}{one}" for one in formats],
                      "offsets": offsets, "itemsize": point_step})  # fmt: skip
    rows = np.frombuffer(body, np.uint8, size, at).reshape(height, row_step)
    points = np.ascontiguousarray(rows[:, : width * point_step]).reshape(-1).view(point)
    x, y, z = (points[axis].astype(np.float64) for axis in "xyz")
    return PointCloud(stamp, frame, x, y, z)


def scan_of_cloud(cloud: PointCloud, band: Band) -> LaserScan:
    """Of the points in a band of heights, the nearest of each bearing.

    A bearing without one says nothing (NaN): a cloud does not tell what was looked at in vain.
    """
    x, y, z = cloud.x, cloud.y, cloud.z
    used = (z >= band.low) & (z <= band.high) & np.isfinite(x) & np.isfinite(y)
    ranges, step = _nearest(x[used], y[used]), math.tau / BEARINGS
    return LaserScan(
        cloud.stamp_ns, cloud.frame, -math.pi, math.pi - step, step, 0.0, 0.0, math.inf, ranges
    )


def _nearest(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float32]:
    """Distance of the nearest point of each bearing from -180 degrees on; NaN without one."""
    away, bearing = np.hypot(x, y), np.arctan2(y, x)
    place = np.rint((bearing + math.pi) * (BEARINGS / math.tau)).astype(np.int64) % BEARINGS
    ranges = np.full(BEARINGS, np.inf)
    np.minimum.at(ranges, place[away > 0], away[away > 0])
    ranges[np.isinf(ranges)] = np.nan
    return ranges.astype(np.float32)
