"""Paths for simulated robots to drive: text, one waypoint a line, the first is the start.

    0.5 0.5                      # x and y in metres, separated by blanks or a comma
    3.0 0.5  speed=0.3 pause=2   # limit on the way there, m/s; seconds to stand there
    1.0 0.5  back                # driven to in reverse

The same as YAML: `waypoints: [[0.5, 0.5], [3, 0.5, speed=0.3, pause=2], [1, 0.5, back]]`.

A pose trace is a path as well: its corners are the waypoints.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import yaml

from mapcli.errors import DataError, FormatError
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.file_kind import Role, expecting, kind_at
from mapcli.formats.input import read_file
from mapcli.formats.yaml_mapping import YamlMapping
from mapcli.model.trajectory import Poses
from mapcli.model.waypoint import Waypoint

EXPECTED = "`X Y [back] [speed=M/S] [pause=S]`"
LIMITS = ("speed", "pause")

OFF_PATH_M = 0.05
"""How far a drive along a trace may be from it: what a robot misses a waypoint by, rounding it."""


def load_waypoints(path: str | Path) -> list[Waypoint]:
    """The waypoints of a path file, or of standard input for `-`.

    Raises:
        FormatError: not readable, empty, or a bad waypoint, naming its line.
    """
    path = Path(path)
    kind = kind_at(path)
    if kind is not None and kind.role is Role.TRACE:
        return waypoints_along(load_trajectory(path).trajectory.poses)
    with expecting(path, "a list of waypoints", Role.WAYPOINTS):
        waypoints = read_waypoints(read_file(path, "a list of waypoints"), str(path))
    if not waypoints:
        raise FormatError("has no waypoints", file=path, expected=f"lines of {EXPECTED}")
    return waypoints


def read_waypoints(data: bytes, file: str) -> list[Waypoint]:
    """Waypoints from text or YAML.

    Raises:
        FormatError: a bad waypoint, naming its line.
    """
    text = data.decode("utf-8-sig", "replace")
    is_yaml = any(line.startswith("waypoints:") for line in text.splitlines())
    rows = _yaml_rows(data, file) if is_yaml else _text_rows(text)
    return [_waypoint(words, file, f"line {line}") for line, words in rows]


def waypoints_along(poses: Poses) -> list[Waypoint]:
    """The corners of a path from which it is nowhere farther than `OFF_PATH_M`; driven to in
    reverse where the robot looked backwards.

    Args:
        poses: shape (n, 3).
    """
    import shapely

    if len(poses) < 2:
        return [Waypoint(x, y) for x, y, _ in poses.tolist()]
    line = shapely.simplify(shapely.LineString(poses[:, :2]), OFF_PATH_M, preserve_topology=False)
    corners = shapely.get_coordinates(line)
    waypoints, at = [Waypoint(*poses[0, :2].tolist())], 0
    for corner, (dx, dy) in zip(corners[1:], np.diff(corners, axis=0).tolist(), strict=True):
        end = at + int(np.argmax((poses[at:, :2] == corner).all(axis=1)))
        ahead = np.cos(poses[at : end + 1, 2]) * dx + np.sin(poses[at : end + 1, 2]) * dy
        x, y = corner.tolist()
        waypoints.append(Waypoint(x, y, back=bool(ahead.sum() < 0)))
        at = end
    return waypoints


def _text_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if words:
            yield number, words


def _yaml_rows(data: bytes, file: str) -> Iterator[tuple[int, list[str]]]:
    document = YamlMapping.parse(data, file)
    waypoints = document.require("waypoints", f"a list of {EXPECTED}")
    if not isinstance(waypoints, yaml.SequenceNode):
        raise document.error("waypoints", "not a list", f"a list of {EXPECTED}")
    for i, node in enumerate(waypoints.value):
        if not isinstance(node, yaml.SequenceNode):
            raise document.error(f"waypoints[{i}]", "not a list", "[x, y]", node)
        words = [
            word.value if isinstance(word, yaml.ScalarNode) else "a list" for word in node.value
        ]
        yield node.start_mark.line + 1, words


def _waypoint(words: Sequence[str], file: str, where: str) -> Waypoint:
    try:
        x, y = (float(word) for word in words[:2])
        back, limits = False, dict[str, float]()
        for word in words[2:]:
            name, _, value = word.partition("=")
            if word == "back" and not back:
                back = True
            elif name in LIMITS and name not in limits:
                limits[name] = float(value)
            else:
                raise ValueError(word)
        return Waypoint(x, y, back, **limits)
    except ValueError:
        shown = " ".join(words)[:60]
        raise FormatError(f"{shown!r}", file=file, where=where, expected=EXPECTED) from None
    except DataError as error:
        raise FormatError(error.problem, file=file, where=where, expected=error.expected) from None
