"""Where the records of an MCAP file are, over damage: in the file, and in an unpacked chunk.

A walk along the records' lengths finds them. Where a length leads nowhere, either the next record's
head is broken or the length itself is: the next record that makes sense is searched for from inside
the last ones on.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Container, Iterator
from typing import BinaryIO

from mcap.opcode import Opcode

from mapcli.formats.logs.mcap.container_records import (
    CHUNK,
    INDEX,
    MAX_DESCRIPTION_BYTES,
    MESSAGE,
    RECORD,
    ChunkHead,
    Place,
    chunk_head,
    reads_like_message,
)

OPCODES = frozenset(Opcode)
FIXED_LENGTHS = {Opcode.DATA_END: 4, Opcode.FOOTER: 20, Opcode.SUMMARY_OFFSET: 17}
LEAST_LENGTHS = {int(opcode): 0 for opcode in Opcode} | {
    int(Opcode.SCHEMA): 14,
    int(Opcode.CHANNEL): 16,
    int(Opcode.MESSAGE): MESSAGE.size,
    int(Opcode.CHUNK): CHUNK.size + 8,
}
"""Plain integers, as these are looked up for every record."""
PRIVATE_OPCODES = 0x80

HELD = 3
"""Records that are doubted again when the one after them makes no sense."""

_FIRST_WINDOW, _LAST_WINDOW = 1 << 12, 1 << 20
_SHAPE = re.compile(
    rb"[\x03-\x06](?:(?<=[\x05\x06])[\x00-\xff]{4}\x00{4}"
    rb"|(?<=\x04)\x00{3}zstd[\x00-\xff]{8}\x28\xb5\x2f\xfd"
    rb"|(?<=\x03)\x00{3}lz4[\x00-\xff]{8}\x04\x22\x4d\x18)"
)
"""A message or chunk of less than 4 GB, maybe; or what stands between a chunk's head and content,
by which a chunk is known whose opcode or length is broken."""
_NAME_OFFSET = RECORD.size + CHUNK.size - 4
_SHAPE_BYTES = 64


def places(
    file: BinaryIO, start: int, end: int, channels: Container[int], *, finished: bool,
    near_ns: int | None = None,
) -> Iterator[Place]:  # fmt: skip
    """The records between two offsets, and the gaps between them.

    Args:
        channels: may grow while the places are asked for.
        finished: the real end of the data is at `end`; otherwise it may be in the middle of a
            record.
        near_ns: log time of a message there, if one is known.
    """
    held: deque[Place] = deque()
    finder = _Finder(file, end, channels, near_ns, finished=finished)
    at = start
    while at < end:
        place = finder.place(at)
        if place is not None and place.complete:
            held.append(place)
            at = place.end
            if len(held) > HELD:
                yield held.popleft()
            continue
        resumed = finder.resume(held, place, at)
        yield from _settled(held, place, at, resumed, end)
        held.clear()
        if resumed is None:
            return
        at = resumed
    yield from held


def _settled(
    held: deque[Place], place: Place | None, at: int, resumed: int | None, end: int
) -> Iterator[Place]:
    """What the records before some damage are, given where the next one stands behind it."""
    stop = end if resumed is None else resumed
    lost = place is None or place.opcode != Opcode.CHUNK
    if lost and held and held[-1].opcode == Opcode.CHUNK and at < stop:
        held.append(_overrun(held.pop(), stop))  # it may have grown; then its last bytes follow
        place, at = None, stop
    for earlier in held:
        if earlier.end <= stop:
            yield earlier
            continue
        if earlier.offset < stop:
            yield _overrun(earlier, stop)
        return  # the walk goes on at `stop`, over those that were right once more
    if resumed is None and at < end:
        yield place or Place(0, at, end)
    elif place is not None:
        yield _overrun(place, stop)
    elif at < stop:
        yield Place(0, at, stop)


def _overrun(place: Place, stop: int) -> Place:
    """A record whose end is not where its length says: a chunk has a readable start."""
    if place.opcode == Opcode.CHUNK:
        return Place(place.opcode, place.offset, stop, whole=False)
    return Place(0, place.offset, stop)


class _Finder:
    """Tells records from other bytes in one file (stateful: remembers the last message's time)."""

    def __init__(
        self, file: BinaryIO, end: int, channels: Container[int], near_ns: int | None, *,
        finished: bool,
    ) -> None:  # fmt: skip
        self._file, self._end, self._channels, self._near_ns = file, end, channels, near_ns
        self._no_records: Container[int] = (Opcode.DATA_END, Opcode.FOOTER) if finished else ()

    def place(self, at: int) -> Place | None:
        """The record at `at`; incomplete if it leads beyond the end; None if it cannot be one."""
        self._file.seek(at)
        head = self._file.read(min(RECORD.size + MESSAGE.size, self._end - at))
        if len(head) < RECORD.size:
            return Place(head[0], at, self._end, complete=False) if head[0] in OPCODES else None
        opcode, length = RECORD.unpack_from(head)
        if opcode == Opcode.MESSAGE:
            self._note_time(head)
        elif found := self._chunk(at, opcode, length) or self._message(at, head, length):
            return found
        if opcode == Opcode.CHUNK or opcode in self._no_records or not _possible(opcode, length):
            return None
        stop = at + RECORD.size + length
        return Place(opcode, at, min(stop, self._end), complete=stop <= self._end)

    def _note_time(self, head: bytes) -> None:
        """The log time of a message, if it seems to be one."""
        if len(head) == RECORD.size + MESSAGE.size:
            channel, _, log_time, _ = MESSAGE.unpack_from(head, RECORD.size)
            if channel in self._channels:
                self._near_ns = log_time

    def _message(self, at: int, head: bytes, length: int) -> Place | None:
        """The message at `at` by its content, whatever its opcode."""
        stop = at + RECORD.size + length
        content = head[RECORD.size :]
        if stop > self._end or not reads_like_message(
            head[0], length, content, self._channels, self._near_ns
        ):
            return None
        return Place(Opcode.MESSAGE, at, stop, whole=False)

    def _chunk(self, at: int, opcode: int, length: int) -> Place | None:
        """The chunk at `at`, by its two lengths, or by its name and the start of its content."""
        head: ChunkHead | None = chunk_head(self._file, at)
        if head is None or not (head.consistent or _signed(head)):
            return None
        whole = opcode == Opcode.CHUNK  # nothing else has two lengths that agree
        for stop in (head.data + head.size, at + RECORD.size + length):
            if head.consistent and stop <= self._end:
                return Place(Opcode.CHUNK, at, stop, whole=whole)
            if head.data <= stop <= self._end and self._leads_on(stop, records=2):
                return Place(Opcode.CHUNK, at, stop, whole=False)
        return Place(Opcode.CHUNK, at, self._end, complete=False, whole=whole and head.consistent)

    def resume(self, held: deque[Place], place: Place | None, at: int) -> int | None:
        """Where to go on when no complete record is at `at`, though those held lead there."""
        start = at
        for earlier in held:
            if earlier.opcode != Opcode.CHUNK:
                start = earlier.offset + 1
                break
            # What an uncompressed chunk contains are records, too; only chunks end it early.
            inside = self.search(earlier.offset + 1, earlier.end, chunks_only=True)
            if inside is not None:
                return inside
        cut = place is not None and place.opcode == Opcode.CHUNK
        return self.search(at + 1 if cut else start, self._end, chunks_only=cut)

    def search(self, start: int, stop: int, *, chunks_only: bool = False) -> int | None:
        """Where the next chunk or sensible message starts, from `start` on and before `stop`."""
        window, size = start, _FIRST_WINDOW
        while window < stop:
            self._file.seek(window)
            data = self._file.read(min(size + _SHAPE_BYTES, self._end - window))
            at = -1
            while match := _SHAPE.search(data, at + 1, min(len(data), size + _SHAPE_BYTES)):
                at = match.start()
                if at >= size:
                    break
                found = self._found(window + at, data[at], chunks_only)
                if found is not None and start <= found < stop:
                    return found
            window, size = window + size, min(2 * size, _LAST_WINDOW)
        return None

    def _found(self, at: int, opcode: int, chunks_only: bool) -> int | None:
        """Where the record starts of which a part with the right shape is at `at`; or None."""
        if opcode not in (Opcode.MESSAGE, Opcode.CHUNK):
            at = max(at - _NAME_OFFSET, 0)
        elif opcode == Opcode.MESSAGE and chunks_only:
            return None
        place = self.place(at)
        if place is None:
            return None
        if place.opcode == Opcode.CHUNK:
            head = chunk_head(self._file, at)
            sensible = head is not None and (head.start_ns <= head.end_ns or _signed(head))
            return at if sensible else None
        sensible = place.opcode == Opcode.MESSAGE and place.complete
        return at if sensible and self._leads_on(place.end, 1 + self._is_foreign(at)) else None

    def _is_foreign(self, at: int) -> bool:
        """Whether a message is of a channel that is not known."""
        self._file.seek(at + RECORD.size)
        return int.from_bytes(self._file.read(2), "little") not in self._channels

    def _leads_on(self, at: int, records: int) -> bool:
        for _ in range(records):
            if at == self._end:
                return True
            self._file.seek(at)
            head = self._file.read(min(RECORD.size, self._end - at))
            if len(head) < RECORD.size:
                return False
            opcode, length = RECORD.unpack(head)
            at += RECORD.size + length
            if opcode in self._no_records or not _possible(opcode, length) or at > self._end:
                return False
        return True


def _signed(head: ChunkHead) -> bool:
    """Whether the name of a compression is followed by content that is compressed so."""
    return bool(head.packed_as) and head.packed_as == head.compression


def _possible(opcode: int, length: int) -> bool:
    if opcode == Opcode.MESSAGE:
        return length >= MESSAGE.size
    if opcode == Opcode.MESSAGE_INDEX:
        return length % 16 == INDEX.size
    if opcode in FIXED_LENGTHS:
        return bool(length == FIXED_LENGTHS[Opcode(opcode)])
    if opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and length > MAX_DESCRIPTION_BYTES:
        return False
    if opcode in LEAST_LENGTHS:
        return length >= LEAST_LENGTHS[opcode]
    return opcode >= PRIVATE_OPCODES and length > 0
