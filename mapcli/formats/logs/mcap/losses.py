"""What was lost of an MCAP file, counted while it is read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Iterator

from mapcli.formats.logs.mcap.container_records import NOTHING, Message, Segment
from mapcli.formats.logs.mcap.gaps import hole
from mapcli.model.log import Damage

LOST_SCANS = "scans lost in damaged parts of the file"
LOST_MESSAGES = "messages lost that the file should hold"


def lost_in(segment: Segment, messages: list[Message], wanted: set[int]) -> list[Message]:
    """What a segment should hold besides the messages found in it."""
    found = Counter(message.channel for message in messages)
    if all(found[channel] >= segment.told.get(channel, 0) for channel in wanted):
        return []
    start_ns = hole(segment, [message.log_time_ns for message in messages]).start_ns
    counts = {channel: segment.told.get(channel, 0) - found[channel] for channel in sorted(wanted)}
    return [Message(start_ns, channel, NOTHING, n) for channel, n in counts.items() if n > 0]


class LossLedger:
    """Counts what was lost while the messages of a file are read (stateful)."""

    def __init__(self, name: str, damage: Damage, scans: Container[int]) -> None:
        self.damage = damage
        self._name, self._scans = name, scans

    def told(self, lost: Iterable[Message]) -> Iterator[Message]:
        """Those of lost messages that were scans; the damage is counted."""
        for message in lost:
            is_scan = message.channel in self._scans
            what = LOST_SCANS if is_scan else LOST_MESSAGES
            self.damage.add(what, message.lost, file=self._name)
            if is_scan:
                yield message
