"""Places of sensors on the robot, as options."""

from __future__ import annotations

from typing import Any

import click

from mapcli.commands._options import POSE
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Mount

FARTHEST_LASER = 100.0
"""Metres; a laser farther from its robot is a mistake, such as millimetres."""


class LaserPoseType(click.ParamType[Any]):
    """`X,Y,YAW_DEG[,flip]` on the command line, a `Mount` inside."""

    name = "X,Y,YAW_DEG[,flip]"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, Mount):
            return value
        numbers, comma, last = str(value).rpartition(",")
        flipped = comma and last.strip() == "flip"
        try:
            mount = Mount(POSE.convert(numbers if flipped else value, param, ctx), bool(flipped))
        except click.BadParameter:
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)
        if mount.pose.distance(Pose2D()) > FARTHEST_LASER:
            self.fail(f"{value!r} is more than {FARTHEST_LASER:g} m off the robot.", param, ctx)
        return mount


class SensorType(click.ParamType[Any]):
    """`NAME=X,Y,YAW_DEG` on the command line, a name and a `Mount` inside.

    Args:
        form: how it is written, with what the name is of.
    """

    def __init__(self, form: str) -> None:
        self.name = form

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, tuple):
            return value
        named, sign, pose = str(value).rpartition("=")
        if not (named and sign):
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)
        return named.strip(), LaserPoseType().convert(pose, param, ctx)
