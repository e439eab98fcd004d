"""`--fail-if`: limits on what a command found."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from mapcli.commands._options import Command
from mapcli.errors import DataError
from mapcli.model.limit import Limit, LimitFields


class LimitType(click.ParamType[Any]):
    """`used_share<0.95` on the command line, a `Limit` inside."""

    name = "EXPR"

    def __init__(self, fields: LimitFields, example: str) -> None:
        self.fields, self.example = fields, example

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if isinstance(value, Limit):
            return value
        try:
            return Limit.parse(value, self.fields, self.example)
        except DataError as error:
            self.fail(f"{error}.", param, ctx)


def limit_option(
    fields: LimitFields, example: str, listed: str | None = None
) -> Callable[[Command], Command]:
    """`--fail-if` of a command, as its parameter `limits`.

    Args:
        listed: how the help names the fields; by default one by one.
    """
    listed = listed or ", ".join(fields)
    text = f"Exit with 3 when this holds, e.g. {example}. Repeatable. Fields: {listed}."
    return click.option(
        "--fail-if", "limits", type=LimitType(fields, example), multiple=True, help=text
    )
