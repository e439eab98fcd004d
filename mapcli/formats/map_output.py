"""Maps out: `dump_map` turns a map into the bytes of its files; see `maps.py` for the formats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import Literal, get_args

import numpy as np

from mapcli.errors import DataError
from mapcli.formats.grey import GreyImage, GreyRule, Mode, percent_greys, trinary_greys
from mapcli.formats.text import write_characters, write_numbers
from mapcli.model.grid import GridMap

Format = Literal["txt", "yaml", "pgm", "png"]
FORMATS: tuple[Format, ...] = get_args(Format)
SUFFIXES: dict[str, Format] = {
    ".txt": "txt", ".yaml": "yaml", ".yml": "yaml", ".pgm": "pgm", ".png": "png",
}  # fmt: skip


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


def dump_map(
    grid: GridMap, path: str | PurePath, options: SaveOptions | None = None
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
        image = f"{name}.{image_kind}" if image == name else image
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
