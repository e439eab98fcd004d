"""Map metadata in YAML: the map_server pair, and mapcli's self-contained map.

    image: depot.pgm            relative to this file's folder, or absolute; ~ is the home folder
    mode: trinary               or scale, raw; trinary when absent
    resolution: 0.05            metres per cell
    origin: [-7.14, -7.83, 0]   x, y, yaw of the outer corner of the bottom-left cell
    negate: 0                   or 1, or a truth value
    occupied_thresh: 0.65
    free_thresh: 0.196

A self-contained map has `cells` in the place of the image and of the four keys about it: a list
of rows, top row first, each a string as in a text map (`"? 0.1 1"` or `"?.#"`) or a list of
numbers and `"?"` (or null); resolution 1 and origin 0, 0, 0 may be left out. Other keys are not
used. Numbers are written as the shortest text that reads back as the same number.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass

import yaml

from mapcli.errors import FormatError
from mapcli.formats.maps.map_image import MODES, GreyRule
from mapcli.formats.maps.text import CHARACTER_ROW, TextRows, number_rows
from mapcli.formats.yaml_mapping import YamlMapping
from mapcli.model.grid import FINEST_M, GridMap
from mapcli.model.pose import FARTHEST_M, Pose2D

_TRUTHS = {"true": True, "yes": True, "on": True, "y": True,
           "false": False, "no": False, "off": False, "n": False}  # fmt: skip

_IMAGE_KEYS = (
    "image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh",
)  # fmt: skip
_CELLS_KEYS = ("cells", "resolution", "origin")


@dataclass(frozen=True)
class ImageMeta:
    """What the YAML of a map_server pair says about its image.

    Attributes:
        image: the image's name as written; "" inside an image's own note.
        image_line: the line it stands in.
        resolution: metres per cell.
        origin: pose of the outer corner of the bottom-left cell.
        rule: what the image's grey means.
        warnings: for whoever loads the map.
        remarks: where other programs would read it otherwise; for `mapcli info`.
    """

    image: str
    image_line: int
    resolution: float
    origin: Pose2D
    rule: GreyRule
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CellsYaml:
    """A self-contained map, with warnings and remarks as of `ImageMeta`."""

    grid: GridMap
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def read_yaml(data: bytes, file: str, *, lenient: bool = False) -> ImageMeta | CellsYaml:
    """Read a map's YAML: the metadata of an image, or a whole map with `cells`.

    Args:
        lenient: take 0 for what is not finite in the origin, with a warning.

    Raises:
        FormatError: broken YAML, a missing or bad key, naming the key and the line.
    """
    document = YamlMapping.parse(data, file)
    if "cells" in document.nodes:
        return _read_cells(document, len(data), lenient=lenient)
    return read_image_meta(document, lenient=lenient)


def read_image_meta(
    document: YamlMapping, *, embedded: bool = False, lenient: bool = False
) -> ImageMeta:
    """The keys of a map_server pair; inside an image (`embedded`) there is no image key."""
    image = "" if embedded else document.text("image", "the name of a PGM or PNG file")
    warnings: list[str] = []
    resolution = _resolution(document)
    origin = _origin(document, warnings, lenient=lenient)
    rule = _rule(document, warnings)
    line = 0 if embedded else document.nodes["image"].start_mark.line + 1
    remarks = _remarks(document, _IMAGE_KEYS, origin)
    return ImageMeta(image, line, resolution, origin, rule, tuple(warnings), remarks)


def _remarks(document: YamlMapping, keys: tuple[str, ...], origin: Pose2D) -> tuple[str, ...]:
    remarks = []
    if origin.theta:
        degrees = math.degrees(origin.theta)
        remarks.append(
            f"origin has a yaw of {degrees:.6g} deg, which Nav2's costmaps and AMCL ignore; "
            "`mapcli transform --bake-yaw` turns the cells instead"
        )
    for key, node in document.nodes.items():
        if key not in keys:
            close = difflib.get_close_matches(key.lower(), set(keys) - document.nodes.keys(), n=1)
            hint = f"; {close[0]} is meant?" if close else ""
            remarks.append(f"line {node.start_mark.line + 1}: key {key!r} is not used{hint}")
    return tuple(remarks)


def _resolution(document: YamlMapping) -> float:
    expected = "metres per cell, more than 0"
    value = document.number("resolution", expected)
    if value <= 0:
        raise document.error("resolution", f"is {value:g}", expected)
    if not FINEST_M <= value <= FARTHEST_M:
        expected = f"{FINEST_M:g} to {FARTHEST_M:g} metres per cell"
        raise document.error("resolution", f"is {value:g}", expected)
    return value


def _origin(document: YamlMapping, warnings: list[str], *, lenient: bool) -> Pose2D:
    expected = "three numbers, [x, y, yaw]"
    place = document.numbers("origin", 3, expected)
    for k, (name, value) in enumerate(zip(("x", "y", "yaw"), place, strict=True)):
        if abs(value) <= FARTHEST_M:
            continue
        if math.isfinite(value):
            most = f"numbers of at most {FARTHEST_M:g}"
            raise document.error("origin", f"the {name} is {value:g}", most)
        # Old map_savers wrote -nan for a quaternion of zeros, which meant no rotation.
        if not (lenient or (name == "yaw" and math.isnan(value))):
            raise document.error("origin", "is not finite", expected)
        what = "not a number (nan)" if math.isnan(value) else "infinite"
        warnings.append(f"the {name} of origin is {what}; 0 is used")
        place[k] = 0.0
    return Pose2D(*place)


def _rule(document: YamlMapping, warnings: list[str]) -> GreyRule:
    occupied, free = (
        document.number(key, "a number from 0 to 1") for key in ("occupied_thresh", "free_thresh")
    )
    for key, value in (("occupied_thresh", occupied), ("free_thresh", free)):
        if not 0 <= value <= 1:
            warnings.append(f"{key} is {value:g}, outside 0 to 1")
    if free >= occupied:
        warnings.append(
            f"free_thresh {free:g} is not below occupied_thresh {occupied:g}; "
            "the cells are what map_server makes of it"
        )
    mode = (document.text("mode", "") if "mode" in document.nodes else "trinary").lower()
    if mode not in MODES:
        raise document.error("mode", f"{mode!r} is unknown", "trinary, scale or raw")
    return GreyRule(mode, free, occupied, _truth(document, "negate"))


def _truth(document: YamlMapping, key: str) -> bool:
    text = document.text(key, "0 or 1").lower()
    if text in _TRUTHS:
        return _TRUTHS[text]
    try:
        return bool(int(text))
    except ValueError:
        raise document.error(key, f"{text!r}", "0 or 1") from None


def _read_cells(document: YamlMapping, limit: int, *, lenient: bool) -> CellsYaml:
    rows = TextRows(document.file, limit)
    node = document.nodes["cells"]
    if isinstance(node, yaml.ScalarNode):
        for line in node.value.split("\n"):
            if line.strip():
                _add_text(rows, line, f"line {node.start_mark.line + 1}: cells")
    elif isinstance(node, yaml.SequenceNode):
        for row in node.value:
            _add_row(rows, row, f"line {row.start_mark.line + 1}")
    else:
        raise document.error("cells", "a mapping", "a list of rows")
    place: dict[str, list[float]] = {}
    warnings: list[str] = []
    if "resolution" in document.nodes:
        place["resolution"] = [_resolution(document)]
    if "origin" in document.nodes:
        origin = _origin(document, warnings, lenient=lenient)
        place["origin"] = [origin.x, origin.y, origin.theta]
    grid = rows.grid(place)
    return CellsYaml(grid, tuple(warnings), _remarks(document, _CELLS_KEYS, grid.origin))


def _add_row(rows: TextRows, row: yaml.Node, place: str) -> None:
    if isinstance(row, yaml.ScalarNode):
        _add_text(rows, row.value, place)
    elif isinstance(row, yaml.SequenceNode) and all(
        isinstance(cell, yaml.ScalarNode) for cell in row.value
    ):
        words = ["?" if cell.value in ("", "~", "null") else cell.value for cell in row.value]
        rows.add_numbers(" ".join(words), place)
    else:
        raise FormatError("not a row", file=rows.file, where=place, expected="a string or a list")


def _add_text(rows: TextRows, text: str, place: str) -> None:
    content = text.strip()
    add = rows.add_characters if CHARACTER_ROW.fullmatch(content) else rows.add_numbers
    add(content, place)


def image_meta_lines(grid: GridMap, rule: GreyRule, image: str = "") -> str:
    """The YAML of a map_server pair, or the note inside an image when `image` is ""."""
    name = f"image: {_quoted(image)}\n" if image else ""
    return (
        f"{name}mode: {rule.mode}\n{_place(grid)}negate: {int(rule.negate)}\n"
        f"occupied_thresh: {_number(rule.occupied_thresh)}\n"
        f"free_thresh: {_number(rule.free_thresh)}\n"
    )


def _place(grid: GridMap) -> str:
    x, y, yaw = map(_number, (grid.origin.x, grid.origin.y, grid.origin.theta))
    return f"resolution: {_number(grid.resolution)}\norigin: [{x}, {y}, {yaw}]\n"


def _number(value: float) -> str:
    """The shortest text that reads back as this number, also in YAML 1.1, for which `1e-05` is a
    word and `1.0e-05` a number."""
    digits, e, power = repr(float(value)).partition("e")
    return f"{digits}.0e{power}" if e and "." not in digits else f"{digits}{e}{power}"


def _quoted(name: str) -> str:
    """A file name as a YAML scalar, quoted only where it must be."""
    plain = name.replace(".", "").replace("-", "").replace("_", "")
    if plain.isascii() and plain.isalnum() and not plain.isdigit() and name[0].isalpha():
        return name
    return json.dumps(name, ensure_ascii=False)  # a JSON string is a YAML scalar


def cells_yaml(grid: GridMap) -> Iterator[bytes]:
    """A self-contained map, in pieces."""
    yield (_place(grid) + "cells:\n").encode()
    for piece in number_rows(grid):
        yield b"".join(b'  - "%b"\n' % row for row in piece.splitlines())
