"""Recovery of a damaged MCAP file: from record to record, over damage, without unpacking anything.

What is left of a damaged chunk is salvaged in `chunks`; how records are found is in `places`.

The index at the end of a file is missing from interrupted recordings and wrong in some others,
so it is not used: a walk along the records' lengths finds the same chunks, at the cost of a read
per chunk.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Container, Mapping
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from mapcli.formats.logs.mcap.container_records import (
    INDEX,
    MESSAGE,
    RECORD,
    Place,
    Segment,
    add_description,
    chunk_head,
)
from mapcli.formats.logs.mcap.places import places
from mapcli.model.log import Damage

BARE_SEGMENT_BYTES = 1 << 20
"""Messages outside chunks are read in stretches of about this."""


class Layout:
    """What a walk has found (stateful: `walk` fills it).

    Attributes:
        segments: in file order.
        schemas, channels: by id, those outside chunks.
        spans: channel -> first and last log time, as far as told without unpacking.
        indexed: whether indexes of messages belong to the last segment.
        gaps: offsets of bytes of which it is not known what they were.
    """

    def __init__(self) -> None:
        self.segments: list[Segment] = []
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.spans: dict[int, tuple[int, int]] = {}
        self.indexed = False
        self.gaps: list[int] = []

    def count(self, channel: int, messages: int, first: int, last: int) -> None:
        """Messages of a channel in the last segment, and their first and last log time."""
        segment = self.segments[-1]
        segment.told[channel] = segment.told.get(channel, 0) + messages
        # The head of a chunk is under no checksum: one that starts too early only costs memory.
        segment.start_ns = min(segment.start_ns, first)
        segment.end_ns = max(segment.end_ns, last)
        known_first, known_last = self.spans.get(channel, (first, last))
        self.spans[channel] = min(first, known_first), max(last, known_last)


def walk(
    file: BinaryIO, end: int, finished: bool, described: Mapping[int, Channel],
    name: str, damage: Damage,
) -> Layout:  # fmt: skip
    """Find all chunks and loose records between the magic and `end`. Damage is counted.

    Args:
        end: byte after the last record: of the data section if the file was finished.
        finished: otherwise it is no surprise that the last record leads beyond the end.
        described: the channels of the summary.
    """
    layout = Layout()
    known = ChainMap(layout.channels, dict(described))
    for place in places(file, 8, end, known, finished=finished):
        if place.opcode == 0 or (finished and not place.complete):
            layout.gaps.append(place.offset)
            layout.indexed = False
            damage.add("gaps of unreadable bytes, skipped", file=name, where=_byte(place))
        elif place.opcode == Opcode.MESSAGE and not place.whole:
            damage.add("messages with a broken head, used", file=name, where=_byte(place))
        elif not place.whole:
            damage.add("chunks with a broken head or end", file=name, where=_byte(place))
        if not place.complete:
            if place.opcode == Opcode.CHUNK:
                _add_chunk(layout, file, place, finished)
        elif place.opcode and not _add(layout, file, place, known):
            layout.gaps.append(place.offset)
            damage.add("records of nonsense, skipped", file=name, where=_byte(place))
    return layout


def _byte(place: Place) -> str:
    return f"byte {place.offset}"


def _add(layout: Layout, file: BinaryIO, place: Place, known: Container[int]) -> bool:
    """Take a record into the layout; False if its content is not what its opcode says.

    Args:
        known: channels; a message of another one is nonsense.
    """
    if place.opcode == Opcode.CHUNK:
        return _add_chunk(layout, file, place, finished=True)
    if place.opcode == Opcode.MESSAGE_INDEX:
        return _add_index(layout, file, place)
    if place.opcode == Opcode.MESSAGE:
        return _add_message(layout, file, place, known)
    if place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        file.seek(place.offset + RECORD.size)
        content = file.read(place.end - place.offset - RECORD.size)
        return add_description(layout.schemas, layout.channels, place.opcode, content)
    return True


def _add_chunk(layout: Layout, file: BinaryIO, place: Place, finished: bool) -> bool:
    head = chunk_head(file, place.offset)
    if head is not None:
        complete = place.complete or finished
        layout.segments.append(
            Segment(
                place.offset, place.end, head.start_ns, head.end_ns, True, complete, place.whole
            )
        )
        layout.indexed = True
    return head is not None


def _add_index(layout: Layout, file: BinaryIO, place: Place) -> bool:
    file.seek(place.offset + RECORD.size)
    content = file.read(place.end - place.offset - RECORD.size)
    channel, size = INDEX.unpack_from(content)
    if size != len(content) - INDEX.size:
        return False
    times = np.frombuffer(content, dtype="<u8", offset=INDEX.size)[::2]
    if layout.indexed and len(times):
        layout.count(channel, len(times), int(times.min()), int(times.max()))
    return True


def _add_message(layout: Layout, file: BinaryIO, place: Place, known: Container[int]) -> bool:
    file.seek(place.offset + RECORD.size)
    channel, _, log_time, _ = MESSAGE.unpack(file.read(MESSAGE.size))
    if channel not in known:
        return False
    last = layout.segments[-1] if layout.segments else None
    if (
        last is not None
        and not last.chunk
        and last.end == place.offset
        and last.end - last.offset < BARE_SEGMENT_BYTES
    ):
        last.end = place.end
    else:
        layout.segments.append(Segment(place.offset, place.end, log_time, log_time, False))
        layout.indexed = False
    layout.count(channel, 1, log_time, log_time)
    return True
