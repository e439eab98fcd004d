"""Large maps go through in bands of rows: with tiny bands everything comes out the same."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from mapcli.algorithms.maps.compare import compare
from mapcli.algorithms.maps.registration import score_motion
from mapcli.algorithms.maps.transform import bake_yaw, merge, move, resample, rotate
from mapcli.algorithms.maps.wall_direction import occupied_points
from mapcli.formats.maps.load import load_map
from mapcli.formats.maps.losses import losses
from mapcli.formats.maps.save import SaveOptions, dump_map
from mapcli.model.grid import GridMap, crop_to_known
from mapcli.model.pose import Pose2D
from mapcli.pictures.difference import difference_picture
from mapcli.pictures.map_window import map_pixels, window_of

RNG = np.random.default_rng(5)
PERCENTS = GridMap(RNG.choice([0, 30, 50, 100, 255], (23, 17)).astype(np.uint8), 0.1, Pose2D(1, 2))
REAL = GridMap(PERCENTS.cells * np.float32(0.77), 0.1, Pose2D(1, 2))
OTHER = move(PERCENTS, Pose2D(0.5, -0.3, 0.2))[0]


def written_and_read(grid: GridMap, name: str, **options: Any) -> tuple[Any, ...]:
    files = dump_map(grid, name, SaveOptions(**options))
    loaded = load_map(name, read=lambda path: files[path.name])
    found = loaded.grid.cells.tobytes(), loaded.warnings, loaded.remarks
    plain = {n: f for n, f in files.items() if not n.endswith(".png")}  # packed in other pieces
    return (plain, *found, losses(grid, name, SaveOptions(**options)))


def picture(grid: GridMap, scale: int | None) -> bytes:
    view = window_of(grid, scale=scale)
    return map_pixels(view).tobytes()


RUNS: dict[str, Callable[[GridMap], Any]] = {
    "txt": lambda grid: written_and_read(grid, "m.txt"),
    "characters": lambda grid: written_and_read(grid, "m.txt", characters=True),
    "yaml": lambda grid: written_and_read(grid, "m.yaml"),
    "inline": lambda grid: written_and_read(grid, "m.yaml", inline=True),
    "scale": lambda grid: written_and_read(grid, "m.yaml", mode="scale"),
    "raw": lambda grid: written_and_read(grid, "m.png", mode="raw"),
    "plain": lambda grid: written_and_read(grid, "m.pgm", plain=True, bits=16),
    "baked": lambda grid: bake_yaw(move(grid, Pose2D(0, 0, 0.4))[0]).cells.tobytes(),
    "turned": lambda grid: rotate(grid, math.pi / 2)[0].cells.tobytes(),
    "resampled": lambda grid: resample(grid, 0.23).cells.tobytes(),
    "merged": lambda grid: merge(grid, OTHER).cells.tobytes(),
    "walls": lambda grid: occupied_points(grid).tobytes(),
    "scored": lambda grid: score_motion(grid, OTHER, Pose2D()),
    "compared": lambda grid: compare(grid, OTHER).pairs.tobytes(),
    "drawn": lambda grid: picture(grid, 3),
    "counted": lambda grid: (grid.count(np.isnan), grid.count(lambda cells: cells > 0.3)),
}


@pytest.mark.parametrize("grid", [PERCENTS, REAL], ids=["percents", "probabilities"])
@pytest.mark.parametrize("name", RUNS)
def test_the_same_in_bands(name: str, grid: GridMap, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = RUNS[name](grid)
    fresh = GridMap(grid.stored, grid.resolution, grid.origin)
    monkeypatch.setattr("mapcli.model.grid.BAND_CELLS", 40)
    assert RUNS[name](fresh) == whole


def test_reduced_pictures_in_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapcli.pictures.map_window.LARGEST_SIDE", 7)
    monkeypatch.setattr("mapcli.pictures.difference._LARGEST_SIDE", 7)
    found = compare(PERCENTS, OTHER)
    plan, difference = picture(PERCENTS, None), difference_picture(found, ("a", "b"))
    monkeypatch.setattr("mapcli.model.grid.BAND_CELLS", 60)
    assert picture(PERCENTS, None) == plan
    again = compare(PERCENTS, OTHER)
    assert difference_picture(again, ("a", "b")) == difference
    assert again.changes == found.changes


def test_a_bad_percent_is_found_in_any_band(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapcli.model.grid.BAND_CELLS", 4)
    cells = np.zeros((9, 3), dtype=np.uint8)
    cells[7, 1] = 101
    with pytest.raises(Exception, match=r"a cell holds 1\.01"):
        GridMap(cells)
    cells[7, 1] = 100
    cropped = crop_to_known(GridMap(np.where(cells == 0, 255, cells).astype(np.uint8), 0.5))
    assert (cropped.rows, cropped.columns, cropped.origin) == (1, 1, Pose2D(0.5, 0.5))
