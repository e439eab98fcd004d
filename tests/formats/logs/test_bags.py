"""ROS 1 bags and ROS 2 bags in SQLite: written by the official writers' twins in rosbags, and left
behind by recorders that were killed."""

from __future__ import annotations

import bz2
import gzip
import lzma
import os
import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from conftest import FIXTURES
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from support import dresses
from support.dresses import said_in, same

from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.logs.bag.records import CHUNK, walk
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.scan import RangeScan, Record

CORRIDOR = FIXTURES / "corridor.mcap"
FIRST_SECONDS = 12.0
STRANGE = "gazebo_msgs/msg/PerformanceMetrics"
"""A type that rosbags does not know."""


SENT = said_in(CORRIDOR, FIRST_SECONDS)


def read(*paths: Path, **options: object) -> tuple[list[Record], Log]:
    log = open_log([str(path) for path in paths], LogOptions(**options))  # type: ignore[arg-type]
    return list(log.records()), log


def scans_in(records: list[Record]) -> int:
    return sum(isinstance(record, RangeScan) for record in records)


@pytest.fixture(scope="module")
def wanted(tmp_path_factory: pytest.TempPathFactory) -> list[Record]:
    """What the same messages are in MCAP."""
    folder = tmp_path_factory.mktemp("mcap") / "bag"
    write_ros2(folder, plugin=StoragePlugin.MCAP)
    return read(folder)[0]


def write_ros1(path: Path, compression: str | None = None, chunk_bytes: int = 1 << 15) -> Path:
    return dresses.write_ros1(path, SENT, compression, chunk_bytes)


def write_ros2(
    folder: Path,
    mode: CompressionMode | None = None,
    plugin: StoragePlugin = StoragePlugin.SQLITE3,
) -> Path:
    return dresses.write_ros2(folder, SENT, mode, plugin)


# --- ROS 1


@pytest.mark.parametrize("compression", [None, "lz4", "bz2"])
def test_a_ros_1_bag(tmp_path: Path, wanted: list[Record], compression: str | None) -> None:
    found, log = read(write_ros1(tmp_path / "a.bag", compression))
    same(found, wanted)
    assert not log.damage.counts
    assert {topic.encoding for topic in log.topics()} == {"ros1"}
    assert sum(topic.count for topic in log.topics()) == len(SENT)


def test_cut_at_60_percent_every_whole_chunk_is_read(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / "a.bag")
    data = path.read_bytes()
    cut = tmp_path / "cut.bag"
    cut.write_bytes(data[: len(data) * 6 // 10])
    with path.open("rb") as file:
        whole = [r.end for r in walk(file, len(data)) if r.op == CHUNK]
    last = max(end for end in whole if end <= len(data) * 6 // 10)
    held = McapFileTimes(path, last)
    found, log = read(cut)
    assert scans_in(found) >= held > 10
    assert "files cut short" in log.damage.counts
    assert "how many scans the damaged log held is not known" in log.notes


def McapFileTimes(path: Path, end: int) -> int:  # noqa: N802
    """Scans in the part of a bag before a byte, by an independent reader of messages."""
    data = path.read_bytes()[:end]
    scans = [said.message for said in SENT if said.topic == "/scan"]
    # The readings of a scan are bytes that occur nowhere else.
    return sum(scan.ranges[-48:].tobytes() in data for scan in scans)


def test_what_a_killed_recorder_leaves(tmp_path: Path, wanted: list[Record]) -> None:
    """`.bag.active`: no index, and the last chunk has no length yet."""
    path = write_ros1(tmp_path / "a.bag")
    data = bytearray(path.read_bytes())
    with path.open("rb") as file:
        places = [record for record in walk(file, len(data)) if record.op == CHUNK]
    last = places[-1]
    del data[last.end :]
    size = last.data - 4
    data[size : size + 4] = bytes(4)
    active = tmp_path / "a.bag.active"
    active.write_bytes(data)
    found, log = read(active)
    same(found, wanted)
    assert list(log.damage.counts) == ["files cut short"]


def test_a_chunk_with_a_broken_head(tmp_path: Path, wanted: list[Record]) -> None:
    path = write_ros1(tmp_path / "a.bag", "lz4")
    data = bytearray(path.read_bytes())
    with path.open("rb") as file:
        places = [record for record in walk(file, len(data)) if record.op == CHUNK]
    middle = places[len(places) // 2]
    data[middle.offset : middle.offset + 20] = b"\xff" * 20
    path.write_bytes(data)
    found, log = read(path)
    lost = scans_in(wanted) - scans_in(found)
    assert 0 < lost <= 12
    assert log.damage.counts["gaps of unreadable bytes, skipped"] == 1
    assert log.damage.counts["scans lost in damaged parts of the file"] == lost
    assert log.damage.lost_share == pytest.approx(lost / scans_in(wanted))


def test_a_chunk_with_broken_content(tmp_path: Path, wanted: list[Record]) -> None:
    for compression in ("lz4", "bz2"):
        path = write_ros1(tmp_path / f"{compression}.bag", compression)
        data = bytearray(path.read_bytes())
        with path.open("rb") as file:
            places = [record for record in walk(file, len(data)) if record.op == CHUNK]
        middle = places[len(places) // 2]
        data[middle.data + 100 : middle.data + 200] = bytes(100)
        path.write_bytes(data)
        found, log = read(path)
        lost = scans_in(wanted) - scans_in(found)
        assert 0 < lost <= 15
        assert log.damage.counts["scans lost in damaged parts of the file"] == lost


# --- ROS 2 in SQLite


@pytest.mark.parametrize("mode", [None, CompressionMode.MESSAGE, CompressionMode.FILE])
def test_a_ros_2_bag(tmp_path: Path, wanted: list[Record], mode: CompressionMode | None) -> None:
    folder = write_ros2(tmp_path / "bag", mode)
    found, log = read(folder)
    same(found, wanted)
    assert not log.damage.counts
    (file,) = (path for path in folder.iterdir() if path.suffix != ".yaml")
    same(read(file)[0], wanted)
    (folder / "metadata.yaml").unlink()
    same(read(folder)[0], wanted)


def database(folder: Path) -> Path:
    (path,) = write_ros2(folder).glob("*.db3")
    with sqlite3.connect(path) as bag:
        bag.execute("VACUUM")  # rosbag2 writes the topics before the messages
    return path


def test_other_topics_may_be_anything(tmp_path: Path, wanted: list[Record]) -> None:
    path = database(tmp_path / "bag")
    with sqlite3.connect(path) as bag:
        bag.execute(f"INSERT INTO topics VALUES (77, '/odd', '{STRANGE}', 'cbor', '', '')")
        bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (77, 5, x'00ff')")
        bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (78, 'x', 'text')")
    same(read(path)[0], wanted)


@pytest.mark.parametrize("mode", ["wal", "delete"])
def test_a_writer_that_was_killed(tmp_path: Path, wanted: list[Record], mode: str) -> None:
    """Committed rows of a write-ahead log count; those of a half transaction do not. The folder
    stays as it was, and may be read-only."""
    path = database(tmp_path / "bag")
    with sqlite3.connect(path) as bag:
        rows = bag.execute("SELECT topic_id, timestamp, data FROM messages").fetchall()
        bag.execute("DELETE FROM messages")
    bag.close()
    left = tmp_path / "left"
    left.mkdir()
    writer = sqlite3.connect(path, isolation_level=None)
    writer.execute(f"PRAGMA journal_mode={mode}")
    writer.execute("PRAGMA cache_size=5")
    writer.execute("BEGIN")
    add = "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)"
    writer.executemany(add, rows)
    writer.execute("COMMIT")
    writer.execute("BEGIN")
    writer.executemany(add, rows)  # spilled to the disk, never committed
    for file in path.parent.iterdir():
        shutil.copy(file, left)
    writer.execute("ROLLBACK")
    writer.close()
    (copy,) = left.glob("*.db3")
    assert any(file.name.endswith(("-wal", "-journal")) for file in left.iterdir())
    before = {file.name: file.read_bytes() for file in left.iterdir()}
    left.chmod(0o555)
    same(read(copy)[0], wanted)
    left.chmod(0o755)
    assert {file.name: file.read_bytes() for file in left.iterdir()} == before
    packed = left / f"{copy.name}.gz"  # to save room, without a look at what lies beside it
    packed.write_bytes(gzip.compress(copy.read_bytes()))
    copy.unlink()
    same(read(packed)[0], wanted)
    assert read(left)[1].sources[0].name == str(packed)


def test_a_database_that_is_cut(tmp_path: Path, wanted: list[Record]) -> None:
    path = database(tmp_path / "bag")
    os.truncate(path, path.stat().st_size // 2)
    found, log = read(path)
    assert scans_in(wanted) // 3 < scans_in(found) < scans_in(wanted)
    assert log.damage.counts["databases with broken pages"] == 1
    lost = log.damage.counts["scans lost in damaged parts of the file"]
    assert lost == scans_in(wanted) - scans_in(found)  # metadata.yaml tells


def test_a_hole_in_a_database(tmp_path: Path, wanted: list[Record]) -> None:
    path = database(tmp_path / "bag")
    data = bytearray(path.read_bytes())
    middle = len(data) // 2 // 4096 * 4096
    data[middle : middle + 8192] = bytes(8192)
    path.write_bytes(data)
    found, log = read(path)
    assert scans_in(found) > scans_in(wanted) * 8 // 10
    times = [record.stamp_ns for record in found if isinstance(record, RangeScan)]
    assert times[-1] == wanted[-1].stamp_ns or times[-1] > wanted[len(wanted) * 9 // 10].stamp_ns
    assert log.damage.counts


# --- Packed files and folders


PACK: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lambda data: lzma.compress(data, preset=0),
    ".zst": zstandard.ZstdCompressor().compress,
    ".lz4": lz4.frame.compress,
}


@pytest.mark.parametrize("packing", PACK)
def test_anything_may_be_packed(tmp_path: Path, wanted: list[Record], packing: str) -> None:
    for plain in (write_ros1(tmp_path / "a.bag"), database(tmp_path / "bag")):
        packed = tmp_path / f"{plain.name}{packing}"
        packed.write_bytes(PACK[packing](plain.read_bytes()))
        same(read(packed)[0], wanted)


@pytest.mark.parametrize("packing", PACK)
def test_what_comes_before_the_damage_of_a_packing_is_read(tmp_path: Path, packing: str) -> None:
    """Packings give their content in blocks of up to a megabyte."""
    chance, lines = random.Random(1), []
    for k in range(2500):
        ranges = " ".join(f"{chance.uniform(1, 9):.3f}" for _ in range(180))
        lines.append(f"FLASER 180 {ranges} {k} 0 0 {k} 0 0 {k}.0 host {k}.0\n")
    packed = PACK[packing]("".join(lines).encode())
    path = tmp_path / f"a.log{packing}"
    path.write_bytes(packed[: len(packed) * 8 // 10])
    found, log = read(path)
    assert 900 < scans_in(found) < 2100
    assert any("streams without an end" in what for what in log.damage.counts)


def test_a_split_recording_in_a_folder_without_metadata(
    tmp_path: Path, wanted: list[Record]
) -> None:
    middle = SENT[len(SENT) // 2].time
    source = database(tmp_path / "bag")
    folder = tmp_path / "parts"
    folder.mkdir()
    for number, keep in enumerate((f"timestamp < {middle}", f"timestamp >= {middle}")):
        part = folder / f"rec_{number}.db3"
        shutil.copy(source, part)
        with sqlite3.connect(part) as bag:
            bag.execute(f"DELETE FROM messages WHERE NOT ({keep}) AND topic_id NOT IN "
                        "(SELECT id FROM topics WHERE name = '/tf_static')")  # fmt: skip
    same(read(folder)[0], wanted)


def test_poses_in_bags(tmp_path: Path) -> None:
    truth = load_trajectory(str(CORRIDOR)).trajectory
    for path in (write_ros1(tmp_path / "a.bag"), write_ros2(tmp_path / "bag")):
        found = load_trajectory(str(path)).trajectory
        assert found.poses.tolist() == truth.poses[: len(found)].tolist()
        assert len(found) > 50
