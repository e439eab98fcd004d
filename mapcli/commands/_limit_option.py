"""`--fail-if`: limits on what a command found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from mapcli.errors import DataError
from mapcli.model.summary import LIMIT_FIELDS, Limit


class LimitType(click.ParamType[Any]):
    """`used_share<0.95` on the command line, a `Limit` inside."""

    name = "EXPR"

    def __init__(
        self, fields: Sequence[str] = LIMIT_FIELDS, example: str = "used_share<0.95"
    ) -> None:
        self.fields, self.example = fields, example

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, Limit):
            return value
        try:
            return Limit.parse(value, self.fields, self.example)
        except DataError as error:
            self.fail(f"{error}.", param, ctx)
