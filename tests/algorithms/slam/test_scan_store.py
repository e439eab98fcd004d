"""The store of scans gives back what was put in, wherever that lies."""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mapcli.algorithms.slam.scan_store import BLOCK_SCANS, BLOCKS_IN_MEMORY, ScanStore

MANY = BLOCK_SCANS * (BLOCKS_IN_MEMORY + 3) + 7
"""Scans of which most go to the file."""


def points_of(scan: int) -> NDArray[np.float32]:
    """So many as the last digit says, and different from scan to scan."""
    return np.arange(2 * (scan % 10), dtype=np.float32).reshape(-1, 2) + scan


def filled(scans: int) -> ScanStore:
    store = ScanStore()
    for scan in range(scans):
        store.append(points_of(scan))
    return store


def in_memory(store: ScanStore) -> int:
    return sum(block.points is not None for block in store._blocks)


def assert_all_there(store: ScanStore, scans: int) -> None:
    assert len(store) == scans
    for scan in [*range(0, scans, 97), scans - 1, 0, 9, BLOCK_SCANS, BLOCK_SCANS - 1]:
        np.testing.assert_array_equal(store[scan], points_of(scan))
    np.testing.assert_array_equal(store[-1], points_of(scans - 1))
    with pytest.raises(IndexError):
        store[scans]


def test_what_is_put_in_comes_out() -> None:
    assert_all_there(filled(BLOCK_SCANS + 20), BLOCK_SCANS + 20)


def test_a_short_log_needs_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_file(**_: Any) -> None:
        raise AssertionError

    monkeypatch.setattr(tempfile, "TemporaryFile", no_file)
    filled(BLOCK_SCANS * BLOCKS_IN_MEMORY)


def test_a_long_log_is_in_a_file() -> None:
    store = filled(MANY)
    assert in_memory(store) == 0
    assert_all_there(store, MANY)


def test_without_a_temporary_folder_all_stays_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_file(**_: Any) -> None:
        raise FileNotFoundError("no usable temporary directory")

    monkeypatch.setattr(tempfile, "TemporaryFile", no_file)
    store = filled(MANY)
    assert in_memory(store) == BLOCKS_IN_MEMORY + 3
    assert_all_there(store, MANY)


class SmallDisk:
    """A file on a disk that is full after some blocks: the last write is cut short."""

    def __init__(self, file: Any, size: int) -> None:
        self.file, self.size = file, size

    def write(self, data: bytes) -> int:
        room = max(self.size - self.file.tell(), 0)
        if not room:
            raise OSError("no space left on device")
        return int(self.file.write(data[:room]))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)


def test_a_full_disk_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    real, size = tempfile.TemporaryFile, 4 * BLOCK_SCANS * 8 * 4 + 100
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **how: SmallDisk(real(**how), size))
    store = filled(MANY)
    assert 0 < in_memory(store) < BLOCKS_IN_MEMORY + 3
    assert_all_there(store, MANY)
