"""The result of a replay as MCAP, to be laid over the log it came from (Foxglove, RViz).

/pose       geometry_msgs/msg/PoseStamped   the robot in map, at every scan
/path       nav_msgs/msg/Path               all of them, at the end
/tf         tf2_msgs/msg/TFMessage          map -> base_link
/map        nav_msgs/msg/OccupancyGrid      the final map, latched
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.formats.logs.ros import messages as ros
from mapcli.formats.logs.topics import LogNames
from mapcli.model.grid import GridMap
from mapcli.model.trace import PoseTrace, TracedPose

OCCUPANCY_GRID = "nav_msgs/msg/OccupancyGrid"
PATH = "nav_msgs/msg/Path"
MAP_FRAME, ROBOT_FRAME = LogNames().map_frame, LogNames().base_frame


def write_result(stream: BinaryIO, grid: GridMap, trace: PoseTrace) -> None:
    """Write the map and the poses of a replay.

    Raises:
        DataError: a stamp does not fit into a ROS 2 time.
    """
    with McapLogWriter(stream) as writer:
        for traced in trace.poses:
            pose = traced.pose
            transform = ros.transform_stamped(traced.stamp_ns, MAP_FRAME, ROBOT_FRAME, pose)
            message = ros.build(ros.TF_MESSAGE, [transform])
            writer.message("/tf", ros.TF_MESSAGE, message, traced.stamp_ns)
            writer.message("/pose", ros.POSE_STAMPED, _stamped(traced), traced.stamp_ns)
        end_ns = trace.poses[-1].stamp_ns
        path = ros.build(PATH, ros.header(end_ns, MAP_FRAME), [_stamped(p) for p in trace.poses])
        writer.message("/path", PATH, path, end_ns, latched=True)
        writer.message("/map", OCCUPANCY_GRID, _occupancy_grid(grid, end_ns), end_ns, latched=True)


def _stamped(traced: TracedPose) -> object:
    pose = ros.pose_message(traced.pose)
    return ros.build(ros.POSE_STAMPED, ros.header(traced.stamp_ns, MAP_FRAME), pose)


def _occupancy_grid(grid: GridMap, stamp_ns: int) -> object:
    """Percent from the bottom row up, -1 where unknown."""
    cells = grid.bottom_up()
    percent = np.rint(np.where(np.isnan(cells), -0.01, cells) * 100).astype(np.int8)
    head = ros.header(stamp_ns, MAP_FRAME)
    info = ros.build(
        "nav_msgs/msg/MapMetaData",
        head.stamp,
        grid.resolution,
        grid.columns,
        grid.rows,
        ros.pose_message(grid.origin),
    )
    return ros.build(OCCUPANCY_GRID, head, info, percent.ravel())
