"""The small files that the examples read, and a folder of their own for each test."""

from __future__ import annotations

import io
import math
import os
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import FIXTURES, run

from mapcli.errors import printable

NOBODY = 65534
"""A user without rights."""

HANG_S, MEMORY_BYTES = 120, 1 << 30
"""What no command on a file of a few kilobytes may take: seconds, though it compiles its loops on
a machine with other work, and address space more than before."""

ODD_NAMES = {
    "control characters": "a\x1b]52;c;eA==\x07\n\x9b",
    "no UTF-8": os.fsdecode(b"n\xff\xfe"),
    "spaces and other letters": "a - b 地図 ü⊙",
}
"""Letters of files that programs trip over."""

COPIED = {
    "room.txt": "corner.txt", "world.yaml": "corridor.yaml", "path.txt": "corridor-path.txt",
    "lawn.yaml": "lawn.yaml", "points.yaml": "landmarks-map.yaml",
    "landmarks.yaml": "landmarks.yaml", "scan.yaml": "corner-scan.yaml",
}  # fmt: skip


def make_kit(folder: Path) -> None:
    """Every file that an example reads."""
    for name, source in COPIED.items():
        shutil.copy(FIXTURES / source, folder / name)
    room = (folder / "room.txt").read_text()
    (folder / "known.txt").write_text(room.replace("0 0 0 ?", "? ? ? ?"))
    ranges = " ".join(f"{2 + 0.3 * math.sin(k / 9):.2f}" for k in range(181))
    scans = (f"FLASER 181 {ranges} {x} 0 0 {x} 0 0 {k}.0 host {k}.0\n"
             for k, x in enumerate((0, 0.1, 0.2)))  # fmt: skip
    (folder / "carmen.log").write_text("".join(scans))
    (folder / "pairs.relations").write_text("1600000000.0 1600000000.4 0.1 0 0 0 0 0\n")
    (folder / "there-and-back.txt").write_text("0.8 0.9\n5.25 1.0\n0.8 0.9\n5.25 1.0\n")
    f = str(folder)
    for line in (
        f"convert {f}/room.txt {f}/image.yaml",
        f"convert {f}/room.txt {f}/picture.png",
        f"perceive {f}/room.txt {f}/database.yaml --cell 4,6 --beams 8",
        f"perceive {f}/room.txt {f}/trials.yaml --cell 4,6 --beams 8 --noise 0.1 --times 2",
        f"perceive {f}/room.txt {f}/measured.yaml --cell 4,6 --beams 8 --alone",
        f"import {FIXTURES}/corridor.mcap {f}/log.mcap --end 0.8",
        f"import {FIXTURES}/corridor.mcap {f}/more.mcap --start 1 --end 1.5",
        f"slam-replay {f}/log.mcap --json {f}/trace.json --trace {f}/truth.tum "
        f"--save-state {f}/state.mcap",
        f"convert {f}/trace.json {f}/other.csv",
        f"simulate {f}/world.yaml {f}/round.mcap --path {f}/there-and-back.txt --speed 2 "
        "--beams 90 --scan-rate 4",
        f"slam-replay {f}/round.mcap --trace {f}/round.tum --search none",
        f"simulate {f}/world.yaml {f}/robot.csv --path {f}/path.txt --odom-rate 5 --scan-rate 5 "
        "--range-max 1 --sensor r1=0.06,0,0 --sensor r2=0,0.05,90",
    ):
        assert run(*line.split(), "-q") == 0, line
    (folder / "robot.yaml").rename(folder / "sensors.yaml")


@dataclass(frozen=True)
class Ran:
    """What a command did: exit code, stdout, stderr, and the files that are new or other."""

    status: int
    out: bytes
    err: str
    files: dict[str, bytes]

    def is_fine(self) -> None:
        """Nothing was wrong."""
        assert self.status == 0, self.err
        assert "Error" not in self.err

    def is_one_error(self, *names: str) -> None:
        """It failed with one line that begins with one of these files, and left nothing."""
        assert self.status == 1, self.err
        (error,) = (line for line in self.err.splitlines() if line.startswith("Error: "))
        assert error.startswith(tuple(f"Error: {printable(name)}: " for name in names)), error
        self.is_no_fault()
        assert not self.files

    def is_no_fault(self) -> None:
        """It ended as a command does."""
        assert self.status in (0, 1, 2)
        for word in ("Traceback", "fault in mapcli", "\x1b"):
            assert word not in self.err


class Sandbox:
    """The current folder, with the kit in it, and a folder for temporary files beside it
    (stateful)."""

    def __init__(self, root: Path, captured: pytest.CaptureFixture[bytes]) -> None:
        self.folder, self.temporary = root / "here", root / "temporary"
        self._captured = captured

    def state(self) -> dict[str, bytes]:
        """Every regular file in the folder."""
        paths = [os.path.join(folder, name) for folder, _, names in os.walk(".") for name in names]
        return {os.path.relpath(path): Path(path).read_bytes() for path in paths
                if os.path.isfile(path) and os.access(path, os.R_OK)}  # fmt: skip

    def run(self, *arguments: str, stdin: bytes | None = None, as_nobody: bool = False) -> Ran:
        """Run `mapcli` in this process; no temporary file may stay."""
        before = self.state()
        self._captured.readouterr()
        with limited(), reading(stdin), nobody(as_nobody):
            status = run(*arguments)
        out, err = self._captured.readouterr()
        after = self.state()
        assert not list(self.temporary.iterdir())
        assert not [name for name in os.listdir(self.folder) if name.startswith(".mapcli-")]
        assert before.keys() <= after.keys()
        changed = {name: data for name, data in after.items() if before.get(name) != data}
        return Ran(status, out, err.decode(), changed)


@contextmanager
def limited() -> Iterator[None]:
    """Neither hanging nor all of the memory: what reads a device to its end fails instead."""

    def hangs(*_: object) -> None:
        raise AssertionError(f"no end after {HANG_S} s")

    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    handler = signal.signal(signal.SIGALRM, hangs)
    signal.setitimer(signal.ITIMER_REAL, HANG_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


@contextmanager
def reading(data: bytes | None) -> Iterator[None]:
    """These bytes as standard input, in order and only once."""
    before = sys.stdin
    if data is not None:
        sys.stdin = io.TextIOWrapper(io.BufferedReader(OneWay(data)))
    try:
        yield
    finally:
        sys.stdin = before


class OneWay(io.RawIOBase):
    """A pipe: it cannot go back (stateful)."""

    def __init__(self, data: bytes) -> None:
        self._rest = io.BytesIO(data)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray) -> int:  # type: ignore[override]
        return self._rest.readinto(buffer)


@contextmanager
def nobody(wanted: bool) -> Iterator[None]:
    """The rights of a user who is not the owner of anything; of one who is not root anyway, they
    are as they were."""
    drops = wanted and os.geteuid() == 0
    if drops:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if drops:
            os.seteuid(0)


@contextmanager
def folder_for_all() -> Iterator[Path]:
    """A new folder that another user finds, too, which pytest's own are not."""
    root = Path(tempfile.mkdtemp(prefix="conformance-"))
    try:
        (root / "here").mkdir()
        (root / "temporary").mkdir()
        for path in (root, *root.iterdir()):
            path.chmod(0o777)
        yield root
    finally:
        shutil.rmtree(root)
