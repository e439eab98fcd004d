"""Opening a log: the content decides which reader is used, not the suffix."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mapcli.errors import FormatError
from mapcli.formats.file_kind import is_state, kind_at, kind_of
from mapcli.formats.file_role import LogFormat, log_format_of
from mapcli.formats.input import (
    SNIFFED_BYTES,
    Reopenable,
    no_such_file,
    reopenable,
    spooled,
    standard_input,
)
from mapcli.formats.logs.bag_metadata import named_files
from mapcli.formats.logs.blocks import read_blocks
from mapcli.formats.logs.carmen import CarmenLog
from mapcli.formats.logs.carmen_lines import looks_like_carmen
from mapcli.formats.logs.log import Log, Source
from mapcli.formats.logs.message_file import MessageFile
from mapcli.formats.packed import packing_of
from mapcli.formats.text_kind import looks_like_robot_csv
from mapcli.model.log import Damage, LogOptions

__all__ = ["Log", "open_log"]

DEFAULTS = LogOptions()

EXPECTED = "an MCAP file, a ROS bag, a CARMEN log or a robot's CSV"

TEXT = LogFormat.CARMEN, LogFormat.CSV
"""Formats of records in lines; the others are of messages."""

PARTS = ".mcap", ".db3", ".bag", ".active"
"""Ends of the names of files of a bag in a folder; behind them may stand that of a packing."""
PACKED = ".zstd", ".zst", ".gz", ".bz2", ".xz", ".lz4"


def open_log(paths: str | Path | Sequence[str | Path], options: LogOptions = DEFAULTS) -> Log:
    """Open one recording for reading; its records stream when they are asked for.

    Args:
        paths: the file, or its parts in any order; a folder stands for the bag's files in it, `-`
            for standard input.
        options: topics, mount, clock and strictness.

    Raises:
        FormatError: missing, empty, of no known format, damaged beyond use; parts of different
            formats.
    """
    names = [str(path) for path in ([paths] if isinstance(paths, str | Path) else paths)]
    try:
        sources = [source for name in names for source in sources_of(name)]
        formats = [_format(source) for source in sources]
        for source, log_format in zip(sources, formats, strict=True):
            if log_format is not formats[0]:
                raise FormatError(
                    f"is {log_format.value}, but {sources[0].name} is {formats[0].value}",
                    file=source.name, expected="parts of one recording in one format",
                )  # fmt: skip
        return _open(formats[0], [_unpacked(source, formats[0]) for source in sources], options)
    except FileNotFoundError as error:
        raise no_such_file(Path(str(error.filename or names[0]))) from error
    except OSError as error:
        name = str(error.filename or names[0])
        raise FormatError((error.strerror or str(error)).lower(), file=name) from error


def open_files(sources: Sequence[Source], damage: Damage) -> list[MessageFile]:
    """The files of a recording of messages, without looking for scans in them.

    Raises:
        FormatError: as of `open_log`, or a log without messages (CARMEN, CSV).
    """
    files = []
    for source in sources:
        log_format = _format(source)
        if log_format in TEXT:
            text = f"is {log_format.value}"
            raise FormatError(text, file=source.name, expected="a log of messages")
        files.append(_container(log_format)(_unpacked(source, log_format), damage))
    return files


def _open(log_format: LogFormat, sources: Sequence[Source], options: LogOptions) -> Log:
    if log_format is LogFormat.CARMEN:
        return CarmenLog(sources, options)
    if log_format is LogFormat.CSV:
        from mapcli.formats.logs.csv.reader import CsvLog

        return CsvLog(sources, options)
    from mapcli.formats.logs.message_log import MessageLog

    return MessageLog(sources, options, _container(log_format))


def _container(log_format: LogFormat) -> Callable[[Source, Damage], MessageFile]:
    """What reads the messages of a file."""
    if log_format is LogFormat.BAG:
        from mapcli.formats.logs.bag.container import BagFile

        return BagFile
    if log_format is LogFormat.SQLITE:
        from mapcli.formats.logs.sqlite_file import SqliteFile

        return SqliteFile
    from mapcli.formats.logs.mcap.container import McapFile

    return McapFile


def sources_of(path: str) -> Iterator[Source]:
    """The files that a name stands for."""
    if path == "-":
        stdin = standard_input()
        yield _source("-", spooled(iter(lambda: stdin.read(SNIFFED_BYTES), b"")))
    elif Path(path).is_dir():
        yield from (Source(str(part), part) for part in _parts_of_bag(path))
    else:
        yield _source(path, reopenable(Path(path)))


def _source(name: str, file: Reopenable) -> Source:
    return Source(name, file.path, file.keeps)


def _parts_of_bag(folder: str) -> list[Path]:
    """The files of a bag: those that its metadata names, or else those that are there."""
    bag = Path(folder)
    parts = named_files(bag) or sorted(filter(_is_part, bag.iterdir()), key=_natural)
    if not parts:
        kind = kind_at(folder)
        what = f"is {kind}" if kind else "is a folder without a bag's files"
        raise FormatError(what, file=folder, expected=EXPECTED)
    return parts


def _is_part(path: Path) -> bool:
    packed = path.suffix.lower() in PACKED
    name = path.with_suffix("") if packed else path
    return name.suffix.lower() in PARTS and path.is_file()


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts `bag_2.mcap` before `bag_10.mcap`."""
    return [(int(part or 0), text) for part, text in re.findall(r"(\d*)(\D*)", path.name)]


def _format(source: Source) -> LogFormat:
    """What a file is, by its content."""
    start = _start(source)
    if is_state(start):
        raise FormatError(f"is {kind_of(start)}", file=source.name, expected=EXPECTED)
    if log_format := log_format_of(start):
        return log_format
    if looks_like_carmen(start):
        return LogFormat.CARMEN
    if looks_like_robot_csv(start):
        return LogFormat.CSV
    what = "is empty"
    if start:
        with source.path.open("rb") as file:
            found = kind_of(file.read(SNIFFED_BYTES), source.name)
        what = f"is {found}" if found else "is no log that mapcli knows"
    raise FormatError(what, file=source.name, expected=EXPECTED)


def _start(source: Source) -> bytes:
    """The first bytes, unpacked. Damage of the gzip stream is counted when the log is read."""
    start = b""
    for block in read_blocks(source, Damage()):
        start += block
        if len(start) >= SNIFFED_BYTES:
            break
    return start


def _unpacked(source: Source, log_format: LogFormat) -> Source:
    """All but text needs random access, so a packed file is unpacked into a temporary one."""
    if log_format in TEXT:
        return source
    with source.path.open("rb") as file:
        packed = packing_of(file.read(SNIFFED_BYTES)) is not None
    return _source(source.name, spooled(read_blocks(source, Damage()))) if packed else source
