"""Damaged MCAP files: what can be read is read, what is lost is counted, strict refuses."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import CompressionType
from support.mcap_making import mcap_bytes, odom, scan, tf_static, transform

from mapcli.errors import FormatError, MapcliError
from mapcli.formats.logs.mcap.container_records import RECORD
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import LogOptions
from mapcli.model.scan import RangeScan, Record

BODY = [tf_static(1, transform(0, "base_link", "laser", (0.2, 0, 0)))] + [
    message for t in range(1, 61) for message in (odom(t), scan(t + 0.5, [1, 2, t / 9] * 9))
]
GOOD = mcap_bytes(*BODY)
CONTAINERS = {
    "zstd": GOOD,
    "lz4": mcap_bytes(*BODY, compression=CompressionType.LZ4),
    "plain": mcap_bytes(*BODY, compression=CompressionType.NONE),
    "no checksums": mcap_bytes(*BODY, compression=CompressionType.NONE, enable_crcs=False),
    "no chunks": mcap_bytes(*BODY, use_chunking=False),
}


def read(folder: Path, data: bytes, **options: Any) -> tuple[list[Record], Log]:
    path = folder / "a.mcap"
    path.write_bytes(data)
    log = open_log([str(path)], LogOptions(**options))
    return list(log.records()), log


def scans_in(records: list[Record]) -> int:
    return sum(isinstance(record, RangeScan) for record in records)


def offsets(data: bytes, opcode: Opcode) -> list[int]:
    """Where the records of a kind start."""
    found, at = [], 8
    while at < len(data) - 8:
        kind, length = RECORD.unpack_from(data, at)
        if kind == opcode:
            found.append(at)
        at += RECORD.size + length
    return found


def patched(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


CHUNKS = offsets(GOOD, Opcode.CHUNK)


def test_a_good_file_is_not_damaged(tmp_path: Path) -> None:
    records, log = read(tmp_path, GOOD, strict=True)
    assert (len(records), scans_in(records), log.damage.counts) == (120, 60, {})


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("share", [0.4, 0.7, 0.95, 0.999])
def test_a_truncated_file_gives_what_it_holds(tmp_path: Path, container: str, share: float) -> None:
    data = CONTAINERS[container]
    end = offsets(data, Opcode.DATA_END)[0]
    records, log = read(tmp_path, data[: int(end * share)])
    # All chunks before the cut, which hold some 5 messages each, and what is left of the last.
    assert share * 120 - 15 <= len(records) <= share * 120 + 15
    assert log.damage.lines() == [f"1 file cut short (byte {int(end * share)})"]
    assert log.scan_count == scans_in(records)
    with pytest.raises(FormatError, match="1 file cut short; expected an undamaged log"):
        read(tmp_path, data[: int(end * share)], strict=True)


def test_the_chunk_at_the_end_is_used_as_far_as_it_goes(tmp_path: Path) -> None:
    data = CONTAINERS["plain"]
    chunk, following = offsets(data, Opcode.CHUNK)[2:4]
    whole = len(read(tmp_path, data[:chunk])[0])
    cut = len(read(tmp_path, data[: chunk + (following - chunk) // 2])[0])
    assert whole + 2 <= cut


def test_a_recording_that_was_never_closed(tmp_path: Path) -> None:
    records, log = read(tmp_path, GOOD[: offsets(GOOD, Opcode.DATA_END)[0]])
    assert len(records) == 120
    assert list(log.damage.counts) == ["files cut short"]


def test_a_wrong_checksum_loses_nothing(tmp_path: Path) -> None:
    data = patched(GOOD, CHUNKS[3] + RECORD.size + 24, b"\x01\x02\x03\x04")
    records, log = read(tmp_path, data)
    assert len(records) == 120
    assert log.damage.lines() == [f"1 chunk with a wrong checksum (byte {CHUNKS[3]})"]
    with pytest.raises(FormatError, match=rf"byte {CHUNKS[3]}: 1 chunk with a wrong checksum"):
        read(tmp_path, data, strict=True)


@pytest.mark.parametrize("container", ["zstd", "lz4"])
def test_broken_data_lose_one_chunk(tmp_path: Path, container: str) -> None:
    data = CONTAINERS[container]
    chunks = offsets(data, Opcode.CHUNK)
    middle = (chunks[3] + chunks[4]) // 2 - 60
    records, log = read(tmp_path, patched(data, middle, bytes(40)))
    assert 90 < len(records) < 120
    assert any(line.startswith("1 chunk with ") for line in log.damage.lines())


@pytest.mark.parametrize("container", ["zstd", "lz4"])
def test_the_name_of_a_compression_may_be_wrong(tmp_path: Path, container: str) -> None:
    """The content says how it is compressed."""
    data = CONTAINERS[container]
    name = offsets(data, Opcode.CHUNK)[3] + RECORD.size + 32
    records, log = read(tmp_path, patched(data, name, b"gzip"[: len(container)]))
    assert len(records) == 120
    assert f"chunks with unknown compression {'gzip'[: len(container)]!r}" in log.damage.counts


def test_unknown_compression_loses_that_chunk(tmp_path: Path) -> None:
    records, log = read(tmp_path, packed_with_gzip(GOOD, CHUNKS[3:4]))
    assert 90 < len(records) < 120
    assert "chunks with unknown compression 'gzip'" in log.damage.counts


def test_all_chunks_in_an_unknown_compression(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"not one scan can be read .*unknown compression 'gzip'"):
        read(tmp_path, packed_with_gzip(GOOD, CHUNKS))


def packed_with_gzip(data: bytes, chunks: list[int]) -> bytes:
    """Chunks that say they are, as their first bytes do."""
    for chunk in chunks:
        data = patched(data, chunk + RECORD.size + 32, b"gzip")
        data = patched(data, chunk + RECORD.size + 32 + 4 + 8, b"\x1f\x8b\x08\x00")
    return data


@pytest.mark.parametrize("length", [0, 3, 1 << 40, (1 << 64) - 1])
def test_a_wrong_length_loses_nothing(tmp_path: Path, length: int) -> None:
    """A chunk tells its length twice."""
    data = patched(GOOD, CHUNKS[3] + 1, struct.pack("<Q", length))
    records, log = read(tmp_path, data)
    assert len(records) == 120
    assert log.damage.lines()[0] == f"1 chunk with a broken head or end (byte {CHUNKS[3]})"


@pytest.mark.parametrize("container", CONTAINERS)
def test_a_hole_in_the_middle(tmp_path: Path, container: str) -> None:
    data = CONTAINERS[container]
    middle = len(data) // 2
    records, log = read(tmp_path, data[:middle] + bytes(700) + data[middle + 700 :])
    assert 60 < len(records) < 120
    assert log.damage.counts


def test_bytes_added_in_the_middle_move_all_that_follows(tmp_path: Path) -> None:
    at = CHUNKS[4]
    records, log = read(tmp_path, GOOD[:at] + b"some nonsense" * 5 + GOOD[at:])
    assert len(records) == 120
    assert "gaps of unreadable bytes, skipped" in log.damage.counts


def test_the_index_may_be_wrong(tmp_path: Path) -> None:
    """It is not used; only its checksum is looked at."""
    for at in offsets(GOOD, Opcode.CHUNK_INDEX):
        data = patched(GOOD, at + RECORD.size + 16, struct.pack("<Q", 77))
    records, log = read(tmp_path, data)
    assert len(records) == 120
    assert list(log.damage.counts) == ["tables of contents that cannot be read"]


def test_message_indexes_may_be_wrong(tmp_path: Path) -> None:
    """A chunk is not skipped on the word of an index that contradicts the statistics."""
    data = GOOD
    for at in offsets(GOOD, Opcode.MESSAGE_INDEX):
        data = patched(data, at + RECORD.size, b"\x63\x00")
    records, log = read(tmp_path, data)
    assert (len(records), log.damage.counts) == (120, {})


def test_a_giant_size_does_not_exhaust_the_memory(tmp_path: Path) -> None:
    data = patched(GOOD, CHUNKS[3] + RECORD.size + 16, struct.pack("<Q", 1 << 60))
    records, log = read(tmp_path, data)
    assert (len(records), log.damage.counts) == (120, {})  # zstd knows better


def test_no_mcap_at_all(tmp_path: Path) -> None:
    for data in (b"\x89MCAP0\r\n", GOOD[:20]):
        with pytest.raises(MapcliError, match=r"a.mcap: 1 file cut short .*no range scans"):
            read(tmp_path, data)
    for data in (b"\x89MCAP1\r\n", GOOD[:5], b"\x89PNG"):
        with pytest.raises(FormatError, match=r"a.mcap: is (no log|a PNG image).*; expected an"):
            read(tmp_path, data)


@pytest.mark.slow
@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    container=st.sampled_from(sorted(CONTAINERS)),
    cut=st.floats(0, 1) | st.just(1.0),
    flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 7)), max_size=5),
    zeros=st.tuples(st.floats(0, 1), st.integers(0, 400)),
    strict=st.booleans(),
)
def test_damaged_anywhere_nothing_but_our_errors(
    tmp_path_factory: pytest.TempPathFactory,
    container: str,
    cut: float,
    flips: list[tuple[float, int]],
    zeros: tuple[float, int],
    strict: bool,
) -> None:
    data = bytearray(CONTAINERS[container])
    last = len(data) - 1
    for at, bit in flips:
        data[8 + int(at * (last - 8))] ^= 1 << bit
    start = 8 + int(zeros[0] * (last - 8))
    data[start : start + zeros[1]] = bytes(len(data[start : start + zeros[1]]))
    folder = tmp_path_factory.mktemp("fuzz")
    try:
        records, log = read(folder, bytes(data[: 8 + int(cut * last)]), strict=strict)
    except MapcliError:
        return
    stamps = [record.stamp_ns for record in records]
    assert stamps == sorted(stamps)
    if len(records) < 120 and container != "no checksums":
        assert log.damage.counts  # nothing is lost without a word
