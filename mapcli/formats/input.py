"""Reading whole files and standard input: the counterpart of `output.py`."""

from __future__ import annotations

import gzip
import hashlib
import os
import shutil
import stat
import sys
import weakref
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryFile, mkdtemp
from typing import IO, cast

from mapcli.errors import FormatError

GZIP_MAGIC = b"\x1f\x8b"
"""How files of gzip start."""

SPOOLED_BYTES = 1 << 16

SNIFFED_BYTES = 1 << 16
"""Of the beginning of a file, enough to tell what it is."""

LIKELY_MEANT = 0.8
"""Share of its letters that a name has in common with one that may be meant."""

OPEN_FILES = Path("/proc/self/fd")
"""Linux's folder of the files that this process has open, each to be opened once more from its
start; a copy of the descriptor, as elsewhere, would share its position."""

ReadBytes = Callable[[Path], bytes]
"""Where the bytes of a path come from: `read_file`, or something that does more with them."""


def read_file(path: Path, expected: str = "a map file") -> bytes:
    """All bytes of a file, or of standard input for `-`.

    Raises:
        FormatError: no such file, a directory, not readable.
    """
    if str(path) == "-":
        data = standard_input().read()
        _starts["-"] = data[:SNIFFED_BYTES]
        return data
    try:
        if _is_endless(path):
            raise FormatError("is a device", file=path, expected=expected)
        path = path.expanduser() if path.parts[:1] == ("~",) else path
        file = reopenable(path)
        return file.path.read_bytes()
    except IsADirectoryError as error:
        raise FormatError("is a directory", file=path, expected=expected) from error
    except FileNotFoundError as error:
        raise no_such_file(path) from error
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FormatError(f"cannot be read: {reason.lower()}", file=path) from error


def no_such_file(path: Path) -> FormatError:
    """The error about a file that is not there; it names one beside it that may be meant."""
    import difflib

    beside: list[str] = []
    with suppress(OSError, ValueError):
        beside = sorted(os.listdir(path.parent))
    close = difflib.get_close_matches(path.name, beside, n=1, cutoff=LIKELY_MEANT)
    hint = f"; did you mean {path.parent / close[0]}?" if close else ""
    return FormatError(f"no such file{hint}", file=path)


def first_bytes(path: Path) -> bytes:
    """The beginning of a file; of standard input, whether it has been read already or not; of a
    pipe that is not kept (`pipes_kept`), and of a device, nothing.

    Raises:
        OSError: it cannot be read.
    """
    if str(path) == "-":
        # Looked at, not taken: the reader that is chosen reads from the first byte on.
        return _starts.get("-") or standard_input().peek(SNIFFED_BYTES)[:SNIFFED_BYTES]
    if _is_endless(path) or (_kept is None and path.is_fifo()):
        return b""
    with reopenable(path).path.open("rb") as file:
        return file.read(SNIFFED_BYTES)


def standard_input() -> BufferedReader:
    """The bytes of standard input.

    Raises:
        FormatError: it is closed.
    """
    _names.setdefault("-")
    if sys.stdin is None:
        raise FormatError("standard input is closed", file="-")
    return cast(BufferedReader, sys.stdin.buffer)


@dataclass(frozen=True)
class Reopenable:
    """A file that can be read more than once, and from any place.

    Attributes:
        path: where its bytes are.
        keeps: with the last reference to it, the temporary file of a pipe is gone.
    """

    path: Path
    keeps: object = None


_kept: dict[str, Reopenable] | None = None
"""The pipes that the running command has read, by name."""

_names: dict[str, None] = {}
"""All files that it has read, in order (see `names_read`)."""

_starts: dict[str, bytes] = {}
"""The beginning of what it has read from standard input, which cannot be read again."""


@contextmanager
def pipes_kept() -> Iterator[None]:
    """Meanwhile, a pipe (`<(zcat robot.log.gz)`) may be read as often as a file."""
    global _kept
    before, _kept = _kept, {}
    try:
        yield
    finally:
        _kept = before


def names_read() -> list[str]:
    """The files read since `forget_names`, for errors that do not know their file."""
    return list(_names)


def forget_names() -> None:
    """Let `names_read` begin anew."""
    _names.clear()
    _starts.clear()


def reopenable(path: Path) -> Reopenable:
    """A file as it is; of a pipe, which gives its bytes once and in order, a copy.

    Raises:
        OSError: it cannot be read.
    """
    _names.setdefault(str(path))
    kept = {} if _kept is None else _kept
    if str(path) in kept:
        return kept[str(path)]
    if not path.is_fifo():
        return Reopenable(path)
    with path.open("rb") as pipe:
        kept[str(path)] = spooled(iter(lambda: pipe.read(SPOOLED_BYTES), b""))
    return kept[str(path)]


def spooled(blocks: Iterable[bytes]) -> Reopenable:
    """Bytes in a temporary file: one without a name, so that nothing stays of a run that is
    killed, where the system has a way to open such a file again."""
    has_name = not OPEN_FILES.is_dir()
    make: Callable[..., IO[bytes]] = NamedTemporaryFile if has_name else TemporaryFile
    file = make(prefix="mapcli-")
    for block in blocks:
        file.write(block)
    file.flush()
    lifetime = _Lifetime()
    weakref.finalize(lifetime, file.close)
    return Reopenable(Path(file.name) if has_name else OPEN_FILES / str(file.fileno()), lifetime)


def temporary_folder() -> Reopenable:
    """An empty folder that is gone, with what is in it, when nobody holds what keeps it."""
    folder, lifetime = mkdtemp(prefix="mapcli-"), _Lifetime()
    weakref.finalize(lifetime, shutil.rmtree, folder, ignore_errors=True)
    return Reopenable(Path(folder), lifetime)


class _Lifetime:
    """Its end is that of something temporary."""


def _is_endless(path: Path) -> bool:
    """Whether a path is a device that may never end, `/dev/zero`; standard input may be one."""
    with suppress(OSError):
        mode = path.stat().st_mode
        is_device = stat.S_ISCHR(mode) or stat.S_ISBLK(mode)
        return is_device and path.name not in ("stdin", "null") and path.parent.name != "fd"
    return False


def sha256_of(data: bytes) -> str:
    """The digest by which a document names what it was made from, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


class DigestingReader:
    """Reads files as `read_file` does, and keeps their digests (stateful).

    Attributes:
        digests: file name -> SHA-256 in hexadecimal, in the order of reading; for documents that
            say what they were made from.
    """

    def __init__(self) -> None:
        self.digests: dict[str, str] = {}

    def __call__(self, path: Path) -> bytes:
        data = read_file(path)
        self.digests[path.name] = sha256_of(data)
        return data


def unpacked(data: bytes, file: str) -> bytes:
    """The content of a file that may be gzip.

    Raises:
        FormatError: damaged gzip.
    """
    if not data.startswith(GZIP_MAGIC):
        return data
    try:
        return gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as error:
        raise FormatError(f"cannot be unpacked: {error}", file=file, expected="gzip") from error
