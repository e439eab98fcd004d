"""The options that several commands share: one flag, one meaning, one default."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

import click

from mapcli import memory, notices
from mapcli.commands._say import note_meanwhile
from mapcli.formats.input import pipes_kept
from mapcli.model.pose import FARTHEST_M, Pose2D
from mapcli.model.scan import LATEST_STAMP_S

Command = TypeVar("Command", bound=Callable[..., Any])


FILE = click.Path(readable=False, allow_dash=True)
"""A file's name, not looked at here; lets shells complete it."""


class Number(click.FloatRange):
    """A finite number in a range: "nan" is of no range, though every comparison lets it pass."""

    name = "number"
    farthest: ClassVar[float] = FARTHEST_M

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        if abs(number) > self.farthest:
            self.fail(f"{value!r} is more than {self.farthest:g}.", param, ctx)
        return number


class UnixTime(Number):
    """Seconds since 1970, as far as logs can tell them."""

    farthest = LATEST_STAMP_S


POSITIVE = Number(0, min_open=True)
UNIX_TIME = UnixTime(0)
NOT_NEGATIVE = Number(0)


class NumberList(click.ParamType[Any]):
    """`X,Y,YAW_DEG` and the like: a fixed count of numbers separated by commas."""

    def __init__(self, metavar: str, cast: type = float) -> None:
        self.name = metavar
        self.count = metavar.count(",") + 1
        self.cast = cast

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Any, ...]:
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(self.cast(part) for part in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != self.count or not all(math.isfinite(n) for n in numbers):
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)
        if any(abs(number) > FARTHEST_M for number in numbers):
            self.fail(f"{value!r} has a number beyond {FARTHEST_M:g}.", param, ctx)
        return numbers


MOST_NUMBERS = 20
"""Of a list that may have any length."""


def numbers_in(value: Any) -> tuple[float, ...]:
    """The numbers of `1,2,3`; none if one of them is none."""
    try:
        return tuple(float(part) for part in str(value).split(","))
    except ValueError:
        return ()


class Numbers(click.ParamType[Any]):
    """`1,2,3`: some numbers separated by commas, each within bounds."""

    def __init__(self, metavar: str, low: float, high: float) -> None:
        self.name, self.low, self.high = metavar, low, high

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        numbers = numbers_in(value)
        able = all(self.low <= number <= self.high for number in numbers)
        if not able or not 1 <= len(numbers) <= MOST_NUMBERS:
            self.fail(
                f"{value!r} is not of the form {self.name}: up to {MOST_NUMBERS} numbers from "
                f"{self.low:g} to {self.high:g}.",
                param,
                ctx,
            )
        return numbers


CELL = NumberList("ROW,COL", int)
POINT = NumberList("X,Y")


class PoseType(NumberList):
    """`X,Y,YAW_DEG` on the command line, a `Pose2D` in radians inside."""

    def __init__(self, metavar: str = "X,Y,YAW_DEG") -> None:
        super().__init__(metavar)

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, Pose2D):
            return value
        x, y, degrees = super().convert(value, param, ctx)
        return Pose2D(x, y, math.radians(degrees))


POSE = PoseType()


class SizeType(click.ParamType[int]):
    """`500M`, `2G`, `1.5G`: bytes, in powers of a thousand."""

    name = "SIZE"
    factors: ClassVar = {"": 1, "K": 1e3, "M": 1e6, "G": 1e9, "T": 1e12}

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        match = re.fullmatch(r"(\d+(?:\.\d*)?) ?([KMGT]?)B?", str(value), re.IGNORECASE | re.ASCII)
        size = float(match[1]) * self.factors[match[2].upper()] if match else 0.0
        if not 0 < size < 1e18:
            self.fail(f"{value!r} is no size such as 500M or 2G.", param, ctx)
        return int(size)


def _limit_memory(ctx: click.Context, parameter: click.Parameter, size: int | None) -> None:
    memory.limit_to(size)


def _prepare(ctx: click.Context, parameter: click.Parameter, quiet: bool) -> bool:
    """Tell on stderr what algorithms have to say, unless -q. Read pipes as files."""
    ctx.with_resource(pipes_kept())
    waits = sys.stderr is not None and sys.stderr.isatty()
    notices.listen(
        note=None if quiet else note_meanwhile,
        progress=None if quiet or not waits else note_meanwhile,
    )
    return quiet


def common_options(command: Command) -> Command:
    """`-q`, `-v`, `--debug` and `--max-memory`, which every command has."""
    for option in (
        click.option(
            "--max-memory",
            type=SizeType(),
            expose_value=False,
            callback=_limit_memory,
            help="Refuse what would take more memory, such as 2G.  [default: half of what the "
            "machine or its control group allows]",
        ),
        click.option(
            "--debug", is_flag=True, expose_value=False, help="Show the traceback of an error."
        ),
        click.option("-v", "--verbose", is_flag=True, help="Say more on stderr."),
        click.option(
            "-q", "--quiet", is_flag=True, callback=_prepare, help="Say nothing but errors."
        ),
    ):
        command = option(command)
    return command


no_clobber_option = click.option(
    "--no-clobber", is_flag=True, help="Refuse to replace a file that exists."
)
