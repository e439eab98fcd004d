"""Fields of perception files: numbers, poses, lists of readings, candidates.

Every function raises `FormatError`, naming key and line, for a field of another type.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import yaml

from mapcli.formats.yaml_mapping import YamlMapping, number_of, shown
from mapcli.model.perception import STEPS, TURNS_DEG, IntendedPose
from mapcli.model.pose import Pose2D

LARGEST = 1e9
"""Metres or degrees; a larger number in a perception is taken for damage."""

POSE = "{cell: [row, column], heading_deg: 90} or {x: 0, y: 0, theta_deg: 90}"
HEADINGS = ("heading_deg", "theta_deg", "theta")


def mapping(document: YamlMapping, key: str, node: yaml.Node) -> YamlMapping:
    """A mapping inside another."""
    if not isinstance(node, yaml.MappingNode):
        raise document.error(key, f"{shown(node)} is not a mapping", "{key: value, ...}", node)
    return YamlMapping(node, document.file)


def list_of(document: YamlMapping, key: str, expected: str) -> list[yaml.Node]:
    """The items of a list under a key."""
    node = document.require(key, expected)
    if not isinstance(node, yaml.SequenceNode):
        raise document.error(key, f"{shown(node)} is not a list", expected, node)
    return list(node.value)


def number(document: YamlMapping, key: str, node: yaml.Node, expected: str) -> float:
    """A number of at most `LARGEST`."""
    value = number_of(node)
    if value is None or not abs(value) <= LARGEST:
        raise document.error(key, f"{shown(node)} is not a number", expected, node)
    return value


def numbers(
    document: YamlMapping,
    key: str,
    node: yaml.Node,
    count: int | None,
    expected: str,
    *,
    null: float | None = None,
) -> list[float]:
    """A list of `count` such numbers (of any length for None).

    Args:
        null: the value that a null becomes; None refuses nulls.
    """
    if not isinstance(node, yaml.SequenceNode) or count not in (None, len(node.value)):
        raise document.error(key, shown(node), expected, node)
    values = []
    for item in node.value:
        empty = isinstance(item, yaml.ScalarNode) and item.value in ("null", "~", "")
        if empty and null is not None:
            values.append(null)
        else:
            values.append(number(document, key, item, expected))
    return values


def choice(document: YamlMapping, key: str, names: Sequence[str]) -> str:
    """The text under a key, which must be one of `names`."""
    expected = f"{', '.join(names[:-1])} or {names[-1]}"
    text = document.text(key, expected)
    if text not in names:
        raise document.error(key, repr(text[:40]), expected)
    return text


def steps_and_turns(document: YamlMapping) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Which candidate poses are compared: the lengths of their steps from the intended pose, in
    the map's unit, and their turns from its heading, degrees, counter-clockwise."""
    steps, turns = STEPS, TURNS_DEG
    if "steps" in document.nodes:
        steps = _one_or_more(document, "steps", "a length of more than 0, or 0 for no neighbours")
    if "turns_deg" in document.nodes:
        turns = _one_or_more(document, "turns_deg", "degrees, each once")
    if min(steps) < 0:
        raise document.error("steps", f"{min(steps):g}", "a length that is not negative")
    return steps, turns


def _one_or_more(document: YamlMapping, key: str, expected: str) -> tuple[float, ...]:
    node = document.nodes[key]
    if isinstance(node, yaml.ScalarNode):
        return (number(document, key, node, expected),)
    values = numbers(document, key, node, None, expected)
    if not values or len(set(values)) != len(values):
        raise document.error(key, "empty" if not values else "a number given twice", expected)
    return tuple(values)


def intended_pose(document: YamlMapping) -> IntendedPose:
    """The pose under the key `pose`: in metres, or a cell of the map."""
    inner = mapping(document, "pose", document.require("pose", POSE))
    theta = _heading(inner)
    if "cell" not in inner.nodes:
        return IntendedPose(theta, _xy(inner))
    row, column = numbers(inner, "cell", inner.nodes["cell"], 2, "[row, column]")
    if not (row.is_integer() and column.is_integer()):
        raise inner.error("cell", f"[{row:g}, {column:g}]", "[row, column], two whole numbers")
    return IntendedPose(theta, cell=(int(row), int(column)))


def pose_of(inner: YamlMapping) -> Pose2D:
    """A pose in metres, its heading in one of the units of `HEADINGS`."""
    return Pose2D(*_xy(inner), _heading(inner))


def _xy(inner: YamlMapping) -> tuple[float, float]:
    x, y = (number(inner, key, inner.require(key, POSE), "a number") for key in ("x", "y"))
    return x, y


def _heading(inner: YamlMapping) -> float:
    given = [key for key in HEADINGS if key in inner.nodes]
    if len(given) != 1:
        problem = "heading is missing" if not given else f"{given[0]} and {given[1]} are both given"
        raise inner.error(given[0] if given else "pose", problem, POSE)
    value = number(inner, given[0], inner.nodes[given[0]], "a number")
    return value if given[0] == "theta" else math.radians(value)
