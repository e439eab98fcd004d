"""What all containers of messages have in common, whatever their format: streams of messages.

MCAP (`mcap/`), ROS 1 bags (`bag/`) and the SQLite files of ROS 2 bags (`sqlite_file`) give the
bytes of messages; what the bytes mean is `ros/decode`.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import NamedTuple, Protocol

from mapcli.formats.logs.log import Source
from mapcli.model.log import Damage

NOTHING = memoryview(b"")


class Stream(NamedTuple):
    """One channel of a file.

    Attributes:
        topic: as recorded, `/scan`; type: of its messages, empty where none is told.
        encoding: of their bytes: `cdr`, `json`, `ros1`, `protobuf`...
        schema: the definition of the type, as stored; protobuf cannot be read without.
    """

    topic: str
    type: str
    encoding: str
    schema: bytes = b""


class Message(NamedTuple):
    """A message as stored; `data` may be a view into its chunk. Or so many that are lost here.

    Attributes:
        doubtful: what it is in is damaged; so it may be, too.
    """

    log_time_ns: int
    channel: int
    data: memoryview
    lost: int = 0
    doubtful: bool = False


def most_of(told: dict[int, int], found: dict[int, int]) -> dict[int, int]:
    """Stream -> messages that a part of a file held, those included that are lost: as many as its
    index tells, or as were found in it."""
    if not found:
        return told
    return {stream: max(told.get(stream, 0), found.get(stream, 0)) for stream in told | found}


class MessageFile(Protocol):
    """One file of a recording, open for reading.

    Attributes:
        streams: by number, in this file.
        counts: stream -> messages; spans: stream -> first and last log time.
        complete: whether `counts` are all that were in the file, lost ones included.
    """

    source: Source
    counts: dict[int, int]
    spans: dict[int, tuple[int, int]]
    complete: bool

    @property
    def streams(self) -> Mapping[int, Stream]: ...

    def messages(
        self, wanted: set[int], damage: Damage, scans: Container[int] = ()
    ) -> Iterator[Message]:
        """The messages of these streams, about in the order of their log times.

        Args:
            damage: what turns out to be wrong is counted.
            scans: streams of which a message that is lost is a lost scan.
        """
        ...
