"""What `mapcli info` says about a range sensor with one beam."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from mapcli.model.counting import counted
from mapcli.model.log import SensorCounts


def sensor_document(sensor: SensorCounts) -> dict[str, Any]:
    """The facts about a range sensor, ready for JSON."""
    limited, has_read = math.isfinite(sensor.range_max), math.isfinite(sensor.least)
    return {
        "name": sensor.name,
        "kind": sensor.kind,
        "mount": sensor.mount and asdict(sensor.mount.pose),
        "range_min": sensor.range_min,
        "range_max": sensor.range_max if limited else None,
        "field_of_view_deg": round(math.degrees(sensor.field_of_view), 3),
        "readings": sensor.readings,
        "nothing": sensor.nothing,
        "too_close": sensor.too_close,
        "invalid": sensor.invalid,
        "least": round(sensor.least, 6) if has_read else None,
        "most": round(sensor.most, 6) if has_read else None,
    }


def sensor_line(sensor: dict[str, Any]) -> str:
    """A range sensor with one beam, and what it read."""
    limit = "" if sensor["range_max"] is None else f" up to {sensor['range_max']:g} m"
    kind = {"switch": "switch at", "ground": "looks at the floor or up,", "distance": "distance,"}
    limit = f" {sensor['range_max']:g} m" if sensor["kind"] == "switch" else limit
    mount, place = sensor["mount"], ""
    if mount is not None:
        yaw = math.degrees(mount["theta"])
        place = f", x {mount['x']:g} m, y {mount['y']:g} m, yaw {yaw:g} deg on the robot"
    read = counted(sensor["readings"], "readings")
    if sensor["least"] is not None and sensor["kind"] != "switch":
        read += f" of {sensor['least']:.3g} to {sensor['most']:.3g} m"
    if sensor["kind"] == "switch":
        something = sensor["readings"] - sensor["nothing"] - sensor["invalid"]
        read += f", {something / max(sensor['readings'], 1):.1%} saw something"
    shares = ", ".join(
        f"{sensor[key] / max(sensor['readings'], 1):.1%} {text}"
        for key, text in (("nothing", "saw nothing"), ("too_close", "too close"),
                          ("invalid", "invalid"))
        if sensor[key]
    )  # fmt: skip
    return (
        f"  sensor      {sensor['name']}: {kind[sensor['kind']]}{limit}{place}; {read}"
        f"{', ' + shares if shares else ''}"
    )
