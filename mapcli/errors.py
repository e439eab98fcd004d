"""What mapcli raises when the data or the machine is at fault.

Every error is one sentence for a person: `FILE: WHERE: what is wrong; what was expected`.
`cli.py` is the only place that prints one. Wrong usage is click's own business (exit 2).
"""

from __future__ import annotations

from pathlib import Path


def printable(text: str) -> str:
    """Text on one line that a terminal shows and does not obey: what is not printable is escaped,
    as in `\\x1b`; a byte of a file name that is no UTF-8 is shown as that byte."""
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else _escaped(sign) for sign in text)


def _escaped(sign: str) -> str:
    if "\udc80" <= sign <= "\udcff":
        return f"\\x{ord(sign) & 0xFF:02x}"
    return sign.encode("unicode_escape").decode()


class MapcliError(Exception):
    """Something in the data is wrong; becomes `Error: ...` and exit code 1.

    Args:
        problem: what is wrong, with the offending value.
        file: the file it is wrong in (`-` for standard input), when there is one.
        where: the place in the file: a line, a key, a byte, a topic.
        expected: what would have been right.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        where: str | None = None,
        expected: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = file
        self.where = where
        self.expected = expected
        super().__init__(problem)

    def __str__(self) -> str:
        place = "".join(
            f"{printable(str(part))}: " for part in (self.file, self.where) if part is not None
        )
        tail = f"; expected {self.expected}" if self.expected else ""
        # One line, whatever a foreign library put into the text.
        return place + printable(" ".join(f"{self.problem}{tail}".split()))


class FormatError(MapcliError):
    """A file does not hold what its format promises (raised by `formats/` only)."""


class DataError(MapcliError):
    """A file is well formed, but the algorithm cannot work with what it says."""


class OutputError(MapcliError):
    """A result could not be written."""


class QualityError(MapcliError):
    """A limit set by `--fail-if` was not met; exit code 3."""
