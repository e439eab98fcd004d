"""From the pixels of a map image to the cells of a map, with warnings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.maps.dialects import DIALECTS, Dialect, percents_of_greys, read_percents
from mapcli.formats.maps.map_image import UNKNOWN_GREY, GreyImage, GreyRule, MapImage
from mapcli.model.counting import counted
from mapcli.model.grid import histogram


@dataclass(frozen=True, eq=False)
class ImageCells:
    """The cells of an image.

    Attributes:
        percents: shape (rows, columns), uint8, see `GridMap.stored`.
        warnings: where the cells are probably not what the author of the map meant.
        remarks: where other programs would read the map otherwise.
    """

    percents: NDArray[np.uint8]
    warnings: tuple[str, ...]
    remarks: tuple[str, ...]


def cells_of_image(image: MapImage, rule: GreyRule, dialect: Dialect) -> ImageCells:
    """The cells as `dialect` reads them."""
    percents = np.empty((image.rows, image.columns), dtype=np.uint8)
    pixels = _Pixels()
    for rows, band in image.bands():
        percents[rows] = read_percents(band, rule, dialect)
        pixels.add(band)
    warnings = (*_freed_unknowns(pixels.greys, rule, dialect), *_odd_percents(pixels.greys, rule))
    remarks = (*pixels.remarks(rule), *_disagreements(pixels.greys, rule, dialect))
    return ImageCells(percents, warnings, remarks)


class _Pixels:
    """Counts what is in an image, band by band."""

    def __init__(self) -> None:
        self.greys = np.zeros(256, dtype=np.int64)
        self.coloured = self.clear = 0
        self.alpha = False

    def add(self, band: GreyImage) -> None:
        self.greys += histogram(band.luma)
        self.coloured += band.coloured
        if band.alpha is not None:
            self.alpha = True
            self.clear += int(np.count_nonzero(band.alpha < 255))

    def remarks(self, rule: GreyRule) -> list[str]:
        found = []
        if self.coloured:
            cells = counted(self.coloured, "cells")
            found.append(
                f"{cells} in colour, which Nav2 takes by brightness and older map servers by the "
                "mean of red, green and blue"
            )
        if self.alpha and rule.mode == "trinary":
            cells = counted(self.clear, "cells")
            found.append(
                f"has an alpha channel, {cells} not opaque; Nav2 reads those as unknown, older "
                "map servers average alpha into the grey of every cell"
            )
        elif self.clear:
            cells = counted(self.clear, "cells")
            found.append(f"{cells} not opaque" + _CLEAR_MEANS[rule.mode])
        return found


_CLEAR_MEANS = {
    "scale": ", read as unknown",
    "raw": ", read by their grey all the same",
}


def _freed_unknowns(greys: NDArray[np.int64], rule: GreyRule, dialect: Dialect) -> list[str]:
    """Warn of grey 205, written for unknown, that reads as free under a free_thresh of 0.25."""
    customary = 255 - UNKNOWN_GREY if rule.negate else UNKNOWN_GREY
    count = int(greys[customary])
    if rule.mode != "trinary" or not count or percents_of_greys(rule, dialect)[customary] != 0:
        return []
    return [
        f"{counted(count, 'cells')} of grey {customary}, which map savers write for "
        f"unknown, read as open under free_thresh {rule.free_thresh:g}; with "
        "free_thresh: 0.196 they stay unknown"
    ]


def _odd_percents(greys: NDArray[np.int64], rule: GreyRule) -> list[str]:
    count = int(greys[101:255].sum())
    if rule.mode != "raw" or not count:
        return []
    cells = counted(count, "cells")
    return [f"{cells} with neither 0 to 100 nor 255 in the image, read as unknown"]


def _disagreements(greys: NDArray[np.int64], rule: GreyRule, dialect: Dialect) -> list[str]:
    """Remarks on cells without colour and alpha that other dialects read as another percent."""
    mine = percents_of_greys(rule, dialect)
    found = []
    for other in DIALECTS:
        count = int(greys[percents_of_greys(rule, other) != mine].sum())
        if count:
            found.append(f"{counted(count, 'cells')} read otherwise by {other}, see --dialect")
    return found
