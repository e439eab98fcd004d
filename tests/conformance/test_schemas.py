"""What commands write is what their JSON Schemas say, and fixtures are what people may write."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from conformance.examples import Example, all_examples
from conformance.kit import Ran, Sandbox
from conftest import FIXTURES
from jsonschema import Draft202012Validator

from mapcli.formats.documents.json_schema import DOCUMENTS, NAMES, json_schema

VARIANTS = {
    "exploration-trace": (
        "frontier room.txt --robot 5,6 --sensor-range 3 --robot-radius 0.5 --return-home -q --json",
        "frontier room.txt --robot 5,6 --robot 5,7 --known known.txt --strategy priority -q --json",
        "frontier room.txt --robot 5,6 --plan -q --json",
    ),
    "similarity-table": (
        "similarity-table room.txt scan.yaml --window-xy 1 -q --json",
        "similarity-table points.yaml landmarks.yaml --locate 3.162,-3.435 -q --json",
        "similarity-table room.txt grids.yaml -q --json",
    ),
    "map-info": ("info room.txt --at 1,1 --at -1,-1 --json", "info world.yaml --at 1,1 --json"),
    "map-comparison": ("compare room.txt known.txt --align -q --json",),
    "map-transform": ("transform room.txt o.txt --align --crop known -q --json",),
    "pose-trace": (
        "slam-replay log.mcap --turn-time 0.1 -q --json",
        "slam-replay carmen.log -q --json",
        "slam-replay log.mcap --search none -q --json",
    ),
}
"""Lines whose documents look other than those of the table of examples."""


def errors(document: Any, name: str) -> list[str]:
    found = Draft202012Validator(json_schema(name)).iter_errors(document)
    return [f"{error.json_path}: {error.message[:200]}" for error in found]


def documents(content: bytes) -> Iterator[tuple[str, Any]]:
    """Those in a JSON file, with their names."""
    read = json.loads(content)
    for one in read if isinstance(read, list) else [read]:
        yield one["format"].removeprefix("mapcli.") if "format" in one else "perception", one


@pytest.mark.parametrize("name", NAMES)
def test_a_schema_is_one_and_every_field_is_explained(name: str) -> None:
    schema = json_schema(name)
    Draft202012Validator.check_schema(schema)
    for path, field in fields(schema):
        assert field.get("description"), path


def fields(schema: dict[str, Any], path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every field that a schema names."""
    inner = [*schema.get("oneOf", ()), *schema.get("prefixItems", ()), schema.get("items"),
             schema.get("additionalProperties")]  # fmt: skip
    for one in inner:
        if isinstance(one, dict):
            yield from fields(one, f"{path}[]")
    for key, field in schema.get("properties", {}).items():
        yield f"{path}.{key}", field
        yield from fields(field, f"{path}.{key}")


JSON_EXAMPLES = [
    example
    for example in all_examples()
    if any(slot.written and slot.name.endswith(".json") for slot in example.slots)
]


@pytest.mark.parametrize("example", JSON_EXAMPLES, ids=lambda example: example.name)
def test_what_a_command_writes(example: Example, usual: Callable[[Example], Ran]) -> None:
    written = {name: data for name, data in usual(example).files.items() if name.endswith(".json")}
    assert written
    for content in written.values():
        for name, document in documents(content):
            assert errors(document, name) == []


@pytest.mark.parametrize(
    ("name", "line"), [(name, line) for name, lines in VARIANTS.items() for line in lines]
)
def test_what_its_options_make_of_it(name: str, line: str, sandbox: Sandbox) -> None:
    shutil.copy(FIXTURES / "corner-grids.yaml", "grids.yaml")
    sandbox.run(*line.split(), "out.json").is_fine()
    ((found, document),) = documents(Path("out.json").read_bytes())
    assert found == name
    assert errors(document, name) == []


def test_every_document_is_written_by_an_example(usual: Callable[[Example], Ran]) -> None:
    written = {
        name
        for example in JSON_EXAMPLES
        for file, content in usual(example).files.items()
        if file.endswith(".json")
        for name, _ in documents(content)
    }
    assert written >= set(DOCUMENTS)


@pytest.mark.parametrize("file", sorted(FIXTURES.glob("*.yaml")), ids=lambda file: file.name)
def test_fixtures_that_people_wrote(file: Path) -> None:
    content = yaml.safe_load(file.read_text())
    if "kind" in content:
        assert errors(content, "perception") == []
    elif {"polygons", "points"} & set(content):
        assert errors(content, "world") == []


def test_what_is_no_such_file() -> None:
    assert errors({"kind": "scan", "pose": {"cell": [1, 2, 3]}}, "perception")
    assert errors({"polygons": [[[0, 0], [1, 1]]]}, "world")
    assert errors({}, "world")


def test_a_field_that_no_schema_has_is_found(usual: Callable[[Example], Ran]) -> None:
    example = next(e for e in JSON_EXAMPLES if e.command == "evaluate")
    ((name, document),) = documents(usual(example).files["e.json"])
    assert errors({**document, "news": 1}, name)
