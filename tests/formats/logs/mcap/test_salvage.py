"""Damage anywhere in an MCAP file: what is readable is used, and every scan is accounted for."""

from __future__ import annotations

import random
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from conftest import SHARED
from mcap.opcode import Opcode
from mcap.writer import CompressionType
from support.mcap_making import mcap_bytes, odom, scan, tf_static, transform

from mapcli.errors import MapcliError
from mapcli.formats.logs.mcap.container_records import CHUNK, RECORD
from mapcli.formats.logs.mcap.frames import lz4_start, zstd_start
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.scan import RangeScan

DAMAGE = SHARED / "cases" / "damage"
SCANS = 200
_RANGES = 1 + 5 * np.random.default_rng(1).random((SCANS, 120))
BODY = [tf_static(1, transform(0, "base_link", "laser", (0.2, 0, 0)))] + [
    message
    for t in range(1, SCANS + 1)
    for message in (odom(t, t * 0.1), scan(t + 0.5, _RANGES[t - 1], increment=0.01))
]
LZ4, NONE = CompressionType.LZ4, CompressionType.NONE
SETTINGS = {
    "zstd": {"chunk_size": 8000},
    "lz4": {"chunk_size": 8000, "compression": LZ4},
    "zstd, one chunk": {"chunk_size": 1 << 20},
    "lz4, one chunk": {"chunk_size": 1 << 20, "compression": LZ4},
    "plain": {"chunk_size": 8000, "compression": NONE},
    "no chunks": {"use_chunking": False},
    "no statistics": {"chunk_size": 8000, "use_statistics": False},
}
LOGS = {name: mcap_bytes(*BODY, **settings) for name, settings in SETTINGS.items()}
"""Every kind of container, with the same 200 scans and as many odometry messages."""


def read(folder: Path, data: bytes) -> tuple[list[int], Log]:
    """The stamps of the scans, nanoseconds."""
    path = folder / "a.mcap"
    path.write_bytes(data)
    log = open_log([str(path)])
    return [r.stamp_ns for r in log.records() if isinstance(r, RangeScan)], log


def accounted(log: Log) -> int:
    """Scans that were read, and those that are said to be lost."""
    return log.damage.scans_read + sum(log.damage.missed.values())


def records_of(data: bytes, opcode: Opcode) -> list[tuple[int, int]]:
    """Start and end of the records of a kind, outside chunks."""
    found, at = [], 8
    while at < len(data) - 8:
        kind, length = RECORD.unpack_from(data, at)
        if kind == opcode:
            found.append((at, at + RECORD.size + length))
        at += RECORD.size + length
    return found


def flipped(data: bytes, at: int, bit: int) -> bytes:
    changed = bytearray(data)
    changed[at] ^= 1 << bit
    return bytes(changed)


@pytest.mark.parametrize("name", LOGS)
def test_undamaged(tmp_path: Path, name: str) -> None:
    stamps, log = read(tmp_path, LOGS[name])
    assert (len(stamps), log.damage.lines(), log.notes[1:]) == (SCANS, [], [])
    assert log.damage.lost_share == 0


@pytest.mark.parametrize("bit", range(0, 8, 3))
def test_without_chunks_one_bit_costs_one_message(tmp_path: Path, bit: int) -> None:
    """Wherever it is: in the opcode, the length, the head or the content of a message."""
    data = LOGS["no chunks"]
    start, end = records_of(data, Opcode.MESSAGE)[200]
    for at in [*range(start, start + 31), *range(start + 31, end, 50)]:
        stamps, log = read(tmp_path, flipped(data, at, bit))
        assert len(stamps) >= SCANS - 1, at
        assert accounted(log) == SCANS, at


@pytest.mark.parametrize("name", ["zstd", "lz4", "plain"])
def test_one_bit_in_the_head_of_a_chunk_costs_nothing(tmp_path: Path, name: str) -> None:
    data = LOGS[name]
    start, _ = records_of(data, Opcode.CHUNK)[5]
    letters = int.from_bytes(data[start + 37 : start + 41], "little")
    for at in range(start, start + RECORD.size + CHUNK.size + letters + 8):
        stamps, log = read(tmp_path, flipped(data, at, at % 8))
        assert accounted(log) == SCANS, at - start
        assert len(stamps) == SCANS, at - start


@pytest.mark.parametrize("name", LOGS)
def test_one_bit_in_the_summary_or_its_checksum_costs_nothing(tmp_path: Path, name: str) -> None:
    data = LOGS[name]
    start, _ = records_of(data, Opcode.DATA_END)[0]
    for at in range(start, len(data), 7):
        stamps, log = read(tmp_path, flipped(data, at, at % 8))
        assert len(stamps) == SCANS, at - start
        assert log.damage.lost_share == 0


@pytest.mark.parametrize("name", ["zstd, one chunk", "lz4, one chunk"])
def test_the_readable_start_of_a_damaged_chunk_is_used(tmp_path: Path, name: str) -> None:
    data = LOGS[name]
    ((start, end),) = records_of(data, Opcode.CHUNK)
    at = start + 2 * (end - start) // 3
    stamps, log = read(tmp_path, data[:at] + bytes(2000) + data[at + 2000 :])
    cut, _ = read(tmp_path, data[:at])
    assert stamps == cut
    assert len(cut) > 60
    lost = SCANS - len(cut)
    assert log.damage.missed == {"scans lost in damaged parts of the file": lost}
    assert log.damage.lost_share == lost / SCANS


def test_a_hole_at_the_start_of_a_chunk(tmp_path: Path) -> None:
    """As in hole.mcap: all that follows is elsewhere than the summary says."""
    data = LOGS["zstd"]
    chunks = records_of(data, Opcode.CHUNK)
    hole = chunks[4][1] - 100, chunks[7][0] + 100
    stamps, log = read(tmp_path, data[: hole[0]] + data[hole[1] :])
    before, _ = read(tmp_path, data[: hole[0]])
    assert stamps[: len(before)] == before
    assert len(stamps) >= SCANS * (1 - 4 / len(chunks)) - 2
    assert accounted(log) == SCANS


def test_what_a_chunk_lost_is_known_without_statistics(tmp_path: Path) -> None:
    """By the indexes behind it."""
    data = LOGS["no statistics"]
    start, end = records_of(data, Opcode.CHUNK)[5]
    stamps, log = read(tmp_path, data[: start + 60] + bytes(end - start - 60) + data[end:])
    assert len(stamps) < SCANS
    assert accounted(log) == SCANS
    assert not any("not known" in note for note in log.notes)


def test_where_it_is_not_known_how_much_was_lost_it_is_said(tmp_path: Path) -> None:
    data = LOGS["zstd"]
    stamps, log = read(tmp_path, data[: len(data) // 2])
    assert 90 < len(stamps) < 110
    assert log.damage.lost_share == 0
    assert "how many scans the damaged log held is not known" in log.notes


def test_a_chunk_without_messages_in_a_damaged_file(tmp_path: Path) -> None:
    data = mcap_bytes(*BODY[:1], scan(1), compression=NONE, chunk_size=1)  # a channel alone
    stamps, _ = read(tmp_path, data[:-1])
    assert len(stamps) == 1


def test_a_bit_in_a_checksum_of_a_frame_loses_nothing() -> None:
    content = np.random.default_rng(2).integers(0, 9, 300_000).astype(np.uint8).tobytes()
    zstd = zstandard.ZstdCompressor(write_checksum=True).compress(content)
    assert zstd_start(flipped(zstd, len(zstd) - 1, 3), 1 << 24) == content
    options = {"content_checksum": True, "block_checksum": True}
    for linked in (True, False):
        frame = lz4.frame.compress(content, block_linked=linked, **options)
        for at in (6, len(frame) - 1):
            assert lz4_start(flipped(frame, at, 3), 1 << 24) == content


def test_what_frames_give_is_bounded() -> None:
    giant = bytes(1 << 28)
    assert len(zstd_start(zstandard.compress(giant), 1 << 20)) < 1 << 25
    assert len(lz4_start(lz4.frame.compress(giant), 1 << 20)) < 1 << 23


@pytest.mark.parametrize("name", LOGS)
def test_damaged_anywhere_every_scan_is_accounted_for(tmp_path: Path, name: str) -> None:
    """Blocks are overwritten, taken out and put in: chunks that were not touched are all used."""
    rng, data = random.Random(7), LOGS[name]
    end, _ = records_of(data, Opcode.DATA_END)[0]
    first = records_of(data, Opcode.CHUNK)[0][1] if "chunks" not in name else 1000
    for _ in range(40):
        at = rng.randrange(min(first, end // 2), end - 2000)
        size = rng.choice((1, 9, 100, 1000))
        gone, put = rng.choice(((size, 0), (size, size), (0, size)))
        try:
            stamps, log = read(tmp_path, data[:at] + rng.randbytes(put) + data[at + gone :])
        except MapcliError:
            assert "one chunk" in name
            continue
        assert accounted(log) == SCANS
        # A chunk holds some 12 scans; a block touches two chunks at most.
        assert len(stamps) >= SCANS - 26 or "one chunk" in name


@pytest.mark.skipif(not DAMAGE.is_dir(), reason="needs the shared cases")
@pytest.mark.parametrize(("name", "used"), [("middle", 371), ("hole", 222)])
def test_the_handed_files(name: str, used: int) -> None:
    log = open_log(DAMAGE / f"{name}.mcap")
    scans = sum(isinstance(record, RangeScan) for record in log.records())
    assert (scans, accounted(log)) == (used, 509)
    assert log.damage.lost_share == (509 - used) / 509
