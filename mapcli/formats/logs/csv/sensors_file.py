"""The YAML that says where the sensors of a CSV log sit, and in what units it is.

    units: {time: s, length: cm, angle: deg, range: cm}   # else s, m, rad, m
    range_max: 100               # as far as the sensors see, in the unit of the readings
    range_min: 2                 # nearer is too close to measure
    nothing: 0                   # what is written where nothing is seen, besides range_max and more
    sensors:                     # column -> where it sits: ahead, to the left (length), degrees
      r1: {x: 5, y: 0, yaw_deg: 0}
      r2: {x: 4, y: 3, yaw_deg: 40, range_max: 80, fov_deg: 15}
      g1: {ground: true}         # looks at the floor: read, reported, not used
    ignore: [battery]            # columns that are none of these

A sensor may have `range_min`, `range_max` and `nothing` of its own; if the first two are the same,
it is a switch. All but `sensors` may be left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from mapcli.formats.file_kind import Role, expecting
from mapcli.formats.input import read_file
from mapcli.formats.logs.range_sensors import RangeSensor
from mapcli.formats.logs.rep117 import single
from mapcli.formats.logs.units import METRES, RADIANS
from mapcli.formats.yaml_mapping import YamlMapping
from mapcli.model.pose import Pose2D, rounded_angle, wrap_angle
from mapcli.model.scan import Mount

DECIMALS = {"s": 0, "ms": 3, "us": 6, "ns": 9}
"""Unit of time -> digits by which the point of a number moves to the left."""

UNITS: Mapping[str, Mapping[str, float]] = {
    "time": DECIMALS, "length": METRES, "angle": RADIANS, "range": METRES,
}  # fmt: skip
DEFAULT_UNITS = {"time": "s", "length": "m", "angle": "rad", "range": "m"}

KEYS = {"units", "range_min", "range_max", "nothing", "sensors", "ignore"}
SENSOR_KEYS = {"x", "y", "yaw_deg", "range_min", "range_max", "nothing", "fov_deg", "ground"}

SENSOR = "{x: M, y: M, yaw_deg: DEG}, or {ground: true}"

FARTHEST_SENSOR_M = 100.0
"""A sensor farther from its robot is a mistake, such as another unit."""


@dataclass(frozen=True)
class ColumnSensor:
    """A sensor of a CSV log.

    Attributes:
        sensor: as all logs have them, metres.
        nothing: what its column holds where nothing is seen, as written; None is `range_max`.
    """

    sensor: RangeSensor
    nothing: float | None = None


@dataclass(frozen=True)
class SensorsFile:
    """What a YAML says about a CSV log.

    Attributes:
        file: its name.
        sensors: by column; ignored: columns that are none.
        time_decimals: see `DECIMALS`; length, angle, range: factors to metres and radians.
    """

    file: str
    sensors: Mapping[str, ColumnSensor]
    ignored: frozenset[str]
    time_decimals: int
    length: float
    angle: float
    range: float


def read_sensors_file(path: str) -> SensorsFile:
    """Read the YAML about a CSV log.

    Raises:
        FormatError: no such file, broken, or a value that makes no sense.
    """
    wanted = "YAML that says where the sensors of a CSV log sit"
    with expecting(path, wanted, Role.SENSORS):
        return _read(path, YamlMapping.parse(read_file(Path(path), wanted), path))


def _read(path: str, document: YamlMapping) -> SensorsFile:
    _refuse_others(document, KEYS)
    factors = _factors(document)
    node = document.require("sensors", f"`sensors:` with COLUMN: {SENSOR}")
    if not isinstance(node, yaml.MappingNode) or not node.value:
        raise document.error("sensors", "names no sensor", f"COLUMN: {SENSOR}")
    named = YamlMapping(node, path).nodes
    sensors = {column: _sensor(document, column, one, factors) for column, one in named.items()}
    return SensorsFile(
        path, sensors, _ignored(document), int(factors["time"]), factors["length"],
        factors["angle"], factors["range"],
    )  # fmt: skip


def _refuse_others(document: YamlMapping, known: set[str]) -> None:
    for key in document.nodes:
        if key not in known:
            raise document.error(key, "is no key of this file", ", ".join(sorted(known)))


def _factors(document: YamlMapping) -> dict[str, float]:
    """What a number of each kind is multiplied by; of times, `DECIMALS`."""
    node = document.nodes.get("units")
    if node is None:
        return {kind: UNITS[kind][unit] for kind, unit in DEFAULT_UNITS.items()}
    if not isinstance(node, yaml.MappingNode):
        raise document.error("units", "is no mapping", "{time: s, length: m, angle: rad, range: m}")
    units = YamlMapping(node, document.file)
    _refuse_others(units, set(UNITS))
    factors = {}
    for kind, known in UNITS.items():
        expected = " or ".join(known)
        unit = units.text(kind, expected) if kind in units.nodes else DEFAULT_UNITS[kind]
        if unit not in known:
            raise units.error(kind, f"{unit!r}", expected)
        factors[kind] = known[unit]
    return factors


def _sensor(
    document: YamlMapping, column: str, node: yaml.Node, factors: Mapping[str, float]
) -> ColumnSensor:
    if not isinstance(node, yaml.MappingNode):
        raise document.error(column, "does not say where it sits", SENSOR, node)
    own = YamlMapping(node, document.file)
    _refuse_others(own, SENSOR_KEYS)
    low, high = (
        _limit(own if key in own.nodes else document, key, missing) * factors["range"]
        for key, missing in (("range_min", 0.0), ("range_max", math.inf))
    )
    if high < low:
        raise own.error("range_max", f"{column} sees less far than its range_min", "more", node)
    with_code = own if "nothing" in own.nodes else document
    nothing = None
    if "nothing" in with_code.nodes:
        nothing = with_code.number("nothing", "the reading where nothing is seen")
    fov = own.number("fov_deg", "degrees") if "fov_deg" in own.nodes else 0.0
    mount = None if _is_ground(own) else _mount(own, column, factors["length"])
    limits = single(low), single(high)
    return ColumnSensor(RangeSensor(column, mount, *limits, math.radians(fov)), nothing)


def _limit(mapping: YamlMapping, key: str, missing: float) -> float:
    if key not in mapping.nodes:
        return missing
    value = mapping.number(key, "a distance, in the unit of the readings")
    if value < 0:
        raise mapping.error(key, f"{value:g} is negative", "a distance")
    return value


def _is_ground(sensor: YamlMapping) -> bool:
    if "ground" not in sensor.nodes:
        return False
    text = sensor.text("ground", "true or false")
    if text not in ("true", "false"):
        raise sensor.error("ground", f"{text!r}", "true or false")
    return text == "true"


def _mount(sensor: YamlMapping, column: str, to_metres: float) -> Mount:
    x, y = (sensor.number(key, f"where {column} sits on the robot") for key in "xy")
    yaw = sensor.number("yaw_deg", f"where {column} looks, degrees to the left of ahead")
    pose = Pose2D(x * to_metres, y * to_metres, rounded_angle(wrap_angle(math.radians(yaw))))
    if pose.distance(Pose2D()) > FARTHEST_SENSOR_M:
        text = f"{column} is more than {FARTHEST_SENSOR_M:g} m off the robot"
        raise sensor.error("x", text, "a place on it, or another unit of length")
    return Mount(pose)


def _ignored(document: YamlMapping) -> frozenset[str]:
    node = document.nodes.get("ignore")
    if node is None:
        return frozenset()
    if not isinstance(node, yaml.SequenceNode):
        raise document.error("ignore", "is no list", "[COLUMN, COLUMN]")
    return frozenset(str(one.value) for one in node.value)


def sensors_file_of(name: str) -> str:
    """The YAML that belongs to a log: its name, with `.yaml` for `.csv` or `.csv.gz`."""
    path = Path(name)
    path = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    return str(path.with_suffix(".yaml"))


def existing_sensors_file(name: str) -> str | None:
    """The same, if the log is a CSV and the file exists."""
    is_csv = name.lower().removesuffix(".gz").endswith(".csv")
    return found if is_csv and Path(found := sensors_file_of(name)).exists() else None
