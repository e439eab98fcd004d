"""What makes a short command start and leave fast, all in one place.

Each function says what it saves of the 0.5 s of processor time that `mapcli slam-replay` on a short
log takes beside its work; `python benchmarks/startup.py` measures it again.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import io
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from types import FrameType, ModuleType
from typing import NoReturn


class Terminated(KeyboardInterrupt):
    """SIGTERM came: to be handled as Ctrl-C is, but for the exit code."""


def end_on_signals() -> None:
    """While modules are imported, and at the very end: SIGINT and SIGTERM end the process at once
    and silently, with their exit codes."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda came, _: os._exit(128 + came))


UNINTERRUPTIBLE = "<frozen importlib", f"{os.sep}llvmlite{os.sep}", f"{os.sep}numba{os.sep}"
"""Parts of the file names of code that an exception from outside breaks: a module stays half made
("initialization failed"), and a callback of the compiler loses the exception or crashes."""

RETRY_SECONDS = 0.02


def raise_on_signals() -> None:
    """While a command runs, signals are exceptions: `KeyboardInterrupt` and `Terminated`.

    Within an import or the compiler they are raised as soon as that is over; a second signal
    meanwhile ends the process.
    """
    waiting: list[int] = []

    def came(number: int, frame: FrameType | None) -> None:
        if waiting:
            os._exit(128 + number)
        waiting.append(number)
        try_to_raise(number, frame)

    def try_to_raise(_: int, frame: FrameType | None) -> None:
        if not is_interruptible(frame) and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, RETRY_SECONDS)
            return
        raise Terminated if waiting.pop() == signal.SIGTERM else KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, came)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, try_to_raise)


def is_interruptible(frame: FrameType | None) -> bool:
    """Whether no caller of a frame is in an import or in the compiler."""
    while frame is not None:
        if any(part in frame.f_code.co_filename for part in UNINTERRUPTIBLE):
            return False
        frame = frame.f_back
    return True


def keep_blas_single_threaded() -> None:
    """Have NumPy's OpenBLAS start no threads, unless the user has set their number.

    Saves 100 ms: no matrix here is large enough for threads, which spin while they wait."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def import_module(name: str) -> ModuleType:
    """A module, imported without garbage collection: what comes with it does not become garbage.

    Saves 55 ms.

    A module that is loaded already is returned as it is, so that the garbage of a program that
    calls `mapcli.cli.main` is not frozen.
    """
    if name in sys.modules:
        return sys.modules[name]
    gc.disable()
    try:
        return importlib.import_module(name)
    finally:
        gc.freeze()
        gc.enable()


@contextlib.contextmanager
def module_hidden(name: str) -> Iterator[None]:
    """Make `import name` fail meanwhile, unless that module is loaded already."""
    if name in sys.modules:
        yield
        return
    sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[name]


def import_numba_without_scipy() -> None:
    """Import numba's array functions without SciPy's linear algebra.

    Before its first loop runs, numba looks whether SciPy's BLAS is there, for `numpy.dot` and the
    like, which no kernel needs. Saves 90 ms.
    """
    with module_hidden("scipy.linalg.cython_blas"), contextlib.suppress(ImportError):
        import numba.np.arraymath  # noqa: F401


def guard_streams() -> None:
    """Have no file take the number of a standard stream that was closed (`>&-`), and have no text
    fail for want of an encoding.

    A closed stdout stays None: reports go nowhere, as click prints them, and `-` is an error.
    """
    for descriptor, stream in enumerate((sys.stdin, sys.stdout, sys.stderr)):
        if stream is None:
            with contextlib.suppress(OSError):
                os.fstat(descriptor)
                continue  # open after all, as under pythonw
            # Takes the lowest number that is free: this one. What is written to /dev/stdout fails.
            os.open(os.devnull, os.O_RDONLY if descriptor < 2 else os.O_WRONLY)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115 (lives on)
    for text in (sys.stdout, sys.stderr):
        if isinstance(text, io.TextIOWrapper):
            text.reconfigure(errors="backslashreplace")


def hide_warnings() -> None:
    """Have no library warn on stderr, unless asked for by `python -W`: such warnings are for
    programmers; what a user must know, mapcli says itself."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def leave(status: int) -> NoReturn:
    """End the process after its exit handlers, but without freeing the compiler's many objects:
    the system does that by itself. Saves 35 ms."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):  # closed, or nobody reads it any more
            if stream is not None:
                stream.flush()
    os._exit(status)
