"""What a text file is, by its content: see `file_kind`."""

from __future__ import annotations

import re
from itertools import pairwise
from math import hypot
from pathlib import Path

from mapcli.formats.file_role import FileKind, LogFormat, Role
from mapcli.formats.input import SNIFFED_BYTES

WEB_PAGE = FileKind("a web page", Role.OTHER, "download the file itself")
DRAWING = FileKind("an SVG drawing", Role.OTHER)

CARMEN = re.compile(
    rb"^(ODOM|[FR]LASER|OLDLASER|(ROBOT|RAW)LASER\d|TRUEPOS|PARAM|SYNC|SONAR|NMEA\w+) ", re.M
)
GFS = re.compile(rb"^(LASER_READING|(ODO|SM)_UPDATE) ", re.M)
DOCUMENT = re.compile(rb'"format"\s*:\s*"mapcli\.([a-z-]+)"')
KEY = re.compile(rb"^[\"']?(\w+)[\"']?\s*:", re.M)
KEY_IN_BRACES = re.compile(rb"[{,]\s*[\"']?(\w+)[\"']?\s*:")
PERCEPTION = re.compile(
    rb"\bkind[\"']?\s*:\s*[\"']?(scan|grids|landmarks|readings|database|trials)\b"
)

YAML_KINDS = (
    ({b"rosbag2_bagfile_information"}, FileKind(
        "the metadata of a ROS 2 bag", Role.OTHER, "name its folder to mapcli slam-replay")),
    ({b"image", b"cells"}, FileKind("a YAML map", Role.MAP)),
    ({b"polygons", b"points"}, FileKind("a continuous map", Role.WORLD)),
    ({b"sensors"}, FileKind("what the sensors of a CSV log are", Role.SENSORS)),
    ({b"waypoints"}, FileKind("a list of waypoints", Role.WAYPOINTS)),
)  # fmt: skip
"""Keys of which a file of the kind has one."""

TABLES = {"strategy,step,": "coverage curve", "position\\turn_deg,": "similarity table",
          "up\\right,": "similarity table"}  # fmt: skip
"""How mapcli's tables in CSV begin -> what they are."""

TRACE_SUFFIXES = {".tum": "TUM", ".kitti": "KITTI", ".g2o": "g2o", ".csv": "CSV"}

POSE_COLUMNS = {"t", "x", "y", "theta"}
"""Of a CSV log of a robot; the others are its sensors."""

TRACE_COLUMNS = POSE_COLUMNS | {"stamp_ns", "odom_x", "odom_y", "odom_theta", "score", "status"}
"""Of a trace; whatever has others is none."""

COLUMN = re.compile(r"[^\W\d][\w. \[\]-]*")
"""The name of a column."""

LINES_LOOKED_AT = 20

Rows = list[list[float]]


def kind_of_text(start: bytes, name: str) -> FileKind | None:
    """What a text file is, see `kind_of`."""
    head = start[:500].lstrip().lower()
    if head.startswith((b"<!doctype html", b"<html")):
        return WEB_PAGE
    if head.startswith(b"<") and b"<svg" in head:
        return DRAWING
    if GFS.search(start.replace(b"\r", b"\n")):
        return FileKind("a GMapping log (.gfs)", Role.LOG)
    if CARMEN.search(start.replace(b"\r", b"\n")):
        return LogFormat.CARMEN.kind
    if found := DOCUMENT.search(start[:1000]):
        form = found[1].decode()
        if form == "pose-trace":
            return FileKind("a pose trace", Role.TRACE)
        return FileKind(f"a mapcli.{form} document", Role.DOCUMENT)
    return _kind_of_yaml(start) or _kind_of_lines(start, name)


def _kind_of_yaml(start: bytes) -> FileKind | None:
    """YAML, or the same as JSON, by its keys."""
    keys = set((KEY_IN_BRACES if start.lstrip().startswith(b"{") else KEY).findall(start))
    if b"kind" in keys and PERCEPTION.search(start):
        return FileKind("a perception", Role.PERCEPTION)
    return next((kind for own, kind in YAML_KINDS if keys & own), None)


def _kind_of_lines(start: bytes, name: str) -> FileKind | None:
    """Text in columns. The last line may be cut off, so it is not looked at unless it is alone."""
    text = start.decode("utf-8", "replace")
    lines = [words for line in text.splitlines() if (words := line.partition("#")[0].strip())]
    whole = (lines[:-1] if len(start) >= SNIFFED_BYTES else lines)[:LINES_LOOKED_AT]
    if any(line.startswith("VERTEX_SE") for line in whole):
        return FileKind("a g2o trace", Role.TRACE)
    if looks_like_robot_csv(start):
        return LogFormat.CSV.kind
    for head, table in TABLES.items():
        if whole and whole[0].startswith(head):
            return FileKind(f"a {table} in CSV", Role.DOCUMENT, "spreadsheets read it")
    if whole and {"x", "y", "theta"} <= {word.strip() for word in whole[0].split(",")}:
        return FileKind("a CSV trace", Role.TRACE)
    suffix = Path(name).suffix.lower()
    if suffix in TRACE_SUFFIXES and _numbers(whole):
        return FileKind(f"a {TRACE_SUFFIXES[suffix]} trace", Role.TRACE)
    if suffix == ".relations":
        return FileKind("a file of relations", Role.RELATIONS)
    return _kind_of_columns(whole) or _map_of_characters(text)


def looks_like_robot_csv(start: bytes) -> bool:
    """Whether a file begins with a head line of columns, of which some are readings of sensors, and
    most of `t,x,y,theta` are there. What is missing is said by the reader."""
    text = start.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "replace")
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    columns = {word.strip().strip('"').strip() for word in next(filter(None, lines), "").split(",")}
    is_named = all(COLUMN.fullmatch(word) for word in columns)
    return is_named and len(columns & POSE_COLUMNS) > 1 and bool(columns - TRACE_COLUMNS)


def _kind_of_columns(lines: list[str]) -> FileKind | None:
    """Numbers in columns. A map has probabilities only; other columns hardly ever do."""
    content = [line for line in lines if ":" not in line]
    rows = _numbers([line.replace("?", "0.5") for line in content])
    if not rows or len({len(row) for row in rows}) > 1:
        return _waypoints(content)
    width = len(rows[0])
    if width == 12 and all(map(_is_pose_matrix, rows)):
        return FileKind("a KITTI trace", Role.TRACE)
    if all(0 <= number <= 1 for row in rows for number in row):
        return FileKind("a text map", Role.MAP)
    in_order = all(a[0] <= b[0] for a, b in pairwise(rows))
    if width == 8 and in_order and all(abs(hypot(*row[4:]) - 1) < 1e-2 for row in rows):
        return FileKind("a TUM trace", Role.TRACE)
    if width == 4 and in_order:
        return FileKind("a trace of `t x y theta`", Role.TRACE)
    return _waypoints(content)


def _is_pose_matrix(row: list[float]) -> bool:
    """Whether the left 3 x 3 of a 3 x 4 has columns of length 1."""
    return all(abs(hypot(*row[k::4]) - 1) < 1e-2 for k in range(3))


def _waypoints(lines: list[str]) -> FileKind | None:
    """`X Y [back] [speed=M/S] [pause=S]`."""
    words = [line.replace(",", " ").split() for line in lines]
    tails = {word.partition("=")[0] for line in words for word in line[2:]}
    is_path = words and min(map(len, words)) > 1 and tails <= {"back", "speed", "pause"}
    if is_path and _numbers([" ".join(line[:2]) for line in words]):
        return FileKind("a list of waypoints", Role.WAYPOINTS)
    return None


def _numbers(lines: list[str]) -> Rows | None:
    """The numbers of all lines, split at blanks or commas; None if something is none."""
    try:
        return [[float(word) for word in line.replace(",", " ").split()] for line in lines]
    except ValueError:
        return None


def _map_of_characters(text: str) -> FileKind | None:
    """A map of `#`, `.` and `?`."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    if any(re.fullmatch(r"[#.?]{2,}", line) for line in lines[:LINES_LOOKED_AT]):
        return FileKind("a text map", Role.MAP)
    return None
