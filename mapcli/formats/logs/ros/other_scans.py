"""Scans in other messages than LaserScan: MultiEchoLaserScan as a `LaserScan`, and PointCloud2; in
CDR, and in ROS 1, where numbers are not aligned.

Every decoder raises ValueError for bytes that do not hold its message.
"""

from __future__ import annotations

import struct

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
from mapcli.formats.logs.ros.decode_ros1 import ORDER, ros1_header, ros1_scan_without_ranges
from mapcli.formats.logs.ros.point_cloud import NUMBER_TYPES, Layout, PointCloud, Points

MAX_FIELDS, MAX_ECHOES = 64, 64
"""Of a cloud, and of a beam; what has more is no such message."""

CDR_STEP, ROS1_STEP = 4, 1
"""Four-byte numbers begin at multiples of these."""


@refuses
def multi_echo_from_cdr(data: Buffer) -> LaserScan:
    """sensor_msgs/msg/MultiEchoLaserScan: the first echo of each beam, and no return without."""
    order, body = opened(data)
    scan, beams, at = scan_without_ranges(order, body)
    return LaserScan(*scan, ranges=_first_echoes(order, body, beams, at))


@refuses
def multi_echo_from_ros1(data: Buffer) -> LaserScan:
    scan, beams, at = ros1_scan_without_ranges(data)
    return LaserScan(*scan, ranges=_first_echoes(ORDER, data, beams, at))


def _first_echoes(order: str, body: Buffer, beams: int, at: int) -> NDArray[np.float32]:
    """The first of the echoes of each beam: a list of beams, each a list of echoes."""
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
    return ranges


@refuses
def cloud_from_cdr(data: Buffer) -> PointCloud:
    """sensor_msgs/msg/PointCloud2."""
    order, body = opened(data)
    stamp, frame, at = header_at(order, body, 0)
    return PointCloud(stamp, frame, _points(order, body, at, CDR_STEP))


@refuses
def cloud_from_ros1(data: Buffer) -> PointCloud:
    stamp, frame, at = ros1_header(data, 0)
    return PointCloud(stamp, frame, _points(ORDER, data, at, ROS1_STEP))


def _points(order: str, body: Buffer, at: int, step: int) -> Points:
    """The points of a PointCloud2, from what comes after its header.

    Args:
        step: four-byte numbers begin at multiples of it.
    """
    at += -at % step
    height, width, count = struct.unpack_from(f"{order}3I", body, at)
    at += 12
    if count > MAX_FIELDS:
        raise ValueError(f"{count} fields")
    fields = []
    for _ in range(count):
        name, at = string_at(order, body, at + -at % step)
        at += -at % step
        offset, kind = struct.unpack_from(f"{order}IB", body, at)
        at += 5 + -(at + 5) % step
        (numbers,) = struct.unpack_from(f"{order}I", body, at)
        at += 4
        if numbers == 1:
            fields.append((name, NUMBER_TYPES[kind], offset))
    (big_endian,) = struct.unpack_from("B", body, at)
    at += 1 + -(at + 1) % step
    point_step, row_step, size = struct.unpack_from(f"{order}3I", body, at)
    at += 12
    if at + size > len(body):
        raise ValueError("points are missing")
    layout = Layout(fields, height, width, point_step, row_step, ">" if big_endian else "<")
    return layout.points(memoryview(body)[at : at + size])
