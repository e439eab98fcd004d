"""What a file is, by its content: the one place that knows the formats of all rooms.

A reader that cannot make sense of a file asks here, so that the error says what the file is and
which command reads it (`expecting`); `mapcli info` asks before it reads (`kind_at`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mapcli.errors import FormatError
from mapcli.formats.file_role import FileKind, LogFormat, Role, log_format_of
from mapcli.formats.input import first_bytes
from mapcli.formats.packed import packing_of, unpacked_start
from mapcli.formats.text_kind import kind_of_text

__all__ = [
    "DRAWN",
    "PICTURE_MARK",
    "STATE_PROFILE",
    "FileKind",
    "Role",
    "expecting",
    "is_state",
    "kind_at",
    "kind_of",
]


MAGIC = (
    (b"P2", FileKind("a PGM map", Role.MAP)),
    (b"P5", FileKind("a PGM map", Role.MAP)),
    (b"\x89PNG", FileKind("a PNG image", Role.MAP)),
    (b"\xff\xd8\xff", FileKind("a JPEG picture", Role.PICTURE)),
    (b"GIF8", FileKind("a GIF picture", Role.PICTURE)),
    (b"BM", FileKind("a BMP picture", Role.PICTURE)),
    (b"II*\0", FileKind("a TIFF picture", Role.PICTURE)),
    (b"MM\0*", FileKind("a TIFF picture", Role.PICTURE)),
    (b"P6", FileKind("a PPM picture", Role.PICTURE)),
    (b"%PDF", FileKind("a PDF", Role.OTHER)),
    (b"PK\x03\x04", FileKind("a zip archive", Role.ARCHIVE)),
    (b"7z\xbc\xaf", FileKind("a 7z archive", Role.ARCHIVE)),
    (b"Rar!", FileKind("a RAR archive", Role.ARCHIVE)),
    (b"version https://git-lfs", FileKind("a Git LFS pointer", Role.OTHER,
                                          "fetch the file itself with git lfs pull")),
)  # fmt: skip
"""First bytes -> what they are the first bytes of; those of logs are in `LOG_MAGIC`."""

PICTURE_MARK = "mapcli, a picture"
"""In the PNG files of pictures that mapcli draws: as maps they would be misread."""

DRAWN = FileKind("a picture that mapcli drew", Role.PICTURE, "name the map that it was drawn of")

STATE_PROFILE = "mapcli.drive-state"
"""What an MCAP file that `slam-replay --save-state` wrote calls itself."""

STATE = FileKind("the state of a map of several drives", Role.STATE)

TAR_AT = 257
"""Where a tar archive says `ustar`."""

LARGE_BYTES = 1 << 20
"""From this size on, a file is looked at before it is read."""

PART = re.compile(r"\.(mcap|db3|bag|active)(\.(zstd|zst|gz|bz2|xz|lz4))?$", re.IGNORECASE)
"""Ends of the names of a bag's files."""


@contextmanager
def expecting(file: str | Path, wanted: str, *roles: Role) -> Iterator[None]:
    """Meanwhile, an error about a file that is something else altogether says what it is.

    Args:
        wanted: what is read here, for people; roles: the same.

    Raises:
        FormatError: as it was raised, or what the file is and which command reads it.
    """
    try:
        yield
    except FormatError as error:
        kind = kind_at(file) if str(error.file) == str(file) else None
        if kind is None or kind.role in roles:
            raise
        raise FormatError(f"is {kind}", file=file, expected=wanted) from error


def refuse_large(file: str | Path, wanted: str, *roles: Role) -> None:
    """Do not read gigabytes of what is something else, as their first bytes tell.

    Raises:
        FormatError: what the file is, as of `expecting`.
    """
    with suppress(OSError, ValueError):
        if not os.path.isfile(file) or os.path.getsize(file) < LARGE_BYTES:
            return
        start = first_bytes(Path(file))
        kind = kind_of(start, str(file)) if b"\0" in start else None
        if kind is not None and kind.role not in roles:
            raise FormatError(f"is {kind}", file=file, expected=wanted)


def kind_at(file: str | Path) -> FileKind | None:
    """What a file, a folder, or standard input (`-`) is; None if that is not known."""
    path = Path(file)
    with suppress(OSError, ValueError, FormatError):
        if str(file) != "-" and path.is_dir():
            return _kind_of_folder(path)
        return kind_of(first_bytes(path), str(file))
    return None


def is_state(start: bytes) -> bool:
    """Whether an MCAP file with these first bytes is the state of a map."""
    return log_format_of(start) is LogFormat.MCAP and STATE_PROFILE.encode() in start[:100]


def kind_of(start: bytes, name: str = "") -> FileKind | None:
    """What a file is, by its first bytes; its name decides where the content can be several things.

    Args:
        start: `SNIFFED_BYTES` of it, or all there are.
    """
    if packing := packing_of(start):
        return _packed(packing.name, kind_of(unpacked_start(start), Path(name).stem))
    if start.startswith(b"\x89PNG") and PICTURE_MARK.encode() in start:
        return DRAWN
    if is_state(start):
        return STATE
    if log_format := log_format_of(start):
        is_database = log_format is LogFormat.SQLITE and b"CREATE TABLE" in start.upper()
        if is_database and b"topics" not in start:
            return FileKind("an SQLite database, and no ROS 2 bag", Role.OTHER)
        return log_format.kind
    for magic, kind in MAGIC:
        if start.startswith(magic):
            return kind
    if start[TAR_AT : TAR_AT + 5] == b"ustar":
        return FileKind("a tar archive", Role.ARCHIVE)
    if not start.strip() or b"\0" in start:
        return None
    return kind_of_text(start.removeprefix(b"\xef\xbb\xbf"), name)


def _packed(packing: str, kind: FileKind | None) -> FileKind:
    """Logs and, in gzip, traces are read as they are."""
    name = f"{kind.name}, packed with {packing}" if kind else f"a file packed with {packing}"
    read = {Role.LOG} | ({Role.TRACE, Role.RELATIONS} if packing == "gzip" else set())
    if kind and kind.role in read:
        return FileKind(name, kind.role, kind.advice)
    return FileKind(name, Role.ARCHIVE)


def _kind_of_folder(folder: Path) -> FileKind | None:
    names = {path.name for path in folder.iterdir()}
    if _has_bag(folder):
        return FileKind("a folder with a bag", Role.LOG)
    if {"map.yaml", "trace.json"} <= names:
        return FileKind(
            "a folder of mapcli slam-replay", Role.OTHER, "name a file in it: map.yaml, trace.json"
        )
    bags = [inner.name for inner in sorted(folder.iterdir()) if inner.is_dir() and _has_bag(inner)]
    if bags:
        return FileKind(
            "a folder of folders with bags", Role.OTHER, f"name one of them, such as {bags[0]}"
        )
    return None


def _has_bag(folder: Path) -> bool:
    return any(PART.search(path.name) for path in folder.iterdir())
