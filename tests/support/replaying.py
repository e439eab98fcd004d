"""Running `mapcli slam-replay` in tests, in the current folder."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from conftest import FIXTURES, run

from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.model.scan import Record

CORRIDOR, APARTMENT = str(FIXTURES / "corridor.mcap"), str(FIXTURES / "apartment.mcap")

Trace = dict[str, Any]


def replay(*arguments: str) -> int:
    """Run the command; its exit code."""
    return run("slam-replay", *arguments)


def traced(*arguments: str) -> Trace:
    """Run the command, which must succeed; the trace."""
    assert replay("-q", *arguments, "--json", "t.json") == 0
    return dict(json.loads(Path("t.json").read_text()))


def write_log(name: str, records: Iterable[Record]) -> str:
    """An MCAP log of these records; its name."""
    with Path(name).open("wb") as file, McapLogWriter(file) as writer:
        for record in records:
            writer.write(record)
    return name


def files() -> list[str]:
    """All files in the current folder, by name."""
    return sorted(str(path) for path in Path().rglob("*") if path.is_file())
