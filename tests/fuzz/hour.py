"""Fuzzing by hand, for as long as one likes.

    python tests/fuzz/hour.py [--minutes 60] [--seed N] [--only WORDS] [--failures FOLDER]

Takes the readers and commands in turn, readers twice as often, half of the inputs mutated and half
from the grammar, and prints for each how many inputs there were, how many of them were accepted,
how many were made and read in a second, the slowest one, the most memory and the faults; times are
the processor's. An input that broke a bound is kept in FOLDER. Ctrl-C or SIGTERM ends it before
its time. The exit code is 1 if there was a fault. Files are written to TMPDIR; where that is in
memory (TMPDIR=/dev/shm), there is time for more of them.
"""

from __future__ import annotations

import argparse
import hashlib
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from random import Random

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]

from fuzz.bounds import FaultError, Read, peak_bytes, watched  # noqa: E402
from fuzz.commands import COMMANDS  # noqa: E402
from fuzz.readers import COMPANIONS, READERS, Reader  # noqa: E402

ROUND_S = 2.0
"""How long a reader has its turn."""

LARGE = 1e-4
"""How often a reader's input is a large file: reading one takes as long as thousands of others."""


@dataclass
class Tally:
    """What came of a reader's inputs."""

    inputs: int = 0
    accepted: int = 0
    faults: int = 0
    seconds: float = 0.0
    slowest_s: float = 0.0
    peak_mb: float = 0.0

    def line(self, name: str) -> str:
        return (
            f"| {name} | {self.inputs:,} | {self.accepted:,} | {self.inputs / self.seconds:,.0f} "
            f"| {self.slowest_s * 1e3:,.0f} | {self.peak_mb:,.0f} | {self.faults} |"
        )


def _input(reader: Reader, random: Random) -> bytes:
    if reader in READERS and random.random() < LARGE:
        return reader.swollen(random, random.choice((30_000, 300_000, 900_000)))
    return reader.mutated(random) if random.random() < 0.5 else reader.made(random)


def turn(
    reader: Reader, tally: Tally, random: Random, folder: Path, failures: Path,
    bounded: Callable[[Read, Path], str | None],
) -> None:  # fmt: skip
    """Feed a reader for `ROUND_S` seconds."""
    path = folder / f"in{reader.suffix}"
    begin = time.process_time()
    while time.process_time() < begin + ROUND_S:
        data = _input(reader, random)
        path.write_bytes(data)
        before = time.process_time()
        try:
            tally.accepted += bounded(reader.read, path) is None
        except FaultError as fault:
            tally.faults += 1
            failures.mkdir(parents=True, exist_ok=True)
            digest = hashlib.sha256(data).hexdigest()[:12]
            kept = failures / f"{reader.name.replace(' ', '-')}-{digest}{reader.suffix}"
            kept.write_bytes(data)
            print(f"FAULT: {reader.name}: {fault}: {kept}", flush=True)
        tally.slowest_s = max(tally.slowest_s, time.process_time() - before)
        tally.peak_mb = max(tally.peak_mb, peak_bytes() / 1e6)
        tally.inputs += 1
    tally.seconds += time.process_time() - begin
    path.unlink()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=time.time_ns())
    parser.add_argument("--only", default="", help="readers whose names have this in them")
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"))
    given = parser.parse_args()
    readers = [one for one in (*READERS, *READERS, *COMMANDS) if given.only in one.name]
    tallies = {reader.name: Tally() for reader in readers}
    random, end = Random(given.seed), time.monotonic() + given.minutes * 60
    print(f"seed {given.seed}", flush=True)
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "inputs"
        folder.mkdir()
        for name, data in COMPANIONS.items():
            (folder / name).write_bytes(data)
        for reader in readers:
            reader.warm_up(folder / f"in{reader.suffix}")
        with watched(Path(scratch) / "stderr") as bounded:
            for reader in cycle(readers):
                if stopped.is_set() or time.monotonic() > end:
                    break
                turn(reader, tallies[reader.name], random, folder, given.failures, bounded)
    print("\n| reader | inputs | accepted | a second | slowest, ms | peak, MB | faults |")
    print("|---|---|---|---|---|---|---|")
    for name, tally in tallies.items():
        if tally.inputs:
            print(tally.line(name))
    print(f"\n{sum(tally.inputs for tally in tallies.values()):,} inputs")
    return 1 if any(tally.faults for tally in tallies.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
