"""A file while it is written, beside its final name."""

from __future__ import annotations

import fcntl
import os
import secrets
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

PREFIX, SUFFIX = ".mapcli-", ".part"
"""Of temporary names, which are short whatever the final name is."""

DEFERRED = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM


@contextmanager
def signals_held_back() -> Iterator[None]:
    """Signals that would end the process wait meanwhile (in the main thread, which hears them)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {one: signal.signal(one, lambda number, _: came.append(number)) for one in DEFERRED}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, signal.SIG_DFL if handler is None else handler)
        for number in came[:1]:
            signal.raise_signal(number)


@contextmanager
def folders_locked(folders: Iterable[Path]) -> Iterator[None]:
    """Other runs that let files appear in these folders wait meanwhile, so that of two sets in one
    folder one stays whole. They wait only as long as renaming takes."""
    with ExitStack() as locks:
        for folder in sorted(folders):  # in one order, so that no two runs wait for each other
            with suppress(OSError):  # not to be read, or a file system without locks
                descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
                locks.callback(os.close, descriptor)
                fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield


class PartialFile:
    """A file under a temporary name (stateful), locked while its writer lives.

    The name cannot be guessed and is made exclusively, so that nobody can put a link in its place.

    Attributes:
        target: the final name; file: to be written into.
    """

    def __init__(self, target: Path) -> None:
        mode = None
        with suppress(FileNotFoundError):  # but not that its name is too long
            mode = os.stat(target).st_mode & 0o7777
        self.target = target
        self.path, descriptor = _created_beside(target)
        self.file = os.fdopen(descriptor, "wb")
        self._lock = os.dup(descriptor)  # closing the file must not unlock it before it is renamed
        self._older: Path | None = None
        if mode is not None:
            os.fchmod(self._lock, mode)

    def appear(self, *, no_clobber: bool) -> None:
        """Take the final name; the file that had it can be brought back until `clean_up`.

        Raises:
            OSError: it cannot be; with `no_clobber`, also FileExistsError.
        """
        if no_clobber:
            _rename_exclusively(self.path, self.target)
            return
        if self.target.exists():
            older = _temporary_name(self.target)
            with suppress(OSError):  # where there are no hard links, there is no way back
                os.link(self.target, older)
                self._older = older
        os.replace(self.path, self.target)

    def undo(self) -> None:
        """After `appear`: bring back the file of before, or the absence of one."""
        with suppress(OSError):
            if self._older is not None:
                os.replace(self._older, self.target)
            else:
                self.target.unlink()

    def clean_up(self) -> None:
        """Leave no temporary name behind."""
        with suppress(OSError, ValueError):
            self.file.close()
        for path in (self.path, self._older):
            if path is not None:
                with suppress(OSError):
                    path.unlink()
        with suppress(OSError):
            os.close(self._lock)


def _temporary_name(target: Path) -> Path:
    return target.with_name(f"{PREFIX}{secrets.token_hex(8)}{SUFFIX}")


def _created_beside(target: Path) -> tuple[Path, int]:
    """A new file, made exclusively and locked: its path and descriptor."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    while True:
        path = _temporary_name(target)
        descriptor = os.open(path, flags, 0o666)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if path.exists():  # else another run took it for abandoned before it was locked
            return path, descriptor
        os.close(descriptor)


def _rename_exclusively(path: Path, target: Path) -> None:
    """Rename, unless there is a file of that name at that very moment."""
    try:
        os.link(path, target)
    except FileExistsError:
        raise
    except OSError:  # no hard links on this file system
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        os.replace(path, target)


def clear_abandoned(folder: Path) -> None:
    """Remove temporary files whose writers are dead: those that nobody has locked."""
    for path in folder.glob(f"{PREFIX}*{SUFFIX}"):
        with suppress(OSError):
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
            finally:
                os.close(descriptor)
