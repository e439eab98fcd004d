"""How much memory a run may take. What is about to take much says so first, with `require`: a line
that names the number is better than a machine that stands still, or a run that is killed.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from mapcli.errors import MapcliError

SHARE = 0.5
"""Of what the machine allows, that a run takes unless more is asked for."""

GIGABYTE = 1_000_000_000

SMALL_FILE, SMALL_FILE_LIMIT = 1_000_000, GIGABYTE
"""Bytes; what is packed into so small a file is not unpacked to more, unless that is asked for."""

_CONTROL_GROUPS = (
    "/sys/fs/cgroup/memory.max",  # version 2
    "/sys/fs/cgroup/memory/memory.limit_in_bytes",  # version 1
)
"""Files that hold the bytes a container may take, or `max`."""

_chosen: dict[str, int] = {}
"""The limit that was asked for, if one was, and that of the machine, once it was looked up."""


class MemoryLimitError(MapcliError):
    """Something would take more memory than a run may."""


def limit_to(size: int | None) -> None:
    """Choose how many bytes a run may take; None is half of what the machine allows."""
    _chosen.clear()
    _chosen.update({} if size is None else {"bytes": size})


def limit() -> int:
    """Bytes that a run may take."""
    if "bytes" in _chosen:
        return _chosen["bytes"]
    if "machine" not in _chosen:
        _chosen["machine"] = int(SHARE * allowed())
    return _chosen["machine"]


def limit_of_file(size: int) -> int:
    """Bytes that what is packed into a file of so many bytes may take."""
    is_small = size < SMALL_FILE and "bytes" not in _chosen
    return min(limit(), SMALL_FILE_LIMIT) if is_small else limit()


def allowed() -> int:
    """Bytes that the machine has, or its control group allows, if that is less."""
    sizes = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    for name in _CONTROL_GROUPS:
        with suppress(OSError, ValueError):  # ValueError: "max", which is no limit
            sizes.append(int(Path(name).read_text()))
    return min(sizes)


def require(
    size: float, what: str, *, file: str | Path | None = None, most: int | None = None
) -> None:
    """Refuse what would take more memory than a run may, before it does.

    Args:
        size: bytes, an estimate.
        what: that takes them, for the message: "a map of 20,000 x 20,000 cells".
        most: bytes that it may take; by default `limit()`.

    Raises:
        MemoryLimitError: it is too much.
    """
    most = limit() if most is None else most
    if size > most:
        raise MemoryLimitError(
            f"{what} would take about {_gigabytes(size)} of memory",
            file=file,
            expected=f"at most {_gigabytes(most)} (--max-memory allows more)",
        )


def _gigabytes(size: float) -> str:
    return f"{size / GIGABYTE:,.1f} GB" if size >= GIGABYTE else f"{size / 1e6:,.0f} MB"
