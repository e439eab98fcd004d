"""The points of every scan of a run, most of them out of memory.

All scans are fitted once more when the log has ended (`map_refinement`), so that their points must
be kept; held in memory they would grow with time, even where the map and its keyframes do not. So
they go to a temporary file, but for the last ones. Where there is no room for such a file they
stay in memory.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, overload

import numpy as np
from numpy.typing import NDArray

BLOCK_SCANS = 500
"""Scans that are written, and read back, together: about a megabyte."""

BLOCKS_IN_MEMORY = 8
"""Blocks of a short log, which is spared the file; later ones go there as soon as they are full."""


@dataclass(slots=True, eq=False)
class _Block:
    """Points of some scans, one after the other.

    Attributes:
        ends: shape (k,), where the points of each scan end.
        points: shape (n, columns), or None when they are in the file; from `begin` on there, bytes.
    """

    ends: NDArray[np.int64]
    points: NDArray[np.float32] | None
    begin: int = 0


class ScanStore(Sequence[NDArray[np.float32]]):
    """Arrays of shape (n, columns), float32, one for each scan (stateful: it grows)."""

    def __init__(self, columns: int = 2) -> None:
        self.columns = columns
        self._blocks: list[_Block] = []
        self._last: list[NDArray[np.float32]] = []
        self._file: IO[bytes] | None = None
        self._written, self._is_full = 0, False
        self._read: tuple[int, NDArray[np.float32]] | None = None

    def __del__(self) -> None:
        if self._file is not None:
            self._file.close()

    def __len__(self) -> int:
        return BLOCK_SCANS * len(self._blocks) + len(self._last)

    @overload
    def __getitem__(self, scan: int) -> NDArray[np.float32]: ...
    @overload
    def __getitem__(self, scan: slice) -> list[NDArray[np.float32]]: ...
    def __getitem__(self, scan: int | slice) -> NDArray[np.float32] | list[NDArray[np.float32]]:
        if isinstance(scan, slice):
            return [self[k] for k in range(*scan.indices(len(self)))]
        number, place = divmod(range(len(self))[scan], BLOCK_SCANS)
        if number == len(self._blocks):
            return self._last[place]
        ends = self._blocks[number].ends
        return self._points(number)[ends[place - 1] if place else 0 : ends[place]]

    def append(self, points: NDArray[np.float32]) -> None:
        """The points of the next scan."""
        self._last.append(points)
        if len(self._last) < BLOCK_SCANS:
            return
        ends = np.cumsum([len(scan) for scan in self._last])
        self._blocks.append(_Block(ends, np.concatenate(self._last)))
        self._last = []
        if len(self._blocks) > BLOCKS_IN_MEMORY:
            for block in self._blocks:
                self._write(block)

    def _write(self, block: _Block) -> None:
        """Move a block to the file, unless it is there or that has no room."""
        if block.points is None or self._is_full:
            return
        data = block.points.tobytes()
        with suppress(OSError):
            if self._file is None:
                self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 (lives on)
            self._file.seek(self._written)
            if self._file.write(data) == len(data):
                block.points, block.begin = None, self._written
                self._written += len(data)
                return
        self._is_full = True

    def _points(self, number: int) -> NDArray[np.float32]:
        """The points of a block."""
        block = self._blocks[number]
        if block.points is not None:
            return block.points
        if self._read is None or self._read[0] != number:
            assert self._file is not None
            self._file.seek(block.begin)
            data = bytearray(4 * self.columns * int(block.ends[-1]))
            size = self._file.readinto(data)  # type: ignore[attr-defined]
            if size != len(data):
                raise OSError("a temporary file was cut short")
            self._read = number, np.frombuffer(data, np.float32).reshape(-1, self.columns)
        return self._read[1]
