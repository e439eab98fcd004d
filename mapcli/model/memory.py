"""What a map takes to store, discrete and continuous, as Sect. 9.1 compares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mapcli.model.counting import counted
from mapcli.model.grid import OCCUPIED_THRESHOLD, GridMap
from mapcli.model.world import World

PAIR_BYTES = 8
"""Two coordinates of four bytes each, as whole numbers of a cell or as those of a vertex."""


@dataclass(frozen=True)
class Memory:
    """The same objects stored in two ways.

    Attributes:
        cells, occupied: of the grid map, how many there are and how many an object covers.
        polygons, vertices: of the continuous map.
    """

    cells: int
    occupied: int
    polygons: int
    vertices: int

    @classmethod
    def of(cls, world: World, grid: GridMap, threshold: float = OCCUPIED_THRESHOLD) -> Memory:
        """Of a continuous map and a grid map of the same objects.

        Args:
            threshold: cells from this probability on are covered by an object.
        """
        occupied = int((grid.cells >= threshold).sum())
        vertices = sum(len(polygon) for polygon in world.polygons)
        return cls(grid.cells.size, occupied, len(world.polygons), vertices)

    def document(self) -> dict[str, Any]:
        """The numbers, ready for JSON."""
        return {
            "discrete": {
                "cells": self.cells,
                "occupied": self.occupied,
                "list_bytes": self.occupied * PAIR_BYTES,
                "bitmap_bytes": self.bitmap_bytes,
            },
            "continuous": {
                "polygons": self.polygons,
                "vertices": self.vertices,
                "list_bytes": self.vertices * PAIR_BYTES,
            },
        }

    @property
    def bitmap_bytes(self) -> int:
        """A bit for each cell."""
        return -(-self.cells // 8)

    def rows(self) -> list[tuple[str, str]]:
        """The comparison for a person: label, text."""
        discrete, bits = self.occupied * PAIR_BYTES, self.bitmap_bytes
        continuous = self.vertices * PAIR_BYTES
        return [
            (
                "discrete",
                f"{counted(self.occupied, 'cells')} of {self.cells:,} covered: {discrete:,} bytes "
                f"as a list of pairs, {bits:,} as one bit a cell",
            ),
            (
                "continuous",
                f"{counted(self.polygons, 'polygons')}, {counted(self.vertices, 'vertices')}: "
                f"{continuous:,} bytes as a list of pairs",
            ),
        ]
