"""What two maps of the same place have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mapcli.model.changed_cells import ChangedCells
from mapcli.model.grid import GridMap
from mapcli.model.limit import limit_fields
from mapcli.model.pose import Pose2D

FREE, OCCUPIED, UNKNOWN = range(3)
STATES = ("free", "occupied", "unknown")


ChangeKind = Literal["appeared", "vanished"]


@dataclass(frozen=True, slots=True)
class Change:
    """A place where something has changed.

    Attributes:
        kind: it is in B and not in A, or the other way round.
        x, y: metres, the middle of its box; width, height: of the box, along the map's axes.
        area_m2: square metres of its cells.
    """

    kind: ChangeKind
    x: float
    y: float
    width: float
    height: float
    area_m2: float

    def document(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "x": round(self.x, 6) + 0.0,
            "y": round(self.y, 6) + 0.0,
            "width_m": round(self.width, 6),
            "height_m": round(self.height, 6),
            "area_m2": round(self.area_m2, 6),
        }


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two maps compared, cell by cell on the cells of the first, and by the distances of walls.

    Attributes:
        cells: cells by state in A and state in B, shape (3, 3); both unknown is not counted.
        pairs: `3 * state in A + state in B` of each cell, shape (rows, columns), uint8.
        cell_area: square metres of a cell.
        walls_a, walls_b: metres from each wall cell of the one, where the other knows something,
            to the nearest of the other; empty when either has none.
        alignment: the motion of B's world that was found; None when none was asked for.
        score: of that alignment.
        changed: cells in which something vanished or appeared, shape (rows, columns).
        changes: places where it did, the largest first.
        place: a map of these cells of which nothing is known.
    """

    cells: NDArray[np.int64]
    pairs: NDArray[np.uint8]
    cell_area: float
    walls_a: NDArray[np.float64]
    walls_b: NDArray[np.float64]
    alignment: Pose2D | None = None
    score: float | None = None
    changed: ChangedCells | None = None
    changes: tuple[Change, ...] = ()
    place: GridMap | None = None

    def changed_m2(self, kind: ChangeKind) -> float:
        """Square metres of the places where something appeared, or vanished."""
        return sum(one.area_m2 for one in self.changes if one.kind == kind)

    @property
    def agreement(self) -> float:
        """Of the cells that both know, the share in which they agree."""
        both = self.cells[:2, :2]
        return _share(int(np.trace(both)), int(both.sum()))

    @property
    def agreement_all(self) -> float:
        """Of the cells that either knows, the share in which they agree; unknown disagrees."""
        return _share(int(np.trace(self.cells[:2, :2])), int(self.cells.sum()))

    def iou(self, state: int) -> float:
        """Cells that are in `state` in both, by those that are in either."""
        both = int(self.cells[state, state])
        either = int(self.cells[state].sum() + self.cells[:, state].sum()) - both
        return _share(both, either)

    def document(self) -> dict[str, Any]:
        """The facts, ready for JSON. Wall distances are of both directions together."""
        walls = np.concatenate([self.walls_a, self.walls_b])
        return {
            "agreement": round(self.agreement, 6),
            "agreement_all": round(self.agreement_all, 6),
            "iou_occupied": round(self.iou(OCCUPIED), 6),
            "iou_free": round(self.iou(FREE), 6),
            "wall_mean_m": _metres(walls, np.mean),
            "wall_p95_m": _metres(walls, _p95),
            "wall_max_m": _metres(walls, np.max),
            "wall_mean_a_to_b_m": _metres(self.walls_a, np.mean),
            "wall_mean_b_to_a_m": _metres(self.walls_b, np.mean),
            "common_m2": round(int(self.cells[:2, :2].sum()) * self.cell_area, 3),
            "changed_m2": round(sum(one.area_m2 for one in self.changes), 6),
            "appeared_m2": round(self.changed_m2("appeared"), 6),
            "vanished_m2": round(self.changed_m2("vanished"), 6),
            "places_changed": len(self.changes),
            "score": None if self.score is None else round(self.score, 4),
        }

    def limits(self) -> dict[str, float]:
        """What limits may be set on; what there is no number for is infinitely bad."""
        missing = {name: 0.0 if name == "score" else np.inf for name in LIMIT_FIELDS}
        found = {k: v for k, v in self.document().items() if v is not None}
        return missing | {name: float(found[name]) for name in LIMIT_FIELDS if name in found}


def _share(part: int, whole: int) -> float:
    """A share; of nothing it is 0, for nothing was found in common."""
    return part / whole if whole else 0.0


def _p95(distances: NDArray[np.float64]) -> float:
    return float(np.percentile(distances, 95))


def _metres(distances: NDArray[np.float64], statistic: Any) -> float | None:
    return round(float(statistic(distances)), 6) if len(distances) else None


_NOTHING = Comparison(
    np.zeros((3, 3), np.int64), np.zeros((0, 0), np.uint8), 1.0, np.empty(0), np.empty(0)
)

LIMIT_FIELDS = limit_fields(_NOTHING.document())
"""The numbers that limits may be set on."""
