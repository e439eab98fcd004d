"""What a reader may do to whoever calls it with a bad file: return, or raise one printable line.

A fault is any other exception, a warning, a byte on the process's stderr, more than `SECONDS`, or
more than `MEMORY_BYTES` beyond what the process had before. Memory is what becomes resident, since
some readers answer a refused allocation, as a limit of address space would give, as damage; beyond
four times as much, allocations are refused so that the machine survives.
"""

from __future__ import annotations

import os
import resource
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

from mapcli.errors import MapcliError

SECONDS = 10.0
MEMORY_BYTES = 1 << 30

Read = Callable[[Path], object]


class FaultError(AssertionError):
    """A reader did what it may not do."""


class TooSlow(BaseException):
    """The time is over; no `except Exception` catches it."""


@contextmanager
def watched(stderr: Path) -> Iterator[Callable[[Read, Path], str | None]]:
    """A function that reads a file within the bounds; its result is the error's text, or None.

    Meanwhile warnings are errors, and what the process writes to its stderr, C libraries
    included, goes to the file `stderr`, which is to stay empty.

    Raises:
        FaultError: the reader broke a bound.
    """
    kept = os.dup(2)
    before = signal.signal(signal.SIGALRM, _too_slow)
    with warnings.catch_warnings(), stderr.open("ab", buffering=0) as file:
        warnings.simplefilter("error")
        os.dup2(file.fileno(), 2)
        try:
            yield lambda read, path: _bounded(read, path, stderr)
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            signal.signal(signal.SIGALRM, before)


def _too_slow(_signal: int, _frame: FrameType | None) -> NoReturn:
    raise TooSlow


def _bounded(read: Read, path: Path, stderr: Path) -> str | None:
    start, (soft, hard) = time.monotonic(), resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_pages(0) + 4 * MEMORY_BYTES, hard))
    resident = _pages(1)
    _PEAK_RESET.write_text("5")
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    said = None
    try:
        read(path)
    except MapcliError as error:
        said = str(error)
        _check_text(said, path, error)
    except FaultError:
        raise
    except TooSlow as error:
        raise FaultError(f"took more than {SECONDS:g} s") from error
    except Exception as error:
        raise FaultError(f"{type(error).__name__}: {error}"[:300]) from error
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    if time.monotonic() - start > SECONDS:  # compiled code does not see the signal
        raise FaultError(f"took {time.monotonic() - start:.0f} s")
    if peak_bytes() - resident > MEMORY_BYTES:
        raise FaultError(f"took {(peak_bytes() - resident) / 1e6:.0f} MB")
    if stderr.stat().st_size:
        noise = stderr.read_bytes()
        os.truncate(stderr, 0)
        raise FaultError(f"wrote to stderr: {noise[:300]!r}")
    return said


def _check_text(text: str, path: Path, error: BaseException) -> None:
    if not text.isprintable():
        raise FaultError(f"an error of more than a printable line: {text[:300]!r}") from error
    if not any(file.name in text for file in (path, *path.parent.iterdir())):
        raise FaultError(f"an error that does not name {path.name}: {text[:300]!r}") from error


def _pages(which: int) -> int:
    """Bytes of the process: 0 its address space, 1 what is resident."""
    return int(Path("/proc/self/statm").read_text().split()[which]) * resource.getpagesize()


_PEAK_RESET = Path("/proc/self/clear_refs")
"""A 5 written here lets the peak begin anew (man 5 proc)."""


def peak_bytes() -> int:
    """The most resident memory of the process since the last input began."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) * 1024
