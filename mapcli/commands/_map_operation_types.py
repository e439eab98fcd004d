"""What the operations of `mapcli transform` take on the command line."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import click

from mapcli.commands._options import NumberList, PoseType
from mapcli.formats.number_pattern import NUMBER

SEARCH = "search"


class Crop(NumberList):
    """`known`, or a box in metres."""

    def __init__(self) -> None:
        super().__init__("LEFT,BOTTOM,RIGHT,TOP")

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return f"known|{self.name}"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        return value if value == "known" else super().convert(value, param, ctx)


class MergeType(click.Path):
    """`MAP`, `MAP@X,Y,YAW_DEG` or `MAP@search`: a file, and how its world is moved."""

    name = "MAP[@X,Y,YAW_DEG|@search]"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, tuple):
            return value
        file, _, motion = str(value).rpartition("@")
        if file and motion == SEARCH:
            return file, SEARCH
        if file and "," in motion:
            return file, PoseType().convert(motion, param, ctx)
        return str(value), None


MERGE = MergeType()


@dataclass(frozen=True)
class CellsToSet:
    """The cells from one corner to the other, both with them, and what they become.

    Attributes:
        text: as typed; corners: (row, column) of each; probability: NaN for unknown.
    """

    text: str
    corners: tuple[tuple[int, int], tuple[int, int]]
    probability: float


class SetType(click.ParamType[Any]):
    """`ROW,COL=P` or `ROW,COL:ROW,COL=P`, with `?` for unknown."""

    name = "ROW,COL[:ROW,COL]=P"
    pattern = re.compile(rf"(\d+),(\d+)(?::(\d+),(\d+))?=(\?|{NUMBER.pattern})", re.ASCII)

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return self.name

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, CellsToSet):
            return value
        found = self.pattern.fullmatch(str(value))
        if not found:
            self.fail(f"{value!r} is not of the form {self.name}.", param, ctx)
        first = int(found[1]), int(found[2])
        last = (int(found[3]), int(found[4])) if found[3] else first
        probability = math.nan if found[5] == "?" else float(found[5])
        if not (math.isnan(probability) or 0 <= probability <= 1):
            self.fail(f"{found[5]} is no probability from 0 to 1, and not ?.", param, ctx)
        return CellsToSet(str(value), (first, last), probability)


SET = SetType()
