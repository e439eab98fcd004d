"""What was lost of a file of messages, counted while it is read."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator

from mapcli.formats.logs.message_file import Message
from mapcli.model.log import Damage

LOST_SCANS = "scans lost in damaged parts of the file"
LOST_MESSAGES = "messages lost that the file should hold"


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
