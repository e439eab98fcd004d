"""The operations of `mapcli transform`, one after the other on a map."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mapcli import load_map
from mapcli.commands._map_operation_types import SEARCH, CellsToSet
from mapcli.formats.input import read_file, sha256_of
from mapcli.formats.maps.dialects import Dialect
from mapcli.formats.maps.load import LoadedMap
from mapcli.model.counting import counted
from mapcli.model.grid import GridMap, crop_to_known
from mapcli.model.isometry import Isometry
from mapcli.model.pose import Pose2D

if TYPE_CHECKING:
    from mapcli.algorithms.maps.transform import MovedMap


@dataclass(frozen=True, eq=False)
class Result:
    """A map after some operations.

    Attributes:
        grid: the map.
        files: what was read, the named file first.
        digests: file name -> SHA-256.
        motion: how the world has moved.
        steps: what was done, for JSON.
        notes: the same for people, where there is something to say.
        warnings: what was odd about the files.
    """

    grid: GridMap
    files: tuple[Path, ...]
    digests: dict[str, str] = field(default_factory=dict)
    motion: Isometry = field(default_factory=Isometry)
    steps: tuple[dict[str, Any], ...] = ()
    notes: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()

    def moved(self, made: MovedMap) -> Result:
        grid, motion = made
        return replace(self, grid=grid, motion=motion.after(self.motion))

    def noted(self, name: str, text: str, **facts: Any) -> Result:
        step = {"operation": name, **facts}
        return replace(self, steps=(*self.steps, step), notes=(*self.notes, (name, text)))

    def content(self) -> dict[str, Any]:
        """The facts, ready for JSON."""
        pose, origin = self.motion.pose, self.grid.origin
        return {
            "world": {**_rounded(pose), "mirrored": self.motion.mirrored},
            "rows": self.grid.rows,
            "columns": self.grid.columns,
            "resolution": self.grid.resolution,
            "origin": {"x": origin.x, "y": origin.y, "theta": origin.theta},
            "found": list(self.steps),
        }

    def lines(self) -> list[tuple[str, str]]:
        """The facts for a person."""
        grid, origin = self.grid, self.grid.origin
        size = f"{grid.rows:,} rows, {grid.columns:,} columns of {grid.resolution:g} m"
        where = f"origin x {origin.x:g} m, y {origin.y:g} m, yaw {math.degrees(origin.theta):g} deg"
        stays = self.motion == Isometry()
        mirrored = "mirrored (y turned around), then " if self.motion.mirrored else ""
        world = "stays where it was" if stays else f"{mirrored}{motion_words(self.motion.pose)}"
        return [*self.notes, ("map", f"{size}; {where}"), ("world", world)]


def apply(
    loaded: LoadedMap, digests: dict[str, str], operations: Sequence[tuple[str, Any]],
    dialect: Dialect,
) -> Result:  # fmt: skip
    """Carry the operations out, each a name of OPERATIONS and its value."""
    warnings = tuple(f"{loaded.files[0]}: {text}" for text in loaded.warnings)
    result = Result(loaded.grid, loaded.files, digests, warnings=warnings)
    for name, value in operations:
        result = OPERATIONS[name](result, value, dialect)
    return result


def _crop(result: Result, box: Any, dialect: Dialect) -> Result:
    from mapcli import crop_to_box

    grid = crop_to_known(result.grid) if box == "known" else crop_to_box(result.grid, *box)
    return replace(result, grid=grid)


def _bake_yaw(result: Result, value: bool, dialect: Dialect) -> Result:
    from mapcli.algorithms.maps.transform import bake_yaw

    return replace(result, grid=bake_yaw(result.grid))


def _resample(result: Result, resolution: float, dialect: Dialect) -> Result:
    from mapcli import resample

    return replace(result, grid=resample(result.grid, resolution))


def _rotate(result: Result, degrees: float, dialect: Dialect) -> Result:
    from mapcli import rotate

    return result.moved(rotate(result.grid, math.radians(degrees)))


def _flip(result: Result, side: Any, dialect: Dialect) -> Result:
    from mapcli import flip

    return result.moved(flip(result.grid, side))


def _shift(result: Result, by: tuple[float, float], dialect: Dialect) -> Result:
    from mapcli.algorithms.maps.transform import shift

    return result.moved(shift(result.grid, *by))


def _origin(result: Result, origin: Pose2D, dialect: Dialect) -> Result:
    from mapcli.algorithms.maps.transform import set_origin

    return result.moved(set_origin(result.grid, origin))


def _align(result: Result, value: bool, dialect: Dialect) -> Result:
    from mapcli import align_walls
    from mapcli.algorithms.maps.transform import MovedMap

    grid, motion, angle = align_walls(result.grid)
    degrees = round(math.degrees(angle), 3) + 0.0
    text = f"walls at {degrees:g} deg, now at 0"
    return result.moved(MovedMap(grid, motion)).noted("align", text, walls_deg=degrees)


def _merge(result: Result, value: tuple[str, Pose2D | str | None], dialect: Dialect) -> Result:
    from mapcli import merge_maps

    file, how = value
    digests = dict(result.digests)
    loaded = load_map(file, dialect=dialect, read=hashing(digests))
    motion = None if how == SEARCH else how if isinstance(how, Pose2D) else Pose2D()
    grid, found = merge_maps(result.grid, loaded.grid, motion)
    overlap = found.overlap_m2
    fit = f"score {found.score:.2f} over {overlap:.1f} square metres"
    text = f"{file}: {motion_words(found.motion)}; {fit}"
    facts = {"motion": _rounded(found.motion), "score": round(found.score, 4)}
    warnings = tuple(f"{file}: {warning}" for warning in loaded.warnings)
    if how == SEARCH and not found.is_reliable:
        warnings += (f"{file}: fits with a score of only {found.score:.2f}; look at the result",)
    result = replace(
        result,
        grid=grid,
        files=(*result.files, *loaded.files),
        digests=digests,
        warnings=(*result.warnings, *warnings),
    )
    name = Path(file).name
    return result.noted("merge", text, file=name, **facts, overlap_m2=round(overlap, 3))


def _set(result: Result, value: CellsToSet, dialect: Dialect) -> Result:
    from mapcli.algorithms.maps.set_cells import set_cells

    grid, changed = set_cells(result.grid, *value.corners, value.probability)
    made = replace(result, grid=grid)
    return made.noted("set", f"{value.text}: {counted(changed, 'cells')} changed", cells=changed)


OPERATIONS: dict[str, Callable[[Result, Any, Dialect], Result]] = {
    "crop": _crop,
    "bake_yaw": _bake_yaw,
    "resample": _resample,
    "rotate": _rotate,
    "flip": _flip,
    "shift": _shift,
    "origin": _origin,
    "align": _align,
    "set": _set,
    "merge": _merge,
}
"""Option (with `_` for `-`) -> what it does."""


def hashing(digests: dict[str, str]) -> Callable[[Path], bytes]:
    """A reader of files that notes their SHA-256, by name; the second of a name by folder too."""

    def read(path: Path) -> bytes:
        data = read_file(path)
        name = (
            path.name if path.name not in digests else f"{path.absolute().parent.name}/{path.name}"
        )
        digests[name] = sha256_of(data)
        return data

    return read


def parameters(operations: Sequence[tuple[str, Any]], dialect: Dialect) -> dict[str, Any]:
    """The operations, ready for JSON."""
    return {"dialect": dialect, "operations": [_operation(*item) for item in operations]}


def _operation(name: str, value: Any) -> dict[str, Any]:
    if name == "merge":
        file, how = value
        return {name: Path(file).name, "motion": _rounded(how) if isinstance(how, Pose2D) else how}
    if isinstance(value, CellsToSet):
        return {name: value.text}
    return {name.replace("_", "-"): _rounded(value) if isinstance(value, Pose2D) else value}


def _rounded(pose: Pose2D) -> dict[str, float]:
    # + 0.0: no -0.0, whose sign is noise.
    return {name: round(float(getattr(pose, name)), 9) + 0.0 for name in ("x", "y", "theta")}


def motion_words(pose: Pose2D) -> str:
    """A motion for people: millimetres, hundredths of a degree."""
    x, y = (round(float(v), 3) + 0.0 for v in (pose.x, pose.y))
    degrees = round(math.degrees(pose.theta), 2) + 0.0
    return f"turned by {degrees:g} deg, moved by x {x:g} m, y {y:g} m"
