"""A log that is described wrongly, all along: its laser's mount, the units of its scans."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mapcli.algorithms.scans.mount_check import MountFinding
from mapcli.algorithms.slam.laser_calibration import LaserEstimate
from mapcli.model.clock import ScansOutside
from mapcli.model.log import UnitCounts
from mapcli.model.reason import Reason
from mapcli.model.scan import Mount

DELAY_S = 1.0
"""Scans and odometry recorded with delays that differ by more than this have other clocks."""

OUTSIDE_SHARE = 0.5
"""So many scans without odometry, where there is some, are more than it stopped early."""

UNKNOWN = "mount unknown: the log does not tell where the laser sits, assumed at the robot's centre"


def log_reasons(
    units: UnitCounts,
    mount: MountFinding | None,
    duration_s: float,
    laser: LaserEstimate | None = None,
    *,
    is_unknown: bool = False,
) -> tuple[Reason, ...]:
    """What is wrong with a log's description, and the option that mends it.

    Args:
        units: what the scans say; mount: what `MountCheck` found.
        duration_s: of the log, from its first to its last scan.
        is_unknown: nothing tells where the laser sits; laser: what was found out about it.
    """
    return (
        *_units(units, duration_s),
        *_mount(mount, laser.mount if laser else None, duration_s),
        *(_unknown(laser, duration_s) if is_unknown else ()),
    )


def clock_reasons(
    recorded_after_s: tuple[float, float] | None, outside: ScansOutside, duration_s: float
) -> Iterator[Reason]:
    """Whether the stamps of scans and odometry are not of one clock.

    Args:
        recorded_after_s: how much later than their stamps scans and odometry were recorded.
        duration_s: of the log, from its first to its last scan.
    """
    scans_s, odometry_s = recorded_after_s or (0.0, 0.0)
    if abs(scans_s - odometry_s) > DELAY_S:
        text = (
            f"scans were recorded {_later(scans_s)} their stamps, odometry {_later(odometry_s)} "
            "its: their clocks differ"
        )
        remedy = "--time-source log"
    elif outside.share > OUTSIDE_SHARE:
        text = (
            f"{outside.share:.0%} of the scans are from before the first or after the last "
            "odometry: their clocks differ, or the wheels were recorded for a part only"
        )
        remedy = ""
    else:
        return
    yield Reason("clocks_differ", 0.0, duration_s, text, remedy, "doubtful")


def _later(seconds: float) -> str:
    return f"{abs(seconds):.1f} s {'before' if seconds < 0 else 'after'}"


def _units(units: UnitCounts, duration_s: float) -> Iterator[Reason]:
    if 2 * units.turning > units.sampled:
        text = f"a scan's angles make {units.turns:,.0f} full turns: they look like degrees"
        yield Reason("angle_unit", 0.0, duration_s, text, "--angle-unit deg")
    if 2 * units.too_far > units.sampled:
        is_mm = 2 * units.millimetres > units.too_far
        name, unit = ("millimetres", "mm") if is_mm else ("centimetres", "cm")
        text = f"readings of {units.middle:,.0f} m in the middle: they look like {name}"
        yield Reason("range_unit", 0.0, duration_s, text, f"--range-unit {unit}")


def _unknown(laser: LaserEstimate | None, duration_s: float) -> Iterator[Reason]:
    text, option = UNKNOWN, ""
    if laser is not None:
        text += f"; scans against wheels: it seems to sit at {_with_errors(laser)}"
        option = laser_pose_option(laser.mount)
    yield Reason("mount_unknown", 0.0, duration_s, text, option, "good")


def _with_errors(laser: LaserEstimate) -> str:
    x, y, yaw = laser.found[0], laser.found[1], math.degrees(laser.found[2])
    x_error, y_error, yaw_error = laser.errors[0], laser.errors[1], math.degrees(laser.errors[2])
    parts = (
        ("x", x, x_error, 2, "m"),
        ("y", y, y_error, 2, "m"),
        ("yaw", yaw, yaw_error, 1, "deg"),
    )
    text = ", ".join(
        f"{name} {round(value, digits) + 0.0:.{digits}f} +- {error:.{digits}f} {unit}"
        for name, value, error, digits, unit in parts
    )
    return f"{text}, upside down" if laser.mount.flipped else text


def _mount(found: MountFinding | None, right: Mount | None, duration_s: float) -> Iterator[Reason]:
    """Args: right: where the laser sits, if that is known better than `found` tells it."""
    if found is None:
        return
    option = laser_pose_option(right or found.right)
    turn_deg = math.degrees(found.turn)
    if found.mirrored:
        text = "scans turn the other way than the wheels: the laser is mirrored"
        if turn_deg:
            text += f", and {_where(turn_deg)}"
        yield Reason("laser_mirrored", 0.0, duration_s, text, option)
    else:
        text = f"scans move another way than the wheels: the laser is {_where(turn_deg)}"
        yield Reason("laser_turned", 0.0, duration_s, text, option)


def _where(turn_deg: float) -> str:
    if abs(turn_deg) == 180:
        return "mounted backwards"
    return f"mounted {abs(turn_deg):g} deg to the {'left' if turn_deg > 0 else 'right'}"


def laser_pose_option(mount: Mount) -> str:
    """The option that says where a laser is mounted."""
    pose, flip = mount.pose, ",flip" if mount.flipped else ""
    numbers = pose.x, pose.y, math.degrees(pose.theta)
    x, y, yaw = (f"{round(number, 4) + 0.0:g}" for number in numbers)
    return f"--laser-pose {x},{y},{'180' if yaw == '-180' else yaw}{flip}"
