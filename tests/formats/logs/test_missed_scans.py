"""Scans lost to damage count in the part of a log where they would be, and on its grid of N-th.

The log has odometry at 1, 2, ... 20 s and scans half a second later; of the scans, numbers 8 to 12
are lost. Seconds count from the first record, so scan k is at k - 0.5 s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType
from support.mcap_making import S, mcap_bytes, odom, scan

from mapcli.formats.logs import log as log_module
from mapcli.formats.logs.mcap.container_records import CHUNK, RECORD
from mapcli.formats.logs.missed_scans import with_stamps
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.log import MissedScans
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, RangeScan, Record
from mapcli.model.selection import select

SCANS = 20
LOST = range(8, 13)
BODY = [message for t in range(1, SCANS + 1) for message in (odom(t), scan(t + 0.5, [2.0] * 40))]
PLAIN = CompressionType.NONE
UNTOLD = {"use_statistics": False}


def record_places(data: bytes, *opcodes: Opcode) -> list[tuple[int, int]]:
    """Start and end of records outside chunks, and of what belongs to chunks."""
    found, at = [], 8
    while at < len(data) - 8:
        kind, length = RECORD.unpack_from(data, at)
        if kind in opcodes:
            found.append((at, at + RECORD.size + length))
        at += RECORD.size + length
    return found


def places_of_messages(**settings: object) -> tuple[bytes, list[tuple[int, int]]]:
    """A log, and where each message stands in it: in a chunk of its own, if it has chunks."""
    data = mcap_bytes(*BODY, chunk_size=1, **settings)
    if settings.get("use_chunking", True):
        chunks = record_places(data, Opcode.CHUNK)
        assert len(chunks) == len(BODY)
        return data, chunks
    return data, record_places(data, Opcode.MESSAGE)


def hit(data: bytes, places: Sequence[tuple[int, int]], spared: int = 0, by: int = 0) -> bytes:
    """Bytes of one kind in the place of records, but for so many bytes at their start."""
    for start, end in places:
        data = data[: start + spared] + bytes([by]) * (end - start - spared) + data[end:]
    return data


def without_chunks() -> bytes:
    data, messages = places_of_messages(use_chunking=False)
    return hit(data, [messages[2 * k - 1] for k in LOST])


def without_chunks_in_one_gap() -> bytes:
    data, messages = places_of_messages(use_chunking=False)
    return hit(data, [(messages[2 * LOST[0] - 1][0], messages[2 * LOST[-1] - 1][1])])


def cut_out() -> bytes:
    """At the bounds of records, so that nothing is to be seen but that scans are missing."""
    data, messages = places_of_messages(use_chunking=False)
    for k in reversed(LOST):
        start, end = messages[2 * k - 1]
        data = data[:start] + data[end:]
    return data


def chunks_told_by_indexes() -> bytes:
    data, chunks = places_of_messages(**UNTOLD)
    return hit(data, [chunks[2 * k - 1] for k in LOST], spared=RECORD.size + CHUNK.size + 12)


def chunks_told_by_both() -> bytes:
    data, chunks = places_of_messages()
    return hit(data, [chunks[2 * k - 1] for k in LOST], spared=RECORD.size + CHUNK.size + 12)


def chunks_told_by_statistics() -> bytes:
    data, chunks = places_of_messages(index_types=IndexType.NONE, compression=PLAIN)
    return hit(data, [chunks[2 * k - 1] for k in LOST], spared=RECORD.size + CHUNK.size + 8)


def contents() -> bytes:
    data, messages = places_of_messages(use_chunking=False)
    return hit(data, [messages[2 * k - 1] for k in LOST], spared=RECORD.size + 22, by=0xFF)


def carmen(broken: Callable[[str], str]) -> Callable[[], bytes]:
    def made() -> bytes:
        lines = []
        for t in range(1, SCANS + 1):
            lines.append(f"ODOM {t}.0 0 0 0 0 0 {t}.0 host {t}.0\n")
            line = f"FLASER 4 1 2 3 4 0 0 0 0 0 0 {t}.5 host {t}.5\n"
            lines.append(broken(line) if t in LOST else line)
        return "".join(lines).encode()

    return made


DAMAGED: dict[str, Callable[[], bytes]] = {
    "without chunks": without_chunks,
    "without chunks, one gap": without_chunks_in_one_gap,
    "cut out": cut_out,
    "chunks, indexes": chunks_told_by_indexes,
    "chunks, both": chunks_told_by_both,
    "chunks, statistics": chunks_told_by_statistics,
    "contents": contents,
    "CARMEN, name": carmen(lambda line: line.replace("FLASER", "FLBSER")),
    "CARMEN, small name": carmen(lambda line: line.replace("FLASER", "fLASER")),
    "CARMEN, control": carmen(lambda line: line.replace("FLASER", "FL\x01SER")),
    "CARMEN, count": carmen(lambda line: line.replace("FLASER 4", "FLASER 5")),
    "CARMEN, reading": carmen(lambda line: line.replace(" 3 4 ", " 3 x4 ")),
    "CARMEN, name and reading": carmen(lambda line: line.replace("FLASER 4 1", "ELASER 4 1z")),
    "CARMEN, cut": carmen(lambda line: line[:15] + "\n"),
}


def read(
    folder: Path, data: bytes, start: float | None = None, end: float | None = None, every: int = 1
) -> tuple[list[int], Log]:
    """The numbers of the scans of a part."""
    path = folder / "a.log"
    path.write_bytes(data)
    log = open_log(path)
    records = list(log.records(start, end, every))
    stamps = [record.stamp_ns for record in records if isinstance(record, RangeScan)]
    return [(stamp - S // 2) // S for stamp in stamps], log


@pytest.mark.parametrize("kind", DAMAGED)
@pytest.mark.parametrize(
    ("start", "end", "every", "used", "lost"),
    [
        (None, None, 1, [*range(1, 8), *range(13, 21)], 5),
        (9.0, None, 1, [*range(13, 21)], 3),  # 10, 11, 12
        (13.0, None, 1, [*range(14, 21)], 0),
        (None, 9.0, 1, [*range(1, 8)], 2),  # 8, 9
        (None, 6.0, 1, [*range(1, 7)], 0),
        (8.0, 10.0, 1, [], 2),  # 9, 10
        (None, None, 3, [1, 4, 7, 13, 16, 19], 1),  # 10
        (None, None, 4, [1, 5, 13, 17], 1),  # 9
        (9.0, None, 2, [14, 16, 18, 20], 2),  # 10, 12
        (6.0, 12.0, 5, [7], 1),  # 12
    ],
)
def test_they_count_where_they_would_be(
    tmp_path: Path, kind: str, start: float | None, end: float | None, every: int,
    used: list[int], lost: int,
) -> None:  # fmt: skip
    found, log = read(tmp_path, DAMAGED[kind](), start, end, every)
    assert found == used
    assert sum(log.damage.missed.values()) == log.damage.scans_lost == lost
    assert log.damage.lost_share == lost / (len(used) + lost)
    assert log.damage.scans_read == len(used)


@pytest.mark.parametrize("kind", ["without chunks", "chunks, both", "CARMEN, name"])
def test_what_is_read_ahead_of_the_end_does_not_count(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A long log is not read to its end; what is lost before counts all the same."""
    monkeypatch.setattr(log_module, "REORDER_RECORDS", 2)
    for end, lost in ((6.0, 0), (9.0, 2), (15.0, 5)):
        _, log = read(tmp_path, DAMAGED[kind](), None, end)
        assert log.damage.scans_lost == lost


def test_scans_that_were_read_and_hold_nothing_count_in_their_part(tmp_path: Path) -> None:
    body = [m if m.log_ns != 8.5 * S else scan(8.5, []) for m in BODY]
    for part, missed in (((None, 7.0), 0), ((None, 8.0), 1), ((8.0, None), 0), ((7.0, 8.0), 1)):
        _, log = read(tmp_path, mcap_bytes(*body), *part)
        assert sum(log.damage.missed.values()) == missed
        assert log.damage.scans_lost == 0
        assert log.damage.counts == {"scans without beams, skipped": 1}  # of what was read


# A message whose opcode or channel was hit


def silent_log(settings: dict[str, object]) -> bytes:
    """Without statistics, indexes and checksums."""
    silent = {
        "use_summary_offsets": False, "repeat_channels": False, "repeat_schemas": False,
        "index_types": IndexType.NONE, "enable_crcs": False, "compression": PLAIN,
    }  # fmt: skip
    return mcap_bytes(*BODY, **settings, **UNTOLD, **silent)


@pytest.mark.parametrize("settings", [{"use_chunking": False}, {"chunk_size": 1 << 20}])
@pytest.mark.parametrize("opcode", [0x00, 0x01, 0x04, 0x07, 0x0D, 0x15, 0x45, 0x85, 0xFF])
def test_a_message_is_known_by_its_content(
    tmp_path: Path, settings: dict[str, object], opcode: int
) -> None:
    """Whatever the opcode says; nothing else in the file tells of it."""
    data = silent_log(settings)
    start = data.index(RECORD.pack(Opcode.MESSAGE, BODY_BYTES), len(data) // 2)
    found, log = read(tmp_path, data[:start] + bytes([opcode]) + data[start + 1 :])
    assert found == [*range(1, SCANS + 1)]
    assert log.damage.counts
    assert log.damage.scans_lost == 0


BODY_BYTES = next(
    end - start - RECORD.size
    for start, end in record_places(mcap_bytes(*BODY[1:2], use_chunking=False), Opcode.MESSAGE)
)
"""Length of a record with a scan."""


@pytest.mark.parametrize("settings", [{"use_chunking": False}, {"chunk_size": 1 << 20}])
def test_a_message_of_no_known_channel_is_said(tmp_path: Path, settings: dict[str, object]) -> None:
    """Which channel it was is not to be known, nor so how many scans there were."""
    data = silent_log(settings)
    start = data.index(RECORD.pack(Opcode.MESSAGE, BODY_BYTES), len(data) // 2) + RECORD.size
    found, log = read(tmp_path, data[:start] + b"\x7f" + data[start + 1 :])
    assert len(found) == SCANS - 1
    assert log.damage.counts
    assert "how many scans the damaged log held is not known" in log.notes
    told, places = places_of_messages(use_chunking=False)  # but with statistics it is
    start = places[15][0] + RECORD.size
    _, log = read(tmp_path, told[:start] + b"\x7f" + told[start + 1 :], None, 8.0)
    assert log.damage.scans_lost == 1
    _, log = read(tmp_path, told[:start] + b"\x7f" + told[start + 1 :], None, 7.0)
    assert log.damage.scans_lost == 0


def test_private_records_are_none_of_ours(tmp_path: Path) -> None:
    data, messages = places_of_messages(use_chunking=False)
    at = messages[9][0]
    for content in (b"\x01\x00" + bytes(40), b"notes of the recorder's own", bytes(22)):
        private = RECORD.pack(0x90, len(content)) + content
        found, log = read(tmp_path, data[:at] + private + data[at:])
        assert len(found) == SCANS
        assert "messages with a broken head, used" not in log.damage.counts


# CARMEN


def carmen_log(folder: Path, *lines: str) -> Log:
    path = folder / "a.log"
    path.write_text("\n".join(lines) + "\n")
    log = open_log(path)
    list(log.records())
    return log


def laser(name: str, t: int, n: int = 4) -> str:
    return f"{name} {n} {'1.5 ' * n}0 0 0 0 0 0 {t}.5 host {t}.5"


@pytest.mark.parametrize("name", ["RLASER", "OLDLASER", "RAWLASER1", "ROBOTLASER2"])
def test_another_message_of_carmen_is_no_damage(tmp_path: Path, name: str) -> None:
    log = carmen_log(tmp_path, *(laser("FLASER", t) for t in range(9)), laser(name, 3))
    assert (log.damage.counts, log.damage.missed) == ({}, {})


def test_another_laser_of_the_users_own_is_no_damage(tmp_path: Path) -> None:
    both = [line for t in range(9) for line in (laser("FLASER", t), laser("BLASER", t))]
    log = carmen_log(tmp_path, *both)
    assert (log.damage.counts, log.damage.missed) == ({}, {})


@pytest.mark.parametrize("line", ["HELLO 1 a b c d e f g h i j", "XLASER 4 1 2", "?", "4 1 2 3 4"])
def test_nonsense_of_another_shape_is_no_scan(tmp_path: Path, line: str) -> None:
    log = carmen_log(tmp_path, *(laser("FLASER", t) for t in range(9)), line)
    assert log.damage.missed == {}


@pytest.mark.parametrize(
    "before", ["ODOM 1 0 0 0 0 0 3.2 host 3.2", "SYNC 1 x 1", laser("FLASER", 3)]
)
def test_the_end_of_the_line_before_a_scan_was_hit(tmp_path: Path, before: str) -> None:
    lines = [laser("FLASER", t) for t in range(9)]
    own = before.startswith("FLASER")
    log = carmen_log(tmp_path, *lines[: 3 if own else 4], before + "\x0b" + lines[4], *lines[5:])
    assert log.damage.scans_lost == 1 + own
    assert log.damage.scans_read + log.damage.scans_lost == 9


# Stamps


def at(t: float) -> RangeScan:
    return RangeScan(round(t * S), 0.0, 0.1, np.ones(2, dtype=np.float32))


def stamps(records: list[Record | MissedScans]) -> list[tuple[float, float, int]]:
    return [
        (m.first_ns / S, m.last_ns / S, m.count)
        for m in with_stamps(records)
        if isinstance(m, MissedScans) and m.first_ns is not None and m.last_ns is not None
    ]


def test_stamps_lie_evenly_between_the_scans_around() -> None:
    lost, more = MissedScans("lost", lost=True, count=3), MissedScans("unreadable", lost=True)
    wheels = Odometry(2 * S, Pose2D())
    assert stamps([at(1), lost, wheels, more, at(6)]) == [(2, 4, 3), (5, 5, 1)]
    assert stamps([at(1), at(1.5), lost]) == [(2, 3, 3)]  # at the end, as the last ones
    assert stamps([lost, at(3), at(4)]) == [(3, 3, 3)]  # at the start, with the first one
    assert stamps([at(5), lost, at(3)]) == [(3, 3, 3)]  # a clock that was set back


def test_a_part_of_very_many_is_not_counted_one_by_one() -> None:
    many = MissedScans("lost", lost=True, count=10**15, first_ns=1 * S, last_ns=3 * S)
    chosen = list(select([at(0), many, at(4)], 1.5, 2.5, every=10))
    assert sum(m.count for m in chosen if isinstance(m, MissedScans)) == pytest.approx(
        10**14 / 2, rel=1e-6
    )
