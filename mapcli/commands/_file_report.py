"""What `mapcli info` says about files that are neither a map nor a log nor a trace."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from mapcli.errors import FormatError
from mapcli.formats.documents.json_document import document
from mapcli.formats.file_kind import FileKind, Role
from mapcli.formats.input import read_file, sha256_of

Facts = dict[str, Any]


def file_report(file: str, kind: FileKind) -> tuple[list[str], dict[str, Any]]:
    """What to print about a file of a kind, and the same as a document.

    Raises:
        FormatError: it is not what it seems to be, or nothing that mapcli can look into.
    """
    if kind.role not in FACTS:
        raise FormatError(f"is {kind}", file=file)
    data = read_file(Path(file))
    facts = FACTS[kind.role](data, file)
    content = {"kind": kind.name, "use": _use(kind), "facts": facts}
    return _lines(file, content), document(
        "mapcli.file-info", {Path(file).name: sha256_of(data)}, {}, content
    )


def _use(kind: FileKind) -> str:
    """What to do with it, after this."""
    if kind.role is Role.DOCUMENT and not kind.advice:
        name = kind.name.split()[1].removeprefix("mapcli.")
        return f"mapcli schema {name} says what its fields mean"
    return kind.advice or kind.role.value


def _document(data: bytes, file: str) -> Facts:
    """Every number and word of a document and of its summary; of a list, how many are in it. Of a
    table in CSV, how large it is."""
    if data.lstrip()[:1] not in (b"{", b"["):
        lines = data.splitlines()
        return {"columns": lines[0].count(b",") + 1, "rows": len(lines) - 1}
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        problem = f"is not JSON: {getattr(error, 'msg', error)}"
        raise FormatError(problem, file=file, expected="a whole document") from error
    if not isinstance(content, dict):
        return {"documents": len(content) if isinstance(content, list) else 0}
    found = {key: value for key, value in content.items() if key not in HEAD}
    summary = found.pop("summary", None)
    facts = {key: len(value) for key, value in found.items() if isinstance(value, list)}
    for fields in (found, summary if isinstance(summary, dict) else {}):
        facts |= {key: value for key, value in fields.items() if _is_plain(value)}
    return facts


HEAD = ("format", "version", "mapcli", "input", "parameters")


def _is_plain(value: Any) -> bool:
    """Whether it is no list or object; nor what JSON has no number for."""
    return value is None or isinstance(value, str | int) or (
        isinstance(value, float) and math.isfinite(value)
    )  # fmt: skip


def _perception(data: bytes, file: str) -> Facts:
    from mapcli.formats.documents.perception_reader import read_perception
    from mapcli.model.perception import (
        GridPerceptions,
        LandmarkPerception,
        MeasuredTrials,
        ReadingsPerception,
        ScanPerception,
    )

    found = read_perception(data, file)
    if isinstance(found, ScanPerception):
        returns = int((found.beams[:, 1] < math.inf).sum())
        facts: Facts = {"beams": len(found.beams), "returns": returns, "range_max": found.range_max}
        return {"perception": "scan", **facts, "turns": len(found.turns_deg)}
    if isinstance(found, LandmarkPerception):
        return {"perception": "landmarks", "landmarks": len(found.measured),
                "turns": len(found.turns_deg)}  # fmt: skip
    if isinstance(found, GridPerceptions):
        rows, columns = found.candidates[0].cells.shape
        return {"perception": "grids", "candidates": len(found.candidates), "rows": rows,
                "columns": columns}  # fmt: skip
    if isinstance(found, ReadingsPerception):
        return {"perception": "readings", "readings": len(found.readings)}
    if isinstance(found, MeasuredTrials):
        return {"perception": "trials", "of": found.of, "trials": len(found.trials)}
    return {"perception": "database", "of": found.of, "candidates": len(found.expectations)}


def _waypoints(data: bytes, file: str) -> Facts:
    from mapcli.formats.documents.waypoints import read_waypoints

    ways = read_waypoints(data, file)
    length = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(ways))
    return {
        "waypoints": len(ways),
        "distance_m": round(length, 6),
        "in_reverse": sum(way.back for way in ways),
        "pauses_s": sum(way.pause for way in ways),
    }


def _relations(data: bytes, file: str) -> Facts:
    from mapcli.formats.documents.relations import read_relations

    found = read_relations(data, file)
    return {
        "relations": len(found),
        "start_ns": int(found.from_ns.min()),
        "end_ns": int(found.to_ns.max()),
    }


def _picture(data: bytes, file: str) -> Facts:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            frames = getattr(image, "n_frames", 1)
            return {"width": image.width, "height": image.height, "mode": image.mode,
                    "frames": frames}  # fmt: skip
    except Exception as error:  # Pillow's plugins raise anything on damaged files
        raise FormatError("the picture is damaged", file=file, expected="a whole file") from error


def _state(data: bytes, file: str) -> Facts:
    """The drives of a state, by name."""
    from mapcli.formats.documents.drive_state import read_state

    facts: Facts = {}
    for drive in read_state(file, lambda path: data):
        one = drive.summary
        facts[drive.name] = f"{one.used} scans, {one.distance_m:.1f} m, verdict {one.verdict}"
    return facts


FACTS: dict[Role, Callable[[bytes, str], Facts]] = {
    Role.DOCUMENT: _document,
    Role.PERCEPTION: _perception,
    Role.WAYPOINTS: _waypoints,
    Role.RELATIONS: _relations,
    Role.PICTURE: _picture,
    Role.STATE: _state,
}
"""Role -> how the facts about a file are found."""


def _lines(file: str, content: dict[str, Any]) -> list[str]:
    """The facts for a person, one a line."""
    lines = [f"{file}: {content['kind'].partition(' ')[2]}"]
    for name, value in content["facts"].items():
        shown = f"{value:.10g}" if isinstance(value, float) else str(value)
        lines.append(f"  {name:<15} {'none' if value is None else shown}")
    return [*lines, f"  {'use':<15} {content['use']}"]
