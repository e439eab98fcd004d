"""What a reader may do to whoever calls it with a bad file: return, or raise one printable line.

A fault is any other exception, a warning, a byte on the process's stderr, more than `SECONDS` of
processor time (or six times as long by the clock), or more than `MEMORY_BYTES` beyond what the
process had before. Memory is what becomes resident, since some readers answer a refused allocation,
as a limit of address space would give, as damage; beyond four times as much, allocations are
refused so that the machine survives.
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
    kept, limits = os.dup(2), resource.getrlimit(resource.RLIMIT_AS)
    before = {number: signal.signal(number, _too_slow) for number in _TIMERS.values()}
    most = _process_bytes(0) + 4 * MEMORY_BYTES
    with warnings.catch_warnings(), stderr.open("a+b", buffering=0) as file:
        warnings.simplefilter("error")
        os.dup2(file.fileno(), 2)
        resource.setrlimit(resource.RLIMIT_AS, (most, limits[1]))
        try:
            yield lambda read, path: _bounded(read, path, file.fileno())
        finally:
            resource.setrlimit(resource.RLIMIT_AS, limits)
            os.dup2(kept, 2)
            os.close(kept)
            for number, handler in before.items():
                signal.signal(number, handler)


def _too_slow(_signal: int, _frame: FrameType | None) -> NoReturn:
    raise TooSlow


_TIMERS = {signal.ITIMER_PROF: signal.SIGPROF, signal.ITIMER_REAL: signal.SIGALRM}


def _bounded(read: Read, path: Path, stderr: int) -> str | None:
    start, resident, noise = time.process_time(), _process_bytes(1), os.fstat(stderr).st_size
    os.pwrite(_PEAK_RESET, b"5", 0)
    said = None
    try:
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.setitimer(signal.ITIMER_REAL, 6 * SECONDS)
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
        for timer in _TIMERS:
            signal.setitimer(timer, 0)
    if (seconds := time.process_time() - start) > SECONDS:  # compiled code does not see the signal
        raise FaultError(f"took {seconds:.0f} s")
    if (grown := peak_bytes() - resident) > MEMORY_BYTES:
        raise FaultError(f"took {grown / 1e6:.0f} MB")
    if (length := os.fstat(stderr).st_size) > noise:
        text = os.pread(stderr, length - noise, noise)
        raise FaultError(f"wrote to stderr: {text[:300]!r}")
    return said


def _check_text(text: str, path: Path, error: BaseException) -> None:
    if not text.isprintable():
        raise FaultError(f"an error of more than a printable line: {text[:300]!r}") from error
    if not any(file.name in text for file in (path, *path.parent.iterdir())):
        raise FaultError(f"an error that does not name {path.name}: {text[:300]!r}") from error


_SIZES, _STATUS, _PEAK_RESET = (
    os.open(f"/proc/self/{name}", mode)
    for name, mode in (
        ("statm", os.O_RDONLY), ("status", os.O_RDONLY), ("clear_refs", os.O_WRONLY)
    )
)  # fmt: skip
"""Open all the time, for speed. A 5 in `clear_refs` lets the peak begin anew (man 5 proc)."""


def _process_bytes(which: int) -> int:
    """Bytes of the process: 0 its address space, 1 what is resident."""
    return int(os.pread(_SIZES, 200, 0).split()[which]) * resource.getpagesize()


def peak_bytes() -> int:
    """The most resident memory of the process since the last input began."""
    return int(os.pread(_STATUS, 4096, 0).split(b"VmHWM:")[1].split()[0]) * 1024
