"""Every kind of file, given to every command where it reads one: it works, or one line says what
the file is and which command reads it."""

from __future__ import annotations

import gzip
import io
import shutil
import sqlite3
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from conformance.examples import Example, Slot, all_examples
from conformance.kit import Sandbox
from conftest import run
from PIL import Image

from mapcli.formats.file_kind import Role, kind_at

INPUTS = [
    pytest.param(example, slot, id=f"{example.name}-{slot.parameter}-{slot.name}")
    for example in all_examples()
    for slot in example.slots
    if not slot.written
]

FROM_KIT = (
    "log.mcap", "carmen.log", "robot.csv", "sensors.yaml", "trace.json", "truth.tum", "world.yaml",
    "room.txt", "image.yaml",
    "scan.yaml", "database.yaml", "path.txt", "image.pgm",
)  # fmt: skip

MADE_BY = {
    "exploration.json": "frontier {kit}/room.txt --robot 5,6 -q --json",
    "table.json": "similarity-table {kit}/room.txt {kit}/scan.yaml -q --json",
    "evaluation.json": "evaluate {kit}/trace.json {kit}/truth.tum -q --json",
    "log-info.json": "info {kit}/log.mcap -q --json",
    "map-info.json": "info {kit}/room.txt -q --json",
    "scan.json": "perceive {kit}/log.mcap --at 0.5 -q",
    "trace.kitti": "slam-replay {kit}/log.mcap -q --trace",
    "trace.g2o": "slam-replay {kit}/log.mcap -q --trace",
    "trace.csv": "slam-replay {kit}/log.mcap -q --trace",
    "drawn.png": "render {kit}/room.txt -q --png",
}
"""Outputs of mapcli -> the command that writes them, as its last word."""


def picture(form: str) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (8, 8), "red").save(stream, form)
    return stream.getvalue()


def zipped(data: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("robot.mcap", data)
    return stream.getvalue()


def tarred(data: bytes) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        entry = tarfile.TarInfo("robot.mcap")
        entry.size = len(data)
        archive.addfile(entry, io.BytesIO(data))
    return stream.getvalue()


MADE_OF: dict[str, Callable[[bytes], bytes]] = {
    "photo.jpg": lambda _: picture("JPEG"),
    "film.gif": lambda _: picture("GIF"),
    "log.zip": zipped,
    "log.tar.gz": tarred,
    "map.txt.gz": lambda _: gzip.compress(b"0 0 1\n? 0 1\n"),
    "page.mcap": lambda _: b"<!DOCTYPE html>\n<html><body>404</body></html>\n",
    "robot.bag": lambda _: b"#ROSBAG V2.0\n" + bytes(100),
    "log.mcap.zst": lambda data: zstandard.compress(data),
    "curve.csv": lambda _: b"strategy,step,time_steps\nnearest,0,0\n",
    "metadata.yaml": lambda _: b"rosbag2_bagfile_information:\n  version: 5\n",
}
"""Files made of the bytes of a log."""

OTHERS = [*FROM_KIT, *MADE_BY, *MADE_OF, "table.db3", "folder", "bag"]


@pytest.fixture(scope="session")
def others(kit: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one file of every kind."""
    folder = tmp_path_factory.mktemp("others")
    for name in FROM_KIT:
        shutil.copy(kit / name, folder)
    for name, line in MADE_BY.items():
        assert run(*line.format(kit=kit).split(), folder / name) == 0, name
    for name, make in MADE_OF.items():
        (folder / name).write_bytes(make((kit / "log.mcap").read_bytes()))
    database = sqlite3.connect(folder / "table.db3")
    database.execute("create table topics(id integer)")
    database.close()
    (folder / "bag").mkdir()
    shutil.copy(kit / "log.mcap", folder / "bag")
    (folder / "folder").mkdir()
    (folder / "folder" / "map.yaml").touch()
    (folder / "folder" / "trace.json").touch()
    return folder


@pytest.mark.parametrize("other", OTHERS)
def test_every_kind_is_known(other: str, others: Path) -> None:
    assert kind_at(others / other) is not None


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_a_file_of_another_kind(
    example: Example, slot: Slot, other: str, others: Path, sandbox: Sandbox
) -> None:
    path, name = others / other, f"other-{other}"
    (shutil.copytree if path.is_dir() else shutil.copy)(path, name)
    shutil.copy(others / "image.pgm", "image.pgm")
    ran = sandbox.run(*example.arguments({slot: name}))
    ran.is_no_fault()
    assert ran.err.count("Error: ") == (ran.status != 0), ran.err
    kind = kind_at(name)
    assert kind is not None
    if ran.status == 1 and kind.role not in read_there(example, slot):
        (error,) = (line for line in ran.err.splitlines() if line.startswith("Error: "))
        assert error.startswith(f"Error: {name}: is {kind}"), error


def read_there(example: Example, slot: Slot) -> set[Role]:
    """The kinds of files that a command can read in a place, though one may not suit the others."""
    own = kind_at(slot.name)
    assert own is not None
    if example.command == "info":
        return set(Role) - {Role.ARCHIVE, Role.OTHER}
    return {own.role} | ALSO_READ.get(own.role, set())


ALSO_READ = {
    Role.WORLD: {Role.MAP},
    Role.MAP: {Role.WORLD},
    Role.TRACE: {Role.LOG},
    Role.WAYPOINTS: {Role.TRACE},
}
"""Where the one is read, so is the other, by some commands: grid maps as worlds, the poses in an
MCAP file, a trace as a path."""
