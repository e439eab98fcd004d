"""Recovery of a damaged MCAP file: from record to record, over damage, without unpacking anything.

What is left of a damaged chunk is salvaged in `chunks`.

The index at the end of a file is missing from interrupted recordings and wrong in some others,
so it is not used: a walk along the records' lengths finds the same chunks, at the cost of a read
per chunk. Where a length leads nowhere, the next record is searched for by its shape.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from mapcli.formats.logs.mcap.container_records import (
    CHUNK,
    INDEX,
    MAX_DESCRIPTION_BYTES,
    MESSAGE,
    RECORD,
    Place,
    Segment,
    add_description,
    chunk_head,
)
from mapcli.model.log import Damage

OPCODES = frozenset(Opcode)
FIXED_LENGTHS = {Opcode.DATA_END: 4, Opcode.FOOTER: 20, Opcode.SUMMARY_OFFSET: 17}
PRIVATE_OPCODES = 0x80

BARE_SEGMENT_BYTES = 1 << 20
"""Messages outside chunks are read in stretches of about this."""

_SEARCH_BYTES = 1 << 20
_SHAPE = re.compile(rb"(?=[\x05\x06][\x00-\xff]{4}\x00{4})")
"""A message or chunk of less than 4 GB, maybe."""


class Layout:
    """What a walk has found (stateful: `walk` fills it).

    Attributes:
        segments: in file order.
        schemas, channels: by id, those outside chunks.
        spans: channel -> first and last log time, as far as told without unpacking.
    """

    def __init__(self) -> None:
        self.segments: list[Segment] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.spans: dict[int, tuple[int, int]] = {}

    def count(self, channel: int, messages: int, first: int, last: int) -> None:
        """Messages of a channel in the last segment, and their first and last log time."""
        counts = self.segments[-1].counts
        counts[channel] = counts.get(channel, 0) + messages
        known_first, known_last = self.spans.get(channel, (first, last))
        self.spans[channel] = min(first, known_first), max(last, known_last)


def walk(file: BinaryIO, end: int, finished: bool, name: str, damage: Damage) -> Layout:
    """Find all chunks and loose records between the magic and `end`. Damage is counted.

    Args:
        end: byte after the last record: of the data section if the file was finished.
        finished: otherwise it is no surprise that the last record leads beyond the end.
    """
    layout = Layout()
    for place in places(file, end, finished):
        if place.opcode == 0 or (finished and not place.complete):
            damage.add("gaps of unreadable bytes, skipped", file=name, where=_byte(place))
        if not place.complete:
            if place.opcode == Opcode.CHUNK:
                _add_chunk(layout, file, place)
        elif place.opcode and not _add(layout, file, place):
            damage.add("records of nonsense, skipped", file=name, where=_byte(place))
    return layout


def _byte(place: Place) -> str:
    return f"byte {place.offset}"


def places(file: BinaryIO, end: int, finished: bool) -> Iterator[Place]:
    """The records in file order, and the gaps between them."""
    at = 8
    while at < end:
        place = _place(file, at, end)
        if place is not None and place.opcode in (Opcode.DATA_END, Opcode.FOOTER) and finished:
            place = None  # the real ones are at `end`
        if place is not None and place.complete:
            yield place
            at = place.end
            continue
        resumed = None if _cut_chunk(file, place, finished) else _search(file, at + 1, end)
        if resumed is None:
            yield place or Place(0, at, end)
            return
        yield Place(0, at, resumed)
        at = resumed


def _cut_chunk(file: BinaryIO, place: Place | None, finished: bool) -> bool:
    """Whether an incomplete record is the chunk at which the file was cut off."""
    if finished or place is None or place.opcode != Opcode.CHUNK:
        return False
    return chunk_head(file, place.offset) is not None


def _place(file: BinaryIO, at: int, end: int) -> Place | None:
    """The record at `at`; incomplete if it leads beyond `end`; None if it cannot be one."""
    file.seek(at)
    head = file.read(min(RECORD.size, end - at))
    if len(head) < RECORD.size:
        return Place(head[0], at, end, complete=False) if head[0] in OPCODES else None
    opcode, length = RECORD.unpack(head)
    if not _possible(opcode, length):
        return None
    stop = at + RECORD.size + length
    return Place(opcode, at, min(stop, end), complete=stop <= end)


def _possible(opcode: int, length: int) -> bool:
    if opcode == Opcode.MESSAGE:
        return length >= MESSAGE.size
    if opcode == Opcode.CHUNK:
        return length >= CHUNK.size + 8
    if opcode == Opcode.MESSAGE_INDEX:
        return length % 16 == INDEX.size
    if opcode in FIXED_LENGTHS:
        return bool(length == FIXED_LENGTHS[Opcode(opcode)])
    return opcode in OPCODES or opcode >= PRIVATE_OPCODES


def _search(file: BinaryIO, start: int, end: int) -> int | None:
    """Where the next chunk starts, or three records in a row of which the first is a message."""
    for window in range(start, end, _SEARCH_BYTES):
        file.seek(window)
        for match in _SHAPE.finditer(file.read(min(_SEARCH_BYTES + RECORD.size, end - window))):
            at = window + match.start()
            place = _place(file, at, end)
            if place is None or not place.complete:
                continue
            if place.opcode == Opcode.CHUNK:
                head = chunk_head(file, at)
                if head is not None and head.start_ns <= head.end_ns:
                    return at
            elif _leads_on(file, place.end, end, records=2):
                return at
    return None


def _leads_on(file: BinaryIO, at: int, end: int, records: int) -> bool:
    for _ in range(records):
        if at == end:
            return True
        place = _place(file, at, end)
        if place is None or not place.complete:
            return False
        at = place.end
    return True


def _add(layout: Layout, file: BinaryIO, place: Place) -> bool:
    """Take a record into the layout; False if its content is not what its opcode says."""
    if place.opcode == Opcode.CHUNK:
        return _add_chunk(layout, file, place)
    if place.opcode == Opcode.MESSAGE_INDEX:
        return _add_index(layout, file, place)
    if place.opcode == Opcode.MESSAGE:
        _add_message(layout, file, place)
    elif place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        if place.end - place.offset > MAX_DESCRIPTION_BYTES:
            return False
        file.seek(place.offset + RECORD.size)
        content = file.read(place.end - place.offset - RECORD.size)
        return add_description(layout.schemas, layout.channels, place.opcode, content)
    return True


def _add_chunk(layout: Layout, file: BinaryIO, place: Place) -> bool:
    head = chunk_head(file, place.offset)
    if head is not None:
        layout.segments.append(
            Segment(place.offset, place.end, head.start_ns, head.end_ns, True, place.complete)
        )
    return head is not None


def _add_index(layout: Layout, file: BinaryIO, place: Place) -> bool:
    file.seek(place.offset + RECORD.size)
    content = file.read(place.end - place.offset - RECORD.size)
    channel, size = INDEX.unpack_from(content)
    if size != len(content) - INDEX.size:
        return False
    times = np.frombuffer(content, dtype="<u8", offset=INDEX.size)[::2]
    if layout.segments and layout.segments[-1].chunk and len(times):
        layout.count(channel, len(times), int(times.min()), int(times.max()))
    return True


def _add_message(layout: Layout, file: BinaryIO, place: Place) -> None:
    file.seek(place.offset + RECORD.size)
    channel, _, log_time, _ = MESSAGE.unpack(file.read(MESSAGE.size))
    last = layout.segments[-1] if layout.segments else None
    if (
        last is not None
        and not last.chunk
        and last.end == place.offset
        and last.end - last.offset < BARE_SEGMENT_BYTES
    ):
        last.end = place.end
        last.start_ns, last.end_ns = min(last.start_ns, log_time), max(last.end_ns, log_time)
    else:
        layout.segments.append(Segment(place.offset, place.end, log_time, log_time, False))
    layout.count(channel, 1, log_time, log_time)
