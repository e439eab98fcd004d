"""Writes the tables of `docs/formats.md` again from the JSON Schemas.

python docs/list_fields.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mapcli.formats.documents.json_schema import DOCUMENTS, FILES, json_schema

PAGE = Path(__file__).with_name("formats.md")
BEGIN, END = "<!-- fields: docs/list_fields.py writes this -->", "<!-- end of fields -->"

HEAD = "format", "version", "mapcli", "input", "parameters"
"""What all documents share."""

Schema = dict[str, Any]


def fields(schema: Schema, path: str = "") -> Iterator[tuple[str, Schema, bool]]:
    """Each field below a schema: its path, what is said of it, and whether it must be there."""
    for one in schema.get("oneOf", ()):
        yield from fields(one, path)
    if isinstance(schema.get("items"), dict):
        yield from fields(schema["items"], f"{path}[]")
    if isinstance(schema.get("additionalProperties"), dict):
        inner = schema["additionalProperties"]
        yield f"{path}.*", inner, False
        yield from fields(inner, f"{path}.*")
    for key, field in schema.get("properties", {}).items():
        name = f"{path}.{key}" if path else key
        yield name, field, key in schema.get("required", ())
        yield from fields(field, name)


def kind(field: Schema) -> str:
    """The type of a field, as a programmer calls it."""
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{'null' if word is None else word}`" for word in field["enum"])
    if "oneOf" in field:
        return " or ".join(dict.fromkeys(kind(one) for one in field["oneOf"]))
    if "prefixItems" in field:
        parts = ", ".join(one["description"] for one in field["prefixItems"])
        return f"[{parts}]" + (" or null" if "null" in field["type"] else "")
    found = field.get("type", "any")
    names = [found] if isinstance(found, str) else list(found)
    items = field.get("items")
    if "array" in names and items:
        names[names.index("array")] = f"list of {kind(items)}"
    return " or ".join(names)


def unit(field: Schema) -> str:
    """The unit of a number, or of the numbers in a list."""
    inner = field.get("items") or (field.get("prefixItems") or [{}])[0]
    return str(field.get("unit") or (unit(inner) if inner else ""))


def table(schema: Schema, since: str) -> Iterator[str]:
    yield "| field | type | unit | meaning | since |"
    yield "|---|---|---|---|---|"
    for path, field, is_required in fields(schema):
        name = f"`{path}`" if is_required or path.endswith("*") else f"`{path}` (optional)"
        text = field["description"].replace("|", "\\|")
        yield f"| {name} | {kind(field)} | {unit(field)} | {text} | {field.get('since', since)} |"


def sections() -> Iterator[str]:
    """Every format, with a table for each kind that it has."""
    for name in (*DOCUMENTS, *FILES):
        schema = json_schema(name)
        form = f"mapcli.{name}" if name in DOCUMENTS else name
        yield f"### {form}\n\n{schema['title']}. Written by {schema['writtenBy']}.\n"
        shared = HEAD if name in DOCUMENTS else ()
        own = {key: field for key, field in schema.get("properties", {}).items()
               if key not in shared}  # fmt: skip
        for one in schema.get("oneOf", [{**schema, "properties": own}]):
            if "description" in one:
                yield f"`kind: {one['properties']['kind']['const']}`: {one['description']}.\n"
            yield "\n".join(table(one, schema["since"])) + "\n"


def head() -> str:
    """The table of what all documents share."""
    schema = json_schema(DOCUMENTS[0])
    shared = {key: schema["properties"][key] for key in HEAD}
    shared["format"] = {"type": "string", "description": "`mapcli.` and a name of this page"}
    return "\n".join(table({"properties": shared, "required": [*shared]}, schema["since"]))


def page() -> str:
    """The page with its tables as they should be."""
    before, rest = PAGE.read_text().split(BEGIN)
    tables = f"### All documents\n\n{head()}\n\n" + "\n".join(sections())
    return f"{before}{BEGIN}\n\n{tables}\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    PAGE.write_text(page())
