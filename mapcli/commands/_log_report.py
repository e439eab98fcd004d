"""What `mapcli info` says about a log."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any

from mapcli.algorithms.evaluation.log_check import LogCheck, Timing, check_log
from mapcli.algorithms.evaluation.log_reasons import log_reasons
from mapcli.algorithms.slam.laser_calibration import LaserCalibration
from mapcli.commands._clock_report import reasons_of_clocks
from mapcli.commands._sensor_report import sensor_document, sensor_line
from mapcli.errors import DataError, FormatError
from mapcli.formats.documents.json_document import document
from mapcli.formats.logs.open_log import Log, open_log
from mapcli.model.counting import counted
from mapcli.model.log import LogOptions, Topic
from mapcli.model.range_reading import RangeReading
from mapcli.model.reason import Reason
from mapcli.model.scan import Mount, RangeScan, Record
from mapcli.model.sweep_summary import LOOKS_TURNING, beams_text

STILL_M, STILL_DEG, STILL_RECORDS = 0.01, 1.0, 10
"""A robot that moves and turns less over so many records of odometry stands."""


def log_report(file: str, *, verbose: bool = False) -> tuple[list[str], dict[str, Any]]:
    """What to print about a log, and the same as a document.

    Args:
        verbose: list topics that mapping does not need, too.

    Raises:
        FormatError: nothing can be read.
    """
    log = open_log([file], LogOptions(one_recording=True))
    content = describe(log)
    lines = [f"{file}: log", *_lines(content, verbose)]
    return lines, document("mapcli.log-info", log.digests(), {}, content)


def describe(log: Log) -> dict[str, Any]:
    """The facts about a log, ready for JSON. Reads the log."""
    mounts: dict[Mount, None] = {}
    trouble: list[str] = []
    try:
        calibration = LaserCalibration(lambda: bool(log.unknown_mounts))
        check = check_log(_noting_mounts(log.records(), mounts), calibration)
    except (DataError, FormatError) as error:
        check = check_log([])
        trouble = [f"slam-replay cannot use it: {error.problem}; expected {error.expected}"]
        if error.expected is None:
            trouble = [f"slam-replay cannot use it: {error.problem}"]
    used = check.scans.count > 0
    return {
        "kind": "log",
        "duration_s": _seconds(check.end_ns - check.start_ns),
        "start_ns": check.start_ns,
        "end_ns": check.end_ns,
        "topics": [_topic(topic) for topic in log.topics()],
        "uses": {
            "scan_topic": ", ".join(log.scan_topics) if used else None,
            "odom_topic": log.odom_topic if used else None,
        },
        "scans": _scans(log, check) if used else None,
        "sensors": [sensor_document(sensor) for sensor in log.sensors.values() if used],
        "lasers": [_laser(log, mount) for mount in mounts if used],
        "odometry": _odometry(check) if check.odometry.count else None,
        "delays_s": {
            name: round(delay.mean_s, 6) for name, delay in log.delays.items() if delay.count
        },
        "clock": log.clock.document(),
        "damage": dict(log.damage.counts),
        "notes": list(log.notes),
        "reasons": [reason.document() for reason in _reasons(log, check) if used],
        "warnings": [*trouble, *log.damage.lines(), *(_warnings(log, check) if used else ())],
    }


def _reasons(log: Log, check: LogCheck) -> tuple[Reason, ...]:
    """What the log is described wrongly in."""
    duration_s = (check.scans.last_ns - check.scans.first_ns) * 1e-9
    is_unknown = bool(log.unknown_mounts) and check.odometry.count > 0
    return (
        *log_reasons(log.units, check.mount, duration_s, check.laser, is_unknown=is_unknown),
        *reasons_of_clocks(log, duration_s),
    )


def _laser(log: Log, mount: Mount) -> dict[str, Any]:
    is_known = not (log.unknown_mounts and mount == Mount())
    return {**asdict(mount.pose), "flipped": mount.flipped, "known": is_known}


def _noting_mounts(records: Iterable[Record], mounts: dict[Mount, None]) -> Iterator[Record]:
    last: Mount | None = None
    for record in records:
        if isinstance(record, RangeScan) and record.mount is not last:
            last = record.mount
            if not isinstance(record, RangeReading):
                mounts[last] = None
        yield record


def _seconds(nanoseconds: float) -> float:
    return round(nanoseconds * 1e-9, 6)


def _topic(topic: Topic) -> dict[str, Any]:
    span = topic.last_ns - topic.first_ns
    rate = round((topic.count - 1) / (span * 1e-9), 3) if span > 0 and topic.count > 1 else None
    return {
        "name": topic.name,
        "role": topic.role,
        "type": topic.type,
        "encoding": topic.encoding,
        "count": topic.count,
        "rate_hz": rate,
    }


def _timing(timing: Timing) -> dict[str, Any]:
    return {
        "count": timing.count,
        "period_s": round(timing.period_s, 6),
        "gaps": timing.gaps,
        "longest_gap_s": round(timing.longest_gap_s, 6),
        "longest_gap_at_s": round(timing.longest_gap_at_s, 6),
        "same_stamps": timing.same_stamps,
    }


def _scans(log: Log, check: LogCheck) -> dict[str, Any]:
    beams = log.beams
    return {
        **_timing(check.scans),
        "beams": list(check.beams),
        "bearings_deg": [round(math.degrees(bearing), 4) for bearing in check.bearings],
        "range_min": check.range_limits[0],
        "range_max": check.range_limits[1] if math.isfinite(check.range_limits[1]) else None,
        "turn_time_s": round(check.turn_time_s, 6),
        "sweep_time_s": round(check.sweep_time_s, 6),
        "turn_time_found": check.turn_time_found,
        "beam_order": check.beam_order,
        "no_return_share": round(beams.no_return / max(beams.total, 1), 6),
        "too_close_share": round(beams.too_close / max(beams.total, 1), 6),
        "invalid_share": round(beams.invalid / max(beams.total, 1), 6),
        "repeated": check.repeated_scans,
        "outside_odometry": check.scans_outside_odometry,
    }


def _odometry(check: LogCheck) -> dict[str, Any]:
    return {
        **_timing(check.odometry),
        "distance_m": round(check.distance_m, 3),
        "turned_deg": round(math.degrees(check.turned_rad), 1),
        "jumps": check.jumps,
        "first_jump_at_s": check.first_jump_at_s and round(check.first_jump_at_s, 3),
    }


def _warnings(log: Log, check: LogCheck) -> Iterator[str]:
    """Warnings about a log that can be read."""
    for found in log.breaks:
        at_s = (found.before_ns - check.start_ns) * 1e-9
        yield f"after {at_s:.1f} s {found.what}: another recording, slam-replay refuses it"
    yield from (reason.line() for reason in _reasons(log, check))
    for name, timing in (("scans", check.scans), ("odometry", check.odometry)):
        if timing.gaps:
            yield (
                f"{counted(timing.gaps, f'gaps in the {name}')}, the longest of "
                f"{timing.longest_gap_s:.1f} s at {timing.longest_gap_at_s:.1f} s"
            )
    if log.disordered:
        yield f"{counted(log.disordered, 'records out of order')}, put in order by their stamps"
    if check.scans.same_stamps:
        yield counted(check.scans.same_stamps, "scans with the stamp of the one before")
    if check.repeated_scans:
        yield counted(check.repeated_scans, "scans with the very ranges of the one before")
    if check.scans_outside_odometry:
        yield counted(
            check.scans_outside_odometry, "scans before the first or after the last odometry"
        )
    yield from _odometry_warnings(check)


def _odometry_warnings(check: LogCheck) -> Iterator[str]:
    if check.jumps:
        jumps = counted(check.jumps, "jumps of the odometry")
        yield f"{jumps}, the first at {check.first_jump_at_s:.1f} s"
    if (
        check.odometry.count >= STILL_RECORDS
        and check.distance_m < STILL_M
        and math.degrees(check.turned_rad) < STILL_DEG
    ):
        yield "the odometry never moves"


def _lines(content: dict[str, Any], verbose: bool) -> Iterator[str]:
    """The facts for a person, one a line."""
    scans, odometry, uses = content["scans"], content["odometry"], content["uses"]
    if scans:
        yield f"  duration    {content['duration_s']:,.1f} s"
    names = {name for listed in uses.values() if listed for name in listed.split(", ")}
    topics = [t for t in content["topics"]
              if verbose or t["role"] not in ("other", "pose") or t["name"] in names]  # fmt: skip
    for topic in topics:
        rate = f", {topic['rate_hz']:g} per second" if topic["rate_hz"] else ""
        used = " <- used" if topic["name"] in names else ""
        yield (
            f"  topic       {topic['name']}: {counted(topic['count'], 'messages')}{rate}, "
            f"{topic['type']} ({topic['encoding']}){used}"
        )
    if hidden := len(content["topics"]) - len(topics):
        yield f"              and {counted(hidden, 'topics')} that mapping does not need (-v)"
    if content["sensors"]:
        yield from map(sensor_line, content["sensors"])
    elif scans:
        yield from _scan_lines(scans)
    for laser in content["lasers"]:
        more = ", upside down" if laser["flipped"] else ""
        more += "" if laser["known"] else ", assumed: the log does not tell"
        yield (
            f"  laser       x {laser['x']:g} m, y {laser['y']:g} m, "
            f"yaw {math.degrees(laser['theta']):g} deg on the robot{more}"
        )
    if odometry:
        period = f", every {odometry['period_s']:g} s" if odometry["count"] > 1 else ""
        yield (
            f"  odometry    {odometry['distance_m']:,.1f} m and "
            f"{odometry['turned_deg']:,.0f} deg of turns{period}"
        )
    yield from (f"  note        {note}" for note in content["notes"])
    yield from (f"  warning     {warning}" for warning in content["warnings"])
    if scans and not content["warnings"]:
        yield "  check-up    nothing odd found"


def _scan_lines(scans: dict[str, Any]) -> Iterator[str]:
    fewest, most = scans["beams"]
    low, high = scans["bearings_deg"]
    beams = f"{most}" if fewest == most else f"{fewest} to {most}"
    limit = "" if scans["range_max"] is None else f", up to {scans['range_max']:g} m"
    period = f", every {scans['period_s']:g} s" if scans["count"] > 1 else ""
    field = f"from {low:g} to {high:g} deg{limit}"
    yield f"  scans       {scans['count']:,}{period}; {beams} beams {field}"
    if scans["turn_time_s"]:
        turn = f"{scans['turn_time_s']:g} s"
        if scans["turn_time_found"]:
            turn = LOOKS_TURNING.format(scans["turn_time_s"])
        yield (
            f"  turn        {turn}; {scans['sweep_time_s']:.3g} s from the first beam of a scan to "
            f"the last, {beams_text(scans['beam_order'])}"
        )
    yield (
        f"  beams       {scans['no_return_share']:.1%} without return, "
        f"{scans['too_close_share']:.1%} too close, {scans['invalid_share']:.1%} invalid"
    )
