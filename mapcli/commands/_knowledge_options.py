"""What a person knows of a drive, as options."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

from mapcli.model.knowledge import Knowledge, Moment, NotSamePlace, SamePlace, TrustedOdometry
from mapcli.model.pose import Pose2D

Command = TypeVar("Command", bound=Callable[..., Any])


class KnowledgeType(click.ParamType[Any]):
    """A text on the command line, a record inside.

    Args:
        name: how it is written; read: makes the record of the text, or raises a ValueError.
    """

    def __init__(self, name: str, read: Callable[[str], Any]) -> None:
        self.name, self._read = name, read

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return self._read(value)
        except ValueError:
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)


def moment_of(text: str) -> Moment:
    """`12.5`, or `monday:12.5` of one drive of several."""
    drive, _, seconds = text.strip().rpartition(":")
    return Moment(_number(seconds), drive)


def same_place(text: str) -> SamePlace:
    one, other, *pose = text.split(",")
    if len(pose) not in (0, 3):
        raise ValueError(text)
    x, y, deg = map(_number, pose or ("0", "0", "0"))
    there = Pose2D(x, y, math.radians(deg)) if pose else None
    return SamePlace(moment_of(one), moment_of(other), there)


def not_same_place(text: str) -> NotSamePlace:
    one, other = text.split(",")
    return NotSamePlace(moment_of(one), moment_of(other))


def trusted_odometry(text: str) -> TrustedOdometry:
    begin, _, end = text.rpartition("-")
    first = moment_of(begin)
    last = Moment(_number(end), first.drive)
    if last.seconds <= first.seconds:
        raise ValueError(text)
    return TrustedOdometry(first, last)


def _number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(text)
    return number


OPTIONS = (
    click.option(
        "--same-place", "same", multiple=True,
        type=KnowledgeType("T1,T2[,X,Y,DEG]", same_place),
        help="The robot was at the same place at these times, seconds after the first scan (of "
        "several drives NAME:T); or at the second one at X,Y,DEG seen from the first. Repeatable.",
    ),
    click.option(
        "--not-same-place", "apart", multiple=True,
        type=KnowledgeType("T1,T2", not_same_place),
        help="It was at two places that look alike: no loop is closed between them. Repeatable.",
    ),
    click.option(
        "--trust-odometry", "trusted", multiple=True,
        type=KnowledgeType("T1-T2", trusted_odometry),
        help="The wheels were right from one time to the other. Repeatable.",
    ),
)  # fmt: skip


def knowledge_options(command: Command) -> Command:
    """Add the options; the command receives them as one argument, `knowledge: Knowledge`."""

    @wraps(command)
    def with_knowledge(*args: Any, same: Any, apart: Any, trusted: Any, **rest: Any) -> Any:
        return command(*args, knowledge=Knowledge(same, apart, trusted), **rest)

    for option in reversed(OPTIONS):
        with_knowledge = option(with_knowledge)
    return with_knowledge  # type: ignore[return-value]
