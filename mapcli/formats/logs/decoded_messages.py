"""The messages of a recording, decoded, in the order of recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from heapq import merge
from operator import itemgetter
from typing import Any

from mapcli.formats.logs.losses import LOST_SCANS
from mapcli.formats.logs.message_file import MessageFile
from mapcli.formats.logs.message_kinds import decoder_of, unpacked
from mapcli.formats.logs.topics import SCANS
from mapcli.model.log import Damage, MissedScans, Topic
from mapcli.model.scan import NANOSECONDS

Carriers = Mapping[Topic, Sequence[tuple[MessageFile, int]]]
"""Topic -> the files that have it, with the number of the stream that carries it in each."""

Decoded = tuple[int, Topic, Any, int, bool]
"""Log time, topic, message or missed scans, number of the file, and whether it is doubtful as of
`Message`."""


def decoded(files: Sequence[MessageFile], topics: Carriers, damage: Damage) -> Iterator[Decoded]:
    """The messages of some topics by log time over all files; what is unreadable is counted."""
    parts = [_of_file(file, part, topics, damage) for part, file in enumerate(files)]
    return merge(*parts, key=itemgetter(0)) if len(parts) > 1 else parts[0]


def _of_file(file: MessageFile, part: int, topics: Carriers, damage: Damage) -> Iterator[Decoded]:
    carried = {
        number: (topic, decoder_of(topic, file.streams[number]))
        for topic, carriers in topics.items()
        for carrier, number in carriers
        if carrier is file
    }
    scans = {number for number, (topic, _) in carried.items() if topic.role in SCANS}
    for log_time, number, data, lost, doubtful in file.messages(set(carried), damage, scans):
        topic, decoder = carried[number]
        if lost:
            missed = MissedScans(LOST_SCANS, lost=True, count=lost)
            yield log_time, topic, missed, part, False
            continue
        try:
            yield log_time, topic, decoder(unpacked(data)), part, doubtful
        except ValueError:
            where = f"at {log_time / NANOSECONDS:.3f} s"
            what = f"messages on {topic.name} without readable content"
            damage.add(what, file=file.source.name, where=where)
            if topic.role in SCANS:
                yield log_time, topic, MissedScans(what, lost=True), part, False
