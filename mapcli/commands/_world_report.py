"""What `mapcli info` says about a continuous map, and what lies at a point of any map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mapcli.formats.documents.json_document import document
from mapcli.formats.documents.world import load_world
from mapcli.formats.input import sha256_of
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap
from mapcli.model.world import World

Points = Sequence[tuple[float, float]]


def world_report(file: str, at: Points) -> tuple[list[str], dict[str, Any]] | None:
    """What to print about a continuous map, and the same as a document; None of a grid map that
    looks like one: its key `image` may be spelt with escapes."""
    loaded = load_world(file)
    world = loaded.world
    if not isinstance(world, World):
        return None
    vertices = sum(len(polygon) for polygon in world.polygons)
    content: dict[str, Any] = {
        "kind": "continuous map",
        "y": "down" if loaded.y_down else "up",
        "polygons": len(world.polygons),
        "vertices": vertices,
        "points": len(world.points),
        "bounds": _bounds(world, loaded.y_down),
        "list_bytes": 8 * (vertices + len(world.points)),
        "at": [_objects_at(world, point, loaded.y_down, file) for point in at],
    }
    digest = {Path(file).name: sha256_of(loaded.data)}
    return _lines(file, content), document("mapcli.map-info", digest, {}, content)


def _bounds(world: World, y_down: bool) -> list[float] | None:
    """x0, y0, x1, y1 in the file's own axes; None for an empty map."""
    if not world.polygons and not len(world.points):
        return None
    x0, y0, x1, y1 = world.bounds()
    return [x0, -y1, x1, -y0] if y_down else [x0, y0, x1, y1]


def _objects_at(
    world: World, point: tuple[float, float], y_down: bool, file: str
) -> dict[str, Any]:
    from mapcli.algorithms.maps.polygons import polygons_at
    from mapcli.errors import DataError

    x, y = point
    try:
        found = polygons_at(world, x, -y if y_down else y)
    except DataError as error:
        error.file = file
        raise
    return {"x": x, "y": y, "polygons": found}


def _lines(file: str, content: dict[str, Any]) -> list[str]:
    objects = [counted(content[key], key) for key in ("polygons", "vertices", "points")]
    lines = [
        f"{file}: continuous map, y {content['y']}",
        f"  objects     {', '.join(objects)}",
    ]
    if content["bounds"]:
        x0, y0, x1, y1 = content["bounds"]
        lines.append(f"  extent      x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m")
    lines.append(f"  memory      {content['list_bytes']:,} bytes as a list of pairs of numbers")
    return lines + [f"  at          {_sentence(query)}" for query in content["at"]]


def _sentence(query: dict[str, Any]) -> str:
    inside = ", ".join(f"polygons[{i}]" for i in query["polygons"])
    return f"{query['x']:g},{query['y']:g}: " + (f"in {inside}" if inside else "in no object")


def cell_at(grid: GridMap, point: tuple[float, float]) -> dict[str, Any]:
    """The cell of a grid map that holds a point; no cell outside, no probability if unknown."""
    row, column = (int(index) for index in grid.cells_of_world([point])[0])
    query: dict[str, Any] = {"x": point[0], "y": point[1], "cell": None, "probability": None}
    if grid.contains(row, column):
        query["cell"] = [row, column]
        value = float(grid.cells[row, column])
        query["probability"] = None if math.isnan(value) else round(value, 6)
    return query


def cell_line(query: dict[str, Any]) -> str:
    """The same for a person."""
    place = f"  at          {query['x']:g},{query['y']:g}: "
    if query["cell"] is None:
        return f"{place}outside the map"
    probability = query["probability"]
    content = "unknown" if probability is None else f"obstacle probability {probability:g}"
    return f"{place}cell {query['cell'][0]},{query['cell'][1]}, {content}"
