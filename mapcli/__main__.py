"""The way in for a shell: `mapcli` and `python -m mapcli`."""

from __future__ import annotations

from typing import NoReturn

from mapcli import startup


def run() -> NoReturn:
    """Run the command line. A signal at any moment ends it without a traceback."""
    startup.end_on_signals()
    startup.guard_streams()
    startup.hide_warnings()
    startup.keep_blas_single_threaded()
    from mapcli.cli import main

    startup.raise_on_signals()
    status = 0
    try:
        main()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 0
    startup.end_on_signals()
    startup.leave(status)


if __name__ == "__main__":
    run()
