"""Reading whole files and standard input: the counterpart of `output.py`."""

from __future__ import annotations

import gzip
import hashlib
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

from mapcli.errors import FormatError

GZIP_MAGIC = b"\x1f\x8b"
MCAP_MAGIC = b"\x89MCAP0\r\n"
"""How files of these formats start."""

ReadBytes = Callable[[Path], bytes]
"""Where the bytes of a path come from: `read_file`, or something that does more with them."""


def read_file(path: Path, expected: str = "a map file") -> bytes:
    """All bytes of a file, or of standard input for `-`.

    Raises:
        FormatError: no such file, a directory, not readable.
    """
    if str(path) == "-":
        return sys.stdin.buffer.read()
    try:
        return (path.expanduser() if path.parts[:1] == ("~",) else path).read_bytes()
    except IsADirectoryError as error:
        raise FormatError("is a directory", file=path, expected=expected) from error
    except FileNotFoundError as error:
        raise FormatError("no such file", file=path) from error
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FormatError(f"cannot be read: {reason.lower()}", file=path) from error


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
