"""Perceptions, as `mapcli similarity-table` compares them and `mapcli perceive` writes them.

YAML or JSON with a `kind`:

    kind: scan
    pose: {cell: [3, 6], heading_deg: 90}     or {x: 6.5, y: 4.5, theta_deg: 90}, or theta: radians
    range_max: 5                              in the map's unit
    beams: [[-15, 3.2], [0, null], ...]       bearing from the heading in degrees, range or null
    no_return: clear                          or ignore: what beams with null say
    walls: thick                              or ends: cells in which beams end are obstacles
    laser: {x: 0.2, y: 0, theta_deg: 0}       where they start on the robot; 0, 0, 0 when absent
    steps: 1                                  of the candidates, in cells; several in a list
    turns_deg: [0, -15, 15]

    kind: landmarks
    pose: {x: 0, y: 0, theta_deg: 0}
    measured: [[2.0, 32.0], null, ...]        distance, bearing in degrees; null: not seen
    steps, turns_deg                          as above, steps in the map's unit

    kind: readings                            values of sensors, in whatever unit
    readings: [1830, 0, 2210]                 in the order of the sensors; null: nothing

    kind: grids
    candidates:
      - {position: intended, turn_deg: 0, rows: ["? 1 -1", ...]}
    cells: sign                               -1 empty, 1 obstacle, 0 or ? unknown; or probability
    corner: [0, 2]                            row and column of the map where they begin
    pose, steps                               only to say what pose the best one is

    kind: database                            one set of readings for each pose (Activity 9.5)
    of: landmarks                             or scan, or readings
    range_max: 5                              of scans
    step: 1                                   readings that differ by no more count as equal
    candidates:
      - {position: intended, turn_deg: 0, pose: {...}, measured: [...]}      or beams, readings

    kind: trials                              sets that were measured at known poses
    of: landmarks                             as of the database
    range_max: 5                              of scans
    trials:
      - {position: intended, turn_deg: 0, measured: [...]}      the same pose any number of times

Readings, landmarks and scans that are compared with a database need no pose.
Other keys are ignored. A JSON file is read as the YAML that it is, so that errors know lines.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from mapcli.errors import FormatError
from mapcli.formats.documents.perception_fields import (
    choice,
    intended_pose,
    list_of,
    mapping,
    number,
    numbers,
    pose_of,
    steps_and_turns,
)
from mapcli.formats.file_kind import Role, expecting
from mapcli.formats.input import read_file
from mapcli.formats.maps.text import CHARACTER_ROW
from mapcli.formats.yaml_mapping import YamlMapping
from mapcli.model.grid import OCCUPIED_THRESHOLD
from mapcli.model.perception import (
    UNTOLD,
    ExpectedReadings,
    GridCandidate,
    GridPerceptions,
    IntendedPose,
    LandmarkPerception,
    MeasuredTrials,
    Perceived,
    PerceptionDatabase,
    ReadingsKind,
    ReadingsPerception,
    ScanPerception,
    Trial,
    measured_of,
)
from mapcli.model.pose import Pose2D

KINDS = ("scan", "grids", "landmarks", "readings", "database", "trials")

Floats = NDArray[np.float64]


def load_perception(path: str | Path, low: float = OCCUPIED_THRESHOLD) -> Perceived:
    """Load a perception from a file, or from standard input for `-`.

    Args:
        low: probabilities of perception maps below it mean empty.

    Raises:
        FormatError: naming line and key.
    """
    with expecting(path, "a perception", Role.PERCEPTION):
        return read_perception(read_file(Path(path), "a perception"), str(path), low)


def read_perception(
    data: bytes, file: str, low: float = OCCUPIED_THRESHOLD, *, needs_pose: bool = True
) -> Perceived:
    """A perception from its bytes; see `load_perception`.

    Args:
        needs_pose: whether scans and landmarks must say where they were taken.
    """
    if not data.strip():
        raise FormatError("is empty", file=file, expected="a perception")
    if data.lstrip()[:1] == b"{":
        data = data.replace(b"\t", b" ")  # JSON may be indented by tabs, YAML not
    document = YamlMapping.parse(data, file)
    kind = choice(document, "kind", KINDS)
    if kind == "scan":
        return _scan(document, needs_pose=needs_pose)
    if kind == "landmarks":
        steps, turns = steps_and_turns(document)
        place = _pose_of_readings(document, needs_pose=needs_pose)
        return LandmarkPerception(place, _measured(document), steps, turns)
    if kind == "readings":
        place = _pose_of_readings(document, needs_pose=False)
        return ReadingsPerception(place, _readings(document))
    if kind == "trials":
        return _trials(document)
    return _grids(document, low) if kind == "grids" else _database(document)


def _pose_of_readings(document: YamlMapping, *, needs_pose: bool) -> IntendedPose:
    return intended_pose(document) if needs_pose or "pose" in document.nodes else UNTOLD


def _readings(document: YamlMapping) -> Floats:
    """Values of sensors, NaN for null; shape (n,)."""
    expected = "a list of numbers, one for each sensor; null for nothing"
    node = document.require("readings", expected)
    values = numbers(document, "readings", node, None, expected, null=math.nan)
    if not values:
        raise document.error("readings", "no readings", expected)
    return np.array(values)


def _scan(document: YamlMapping, *, needs_pose: bool) -> ScanPerception:
    steps, turns = steps_and_turns(document)
    range_max = _range_max(document)
    laser = Pose2D()
    if "laser" in document.nodes:
        laser = pose_of(mapping(document, "laser", document.nodes["laser"]))
    no_return: Any = "clear"
    if "no_return" in document.nodes:
        no_return = choice(document, "no_return", ("clear", "ignore"))
    walls: Any = "thick"
    if "walls" in document.nodes:
        walls = choice(document, "walls", ("thick", "ends"))
    beams = _beams(document)
    return ScanPerception(
        _pose_of_readings(document, needs_pose=needs_pose), beams, range_max, laser, no_return,
        walls, steps, turns,
    )  # fmt: skip


def _range_max(document: YamlMapping) -> float:
    expected = "the largest range that is measured, more than 0, in the map's unit"
    value = number(document, "range_max", document.require("range_max", expected), expected)
    if value <= 0:
        raise document.error("range_max", f"is {value:g}", expected)
    return value


def _beams(document: YamlMapping) -> Floats:
    """Bearings in radians and ranges, inf for null; shape (n, 2)."""
    expected = "[bearing in degrees, range or null]"
    rows = []
    for k, node in enumerate(list_of(document, "beams", f"a list of {expected}")):
        bearing, reach = numbers(document, f"beams[{k}]", node, 2, expected, null=math.inf)
        if reach < 0 or math.isinf(bearing):
            raise document.error(f"beams[{k}]", f"[{bearing:g}, {reach:g}]", expected, node)
        rows.append((math.radians(bearing), reach))
    if not rows:
        raise document.error("beams", "no beams", f"a list of {expected}")
    return np.array(rows)


def _measured(document: YamlMapping) -> Floats:
    """Distances and bearings in radians, NaN for null; shape (n, 2)."""
    expected = "[distance, bearing in degrees], or null for one not seen"
    rows = []
    for k, node in enumerate(list_of(document, "measured", f"a list of {expected}")):
        if isinstance(node, yaml.ScalarNode) and node.value in ("null", "~", ""):
            rows.append((math.nan, math.nan))
            continue
        distance, bearing = numbers(document, f"measured[{k}]", node, 2, expected)
        if distance < 0:
            raise document.error(f"measured[{k}]", f"distance {distance:g}", expected, node)
        rows.append((distance, math.radians(bearing)))
    if not rows:
        raise document.error("measured", "no landmarks", f"a list of {expected}")
    return np.array(rows)


def _grids(document: YamlMapping, low: float) -> GridPerceptions:
    signs = True
    if "cells" in document.nodes:
        signs = choice(document, "cells", ("sign", "probability")) == "sign"
    expected = "a list of {position, turn_deg, rows}"
    candidates: list[GridCandidate] = []
    for k, node in enumerate(list_of(document, "candidates", expected)):
        inner = mapping(document, f"candidates[{k}]", node)
        position, turn = _which(inner, {(c.position, c.turn_deg) for c in candidates})
        cells = _rows(inner, signs=signs, low=low)
        if candidates and cells.shape != candidates[0].cells.shape:
            size, first = (
                "{} rows of {}".format(*s) for s in (cells.shape, candidates[0].cells.shape)
            )
            raise inner.error("rows", size, f"{first} cells, as in the first candidate")
        candidates.append(GridCandidate(position, turn, cells))
    if not candidates:
        raise document.error("candidates", "no candidates", expected)
    corner = None
    if "corner" in document.nodes:
        place = numbers(document, "corner", document.nodes["corner"], 2, "[row, column]")
        if not all(value.is_integer() for value in place):
            raise document.error("corner", f"{place}", "[row, column], two whole numbers")
        corner = int(place[0]), int(place[1])
    stand = intended_pose(document) if "pose" in document.nodes else None
    return GridPerceptions(tuple(candidates), corner, stand, steps_and_turns(document)[0])


def _which(inner: YamlMapping, taken: set[tuple[str, float]]) -> tuple[str, float]:
    """Position and turn of a candidate, which no other has."""
    position = inner.text("position", "intended, up, down, left, right, or any other name")
    expected = "degrees, counter-clockwise of the intended heading"
    turn = number(inner, "turn_deg", inner.require("turn_deg", expected), expected)
    if (position, turn) in taken:
        raise inner.error("position", f"{position} at {turn:g} degrees was there before",
                          "each candidate once")  # fmt: skip
    return position, turn


def _rows(inner: YamlMapping, *, signs: bool, low: float) -> NDArray[np.int8]:
    """The cells of a perception map as -1, 0 and +1, top row first."""
    expected = "a list of rows of cells"
    rows: list[list[int]] = []
    for k, node in enumerate(list_of(inner, "rows", expected)):
        if isinstance(node, yaml.ScalarNode):
            text = str(node.value).strip()
            words = list(text) if CHARACTER_ROW.fullmatch(text) else text.split()
        else:
            words = [str(cell.value) for cell in _scalars(inner, f"rows[{k}]", node)]
        rows.append([_sign(inner, node, f"rows[{k}]", w, signs=signs, low=low) for w in words])
        if len(rows[-1]) != len(rows[0]) or not words:
            raise inner.error(f"rows[{k}]", f"{len(words)} cells", f"{len(rows[0])} as in the row "
                              "before" if rows[0] else "at least one cell", node)  # fmt: skip
    if not rows:
        raise inner.error("rows", "no rows", expected)
    return np.array(rows, np.int8)


def _scalars(inner: YamlMapping, key: str, node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.SequenceNode) and all(
        isinstance(cell, yaml.ScalarNode) for cell in node.value
    ):
        return list(node.value)
    raise inner.error(key, "not a row", "a string or a list of cells", node)


def _sign(
    inner: YamlMapping, node: yaml.Node, key: str, word: str, *, signs: bool, low: float
) -> int:
    if word in ("?", "null", "~", ""):
        return 0
    if word in ("#", "."):
        return 1 if word == "#" else -1
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if signs and value in (-1, 0, 1):
        return int(value)
    if not signs and 0 <= value <= 1:
        return -1 if value < low else 1
    expected = "-1, 0, 1 or ?" if signs else "a probability from 0 to 1, or ?"
    hint = " (or cells: probability)" if signs and 0 < value < 1 else ""
    raise inner.error(key, f"cell {word[:40]!r}", f"{expected}{hint}", node)


OF = {"scan": "beams", "landmarks": "measured", "readings": "readings"}
"""Kind of readings -> the key that they stand under."""


def _set_of_readings(inner: YamlMapping, of: ReadingsKind, first: Floats | None) -> Floats:
    """The readings of one pose.

    Raises:
        FormatError: not as many as at the first pose.
    """
    if of == "readings":
        found = _readings(inner)[:, None]
    else:
        found = _beams(inner) if of == "scan" else _measured(inner)
    if first is not None and len(found) != len(first):
        problem = f"{len(found)} readings"
        raise inner.error(OF[of], problem, f"{len(first)}, as at the first pose")
    return found


def _trials(document: YamlMapping) -> MeasuredTrials:
    of: Any = choice(document, "of", tuple(OF))
    range_max = _range_max(document) if of == "scan" else math.inf
    expected = f"a list of {{position, turn_deg, {OF[of]}}}"
    found: list[Trial] = []
    first: Floats | None = None
    for k, node in enumerate(list_of(document, "trials", expected)):
        inner = mapping(document, f"trials[{k}]", node)
        position, turn = _which(inner, set())
        readings = _set_of_readings(inner, of, first)
        first = readings if first is None else first
        found.append(Trial(position, turn, measured_of(of, readings, range_max)))
    if not found:
        raise document.error("trials", "no trials", expected)
    return MeasuredTrials(of, tuple(found))


def _database(document: YamlMapping) -> PerceptionDatabase:
    of: Any = choice(document, "of", tuple(OF))
    range_max = _range_max(document) if of == "scan" else math.inf
    step = 1.0
    if "step" in document.nodes:
        step = number(document, "step", document.nodes["step"], "a number")
    expected = f"a list of {{position, turn_deg, {OF[of]}}}"
    found: list[ExpectedReadings] = []
    for k, node in enumerate(list_of(document, "candidates", expected)):
        inner = mapping(document, f"candidates[{k}]", node)
        position, turn = _which(inner, {(e.position, e.turn_deg) for e in found})
        pose = None
        if "pose" in inner.nodes:
            pose = pose_of(mapping(inner, "pose", inner.nodes["pose"]))
        readings = _set_of_readings(inner, of, found[0].readings if found else None)
        found.append(ExpectedReadings(position, turn, pose, readings))
    if not found:
        raise document.error("candidates", "no candidates", expected)
    return PerceptionDatabase(of, tuple(found), range_max, step)
