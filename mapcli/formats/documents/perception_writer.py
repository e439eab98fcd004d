"""Writing perceptions as YAML or JSON; `perception_reader` has the format.

Lengths and poses have six decimals (micrometres), bearings four (0.36 arc seconds): finer than any
sensor.
"""

from __future__ import annotations

import json
import math
from pathlib import PurePath
from typing import Any

from mapcli.formats.documents.json_document import json_bytes
from mapcli.model.perception import (
    ExpectedReadings,
    IntendedPose,
    LandmarkPerception,
    MeasuredTrials,
    PerceptionDatabase,
    ReadingsPerception,
    ScanPerception,
    Trial,
)
from mapcli.model.pose import Pose2D

SUFFIXES = (".yaml", ".yml", ".json")

Writable = ScanPerception | LandmarkPerception | PerceptionDatabase | MeasuredTrials


def dump_perception(perception: Writable, name: str, odom: Pose2D | None = None) -> bytes:
    """The bytes of a perception file: JSON if the name ends so, else YAML.

    Args:
        odom: the raw odometry pose of a scan from a log, noted as `odom`.
    """
    content = _content(perception)
    if odom is not None:
        content["odom"] = _pose(odom)
    if PurePath(name).suffix.lower() == ".json":
        return json_bytes(content)
    return "".join(f"{key}:{_yaml(value)}\n" for key, value in content.items()).encode()


def _content(perception: Writable) -> dict[str, Any]:
    if isinstance(perception, PerceptionDatabase):
        head: dict[str, Any] = {"kind": "database", "of": perception.of}
        if perception.of == "scan":
            head["range_max"] = _rounded(perception.range_max)
        candidates = [_expectation(e, perception.of) for e in perception.expectations]
        return {**head, "step": _rounded(perception.step), "candidates": candidates}
    if isinstance(perception, MeasuredTrials):
        return _trials(perception)
    place = _intended_pose(perception.intended_pose)
    search = {
        "steps": [_rounded(step) for step in perception.steps],
        "turns_deg": [_rounded(turn) for turn in perception.turns_deg],
    }
    if isinstance(perception, LandmarkPerception):
        return {"kind": "landmarks", "pose": place, **search,
                "measured": _measured(perception.measured)}  # fmt: skip
    content = {"kind": "scan", "pose": place, "range_max": _rounded(perception.range_max),
               "no_return": perception.no_return, "walls": perception.walls}  # fmt: skip
    if perception.laser != Pose2D():
        content["laser"] = _pose(perception.laser)
    return {**content, **search, "beams": _beams(perception.beams)}


def _trials(measured: MeasuredTrials) -> dict[str, Any]:
    head: dict[str, Any] = {"kind": "trials", "of": measured.of}
    first = measured.trials[0].measured
    if isinstance(first, ScanPerception):
        head["range_max"] = _rounded(first.range_max)
    return {**head, "trials": [_trial(trial) for trial in measured.trials]}


def _trial(trial: Trial) -> dict[str, Any]:
    content: dict[str, Any] = {"position": trial.position, "turn_deg": _rounded(trial.turn_deg)}
    match trial.measured:
        case ScanPerception(beams=beams):
            return {**content, "beams": _beams(beams)}
        case LandmarkPerception(measured=measured):
            return {**content, "measured": _measured(measured)}
        case ReadingsPerception(readings=readings):
            return {**content, "readings": _values(readings)}


def _values(readings: Any) -> list[float | None]:
    return [None if math.isnan(value) else _rounded(value) for value in readings.tolist()]


def _expectation(expectation: ExpectedReadings, of: str) -> dict[str, Any]:
    content: dict[str, Any] = {
        "position": expectation.position,
        "turn_deg": _rounded(expectation.turn_deg),
    }
    if expectation.pose is not None:
        content["pose"] = _pose(expectation.pose)
    if of == "scan":
        return {**content, "beams": _beams(expectation.readings)}
    if of == "readings":
        return {**content, "readings": _values(expectation.readings[:, 0])}
    return {**content, "measured": _measured(expectation.readings)}


def _beams(readings: Any) -> list[list[float | None]]:
    return [
        [_bearing(bearing), _rounded(reach) if math.isfinite(reach) else None]
        for bearing, reach in readings.tolist()
    ]


def _measured(readings: Any) -> list[list[float] | None]:
    return [
        None if math.isnan(distance) else [_rounded(distance), _bearing(bearing)]
        for distance, bearing in readings.tolist()
    ]


def _bearing(radians: float) -> float:
    return _rounded(round(math.degrees(radians), 4))


def _intended_pose(place: IntendedPose) -> dict[str, Any]:
    if place.cell is not None:
        return {"cell": list(place.cell), "heading_deg": _rounded(math.degrees(place.theta))}
    return _pose(Pose2D(*place.xy, place.theta))


def _pose(pose: Pose2D) -> dict[str, float]:
    return {
        "x": _rounded(pose.x), "y": _rounded(pose.y),
        "theta_deg": _rounded(math.degrees(pose.theta)),
    }  # fmt: skip


def _rounded(value: float) -> float:
    """Six decimals, whole numbers as int; 0.0 instead of -0.0."""
    rounded = round(float(value), 6) + 0.0
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded


def _yaml(value: Any) -> str:
    """Lists of readings or candidates with a line for each, anything else in one line."""
    if not isinstance(value, list) or not any(isinstance(v, list | dict) for v in value):
        return f" {_flow(value)}"
    lines = []
    for item in value:
        if isinstance(item, dict):
            keys = (f"{key}: {_flow(inner)}" for key, inner in item.items())
            lines.append("\n  - " + "\n    ".join(keys))
        else:
            lines.append(f"\n  - {_flow(item)}")
    return "".join(lines)


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str) and not value.replace("_", "").isalnum():
        return json.dumps(value, ensure_ascii=False)
    return "null" if value is None else str(value)
