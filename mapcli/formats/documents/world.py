"""Worlds in YAML: the continuous map of Sect. 9.1.

    polygons:                    # solid obstacles: x and y of each vertex, metres, y up
      - [[0, 0], [4, 0], [4, 0.1], [0, 0.1]]
    points:                      # landmarks
      - [2, 2]
    y: down                      # y grows downwards, as in pictures and in Fig. 9.1; else up

Polygons or points may be left out, other keys are ignored. In memory y is always up: where the
file has it down, every y changes its sign. A grid map of any format is a world as well. Numbers
are written as the shortest text that reads back as the same number.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from mapcli.errors import DataError
from mapcli.formats.file_kind import Role, expecting, refuse_large
from mapcli.formats.input import read_file
from mapcli.formats.maps.load import load_map, sniff
from mapcli.formats.maps.save import SUFFIXES
from mapcli.formats.yaml_mapping import YamlMapping
from mapcli.model.grid import GridMap
from mapcli.model.pose import FARTHEST_M
from mapcli.model.world import World

KEYS = {"polygons", "points"}


@dataclass(frozen=True)
class LoadedWorld:
    """A world, continuous or as a grid map, with warnings as of `LoadedMap`.

    Attributes:
        y_down: whether y grows downwards in the file; in `world` it grows upwards.
        data: the bytes of the file.
    """

    world: World | GridMap
    warnings: tuple[str, ...] = ()
    y_down: bool = False
    data: bytes = field(default=b"", repr=False)


def load_world(path: str | Path, *, y_down: bool = False) -> LoadedWorld:
    """Load a continuous map or a grid map from a file, or from standard input for `-`.

    Args:
        y_down: take y to grow downwards in a continuous map without a key `y`.

    Raises:
        FormatError: the file holds neither, naming line and key.
    """
    wanted = "a world: a continuous map or a grid map"
    refuse_large(path, wanted, Role.WORLD, Role.MAP)
    with expecting(path, wanted, Role.WORLD, Role.MAP):
        return _load(Path(path), y_down)


def _load(path: Path, y_down: bool) -> LoadedWorld:
    data = read_file(path, "a world")
    if (SUFFIXES.get(path.suffix.lower()) or sniff(data)) == "yaml":
        document = YamlMapping.parse(data, str(path))
        if not KEYS.isdisjoint(document.nodes) and "image" not in document.nodes:
            y_down = _y_down(document, y_down)
            return LoadedWorld(_world(document, y_down), (), y_down, data)
    # The bytes at hand are handed on, because standard input can be read only once.
    loaded = load_map(path, read=lambda file: data if file == path else read_file(file))
    return LoadedWorld(loaded.grid, loaded.warnings, data=data)


def read_world(data: bytes, file: str) -> World:
    """A continuous map from YAML.

    Raises:
        FormatError: broken YAML, neither polygons nor points, or a bad one of them.
    """
    document = YamlMapping.parse(data, file)
    if KEYS.isdisjoint(document.nodes):
        raise document.error("polygons", "key is missing", "a list of polygons")
    return _world(document, _y_down(document, False))


def write_world(world: World, *, y_down: bool = False) -> bytes:
    """A continuous map as YAML, one polygon or point a line."""
    lines = ["y: down"] if y_down else []
    world = turned_over(world) if y_down else world
    if world.polygons or not len(world.points):
        lines += ["polygons:" if world.polygons else "polygons: []"]
        lines += [f"  - [{', '.join(map(_pair, polygon))}]" for polygon in world.polygons]
    if len(world.points):
        lines += ["points:", *(f"  - {_pair(point)}" for point in world.points)]
    return ("\n".join(lines) + "\n").encode()


def turned_over(world: World) -> World:
    """The world with the sign of every y changed: from y up to y down, or back."""
    # + 0.0 makes 0.0 of -0.0.
    over = np.array([1.0, -1.0])
    return World(tuple(p * over + 0.0 for p in world.polygons), world.points * over + 0.0)


def _pair(point: Iterable[float]) -> str:
    return f"[{', '.join(repr(float(value)).removesuffix('.0') for value in point)}]"


def _y_down(document: YamlMapping, otherwise: bool) -> bool:
    if "y" not in document.nodes:
        return otherwise
    direction = document.text("y", "up or down")
    if direction not in ("up", "down"):
        raise document.error("y", f"{direction!r}", "up or down")
    return direction == "down"


def _world(document: YamlMapping, y_down: bool) -> World:
    polygons = tuple(
        _polygon(document, node, f"polygons[{i}]")
        for i, node in enumerate(_items(document, "polygons"))
    )
    points = _points(document, _items(document, "points"), "points")
    world = World(polygons, points)
    return turned_over(world) if y_down else world


def _items(document: YamlMapping, key: str) -> list[yaml.Node]:
    """The list under a key; nothing when the key is absent or empty."""
    node = document.nodes.get(key)
    if node is None or (isinstance(node, yaml.ScalarNode) and not node.value):
        return []
    return _list(document, key, node, f"a list of {key}")


def _list(document: YamlMapping, key: str, node: yaml.Node, expected: str) -> list[yaml.Node]:
    if not isinstance(node, yaml.SequenceNode):
        raise document.error(key, "not a list", expected, node)
    return list(node.value)


def _polygon(document: YamlMapping, node: yaml.Node, key: str) -> NDArray[np.float64]:
    vertices = _list(document, key, node, "a list of vertices, [[x, y], ...]")
    polygon = _points(document, vertices, key)
    try:
        return World((polygon,)).polygons[0]
    except DataError as error:
        raise document.error(key, error.problem, str(error.expected), node) from error


def _points(document: YamlMapping, nodes: list[yaml.Node], key: str) -> NDArray[np.float64]:
    points = [_point(document, node, f"{key}[{i}]") for i, node in enumerate(nodes)]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _point(document: YamlMapping, node: yaml.Node, key: str) -> list[float]:
    expected = "x and y, two numbers"
    values = [
        value.value if isinstance(value, yaml.ScalarNode) else "a list"
        for value in _list(document, key, node, expected)
    ]
    try:
        x, y = map(float, values)
    except ValueError:
        shown = f"[{', '.join(map(str, values))}]"[:60]
        raise document.error(key, f"{shown} is no point", expected, node) from None
    if not np.isfinite([x, y]).all():
        raise document.error(key, f"[{x:g}, {y:g}] is not finite", expected, node)
    if max(abs(x), abs(y)) > FARTHEST_M:
        expected = f"metres, at most {FARTHEST_M:g}"
        raise document.error(key, f"[{x:g}, {y:g}] is too far", expected, node)
    return [x, y]
