"""Saving maps: `save_map` writes the files of a map, `dump_map` gives their bytes.

The formats are those that `load` lists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import DataError, OutputError
from mapcli.formats.maps.dialects import Dialect, greys_of_percents, percents_of_greys
from mapcli.formats.maps.map_image import GreyImage, GreyRule, Mode, trinary_greys
from mapcli.formats.maps.text import rounded, write_characters, write_numbers
from mapcli.formats.output import output_file, write_files
from mapcli.model.grid import PROBABILITIES, GridMap

Format = Literal["txt", "yaml", "pgm", "png"]
FORMATS: tuple[Format, ...] = get_args(Format)
SUFFIXES: dict[str, Format] = {
    ".txt": "txt", ".yaml": "yaml", ".yml": "yaml", ".pgm": "pgm", ".png": "png",
}  # fmt: skip


TRINARY_THRESHOLDS = (0.25, 0.65)
"""Cells up to the one are written as open, from the other as obstacle, as Nav2's map saver does."""

WHOLE_SCALE = (0.0, 1.0)
"""Ends of a scale that keeps every percent."""

ROS1_SCALE = (1 / 255, 254 / 255)
"""Ends of a scale in which ROS 1 reads every percent from some grey."""


@dataclass(frozen=True)
class SaveOptions:
    """How a map is written.

    Attributes:
        mode: what grey means in an image: three values, percents with transparency, or percents.
        free_thresh, occupied_thresh: None takes the mode's own. In trinary mode (and in the
            character form of text) cells up to the one are written as open and cells from the
            other as obstacle, by default 0.25 and 0.65 as in Nav2; the YAML always gets 0.196
            and 0.65, under which the pixels read back as they were meant. In scale mode they are
            the ends of the scale, by default 0 and 1, which keeps every percent; for ROS 1,
            which reads the ends themselves as 1 % and 99 %, one grey inside.
        negate: dark is open and light is obstacle.
        format: overrides the suffix.
        characters: text as `#`, `.`, `?` instead of numbers.
        digits: after the point, of text as numbers; None writes what reads back as the same.
        inline: YAML with the cells inside instead of an image beside it.
        plain: PGM as numbers (P2).
        bits: 8 or 16, of a PGM.
        dialect: who is to read an image.

    Raises:
        DataError: thresholds out of order or outside 0 to 1.
    """

    mode: Mode = "trinary"
    free_thresh: float | None = None
    occupied_thresh: float | None = None
    negate: bool = False
    format: Format | None = None
    characters: bool = False
    digits: int | None = None
    inline: bool = False
    plain: bool = False
    bits: Literal[8, 16] = 8
    dialect: Dialect = "nav2"

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
        ends = ROS1_SCALE if self.dialect == "ros1" else WHOLE_SCALE
        free, occupied = ends if self.mode == "scale" else TRINARY_THRESHOLDS
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

    def image_kind(self, kind: Format) -> Format:
        """Of the image that a map of the format `kind` is written in."""
        return kind if kind != "yaml" else "png" if self.mode == "scale" else "pgm"


Pieces = Iterable[bytes]
"""A file's content, made piece by piece and each time it is asked for."""


@dataclass(frozen=True)
class _Content:
    make: Callable[[], Iterator[bytes]]

    def __iter__(self) -> Iterator[bytes]:
        return self.make()


def save_map(
    grid: GridMap,
    path: str | Path,
    options: SaveOptions | None = None,
    *,
    no_clobber: bool = False,
) -> list[str]:
    """Write a map in the format of its suffix, and give the names of its files: `x.yaml` also
    makes `x.pgm`. `options` has the rest.

    All files appear complete, or none. `-` is standard output. `mapcli.load_map` is the inverse.

    Raises:
        DataError: a suffix that says no format.
        OutputError: a file cannot be written, or exists and `no_clobber` is set.
    """
    files = map_files(grid, path, options)
    if str(path) == "-":
        with output_file("-") as out:
            out.writelines(files["-"])
    else:
        write_files(Path(path).parent, files, no_clobber=no_clobber)
    return list(files)


def dump_map(
    grid: GridMap, path: str | PurePath, options: SaveOptions | None = None
) -> dict[str, bytes]:
    """The files of a map that is not large, see `map_files`: name -> content."""
    files = map_files(grid, path, options)
    return {name: b"".join(content) for name, content in files.items()}


def map_files(
    grid: GridMap, path: str | PurePath, options: SaveOptions | None = None
) -> dict[str, Pieces]:
    """The files of a map: name -> content, an image before the YAML that names it.

    `x.yaml` gives the pair `x.pgm` (`x.png` in scale mode, which needs transparency) and `x.yaml`;
    `x.pgm` and `x.png` alone carry the metadata inside; `-` needs `options.format`, and its YAML
    is self-contained.

    Raises:
        DataError: a suffix that says no format.
        OutputError: a name that the YAML cannot hold.
    """
    options = options or SaveOptions()
    name = PurePath(path).name
    kind = format_of(path, options)
    if kind == "txt":
        return {name: _Content(lambda: _text(grid, options))}
    from mapcli.formats.maps.yaml_map import cells_yaml, image_meta_lines

    if kind == "yaml" and (options.inline or name == "-"):
        return {name: _Content(lambda: cells_yaml(grid))}
    note = image_meta_lines(grid, options.rule)
    if kind != "yaml":
        return {name: _Content(lambda: _image(grid, kind, options, note))}
    image_kind = options.image_kind(kind)
    image = str(PurePath(name).with_suffix(f".{image_kind}"))
    image = f"{name}.{image_kind}" if image == name else image
    try:
        text = image_meta_lines(grid, options.rule, image).encode()
    except UnicodeEncodeError as error:
        raise OutputError(
            "its image would have a name that is no UTF-8, as YAML must be", file=str(path),
            expected="another name, or a map without an image beside it",
        ) from error  # fmt: skip
    pixels = _Content(lambda: _image(grid, image_kind, options, ""))
    return {image: pixels, name: _Content(lambda: iter([text]))}


def format_of(path: str | PurePath, options: SaveOptions) -> Format:
    """The format that a map is written in.

    Raises:
        DataError: a suffix that says none.
    """
    kind = options.format or SUFFIXES.get(PurePath(path).suffix.lower())
    if kind is None:
        name = PurePath(path).name
        raise DataError(f"{name!r} says no map format", expected="a name in .txt .yaml .pgm .png")
    return kind


def as_written(
    grid: GridMap, path: str | PurePath, options: SaveOptions
) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    """What readers of the dialect find for cells of a map that `map_files` writes: a function of
    probabilities, float32, NaN where unknown, both ways."""
    kind = format_of(path, options)
    free, occupied = options.thresholds
    if kind == "txt" and options.characters:
        return lambda cells: _three_states(cells, free, occupied)
    inline = kind == "yaml" and (options.inline or PurePath(path).name == "-")
    if kind == "txt" or inline:
        digits = options.digits if kind == "txt" else None
        return lambda cells: rounded(cells, digits)
    read = PROBABILITIES[percents_of_greys(options.rule, options.dialect)]
    clear = options.mode == "scale" and options.image_kind(kind) == "png"

    def found(cells: NDArray[np.float32]) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = read[_greys(cells, options)]
        return np.where(np.isnan(cells), cells, seen) if clear else seen

    return found


def _three_states(cells: NDArray[np.float32], free: float, occupied: float) -> NDArray[np.float32]:
    states = np.where(cells <= free, np.float32(0), np.float32(np.nan))
    return np.where(cells >= occupied, np.float32(1), states)


def _text(grid: GridMap, options: SaveOptions) -> Iterator[bytes]:
    if options.characters:
        return write_characters(grid, *options.thresholds)
    return write_numbers(grid, options.digits)


def _greys(cells: NDArray[np.float32], options: SaveOptions) -> NDArray[np.uint8]:
    """The grey of each cell's pixel, by mode."""
    if options.mode == "trinary":
        return trinary_greys(cells, *options.thresholds, negate=options.negate)
    unknown = 255 if options.mode == "raw" else 128
    table = np.append(greys_of_percents(options.rule, options.dialect), np.uint8(unknown))
    percents = np.rint(cells * np.float32(100))
    greys: NDArray[np.uint8] = table[np.where(np.isnan(percents), 101, percents).astype(np.uint8)]
    return greys


def _image(grid: GridMap, kind: Format, options: SaveOptions, note: str) -> Iterator[bytes]:
    def greys() -> Iterator[NDArray[np.uint8]]:
        for band in grid.bands():
            yield band.each(lambda cells: _greys(cells, options))

    if kind == "pgm":
        from mapcli.formats.maps.pgm import write_pgm

        plain, bits = options.plain, options.bits
        return write_pgm(grid.rows, grid.columns, greys(), note, plain=plain, bits=bits)
    from mapcli.formats.maps.png import write_png

    clear = options.mode == "scale" and grid.count(np.isnan) > 0

    def pixels() -> Iterator[GreyImage]:
        for band, grey in zip(grid.bands(), greys(), strict=True):
            alpha = np.where(band.known, np.uint8(255), np.uint8(0)) if clear else None
            yield GreyImage(grey[:, :, None], alpha)

    return write_png(grid.rows, grid.columns, pixels(), note, clear=clear)
