"""Limits on what a command found: `--fail-if 'used_share<0.95'`."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mapcli.errors import DataError, QualityError

LimitFields = Mapping[str, Sequence[str]]
"""Field of a summary -> the words that it may be; no words for numbers."""

Values = Mapping[str, float | str]
"""Field -> what was found."""


COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}


def limit_fields(names: Iterable[str], **words: Sequence[str]) -> LimitFields:
    """Fields of these names; of some of them, the words that they may be."""
    return {name: words.get(name, ()) for name in names}


@dataclass(frozen=True, slots=True)
class Limit:
    """One comparison of `--fail-if`: fail when `field` compares so to `value`."""

    field: str
    comparison: str
    value: float | str

    @classmethod
    def parse(cls, text: str, fields: LimitFields, example: str) -> Limit:
        """`used_share<0.95`, about one of these fields.

        Raises:
            DataError: not of that form, or about nothing that the summary has.
        """
        match = re.fullmatch(r"\s*(\w+)\s*(<=|>=|==|!=|<|>)\s*([-+.\w]+)\s*", text)
        if match is None:
            raise DataError(f"{text!r}", expected=f"a limit such as '{example}'")
        name, comparison, value = match.groups()
        if name not in fields:
            expected = f"one of {', '.join(fields)}"
            raise DataError(f"{text!r}: no {name!r} in the summary", expected=expected)
        if not fields[name]:
            return cls(name, comparison, _number(value, text, example))
        if comparison not in ("==", "!="):
            expected = f"{name}== or {name}!=, since its values are words"
            raise DataError(f"{text!r}", expected=expected)
        if value not in fields[name]:
            raise DataError(f"{text!r}", expected=f"one of {', '.join(fields[name])}")
        return cls(name, comparison, value)

    def check(self, values: Values, name: str) -> None:
        """Fail if the limit is not met.

        Raises:
            QualityError: the comparison holds.
        """
        found = values[self.field]
        if COMPARISONS[self.comparison](found, self.value):
            raise QualityError(
                f"{self.field} is {_shown(found)}",
                file=name,
                expected=f"not {self.field}{self.comparison}{_shown(self.value)} (--fail-if)",
            )


def _number(text: str, limit: str, example: str) -> float:
    """A number of a limit.

    Raises:
        DataError: it is none.
    """
    try:
        if not re.fullmatch(r"[-+.\deE]+", text):
            raise ValueError
        return float(text)
    except ValueError:
        raise DataError(f"{limit!r}", expected=f"a limit such as '{example}'") from None


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"
