"""JSON Schemas of the documents that mapcli writes, and of the files that people write for it.

`schemas/NAME.json` says what a document holds besides the head, `schemas/head.json`, that all
documents share. Two keywords are our own: `unit` of a number, and `since`, the version of mapcli
that first wrote a field. `docs/list_fields.py` writes the tables of `docs/formats.md` from them.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

DRAFT = "https://json-schema.org/draft/2020-12/schema"

DOCUMENTS = (
    "pose-trace", "exploration-trace", "similarity-table", "confusion-table", "evaluation",
    "log-info", "map-info", "trace-info", "file-info", "sessions", "map-comparison",
    "map-transform", "rasterize", "mowing",
)  # fmt: skip
"""What commands write; `format` in the document is `mapcli.` and the name."""

FILES = "perception", "world"
"""What people write as well; YAML, or the same as JSON. They have no head."""

NAMES = DOCUMENTS + FILES


def json_schema(name: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of one of `NAMES`."""
    own = _read(name)
    if name not in DOCUMENTS:
        return {"$schema": DRAFT, **own}
    head = _read("head")
    head["format"]["const"] = f"mapcli.{name}"
    own["required"] = [*head, *own["required"]]
    own["properties"] = {**head, **own["properties"]}
    return {"$schema": DRAFT, **own}


def _read(name: str) -> dict[str, Any]:
    text = files("mapcli.formats.documents").joinpath("schemas", f"{name}.json").read_text("utf-8")
    return dict(json.loads(text, object_hook=_included))


def _included(part: dict[str, Any]) -> dict[str, Any]:
    """What an object of a schema stands for: `{"include": NAME}` is the content of another file."""
    return _read(part["include"]) if set(part) == {"include"} else part
