"""Opening a log, whatever its format: the content decides, not the suffix."""

from __future__ import annotations

from collections.abc import Sequence

from mapcli.formats._log import Log
from mapcli.model.log import LogOptions

__all__ = ["Log", "open_log"]

DEFAULTS = LogOptions()


def open_log(paths: Sequence[str], options: LogOptions = DEFAULTS) -> Log:
    """Open one recording for reading.

    Args:
        paths: the file, or its parts in any order; `-` is standard input.
        options: topics, mount, clock and strictness.

    Raises:
        FormatError: missing, empty, of no known format, damaged beyond use.
    """
    raise NotImplementedError
