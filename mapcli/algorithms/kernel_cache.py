"""Where the machine code of compiled loops is kept: numba's cache, for other people's machines.

numba's own refuses to compile without a writable folder, unpickles what it finds, whoever wrote it
and however damaged, and does not see that a callee in another file has changed. Here a loop that
cannot be kept is compiled in memory; a file is only unpickled when it is ours and whole and was
made from the sources as they are.

One file holds one loop for one signature: a digest of the sources and of what follows, then the
pickled `(key, code)`.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import secrets
import stat
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from mapcli import notices

VARIABLES = "MAPCLI_CACHE_DIR", "NUMBA_CACHE_DIR"
"""The environment variables that choose the folder, the first that is set."""

DIGEST_BYTES = 32

WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH

COMPILING = "compiling the loops for this machine; this takes some seconds, once"


class KernelCache:
    """The machine code of one function, for every signature (numba's `_Cache` interface).

    Args:
        function: what is compiled.
        sources: the files on whose text its code depends.
    """

    def __init__(self, function: Callable[..., Any], sources: Sequence[Path]) -> None:
        self._name = f"{Path(function.__code__.co_filename).stem}.{function.__qualname__}"
        self._sources = tuple(sources)
        self._beside = Path(function.__code__.co_filename).parent / "__pycache__"

    @property
    def cache_path(self) -> str:
        return str(self._folders().writable or "")

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """The compiled function, or None when it must be compiled."""
        target_context.refresh()
        key = _key(signature, target_context.codegen())
        for folder in self._folders().readable:
            content = _read(folder / self._file_name(key))
            code = content and self._rebuilt(content, key, target_context)
            if code:
                return code
        if self._folders().writable:
            _say_once(notices.progress, COMPILING)
        else:
            self._say_not_kept(self._folders().reason)
        return None

    def save_overload(self, signature: Any, code: Any) -> None:
        """Keep a compiled function; not being able to is no fault."""
        folder = self._folders().writable
        if not folder or code.lifted or code.library.has_dynamic_globals:
            return
        key = _key(signature, code.codegen)
        content = dumps((key, code._reduce()))  # type: ignore[no-untyped-call]
        try:
            _write(folder / self._file_name(key), self._digest(content) + content)
        except OSError as error:
            self._say_not_kept(f"{folder}: {(error.strerror or str(error)).lower()}")

    def enable(self) -> None:
        """For numba; it is always enabled."""

    def disable(self) -> None:
        """For numba; it is always enabled."""

    def flush(self) -> None:
        """For numba; files made from other sources are made anew by themselves."""

    def _rebuilt(self, content: bytes, key: object, target_context: Any) -> Any:
        digest, content = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
        if digest != self._digest(content):
            return None  # damaged, planted, or made from other sources
        with contextlib.suppress(Exception):  # whatever unpickling raises: it is made anew
            found, code = pickle.loads(content)
            if found == key:
                return CompileResult._rebuild(target_context, *code)  # type: ignore[no-untyped-call]
        return None

    def _digest(self, content: bytes) -> bytes:
        hasher = hashlib.blake2b(_digest_of_files(self._sources), digest_size=DIGEST_BYTES)
        hasher.update(content)
        return hasher.digest()

    def _file_name(self, key: object) -> str:
        # The place is in it because several installations may share a folder.
        place = f"{self._beside} {key}"
        digest = hashlib.blake2b(place.encode(errors="surrogateescape"), digest_size=8)
        return f"{self._name}-{digest.hexdigest()}.nbc"

    def _folders(self) -> Folders:
        return _folders(self._beside, tuple(os.environ.get(name, "") for name in VARIABLES))

    @staticmethod
    def _say_not_kept(reason: str) -> None:
        _say_once(
            notices.note,
            f"compiled loops cannot be kept ({reason}), so they are compiled in memory, at "
            f"every run; {VARIABLES[0]} names another folder for them",
        )


@dataclass(frozen=True)
class Folders:
    """The folders of a function's machine code.

    Attributes:
        readable: those whose files are trusted; writable: where new files go, if anywhere;
        reason: why nowhere.
    """

    readable: tuple[Path, ...]
    writable: Path | None
    reason: str


@cache
def _folders(beside: Path, chosen: tuple[str, ...]) -> Folders:
    """Those chosen by environment variables, or else beside the source and below the home."""
    readable, writable, reasons = [], None, []
    for folder in _candidates(beside, chosen):
        there = folder.is_dir() if writable else _made(folder)
        if not there and writable:
            continue
        reason = distrust(folder) if there else "is not there"
        if not reason:
            readable.append(folder)
            if os.access(folder, os.W_OK | os.X_OK):
                writable = writable or folder
            else:
                reason = "is not writable"
        if reason:
            reasons.append(f"{folder} {reason}")
    return Folders(tuple(readable), writable, ", ".join(reasons) or "there is no home folder")


def _candidates(beside: Path, chosen: tuple[str, ...]) -> Iterator[Path]:
    name = next(filter(None, chosen), None)
    if name:
        yield Path(os.path.expanduser(name)).absolute()
        return
    yield beside
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    # A container's user without a home has / for one.
    if home.is_absolute() and home.parent.is_dir() and home != Path("/.cache"):
        yield home / "mapcli"


def _made(folder: Path) -> bool:
    """Whether a folder is there; made, for this user alone, if it was not."""
    with contextlib.suppress(OSError, ValueError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    try:
        return folder.is_dir()
    except (OSError, ValueError):
        return False


def distrust(folder: Path) -> str:
    """Why code from a folder is not run: it is another user's, or others may write to it."""
    try:
        status = folder.stat()
    except OSError as error:
        return (error.strerror or str(error)).lower()
    if not _is_ours(status):
        return "belongs to another user"
    return "may be written to by other users" if _others_write(status) else ""


def _is_ours(status: os.stat_result) -> bool:
    # Root may do anything anyway. Windows has no such numbers, and private folders by default.
    return not hasattr(os, "geteuid") or status.st_uid in (0, os.geteuid())


def _others_write(status: os.stat_result) -> bool:
    return hasattr(os, "geteuid") and bool(status.st_mode & WRITABLE_BY_OTHERS)


def _read(path: Path) -> bytes | None:
    """A file's content, if nobody else can have written it."""
    try:
        # Opened without waiting: in the place of a file there may be a pipe.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with open(descriptor, "rb") as file:
            status = os.fstat(file.fileno())
            regular = stat.S_ISREG(status.st_mode)
            trusted = regular and _is_ours(status) and not _others_write(status)
            return file.read() if trusted else None
    except OSError:
        return None


def _write(path: Path, content: bytes) -> None:
    """Put a file in its place, whole, and writable by nobody else whatever the umask."""
    partial = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        with open(descriptor, "wb") as file:
            file.write(content)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _key(signature: Any, codegen: Any) -> tuple[Any, ...]:
    """What machine code depends on beside the sources: types, processor, compiler."""
    return signature, codegen.magic_tuple(), numba.__version__, sys.implementation.cache_tag


@cache
def _digest_of_files(sources: tuple[Path, ...]) -> bytes:
    """Of their names and texts."""
    hasher = hashlib.blake2b(digest_size=DIGEST_BYTES)
    for file in sources:
        text = file.read_bytes()
        hasher.update(f"{file.name} {len(text)} ".encode(errors="surrogateescape"))
        hasher.update(text)
    return hasher.digest()


_said: set[str] = set()


def _say_once(say: Callable[[str], None], text: str) -> None:
    # One of the two in a run: who hears that it is in memory knows that it is compiled.
    if not _said:
        _said.add(text)
        say(text)
