"""The topics of files of messages: what each is good for, by the types of its messages."""

from __future__ import annotations

from collections.abc import Container, Sequence
from itertools import islice
from operator import itemgetter

from mapcli.formats.logs.message_file import MessageFile, Stream
from mapcli.formats.logs.message_kinds import MessageKind, kind_of_type, unpacked
from mapcli.formats.logs.recognition import recognised
from mapcli.model.log import Damage, Role, Topic

FIRST_MESSAGES = 5
"""By which a topic without a type is recognised."""


def topics_of(
    files: Sequence[MessageFile], named: Container[str] = ()
) -> dict[Topic, list[tuple[MessageFile, int]]]:
    """The topics of all files by name, with the streams that carry them.

    Args:
        named: topics that the user named; see `described`.
    """
    carriers: dict[tuple[str, str, str, Role], list[tuple[MessageFile, int]]] = {}
    for file in files:
        for number, told in file.streams.items():
            stream = described(file, number, told, named)
            role = _role(kind_of_type(stream.type), stream)
            key = stream.topic, stream.type or "no type", stream.encoding, role
            carriers.setdefault(key, []).append((file, number))
    topics = {}
    for (name, type_name, encoding, role), streams in sorted(carriers.items(), key=itemgetter(0)):
        count = sum(file.counts.get(number, 0) for file, number in streams)
        spans = [file.spans[number] for file, number in streams if number in file.spans]
        first = min((span[0] for span in spans), default=0)
        last = max((span[1] for span in spans), default=0)
        topics[Topic(name, role, type_name, encoding, count, first, last)] = streams
    return topics


def described(file: MessageFile, number: int, stream: Stream, named: Container[str] = ()) -> Stream:
    """A stream with its type: without one, or named by the user and with one that is not read,
    what its first messages are (`recognition`)."""
    if stream.type and not (stream.topic in named and kind_of_type(stream.type) is None):
        return stream
    messages = file.messages({number}, Damage())
    sound = (message for message in messages if not (message.lost or message.doubtful))
    first = islice(sound, FIRST_MESSAGES)
    try:
        found = recognised([bytes(unpacked(message.data)) for message in first], stream.encoding)
    except ValueError:  # packed, and broken
        return stream
    return stream._replace(type=found) if found else stream


def _role(kind: MessageKind | None, stream: Stream) -> Role:
    """Of a stream; `other` if its encoding cannot be decoded."""
    if kind is None or stream.encoding not in kind.decoders:
        return "other"
    if kind.role == "tf" and stream.topic.endswith("tf_static"):
        return "tf_static"
    return kind.role
