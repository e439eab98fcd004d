"""Opening a log: the content decides which reader is used, not the suffix."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from mapcli.errors import FormatError
from mapcli.formats.file_kind import kind_of
from mapcli.formats.input import (
    GZIP_MAGIC,
    MCAP_MAGIC,
    SNIFFED_BYTES,
    Reopenable,
    reopenable,
    spooled,
    standard_input,
)
from mapcli.formats.logs.blocks import read_blocks
from mapcli.formats.logs.carmen import CarmenLog
from mapcli.formats.logs.carmen_lines import looks_like_carmen
from mapcli.formats.logs.log import Log, Source
from mapcli.model.log import Damage, LogOptions

__all__ = ["Log", "open_log"]

DEFAULTS = LogOptions()

EXPECTED = "an MCAP file or a CARMEN log"

_CONVERT = "first: rosbags-convert --src {file} --dst {stem}-mcap --dst-storage mcap"
SQLITE = b"SQLite format 3"
FOREIGN = {
    b"#ROSBAG V": f"is a ROS 1 bag; convert it {_CONVERT}",
    SQLITE: "is part of a ROS 2 bag in SQLite; name the folder it lies in to see how to convert it",
    b"BZh": "is packed with bzip2; unpack it first",
    b"\xfd7zXZ": "is packed with xz; unpack it first",
    b"\x28\xb5\x2f\xfd": "is packed with zstd; unpack it first",
    b"PK\x03\x04": "is a zip archive; unpack it first",
}
"""First bytes of formats that are recognised but not read -> what the user can do."""


def open_log(paths: str | Path | Sequence[str | Path], options: LogOptions = DEFAULTS) -> Log:
    """Open one recording for reading; its records stream when they are asked for.

    Args:
        paths: the file, or its parts in any order; a folder stands for the MCAP files in it
            (a ROS 2 bag), `-` for standard input.
        options: topics, mount, clock and strictness.

    Raises:
        FormatError: missing, empty, of no known format, damaged beyond use; parts of different
            formats.
    """
    names = [str(path) for path in ([paths] if isinstance(paths, str | Path) else paths)]
    try:
        sources = [source for name in names for source in _sources(name)]
        kinds = [_kind(source) for source in sources]
        if len(set(kinds)) > 1:
            raise FormatError(
                f"is {kinds[1]}, but {sources[0].name} is {kinds[0]}",
                file=next(s.name for s, k in zip(sources, kinds, strict=True) if k != kinds[0]),
                expected="parts of one recording in one format",
            )
        return _open(
            kinds[0], [_unpacked(s, k) for s, k in zip(sources, kinds, strict=True)], options
        )
    except OSError as error:
        name = str(error.filename or names[0])
        raise FormatError((error.strerror or str(error)).lower(), file=name) from error


def _open(kind: str, sources: Sequence[Source], options: LogOptions) -> Log:
    if kind == "CARMEN":
        return CarmenLog(sources, options)
    from mapcli.formats.logs.mcap.reader import McapLog

    return McapLog(sources, options)


def _sources(path: str) -> Iterator[Source]:
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
    """The MCAP files of a ROS 2 bag."""
    bag = Path(folder)
    parts = sorted(bag.glob("*.mcap"), key=_natural)
    if (bag / "metadata.yaml").exists() and parts:
        return parts
    if any(bag.glob("*.db3")):
        convert = _CONVERT.format(file=folder, stem=bag)
        raise FormatError(f"is a ROS 2 bag in SQLite; convert it {convert}", file=folder)
    raise FormatError("is a folder", file=folder, expected=f"{EXPECTED}, or a ROS 2 bag's folder")


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts `bag_2.mcap` before `bag_10.mcap`."""
    return [(int(part or 0), text) for part, text in re.findall(r"(\d*)(\D*)", path.name)]


def _kind(source: Source) -> str:
    """`MCAP` or `CARMEN`."""
    start = _start(source)
    if start.startswith(MCAP_MAGIC):
        return "MCAP"
    for magic in FOREIGN:
        if start.startswith(magic):
            stem = Path(source.name).with_suffix("")
            text = FOREIGN[magic].format(file=source.name, stem=stem)
            raise FormatError(text, file=source.name)
    if not start:
        raise FormatError("is empty", file=source.name, expected=EXPECTED)
    if not looks_like_carmen(start):
        with source.path.open("rb") as file:
            kind = kind_of(file.read(SNIFFED_BYTES), source.name)
        what = f"is {kind}" if kind else "is no log that mapcli knows"
        raise FormatError(what, file=source.name, expected=EXPECTED)
    return "CARMEN"


def _start(source: Source) -> bytes:
    """The first bytes, unpacked. Damage of the gzip stream is counted when the log is read."""
    start = b""
    for block in read_blocks(source, Damage()):
        start += block
        if len(start) >= SNIFFED_BYTES:
            break
    return start


def _unpacked(source: Source, kind: str) -> Source:
    """MCAP files need random access, so a gzip one is unpacked into a temporary file."""
    if kind != "MCAP":
        return source
    with source.path.open("rb") as file:
        packed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
    return _source(source.name, spooled(read_blocks(source, Damage()))) if packed else source
