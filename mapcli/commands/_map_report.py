"""What `mapcli info` says about a map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mapcli.commands._world_report import Points, cell_at, cell_line
from mapcli.formats.documents.json_document import document
from mapcli.formats.documents.pose_trace import torn_files
from mapcli.formats.input import DigestingReader
from mapcli.formats.maps.dialects import Dialect
from mapcli.formats.maps.load import LoadedMap, load_map
from mapcli.model.grid import OCCUPIED_THRESHOLD


def map_report(file: str, dialect: Dialect, at: Points = ()) -> tuple[list[str], dict[str, Any]]:
    """What to print about a map, and the same as a document."""
    read = DigestingReader()
    loaded = load_map(file, dialect=dialect, read=read, lenient=True)
    content = describe(loaded)
    content["warnings"] += _of_another_run(loaded)
    queries = [cell_at(loaded.grid, point) for point in at]
    lines = [f"{file}: map, {loaded.format}", *_lines(content), *map(cell_line, queries)]
    content |= {"at": queries} if at else {}
    parameters = {"dialect": dialect, "occupied_from": OCCUPIED_THRESHOLD}
    return lines, document("mapcli.map-info", read.digests, parameters, content)


def _of_another_run(loaded: LoadedMap) -> list[str]:
    """A warning when the trace beside a map was written with another one."""
    trace = loaded.files[0].with_name("trace.json")
    torn = {*torn_files(trace)} & {path.name for path in loaded.files}
    return [f"{name} is not the one that {trace.name} was written with" for name in sorted(torn)]


def describe(loaded: LoadedMap) -> dict[str, Any]:
    """The facts about a map, ready for JSON."""
    grid, rule = loaded.grid, loaded.rule
    unknown = grid.count(np.isnan)
    occupied = grid.count(lambda cells: cells >= OCCUPIED_THRESHOLD)
    graded = grid.count(lambda cells: (cells > 0) & (cells < 1))
    image = None if rule is None else {
        "mode": rule.mode, "negate": rule.negate,
        "free_thresh": rule.free_thresh, "occupied_thresh": rule.occupied_thresh,
    }  # fmt: skip
    return {
        "kind": loaded.format,
        "rows": grid.rows,
        "columns": grid.columns,
        "resolution": grid.resolution,
        "origin": {"x": grid.origin.x, "y": grid.origin.y, "theta": grid.origin.theta},
        "image": image,
        "cells": {
            "free": grid.stored.size - unknown - occupied,
            "occupied": occupied,
            "unknown": unknown,
            "between_0_and_1": graded,
        },
        "warnings": [*loaded.warnings, *loaded.remarks],
    }


def _lines(content: dict[str, Any]) -> list[str]:
    """The facts for a person, one a line."""
    rows, columns, resolution = content["rows"], content["columns"], content["resolution"]
    origin, cells, image = content["origin"], content["cells"], content["image"]

    def share(name: str) -> str:
        return f"{cells[name]:,} {name} ({cells[name] / (rows * columns):.1%})"

    lines = [
        f"  size        {rows} rows, {columns} columns; "
        f"{columns * resolution:g} x {rows * resolution:g} m",
        f"  resolution  {resolution:g} m per cell",
        f"  origin      x {origin['x']:g} m, y {origin['y']:g} m, "
        f"yaw {math.degrees(origin['theta']):g} deg",
    ]
    if image:
        bounds = f"free up to {image['free_thresh']:g}, occupied from {image['occupied_thresh']:g}"
        bounds = "" if image["mode"] == "raw" else f", {bounds}"
        negate = ", negated" if image["negate"] else ""
        lines.append(f"  mode        {image['mode']}{bounds}{negate}")
    lines.append(f"  cells       {share('free')}, {share('occupied')}, {share('unknown')}")
    if cells["between_0_and_1"]:
        lines.append(f"              {cells['between_0_and_1']:,} of them between 0 and 1")
    return lines + [f"  warning     {warning}" for warning in content["warnings"]]
