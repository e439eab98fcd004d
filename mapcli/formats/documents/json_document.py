"""JSON documents of mapcli: the head that all of them share, and how they are written.

{"format": "mapcli.pose-trace", "version": 1, "mapcli": "0.1.0",
 "input": [{"file": "robot.mcap", "sha256": "..."}], "parameters": {...}, ...}
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

from mapcli.errors import FormatError
from mapcli.version import __version__

LINES_AT_ONCE = 1000
"""Objects that are made to text together."""


def document(
    form: str,
    inputs: Mapping[str, str],
    parameters: Mapping[str, Any],
    content: Mapping[str, Any],
) -> dict[str, Any]:
    """A document with its head.

    Args:
        form: its format, "mapcli.map-info".
        inputs: file name (without folders) -> SHA-256 of its bytes.
        parameters: what the result depends on besides the inputs.
        content: the rest, in order.
    """
    return {
        "format": form,
        "version": 1,
        "mapcli": __version__,
        "input": [{"file": name, "sha256": digest} for name, digest in inputs.items()],
        "parameters": dict(parameters),
        **content,
    }


def json_bytes(content: Any) -> bytes:
    """JSON as UTF-8; the items of a list of objects or of rows have a line each, and numbers are
    the shortest that read back as the same float64."""
    if not isinstance(content, dict):
        return utf8(f"{_indented(content)}\n")
    return b"".join(json_pieces(content))


def json_pieces(content: Mapping[str, Any]) -> Iterator[bytes]:
    """The same of an object in pieces. Values may be iterators of objects, so that a long list of
    them is never in memory."""
    yield b"{\n"
    for k, (key, value) in enumerate(content.items()):
        yield utf8(f",\n {_dumps(key)}: " if k else f" {_dumps(key)}: ")
        yield from map(utf8, _value(value))
    yield b"\n}\n"


def utf8(json_text: str) -> bytes:
    """JSON as bytes. A file name that is no UTF-8 is in it as Python reads it back: its odd bytes
    as `\\udc80` to `\\udcff`."""
    return json_text.encode(errors="backslashreplace")


def _value(value: Any) -> Iterator[str]:
    """A list of objects or rows, such as poses, with a line for each; anything else indented."""
    is_rows = isinstance(value, list) and all(isinstance(item, dict | list) for item in value)
    if not isinstance(value, Iterator) and not (is_rows and value):
        yield _indented(value).replace("\n", "\n ")
        return
    rows, between = iter(value), "[\n"
    while lines := [f"  {_dumps(item)}" for item in islice(rows, LINES_AT_ONCE)]:
        yield between + ",\n".join(lines)
        between = ",\n"
    yield "[]" if between == "[\n" else "\n ]"


_dumps = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
"""JSON on one line. One encoder for all calls: `json.dumps` makes a new one for each pose."""


def _indented(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False)


def read_document(data: bytes, file: str, form: str) -> dict[str, Any]:
    """The content of a document of the format `form`.

    Raises:
        FormatError: no JSON, another format, or a later version.
    """
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        line = getattr(error, "lineno", None)
        raise FormatError(
            f"is not JSON: {getattr(error, 'msg', error)}",
            file=file,
            where=f"line {line}" if line else None,
            expected=form,
        ) from error
    found = content.get("format") if isinstance(content, dict) else None
    if found != form:
        raise FormatError(f"has the format {found!r}", file=file, expected=form)
    if content.get("version") != 1:
        version = content.get("version")
        raise FormatError(f"has version {version!r} of {form}", file=file, expected="version 1")
    return dict(content)
