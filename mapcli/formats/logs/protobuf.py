"""Messages in protobuf, as mappings of the same shape as in JSON.

The schema of a channel holds the definitions (a FileDescriptorSet), so any message can be read,
also one whose definition has changed since. Imported when a log has such messages, as all of
protobuf is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from google.protobuf.message import DecodeError, Message
from mcap.exceptions import McapError
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from mapcli.formats.logs.ros.decode import Buffer, refuses

ENCODING = "protobuf"


def decoder_of_fields(
    type_name: str, schema: bytes, decode: Callable[[dict[str, Any]], Any]
) -> Callable[[Buffer], Any]:
    """The decoder of messages of a type, from what takes their fields.

    Args:
        schema: of the channel. Where it is broken, every message is refused.
    """
    try:
        parse = DecoderFactory().decoder_for(ENCODING, Schema(0, schema, ENCODING, type_name))
    except (McapError, DecodeError, TypeError, ValueError, KeyError, RecursionError):
        parse = None

    def decoded(data: Buffer) -> Any:
        if parse is None:
            raise ValueError(f"no definition of {type_name}")
        try:
            return decode(fields_of(parse(bytes(data))))
        except DecodeError as error:
            raise ValueError(str(error)) from error

    return refuses(decoded)


def fields_of(message: Message) -> dict[str, Any]:
    """The fields by name: messages in it as mappings, those that are not there left out."""
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if isinstance(value, Message):
            if message.HasField(field.name):
                found[field.name] = fields_of(value)
        elif field.message_type is not None:
            found[field.name] = [fields_of(one) for one in value]
        else:
            found[field.name] = value
    return found
