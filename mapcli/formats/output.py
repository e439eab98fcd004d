"""The one writer of every output: files appear whole or not at all, and one that must stay is never
overwritten. The counterpart of `input.py`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

from mapcli.errors import OutputError


@contextmanager
def output_file(path: str | Path, *, no_clobber: bool = False) -> Iterator[BinaryIO]:
    """A binary file that appears under its name only when it is complete.

    It is written beside its final name and renamed at the end; when anything fails on the way,
    an older file of that name stays as it was. `-` is standard output.

    Raises:
        OutputError: the file exists and `no_clobber` is set, or it cannot be written.
    """
    if str(path) == "-":
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
        return
    path = Path(path)
    _refuse(path, no_clobber)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with partial.open("wb") as file:
            yield file
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", file=path) from error
    finally:
        partial.unlink(missing_ok=True)


def _refuse(path: Path, no_clobber: bool) -> None:
    if no_clobber and path.exists():
        raise OutputError("exists already, and --no-clobber is set", file=path)
    if path.is_dir():
        raise OutputError("is a directory", file=path, expected="a file name")


def check_output(path: str | Path, *, no_clobber: bool = False) -> None:
    """Raise before minutes of work what writing a file would raise at their end. Leaves no file.

    Folders that do not exist yet are taken to be made when the file is written.

    Raises:
        OutputError: as of `output_file`.
    """
    if str(path) == "-":
        return
    import tempfile

    path = Path(path)
    _refuse(path, no_clobber)
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", file=path) from error


def write_bytes(path: str | Path, data: bytes, *, no_clobber: bool = False) -> None:
    """Write a whole file, or nothing (see `output_file`)."""
    with output_file(path, no_clobber=no_clobber) as file:
        file.write(data)


def write_files(
    directory: str | Path, files: Mapping[str, bytes | Iterable[bytes]], *,
    no_clobber: bool = False,
) -> None:  # fmt: skip
    """Write the files of one result in the order given: all of them, or none when one cannot be
    written, so that an older pair of image and YAML never ends up half replaced.

    Args:
        files: name -> content, whole or in pieces.
    """
    with ExitStack() as stack:
        # Files appear when their context closes, the last opened first.
        for name in reversed(list(files)):
            file = stack.enter_context(output_file(Path(directory) / name, no_clobber=no_clobber))
            content = files[name]
            file.writelines([content] if isinstance(content, bytes) else content)


def write_beside(target: str, files: dict[str, bytes], *, no_clobber: bool = False) -> None:
    """Write the files of a map into the folder of its name, or `-` to standard output."""
    if target == "-":
        write_bytes("-", files["-"])
    else:
        write_files(Path(target).parent, files, no_clobber=no_clobber)
