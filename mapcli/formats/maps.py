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
from pathlib import Path, PurePath
from typing import Literal, get_args

import numpy as np

from mapcli.errors import DataError, FormatError
from mapcli.formats.grey import (
    UNKNOWN_GREY,
    Dialect,
    GreyImage,
    GreyRule,
    Mode,
    percent_greys,
    trinary_greys,
)
from mapcli.formats.text import read_text, write_characters, write_numbers
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Format = Literal["txt", "yaml", "pgm", "png"]
FORMATS: tuple[Format, ...] = get_args(Format)
SUFFIXES: dict[str, Format] = {
    ".txt": "txt", ".yaml": "yaml", ".yml": "yaml", ".pgm": "pgm", ".png": "png",
}  # fmt: skip

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


@dataclass(frozen=True)
class SaveOptions:
    """How a map is written.

    Attributes:
        mode: what grey means in an image: three values, percents with transparency, or percents.
        free_thresh, occupied_thresh: None takes the mode's own. In trinary mode (and in the
            character form of text) cells up to the one are written as open and cells from the
            other as obstacle, by default 0.25 and 0.65 as in Nav2; the YAML always gets 0.196
            and 0.65, under which the pixels read back as they were meant. In scale mode they are
            the ends of the scale, by default 0 and 1, which keeps every percent.
        negate: dark is open and light is obstacle.
        format: overrides the suffix.
        characters: text as `#`, `.`, `?` instead of numbers.
        inline: YAML with the cells inside instead of an image beside it.
        plain: PGM as numbers (P2).
        bits: 8 or 16, of a PGM.

    Raises:
        DataError: thresholds out of order or outside 0 to 1.
    """

    mode: Mode = "trinary"
    free_thresh: float | None = None
    occupied_thresh: float | None = None
    negate: bool = False
    format: Format | None = None
    characters: bool = False
    inline: bool = False
    plain: bool = False
    bits: Literal[8, 16] = 8

    def __post_init__(self) -> None:
        free, occupied = self.thresholds
        if not 0 <= free < occupied <= 1:
            raise DataError(
                f"free_thresh {free:g} and occupied_thresh {occupied:g}",
                expected="0 <= free_thresh < occupied_thresh <= 1",
            )

    @property
    def thresholds(self) -> tuple[float, float]:
        """(free, occupied), with the mode's defaults filled in."""
        free, occupied = (0.0, 1.0) if self.mode == "scale" else (0.25, 0.65)
        return (
            free if self.free_thresh is None else self.free_thresh,
            occupied if self.occupied_thresh is None else self.occupied_thresh,
        )

    @property
    def rule(self) -> GreyRule:
        """How the image is to be read, which is what its YAML says."""
        if self.mode == "scale":
            free, occupied = self.thresholds
            return GreyRule("scale", free, occupied, self.negate)
        return GreyRule(self.mode, negate=self.negate)


def read_file(path: Path) -> bytes:
    """All bytes of a file, or of standard input for `-`.

    Raises:
        FormatError: no such file, a directory, not readable.
    """
    if str(path) == "-":
        return sys.stdin.buffer.read()
    try:
        return path.expanduser().read_bytes()
    except IsADirectoryError as error:
        raise FormatError("is a directory", file=path, expected="a map file") from error
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
    path = Path(path)
    data = read(path)
    if not data.strip():
        raise FormatError("is empty", file=path, expected="a map")
    kind = form or SUFFIXES.get(path.suffix.lower()) or sniff(data)
    if kind == "txt":
        grid, cells = read_text(data, str(path))
        loaded = LoadedMap(grid, f"text, {cells}", (path,))
    elif kind == "yaml":
        loaded = _load_yaml(path, data, dialect, read)
    else:
        placed = resolution is not None and origin is not None
        loaded = _load_image(path, data, dialect, placed=placed)
    if resolution is None and origin is None:
        return loaded
    grid = loaded.grid
    moved = replace(grid, resolution=resolution or grid.resolution, origin=origin or grid.origin)
    return replace(loaded, grid=moved)


def sniff(data: bytes) -> Format:
    """The format of bytes without a telling name."""
    if data[:2] in (b"P2", b"P5"):
        return "pgm"
    if data.startswith(b"\x89PNG"):
        return "png"
    yaml_keys = re.compile(rb"^[ {]*[\"']?(image|cells|polygons|points)[\"']?\s*:", re.MULTILINE)
    return "yaml" if yaml_keys.search(data[:100_000]) else "txt"


def _load_yaml(path: Path, data: bytes, dialect: Dialect, read: ReadBytes) -> LoadedMap:
    from mapcli.formats.yaml_map import read_yaml

    meta = read_yaml(data, str(path))
    if isinstance(meta, GridMap):
        return LoadedMap(meta, "YAML with cells", (path,))
    folder = Path() if str(path) == "-" else path.parent
    image_path = folder / Path(meta.image).expanduser()
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
    grid = _grid(image, meta.rule, dialect, meta.resolution, meta.origin, image_path)
    warnings = (*meta.warnings, *image.warnings, *_doubts(image, meta.rule, dialect))
    return LoadedMap(grid, f"YAML with {image.kind}", (path, image_path), meta.rule, warnings)


def _load_image(path: Path, data: bytes, dialect: Dialect, *, placed: bool) -> LoadedMap:
    from mapcli.formats.yaml_map import Document, read_image_meta

    image = _decode(data, path)
    if image.note:
        document = Document.parse(image.note.encode(), f"{path}: note inside the image")
        meta = read_image_meta(document, embedded=True)
        grid = _grid(image, meta.rule, dialect, meta.resolution, meta.origin, path)
        warnings = (*meta.warnings, *image.warnings, *_doubts(image, meta.rule, dialect))
        return LoadedMap(grid, image.kind, (path,), meta.rule, warnings)
    rule = GreyRule()
    grid = _grid(image, rule, dialect, 1.0, Pose2D(), path)
    warnings = (*image.warnings, *_doubts(image, rule, dialect))
    if not placed:
        beside = path.with_suffix(".yaml") if path.name not in ("-", "") else None
        hint = f"; give {beside.name} instead, which has them" if beside and beside.exists() else ""
        warnings += (
            "an image alone has no resolution and origin; 1 m per cell and 0, 0, 0 are used, "
            f"and grey is read as trinary{hint}",
        )
    return LoadedMap(grid, image.kind, (path,), rule, warnings)


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


def _grid(
    image: GreyImage,
    rule: GreyRule,
    dialect: Dialect,
    resolution: float,
    origin: Pose2D,
    path: Path,
) -> GridMap:
    try:
        return GridMap(rule.cells(image, dialect), resolution, origin)
    except DataError as error:
        raise FormatError(error.problem, file=path, expected=error.expected) from error


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
                f"{count:,} cells of grey {customary}, which map savers write for unknown, are "
                f"open under free_thresh {rule.free_thresh:g}; with free_thresh: 0.196 they would "
                "be unknown"
            )
    if rule.mode == "raw":
        count = int(np.count_nonzero((grey > 100) & (grey < 255)))
        if count:
            doubts.append(f"{count:,} cells hold neither 0 to 100 nor 255; they are unknown")
    return doubts


def dump_map(
    grid: GridMap, path: str | Path, options: SaveOptions | None = None
) -> dict[str, bytes]:
    """The files of a map: name -> content, an image before the YAML that names it.

    `x.yaml` gives the pair `x.pgm` (`x.png` in scale mode, which needs transparency) and `x.yaml`;
    `x.pgm` and `x.png` alone carry the metadata inside; `-` needs `options.format`, and its YAML
    is self-contained.

    Raises:
        DataError: a suffix that says no format.
    """
    options = options or SaveOptions()
    name = PurePath(path).name
    kind = options.format or SUFFIXES.get(PurePath(path).suffix.lower())
    if kind is None:
        raise DataError(f"{name!r} says no map format", expected="a name in .txt .yaml .pgm .png")
    if kind == "txt":
        free, occupied = options.thresholds
        characters = options.characters
        return {name: write_characters(grid, free, occupied) if characters else write_numbers(grid)}
    from mapcli.formats.yaml_map import image_meta_lines, write_cells_yaml

    if kind == "yaml" and (options.inline or name == "-"):
        return {name: write_cells_yaml(grid)}
    if kind == "yaml":
        image_kind: Format = "png" if options.mode == "scale" else "pgm"
        image = str(PurePath(name).with_suffix(f".{image_kind}"))
        text = image_meta_lines(grid, options.rule, image)
        return {image: _encode(grid, image_kind, options, note=""), name: text.encode()}
    return {name: _encode(grid, kind, options, note=image_meta_lines(grid, options.rule))}


def _encode(grid: GridMap, kind: Format, options: SaveOptions, note: str) -> bytes:
    alpha = None
    unknown = ~grid.known
    if options.mode == "trinary":
        grey = trinary_greys(grid.cells, *options.thresholds, negate=options.negate)
    elif options.mode == "raw":
        grey = percent_greys(grid.cells, options.rule, unknown=255)
    else:
        grey = percent_greys(grid.cells, options.rule, unknown=128)
        if kind == "png" and unknown.any():
            alpha = np.where(unknown, 0, 255).astype(np.uint8)
    image = GreyImage(grey[:, :, None], alpha, note)
    if kind == "png":
        from mapcli.formats.png import write_png

        return write_png(image)
    from mapcli.formats.pgm import write_pgm

    return write_pgm(image, plain=options.plain, bits=options.bits)
