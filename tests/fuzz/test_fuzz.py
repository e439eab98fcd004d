"""Every reader, and commands on what they read, with damaged and with made-up files.

`hour.py` does the same by hand, for as long as one likes and with other inputs each time.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pytest
from fuzz.bounds import MEMORY_BYTES, FaultError, Read, watched
from fuzz.commands import COMMANDS
from fuzz.readers import COMPANIONS, READERS, Reader
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mapcli.errors import FormatError

EXAMPLES, OF_COMMANDS = 400, 60
"""Inputs of each reader and command by either generator: together two minutes on one core."""


LARGE, LARGE_BYTES = 8, 300_000
"""Files of each reader that are large, and how large they are."""


def fuzzing(examples: int) -> settings:
    """The same inputs in every run."""
    return settings(
        max_examples=examples, derandomize=True, database=None, deadline=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the fuzzed file goes, and what lies beside it."""
    inputs = tmp_path / "inputs"
    inputs.mkdir()
    for name, data in COMPANIONS.items():
        (inputs / name).write_bytes(data)
    return inputs


@pytest.mark.slow
@pytest.mark.parametrize("reader", [*READERS, *COMMANDS], ids=lambda reader: reader.name)
@pytest.mark.parametrize("make", [Reader.mutated, Reader.made], ids=["mutated", "made"])
def test_bounds(reader: Reader, make: Callable[[Reader, Random], bytes], folder: Path) -> None:
    path = folder / f"in{reader.suffix}"
    reader.warm_up(path)
    with watched(folder.parent / "stderr") as bounded:

        @fuzzing(EXAMPLES if reader in READERS else OF_COMMANDS)
        @given(st.randoms(use_true_random=False))
        def within_bounds(random: Random) -> None:
            path.write_bytes(make(reader, random))
            bounded(reader.read, path)

        within_bounds()


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_bounds_of_large_files(reader: Reader, folder: Path) -> None:
    path = folder / f"in{reader.suffix}"
    reader.warm_up(path)
    with watched(folder.parent / "stderr") as bounded:
        for seed in range(LARGE):
            path.write_bytes(reader.swollen(Random(seed), LARGE_BYTES))
            bounded(reader.read, path)


@pytest.mark.parametrize("reader", [*READERS, *COMMANDS], ids=lambda reader: reader.name)
def test_seeds_are_valid(reader: Reader, folder: Path) -> None:
    """Of each reader some seed is accepted: else nothing behind the first check is reached."""
    path = folder / f"in{reader.suffix}"
    said = []
    reader.warm_up(path)
    with watched(folder.parent / "stderr") as bounded:
        for seed in reader.seeds:
            path.write_bytes(seed)
            said.append(bounded(reader.read, path))
    assert None in said, said


def raising(error: Exception) -> Read:
    def read(_path: Path) -> None:
        raise error

    return read


def forever(_path: Path) -> None:
    while True:
        pass


@pytest.mark.parametrize(
    ("read", "fault"),
    [
        (raising(IndexError("no\nmapcli error")), "IndexError: no"),
        (raising(MemoryError()), "MemoryError"),
        (raising(FormatError("is bad")), "an error that does not name in: 'is bad'"),
        (lambda _: np.ones(MEMORY_BYTES // 64), r"took \d+ MB"),
        (lambda _: warnings.warn("odd", stacklevel=1), "UserWarning: odd"),
        (lambda _: os.write(2, b"libpng: odd"), "wrote to stderr: b'libpng: odd'"),
        (forever, "took more than 0.5 s"),
    ],
)
def test_faults_are_found(
    read: Read, fault: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if read is forever:
        monkeypatch.setattr("fuzz.bounds.SECONDS", 0.5)
    monkeypatch.setattr("fuzz.bounds.MEMORY_BYTES", MEMORY_BYTES // 16)
    with (
        watched(folder.parent / "stderr") as bounded,
        pytest.raises(FaultError, match=f"^{fault}"),
    ):
        bounded(read, folder / "in")


def test_what_is_no_fault(folder: Path) -> None:
    path = folder / "in"
    with watched(folder.parent / "stderr") as bounded:
        assert bounded(raising(FormatError("is bad", file=path)), path) == f"{path}: is bad"
        assert bounded(lambda _: np.ones(MEMORY_BYTES // 128), path) is None
