"""Maps in and out, whatever their format: `load_map` and `dump_map`.

    .txt            text, see `text.py`
    .yaml .yml      a map_server pair (with an image) or a self-contained map, see `yaml_map.py`
    .pgm .png       the image alone; mapcli's own carry resolution, origin and mode inside

Standard input (`-`) and files of other suffixes are told by their content. Writers return bytes
and write nothing; `commands/_output.py` does.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapcli.errors import FormatError
from mapcli.formats.grey import UNKNOWN_GREY, Dialect, GreyImage, GreyRule
from mapcli.formats.map_output import FORMATS, SUFFIXES, Format, SaveOptions, dump_map
from mapcli.formats.text import read_text
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

__all__ = [
    "FORMATS",
    "SUFFIXES",
    "Format",
    "LoadedMap",
    "SaveOptions",
    "dump_map",
    "load_map",
    "read_file",
    "sniff",
]

if TYPE_CHECKING:
    from mapcli.formats.yaml_map import ImageMeta

ReadBytes = Callable[[Path], bytes]


@dataclass(frozen=True)
class LoadedMap:
    """A map and what its files say about it.

    Attributes:
        grid: the map.
        format: for people: "text, numbers", "YAML with PGM P5, 8 bit".
        files: what was read, the named file first.
        rule: what the image's grey means; None for maps without an image.
        warnings: sentences for the user, each without the file's name.
    """

    grid: GridMap
    format: str
    files: tuple[Path, ...]
    rule: GreyRule | None = None
    warnings: tuple[str, ...] = ()


def read_file(path: Path, expected: str = "a map file") -> bytes:
    """All bytes of a file, or of standard input for `-`.

    Raises:
        FormatError: no such file, a directory, not readable.
    """
    if str(path) == "-":
        return sys.stdin.buffer.read()
    try:
        return (path.expanduser() if path.parts[:1] == ("~",) else path).read_bytes()
    except IsADirectoryError as error:
        raise FormatError("is a directory", file=path, expected=expected) from error
    except FileNotFoundError as error:
        raise FormatError("no such file", file=path) from error
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FormatError(f"cannot be read: {reason.lower()}", file=path) from error


def load_map(
    path: str | Path,
    *,
    dialect: Dialect = "nav2",
    resolution: float | None = None,
    origin: Pose2D | None = None,
    form: Format | None = None,
    read: ReadBytes = read_file,
) -> LoadedMap:
    """Load a map of any format.

    Args:
        path: the file, or `-` for standard input.
        dialect: whose rules give an image's grey its meaning (see `grey.py`).
        resolution, origin: used in the place of what the file says.
        form: the format, when it is known otherwise than by suffix or content.
        read: where bytes come from.

    Raises:
        FormatError: the file, or the image it names, does not hold a map.
        DataError: a resolution that is not positive.
    """
    loaded = _load(Path(path), dialect, resolution, origin, form, read)
    if resolution is None and origin is None:
        return loaded
    grid = loaded.grid
    size = grid.resolution if resolution is None else resolution
    return replace(loaded, grid=GridMap(grid.cells, size, origin or grid.origin))


def _load(
    path: Path,
    dialect: Dialect,
    resolution: float | None,
    origin: Pose2D | None,
    form: Format | None,
    read: ReadBytes,
) -> LoadedMap:
    data = read(path)
    if not data.strip():
        raise FormatError("is empty", file=path, expected="a map")
    kind = form or SUFFIXES.get(path.suffix.lower()) or sniff(data)
    if kind == "txt":
        grid, cells = read_text(data, str(path))
        return LoadedMap(grid, f"text, {cells}", (path,))
    if kind == "yaml":
        return _load_yaml(path, data, dialect, read)
    assumed = [] if resolution else ["1 m per cell"]
    assumed += [] if origin else ["origin 0, 0, 0"]
    return _load_image(path, data, dialect, assumed)


def sniff(data: bytes) -> Format:
    """The format of bytes without a telling name."""
    if data[:2] in (b"P2", b"P5"):
        return "pgm"
    if data.startswith(b"\x89PNG"):
        return "png"
    yaml_keys = re.compile(rb"^[ {]*[\"']?(image|cells|polygons|points)[\"']?\s*:", re.MULTILINE)
    return "yaml" if yaml_keys.search(data[:100_000]) else "txt"


def _load_yaml(path: Path, data: bytes, dialect: Dialect, read: ReadBytes) -> LoadedMap:
    from mapcli.formats.yaml_map import CellsYaml, read_yaml

    meta = read_yaml(data, str(path))
    if isinstance(meta, CellsYaml):
        return LoadedMap(meta.grid, "YAML with cells", (path,), warnings=meta.warnings)
    folder = Path() if str(path) == "-" or meta.image.startswith("~/") else path.parent
    image_path = folder / meta.image
    try:
        pixels = read(image_path)
    except FormatError as error:
        raise FormatError(
            f"image {meta.image!r}: {error.problem}",
            file=path,
            where=f"line {meta.image_line}",
            expected=f"a PGM or PNG file at {image_path}",
        ) from error
    image = _decode(pixels, image_path)
    return _map_of(image, meta, dialect, f"YAML with {image.kind}", (path, image_path))


def _load_image(path: Path, data: bytes, dialect: Dialect, assumed: list[str]) -> LoadedMap:
    """An image alone; `assumed` is what its metadata would have said and nobody did."""
    from mapcli.formats.yaml_map import Document, ImageMeta, read_image_meta

    image = _decode(data, path)
    if image.note:
        document = Document.parse(image.note.encode(), f"{path}: metadata inside the image")
        meta = read_image_meta(document, embedded=True)
    else:
        meta = ImageMeta("", 0, 1.0, Pose2D(), GreyRule(), _assumption(path, assumed))
    return _map_of(image, meta, dialect, image.kind, (path,))


def _assumption(path: Path, assumed: list[str]) -> tuple[str, ...]:
    beside = path.with_suffix(".yaml") if path.suffix else path
    hint = f"; {beside.name} beside it may say more" if path.suffix and beside.is_file() else ""
    used = ", ".join([*assumed, "trinary grey"])
    return (f"is an image without metadata; assumed: {used}{hint}",) if assumed else ()


def _map_of(
    image: GreyImage, meta: ImageMeta, dialect: Dialect, kind: str, files: tuple[Path, ...]
) -> LoadedMap:
    cells = meta.rule.cells(image, dialect)
    warnings = (*meta.warnings, *image.warnings, *_doubts(image, meta.rule, dialect))
    grid = GridMap(cells, meta.resolution, meta.origin)
    return LoadedMap(grid, kind, files, meta.rule, warnings)


def _decode(data: bytes, path: Path) -> GreyImage:
    """An image by its first bytes, whatever its name."""
    if data.startswith(b"\x89PNG"):
        from mapcli.formats.png import read_png

        return read_png(data, str(path))
    from mapcli.formats.pgm import read_pgm

    if data[:1] == b"P" and data[:2] in (b"P2", b"P5"):
        return read_pgm(data, str(path))
    problem = f"starts with {data[:8]!r}" if data else "is empty"
    raise FormatError(problem, file=path, expected="a PGM (P2, P5) or PNG image")


def _doubts(image: GreyImage, rule: GreyRule, dialect: Dialect) -> list[str]:
    """What a reader of this map should know: it may not mean what its author meant."""
    grey = image.luma()
    doubts = []
    if rule.mode == "trinary":
        customary = np.uint8(255 - UNKNOWN_GREY if rule.negate else UNKNOWN_GREY)
        one = GreyImage(np.array([[[customary]]], dtype=np.uint8))
        count = int(np.count_nonzero(grey == customary))
        if count and rule.cells(one, dialect)[0, 0] == 0:
            doubts.append(
                f"{counted(count, 'cells')} of grey {customary}, which map savers write for "
                f"unknown, read as open under free_thresh {rule.free_thresh:g}; with "
                "free_thresh: 0.196 they stay unknown"
            )
    if rule.mode == "raw":
        count = int(np.count_nonzero((grey > 100) & (grey < 255)))
        if count:
            cells = counted(count, "cells")
            doubts.append(f"{cells} with neither 0 to 100 nor 255 in the image, read as unknown")
    return doubts
