"""A literal map of ten by ten cells, every dialect, both ways, cell by cell."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from mapcli.formats.maps.dialects import DIALECTS, Dialect
from mapcli.formats.maps.load import load_map
from mapcli.formats.maps.map_image import MODES, Mode
from mapcli.formats.maps.save import SaveOptions, as_written, dump_map
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

ROOM = """
# # # # # # # # # #
# . . . . ? ? ? ? #
# . . . . ? ? ? ? #
# . . # . ? ? ? ? #
# . . . . ? ? # # #
# . . . . . . . . #
# . . . . . . . . .
# ? ? ? . . . . . .
# ? # ? . . . . . #
# # # # # # # # # #
"""

GREYS = """
  0   1  10  50  88  89  90  91 101 102
103 110 120 127 128 129 140 150 152 153
154 160 170 178 179 180 190 191 192 193
200 201 202 203 204 205 206 207 208 209
210 220 230 240 250 251 252 253 254 255
  0   0   0   0   0 205 205 205 254 254
  0 254 254 254   0 205 205 205 254 254
  0 254 254 254   0 254 254   0   0   0
  0 254 254 254   0 254 254   0 205   0
  0   0   0   0   0 254 254   0   0   0
"""

CODES = {"#": 100, ".": 0, "?": -1}
PIXELS = {"#": 0, ".": 254, "?": 205}


def rows(text: str) -> list[list[str]]:
    return [line.split() for line in text.strip().splitlines()]


def grid_of(text: str) -> GridMap:
    percents = np.array([[CODES[cell] for cell in row] for row in rows(text)], dtype=np.int16)
    cells = np.where(percents < 0, np.nan, percents / 100).astype(np.float32)
    return GridMap(cells, 0.05, Pose2D(-1.5, 2.25, 0.0))


def percents(grid: GridMap) -> list[list[int]]:
    """As an OccupancyGrid has them, -1 unknown, the top row first."""
    return [[-1 if cell != cell else round(float(cell) * 100) for cell in r] for r in grid.cells]


def load(files: dict[str, bytes], name: str, dialect: Dialect) -> GridMap:
    return load_map(name, dialect=dialect, read=lambda path: files[path.name]).grid


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("negate", [False, True])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["m.yaml", "m.pgm", "m.png"])
def test_the_room_is_written_for_every_dialect(
    dialect: Dialect, negate: bool, mode: Mode, name: str
) -> None:
    if mode == "scale" and name == "m.pgm":
        pytest.skip("a PGM has no transparency for unknown cells")
    negate = negate and mode != "raw"  # of which Nav2 and ROS 1 think differently
    files = dump_map(grid_of(ROOM), name, SaveOptions(mode, negate=negate, dialect=dialect))
    found = load(files, name, dialect)
    assert percents(found) == [[CODES[cell] for cell in row] for row in rows(ROOM)]
    assert (found.resolution, found.origin) == (0.05, Pose2D(-1.5, 2.25, 0.0))


@pytest.mark.parametrize("negate", [False, True])
@pytest.mark.parametrize("name", ["m.yaml", "m.pgm", "m.png"])
def test_pillow_sees_the_customary_pixels(name: str, negate: bool) -> None:
    files = dump_map(grid_of(ROOM), name, SaveOptions(negate=negate))
    image = Image.open(io.BytesIO(next(iter(files.values()))))
    assert (image.mode, image.size) == ("L", (10, 10))
    expected = np.array([[PIXELS[cell] for cell in row] for row in rows(ROOM)])
    assert np.array_equal(np.asarray(image), 255 - expected if negate else expected)


def read_greys(dialect: Dialect, **keys: Any) -> list[list[int]]:
    """GREYS as an image, read with some keys of its YAML."""
    pixels = bytes(int(grey) for row in rows(GREYS) for grey in row)
    meta = {"image": "m.pgm", "resolution": 0.05, "origin": [0, 0, 0], "negate": 0,
            "occupied_thresh": 0.65, "free_thresh": 0.196, **keys}  # fmt: skip
    text = "".join(f"{key}: {value}\n" for key, value in meta.items())
    files = {"m.pgm": b"P5 10 10 255\n" + pixels, "m.yaml": text.encode()}
    return percents(load(files, "m.yaml", dialect))


CUSTOMARY_ROWS = [
    [100, 100, 100, 100, 100, -1, -1, -1, 0, 0],
    [100, 0, 0, 0, 100, -1, -1, -1, 0, 0],
    [100, 0, 0, 0, 100, 0, 0, 100, 100, 100],
    [100, 0, 0, 0, 100, 0, 0, 100, -1, 100],
    [100, 100, 100, 100, 100, 0, 0, 100, 100, 100],
]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_greys_are_read_alike_under_the_customary_thresholds(dialect: Dialect) -> None:
    assert read_greys(dialect) == [
        [100, 100, 100, 100, 100, 100, -1, -1, -1, -1],
        [-1] * 10,
        [-1] * 10,
        [-1, -1, -1, -1, -1, -1, 0, 0, 0, 0],
        [0] * 10,
        *CUSTOMARY_ROWS,
    ]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_trap_of_the_old_default_threshold(dialect: Dialect) -> None:
    found = read_greys(dialect, free_thresh=0.25)
    assert found[2] == [-1] * 8 + [0, 0]  # from 192 on
    assert found[3] == [0] * 10
    assert found[5][5:] == [0] * 5


def test_ties_tell_the_dialects_apart() -> None:
    """102 is occ 0.6 and 204 is occ 0.2. In double, 1 - 204/255 is a little less than 0.2 and
    51/255 is 0.2, so that Nav2 of 2024 and ROS 1 part where a cell must be below."""
    found = {d: read_greys(d, occupied_thresh=0.6, free_thresh=0.2) for d in DIALECTS}
    assert {d: (cells[0][9], cells[3][4]) for d, cells in found.items()} == {
        "nav2": (100, 0),
        "nav2-2024": (-1, 0),
        "ros1": (-1, -1),
    }
    assert all(cells[0][8] == 100 and cells[1][0] == -1 for cells in found.values())
    assert all(cells[3][3] == -1 and cells[3][5] == 0 for cells in found.values())


def test_scale_row_by_row() -> None:
    """The second row by hand: occ of 103 is 1 - 103/255 = 0.5961, (0.5961 - 0.196) / 0.454 is
    0.8812, 1 + 98 * 0.8812 = 87.4; for 120 they are 73.4 and 72.97."""
    expected = {
        "nav2": [88, 82, 73, 67, 67, 66, 56, 48, 46, 45],
        "nav2-2024": [88, 82, 73, 67, 67, 66, 56, 48, 46, 45],
        "ros1": [87, 81, 72, 67, 66, 65, 56, 47, 45, 45],
    }
    for dialect in DIALECTS:
        found = read_greys(dialect, mode="scale")
        assert found[0][:6] == [100] * 6
        assert found[1] == expected[dialect]
        assert found[4] == [0] * 10
    assert read_greys("ros1", mode="scale")[3][5] == 1
    assert read_greys("nav2", mode="scale")[3][5] == 0


@pytest.mark.parametrize("dialect", DIALECTS)
def test_raw_row_by_row(dialect: Dialect) -> None:
    found = read_greys(dialect, mode="raw", occupied_thresh=0.1, free_thresh=0.05)
    assert found[0] == [0, 1, 10, 50, 88, 89, 90, 91, -1, -1]
    assert found[1:5] == [[-1] * 10] * 4
    assert found[8] == [0, -1, -1, -1, 0, -1, -1, 0, -1, 0]


CELLS = hnp.arrays(
    np.float32, (3, 7), elements=st.floats(0, 1, width=32) | st.just(float("nan"))
)  # fmt: skip


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ["m.yaml", "m.pgm", "m.png", "m.txt"])
@given(cells=CELLS, negate=st.booleans(), free=st.floats(0.05, 0.45), inline=st.booleans())
@settings(max_examples=15)
def test_what_is_said_to_be_found_is_found(
    dialect: Dialect, mode: Mode, name: str, cells: Any, negate: bool, free: float, inline: bool
) -> None:
    grid = GridMap(cells)
    options = SaveOptions(
        mode, free, negate=negate and mode != "raw", dialect=dialect,
        inline=inline and name == "m.yaml", characters=inline and name == "m.txt",
    )  # fmt: skip
    promised = as_written(grid, name, options)(cells)
    found = load(dump_map(grid, name, options), name, dialect).cells
    assert np.array_equal(found, promised, equal_nan=True)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_scale_keeps_every_percent_in_every_dialect(dialect: Dialect) -> None:
    ramp = np.append(np.arange(101, dtype=np.float32) / np.float32(100), np.float32(np.nan))
    files = dump_map(GridMap(ramp[None]), "m.yaml", SaveOptions("scale", dialect=dialect))
    assert np.array_equal(load(files, "m.yaml", dialect).cells[0], ramp, equal_nan=True)
