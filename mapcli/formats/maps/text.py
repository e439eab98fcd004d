"""Maps as text, as the book prints them.

    # a comment, from `#` to the end of the line
    resolution: 0.05              metres per cell; 1 when absent
    origin: -7.14, -7.83, 0       x, y, yaw (radians) of the outer corner bottom left; 0 when absent
    ?    0.1  0.1  1              one row of cells, the top row first

Header lines come before the first row. A file has one of two forms:

- **numbers**: a row is cells separated by blanks, a cell is a number from 0 to 1, or `?`.
- **characters**: a row is a word of `#` (obstacle, 1), `.` (open, 0) and `?`, one per cell.

A file is in the number form when, comments and headers aside, some line has a digit or a blank
between two words; else it is in the character form. There a line made of nothing but `#`, `.` and
`?` is always a row, so a comment must have some other character, be it a blank: `# like this`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError, FormatError
from mapcli.formats.number_pattern import NUMBER
from mapcli.model.grid import PROBABILITIES, UNKNOWN_PERCENT, GridMap
from mapcli.model.pose import Pose2D

CHARACTER_ROW = re.compile(r"[#.?]+")

_HEADER = re.compile(r"([A-Za-z_]+)\s*:(.*)")
_NUMBER_FORM = re.compile(r"\d|\S\s+\S")
_CODES = {"#": 1.0, ".": 0.0, "?": np.nan}
_MEMO_LIMIT = 100_000


class CellTokens(dict[str, float]):
    """Token -> probability, checked once for each distinct token: a map has few of them."""

    def __missing__(self, token: str) -> float:
        if token == "?":
            value = np.nan
        elif NUMBER.fullmatch(token) and 0 <= float(token) <= 1:
            value = float(token)
        else:
            raise ValueError(token)
        if len(self) < _MEMO_LIMIT:
            self[token] = value
        return value


def read_text(data: bytes, file: str) -> tuple[GridMap, str]:
    """Read a text map; also says which form it is in, "numbers" or "characters".

    Raises:
        FormatError: naming the line: ragged rows, a bad cell, a bad header, no rows.
    """
    numbers = any(map(_has_numbers, _lines(data)))
    rows = TextRows(file, limit=len(data))
    place: dict[str, list[float]] = {}
    for count, line in enumerate(_lines(data), start=1):
        content = _bare(line) if numbers else _character_line(line)
        header = _HEADER.fullmatch(content) if ":" in content else None
        if header:
            _add_header(place, header, count, file, late=bool(rows.rows))
        elif content and numbers:
            rows.add_numbers(content, f"line {count}")
        elif content:
            rows.add_characters(content, f"line {count}")
    return rows.grid(place), "numbers" if numbers else "characters"


def _lines(data: bytes) -> Iterator[str]:
    """One at a time: the text of a large map is large."""
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data
    for count, line in enumerate(io.BytesIO(data)):
        yield line.decode("utf-8" if count else "utf-8-sig", "replace").removesuffix("\n")


def _has_numbers(line: str) -> bool:
    """Whether a line, its comment and headers aside, can only stand in the number form."""
    content = _bare(line)
    odd = content.strip(".?")  # nothing is left of a row of characters
    return bool(odd) and ":" not in content and _NUMBER_FORM.search(content) is not None


def _bare(line: str) -> str:
    """A line of the number form without its comment; headers and blank lines alike."""
    return line.partition("#")[0].strip()


def _character_line(line: str) -> str:
    """A line of the character form, whole when it is a row: there `#` is an obstacle."""
    content = line.strip()
    if CHARACTER_ROW.fullmatch(content):
        return content
    return _bare(line) if content.startswith("#") or ":" in content else content


def _add_header(
    place: dict[str, list[float]], header: re.Match[str], line: int, file: str, *, late: bool
) -> None:
    key, value = header[1].lower(), header[2]
    words = value.strip().strip("[]").replace(",", " ").split()
    count = {"resolution": 1, "origin": 3}.get(key, 0)
    if late or key in place or len(words) != count or not all(map(NUMBER.fullmatch, words)):
        raise FormatError(
            f"{key}: {value.strip()!r}",
            file=file,
            where=f"line {line}",
            expected="resolution: METRES or origin: X, Y, YAW, each once, before the rows",
        )
    place[key] = [float(word) for word in words]


class TextRows:
    """Collects rows of cells, and checks that all have the same length (stateful).

    Args:
        file: for errors.
        limit: the most cells that a file of its length can hold; with aliases, a few bytes of
            YAML can claim any number.
    """

    def __init__(self, file: str, limit: int) -> None:
        self.file = file
        self.limit = limit
        self.count = 0
        self.tokens = CellTokens()
        self.rows: list[NDArray[Any]] = []
        self.percents = True
        self.first_place = ""

    def add_characters(self, content: str, place: str) -> None:
        """A row of `#`, `.` and `?`; `place` says where it stands, for errors."""
        if not CHARACTER_ROW.fullmatch(content):
            raise FormatError(
                f"row {content[:40]!r}",
                file=self.file,
                where=place,
                expected="one of #, . and ? for each cell",
            )
        codes = np.frombuffer(content.encode("ascii"), dtype=np.uint8)
        self.append(_CODE_TABLE[codes], place)

    def add_numbers(self, content: str, place: str) -> None:
        """A row of numbers and `?` with blanks between."""
        words = content.split()
        try:
            values = np.fromiter(map(self.tokens.__getitem__, words), np.float32, len(words))
        except ValueError as error:
            self._fail(words, str(error), place)
        self.append(values, place)

    def append(self, row: NDArray[np.float32], place: str) -> None:
        if not self.rows:
            self.first_place = place
        elif len(row) != len(self.rows[0]):
            raise FormatError(
                f"a row of {len(row)} cells",
                file=self.file,
                where=place,
                expected=f"{len(self.rows[0])} as in the first row ({self.first_place})",
            )
        self.count += len(row)
        if self.count > self.limit:
            raise FormatError(
                f"claims more than {self.limit:,} cells",
                file=self.file,
                where=place,
                expected="every cell written out",
            )
        self._keep(row)

    def _keep(self, row: NDArray[np.float32]) -> None:
        """As percents, a byte a cell, as long as all cells are whole percents."""
        if self.percents:
            percents = np.rint(row * np.float32(100))
            if np.array_equal(percents / np.float32(100), row, equal_nan=True):
                unknown = np.float32(UNKNOWN_PERCENT)
                self.rows.append(np.where(np.isnan(row), unknown, percents).astype(np.uint8))
                return
            self.percents = False
            self.rows = [PROBABILITIES[earlier] for earlier in self.rows]
        self.rows.append(row)

    def _fail(self, words: list[str], token: str, place: str) -> NoReturn:
        column = words.index(token) if token in words else 0
        raise FormatError(
            f"cell {token[:40]!r}",
            file=self.file,
            where=f"{place}, column {column}",
            expected="a probability from 0 to 1, or ?",
        )

    def grid(self, place: dict[str, list[float]]) -> GridMap:
        if not self.rows:
            raise FormatError("no rows of cells", file=self.file, expected="a map")
        resolution = place.get("resolution", [1.0])[0]
        try:
            return GridMap(
                np.vstack(self.rows), resolution, Pose2D(*place.get("origin", (0.0, 0.0, 0.0)))
            )
        except DataError as error:
            raise FormatError(error.problem, file=self.file, expected=error.expected) from error


_CODE_TABLE = np.full(256, np.nan, dtype=np.float32)
for _code, _value in _CODES.items():
    _CODE_TABLE[ord(_code)] = _value


def write_numbers(grid: GridMap, digits: int | None = None) -> Iterator[bytes]:
    """The number form, in pieces: the shortest numbers that read back as the same float32, in
    columns; or rounded to so many digits after the point."""
    yield _header_lines(grid)
    yield from number_rows(grid, digits)


def write_characters(grid: GridMap, free_thresh: float, occupied_thresh: float) -> Iterator[bytes]:
    """The character form, in pieces; cells between the thresholds become `?`."""

    def characters(cells: NDArray[np.float32]) -> NDArray[np.uint8]:
        codes = np.full(cells.shape, ord("?"), dtype=np.uint8)
        codes[cells <= free_thresh] = ord(".")
        codes[cells >= occupied_thresh] = ord("#")
        return codes

    yield _header_lines(grid)
    for band in grid.bands():
        lines = np.full((band.rows, band.columns + 1), ord("\n"), dtype=np.uint8)
        lines[:, :-1] = band.each(characters)
        yield lines.tobytes()


def _header_lines(grid: GridMap) -> bytes:
    lines = ""
    if grid.resolution != 1:
        lines += f"resolution: {float(grid.resolution)!r}\n"
    if grid.origin != Pose2D():
        x, y, yaw = map(float, (grid.origin.x, grid.origin.y, grid.origin.theta))
        lines += f"origin: {x!r}, {y!r}, {yaw!r}\n"
    return lines.encode()


def rounded(cells: NDArray[np.float32], digits: int | None) -> NDArray[np.float32]:
    """Probabilities as text of so many digits after the point has them; None changes nothing."""
    if digits is None:
        return cells
    # In double precision: 0.35 as float32 is a little more than the half between 0.3 and 0.4.
    return np.round(cells.astype(np.float64), digits).astype(np.float32)


def number_rows(grid: GridMap, digits: int | None = None) -> Iterator[bytes]:
    """Rows of right-justified numbers, one line each, in pieces."""
    if grid.stored.dtype == np.uint8:
        values = np.unique(np.concatenate([cells[counts > 0] for cells, counts in grid.tally()]))
    else:
        values = np.unique(grid.stored)
    tokens = [shortest(value) for value in rounded(values, digits)]
    width = max(map(len, tokens))
    table = np.array([f"{token:>{width}} ".encode() for token in tokens])
    for band in grid.bands():
        index = band.each(lambda cells: np.searchsorted(values, cells).clip(0, len(values) - 1))
        body = np.ascontiguousarray(table[index]).view(np.uint8).reshape(band.rows, -1)
        body[:, -1] = ord("\n")
        yield body.tobytes()


def shortest(value: np.float32) -> str:
    """The shortest text that reads back as this float32, or `?`."""
    if np.isnan(value):
        return "?"
    plain = np.format_float_positional(value, unique=True, trim="-")
    short = np.format_float_scientific(value, unique=True, trim="-", exp_digits=1)
    return plain if len(plain) <= len(short) + 2 else short
