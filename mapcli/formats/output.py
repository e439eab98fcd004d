"""The one writer of every output, the counterpart of `input.py`.

A regular file appears whole or not at all: it is written beside its final name and renamed at the
end. Files of one result change together. What is no regular file (a device, a FIFO, `/dev/stdout`,
`>(...)`) is written into and never replaced; of a symbolic link the target is replaced.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from mapcli.errors import OutputError
from mapcli.formats.partial_file import (
    PartialFile,
    clear_abandoned,
    folders_locked,
    signals_held_back,
)

DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/fd/(\d+)")
STANDARD_STREAMS = {"/dev/stdout": 1, "/dev/stderr": 2}

MOST_LINKS = 40
"""That Linux follows."""

Content = bytes | Iterable[bytes]
"""Of a file: whole, or in pieces."""


class OutputSet:
    """The files of one result (stateful): none appears before all are complete.

    They are renamed in the order in which they were opened, with signals held back and other runs
    waiting meanwhile, and when one cannot be renamed the others are as before.
    """

    def __init__(self, *, no_clobber: bool = False) -> None:
        self.no_clobber = no_clobber
        self._partial: dict[str, PartialFile] = {}
        self._streams: list[tuple[str, BinaryIO]] = []

    def open(self, path: str | Path) -> BinaryIO:
        """A binary stream for a file, whose folder is made if there is none; `-` is standard
        output.

        Raises:
            OutputError: the file exists and `no_clobber` is set, it cannot be written, or it is
                in the set already.
        """
        if str(path) == "-":
            _refuse_closed_stdout()
            return sys.stdout.buffer
        with _telling(path):
            stream = _stream_of(path)
            if stream is not None:
                self._streams.append((str(path), stream))
                return stream
            _refuse(path, no_clobber=self.no_clobber)
            target = Path(os.path.realpath(path))
            if any(target == partial.target for partial in self._partial.values()):
                raise OutputError("two results cannot both be written to one file", file=path)
            target.parent.mkdir(parents=True, exist_ok=True)
            with signals_held_back():  # none comes between the file and who clears it
                self._partial[str(path)] = PartialFile(target)
            return self._partial[str(path)].file

    @contextmanager
    def opened(self, path: str | Path) -> Iterator[BinaryIO]:
        """The same, for a file that is written bit by bit: failures name it."""
        with _telling(path):
            yield self.open(path)

    def write(self, path: str | Path, content: Content) -> str:
        """Write one whole file of the set; its SHA-256, hexadecimal.

        Raises:
            OutputError: as of `open`.
        """
        file, digest = self.open(path), hashlib.sha256()
        for piece in (content,) if isinstance(content, bytes) else content:
            digest.update(piece)
            with _telling(path):
                file.write(piece)
        return digest.hexdigest()

    def write_beside(self, target: str | Path, files: Mapping[str, Content]) -> list[str]:
        """Write the files of a map, name -> content, into the folder of its own name; `-` to
        standard output. Returns their names.

        Raises:
            OutputError: as of `open`.
        """
        names = [name if name == "-" else str(Path(target).with_name(name)) for name in files]
        for name, content in zip(names, files.values(), strict=True):
            self.write(name, content)
        return names

    def commit(self) -> None:
        """Let all files appear under their names.

        Raises:
            OutputError: one of them cannot; then all are as they were before.
        """
        if sys.stdout is not None:  # closed, as by `>&-`
            sys.stdout.flush()
        files = [(name, partial.file) for name, partial in self._partial.items()]
        for name, file in (*self._streams, *files):
            with _telling(name):
                file.close()
        folders = {partial.target.parent for partial in self._partial.values()}
        done: list[PartialFile] = []
        with folders_locked(folders), signals_held_back():
            try:
                for name, partial in self._partial.items():
                    with _telling(name):
                        partial.appear(no_clobber=self.no_clobber)
                    done.append(partial)
            except OutputError:
                for partial in reversed(done):
                    partial.undo()
                raise
            finally:
                for partial in self._partial.values():
                    partial.clean_up()

    def discard(self) -> None:
        """Leave everything as it was."""
        for _, stream in self._streams:
            with suppress(OSError):
                stream.close()
        for partial in self._partial.values():
            partial.clean_up()


@contextmanager
def output_set(*, no_clobber: bool = False) -> Iterator[OutputSet]:
    """Files that appear together at the end, or not at all when anything fails on the way."""
    outputs = OutputSet(no_clobber=no_clobber)
    try:
        yield outputs
        outputs.commit()
    except BaseException:
        outputs.discard()
        raise


@contextmanager
def output_file(path: str | Path, *, no_clobber: bool = False) -> Iterator[BinaryIO]:
    """A binary file that appears under its name only when it is complete; `-` is standard output.

    Raises:
        OutputError: the file exists and `no_clobber` is set, or it cannot be written.
    """
    with output_set(no_clobber=no_clobber) as outputs, outputs.opened(path) as file:
        yield file


@contextmanager
def _telling(path: str | Path) -> Iterator[None]:
    """Failures of the system as errors that name the file."""
    try:
        yield
    except BrokenPipeError:
        raise  # whoever read the pipe has gone: the boundary knows what to do
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", file=path) from error


def _stream_of(path: str | Path) -> BinaryIO | None:
    """What is written into as it is: an open stream of this process, or no regular file; None of
    a file that is to be replaced, or made."""
    descriptor = descriptor_of(path)
    if descriptor is not None:
        return os.fdopen(os.dup(descriptor), "wb")
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return None
    return open(path, "wb")


def descriptor_of(path: str | Path) -> int | None:
    """The open stream of this process that a name, or a link to it, stands for: 1 for `-`,
    `/dev/stdout`, `/dev/fd/1`; None of any other file."""
    if str(path) == "-":
        return 1
    name = os.path.abspath(path)
    for _ in range(MOST_LINKS):
        descriptor = DESCRIPTOR.fullmatch(name)
        if name in STANDARD_STREAMS or descriptor:
            return int(descriptor[1]) if descriptor else STANDARD_STREAMS[name]
        if not os.path.islink(name):
            break
        name = os.path.normpath(os.path.join(os.path.dirname(name), os.readlink(name)))
    return None


def _refuse_closed_stdout() -> None:
    if sys.stdout is None:
        raise OutputError("standard output is closed", file="-")


def _refuse(path: str | Path, *, no_clobber: bool) -> None:
    if os.path.isdir(path):
        raise OutputError("is a directory", file=path, expected="a file name")
    if no_clobber and os.path.lexists(path):
        raise OutputError("exists already, and --no-clobber is set", file=path)


def check_output(path: str | Path, *, no_clobber: bool = False) -> None:
    """Raise before minutes of work what writing a file would raise at their end. Leaves no file.

    Folders that do not exist yet are made when the file is written. What runs that were killed
    have left in the folder is cleared.

    Raises:
        OutputError: as of `output_file`.
    """
    if str(path) == "-":
        _refuse_closed_stdout()
    if descriptor_of(path) is not None:
        return
    with _telling(path):
        if os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path):
            if not os.access(path, os.W_OK):
                raise OutputError("cannot be written: permission denied", file=path)
            return
        _refuse(path, no_clobber=no_clobber)
        target = Path(os.path.realpath(path))
        folder = next(parent for parent in target.parents if parent.exists())
        clear_abandoned(folder)
        with signals_held_back():
            PartialFile(folder / target.name).clean_up()


def write_bytes(path: str | Path, data: bytes, *, no_clobber: bool = False) -> None:
    """Write a whole file, or nothing (see `output_file`)."""
    with output_file(path, no_clobber=no_clobber) as file:
        file.write(data)


def write_files(
    directory: str | Path, files: Mapping[str, Content], *, no_clobber: bool = False
) -> None:
    """Write the files of one result: all of them, or none when one cannot be written.

    Args:
        files: name -> content, whole or in pieces, in the order in which they appear.
    """
    with output_set(no_clobber=no_clobber) as outputs:
        for name, content in files.items():
            outputs.write(Path(directory) / name, content)
