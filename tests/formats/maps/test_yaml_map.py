"""YAML maps: the map_server pair, the self-contained map, and what can be wrong with them."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import pytest

from mapcli.errors import FormatError
from mapcli.formats.maps.load import load_map
from mapcli.formats.maps.map_image import GreyRule
from mapcli.formats.maps.yaml_map import image_meta_lines, read_yaml
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Q = np.float32(np.nan)

PAIR = {
    "image": "m.pgm",
    "mode": "trinary",
    "resolution": "0.05",
    "origin": "[-7.14, -7.83, 0.5]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def write_pair(folder: Path, name: str = "m.yaml", **changes: str | None) -> Path:
    """A pair of a 3x1 image and its YAML, with some keys changed or left out."""
    (folder / "m.pgm").write_bytes(b"P5 3 1 255\n\x00\xcd\xfe")
    keys = PAIR | changes
    lines = [f"{key}: {value}" for key, value in keys.items() if value is not None]
    (folder / name).write_text("\n".join(lines) + "\n")
    return folder / name


def cells(path: Path) -> list[float | None]:
    row = load_map(path).grid.cells[0]
    return [None if math.isnan(cell) else float(cell) for cell in row]


def test_pair(tmp_path: Path) -> None:
    loaded = load_map(write_pair(tmp_path))
    assert np.array_equal(loaded.grid.cells, [[1, Q, 0]], equal_nan=True)
    assert loaded.grid.resolution == 0.05
    assert loaded.grid.origin == Pose2D(-7.14, -7.83, 0.5)
    assert loaded.rule == GreyRule()
    assert loaded.format == "YAML with PGM P5, 8 bit"
    assert loaded.files == (tmp_path / "m.yaml", tmp_path / "m.pgm")
    assert loaded.warnings == ()


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("mode", "TriNary", [1, None, 0]),
        ("mode", None, [1, None, 0]),
        ("mode", "Scale", [1, 0, 0]),
        ("mode", "raw", [0, None, None]),
        ("negate", "1", [0, 1, 1]),
        ("negate", "true", [0, 1, 1]),
        ("negate", "no", [1, None, 0]),
        ("resolution", "5e-2", [1, None, 0]),
        ("free_thresh", "0.25", [1, 0, 0]),
        ("frame_id", "{map: [of, the, world]}", [1, None, 0]),
    ],
)
def test_keys(tmp_path: Path, key: str, value: str, expected: list[float | None]) -> None:
    assert cells(write_pair(tmp_path, **{key: value})) == expected


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"image": None}, "line 1: image: key is missing"),
        ({"image": ""}, "line 1: image: empty"),
        ({"image": "[a]"}, "line 1: image: not a text"),
        (
            {"image": "no.pgm"},
            "line 1: image 'no.pgm': no such file; expected a PGM or",
        ),
        ({"image": "."}, "line 1: image '.': is a directory"),
        ({"resolution": None}, "line 1: resolution: key is missing; expected metres per cell"),
        ({"resolution": "fine"}, "line 3: resolution: 'fine' is not a number"),
        ({"resolution": "0"}, "line 3: resolution: is 0; expected metres per cell, more than 0"),
        ({"resolution": "-0.05"}, "line 3: resolution: is -0.05"),
        ({"resolution": ".inf"}, "line 3: resolution: '.inf' is not a number"),
        ({"origin": None}, "line 1: origin: key is missing"),
        ({"origin": "[1, 2]"}, "line 4: origin: a list of 2; expected three numbers, [x, y, yaw]"),
        ({"origin": "7"}, "line 4: origin: '7'"),
        ({"origin": "[nan, 2, 0]"}, "line 4: origin: is not finite"),
        ({"origin": "[1, 2, inf]"}, "line 4: origin: is not finite"),
        ({"negate": None}, "line 1: negate: key is missing"),
        ({"negate": "maybe"}, "line 5: negate: 'maybe'; expected 0 or 1"),
        ({"mode": "sclae"}, "line 2: mode: 'sclae' is unknown; expected trinary, scale or raw"),
        ({"occupied_thresh": None}, "line 1: occupied_thresh: key is missing"),
        ({"free_thresh": "nan"}, "line 7: free_thresh: 'nan' is not a number"),
        ({"free_thresh": "0.196\nmode: raw"}, "line 8: mode: given twice; expected each key once"),
        ({"free_thresh": "0.196\n  bad: [1"}, "line 8: broken YAML: mapping values are not"),
        ({"free_thresh": "[0.196"}, "line 8: broken YAML"),
    ],
)
def test_malformed_pair(tmp_path: Path, changes: dict[str, str | None], message: str) -> None:
    path = write_pair(tmp_path, **changes)
    with pytest.raises(FormatError) as raised:
        load_map(path)
    assert str(raised.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; expected a map"),
        (" \n", "is empty; expected a map"),
        ("just words\n", "not a YAML mapping"),
        ("- a\n- b\n", "not a YAML mapping"),
        ("image: [" + "[" * 60, "lists nested deeper than 50"),
        ("image: \x01\n", "broken YAML: "),
        ("a: &x [1]\nb: *y\n", "line 2: broken YAML: found undefined alias"),
        (
            "polygons: [[[0, 0], [1, 0], [0, 1]]]\n",
            "is a continuous map; make a grid map of it with mapcli rasterize",
        ),
        ("cells: {}\n", "line 1: cells: a mapping; expected a list of rows"),
        ("cells: []\n", "no rows of cells"),
        ("cells:\n  - 0 1\n  - 0\n", "line 3: a row of 1 cells; expected 2"),
        ("cells:\n  - [0, x]\n", "line 2, column 1: cell 'x'"),
        ("cells:\n  - [0, [1]]\n", "line 2: not a row"),
        ("cells: ['0 1']\nresolution: 0\n", "line 2: resolution: is 0"),
    ],
)
def test_malformed_document(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(text)
    with pytest.raises(FormatError) as raised:
        load_map(path)
    assert str(raised.value).startswith(f"{path}: {message}")


def test_a_file_of_brackets_is_refused(tmp_path: Path) -> None:
    """PyYAML has a limit of its own from 6.0.4 on, which may be met before ours."""
    path = tmp_path / "m.yaml"
    path.write_text("image: " + "[" * 100_000)
    with pytest.raises(FormatError, match=r"nested deeper than 50|maximum nesting depth"):
        load_map(path)


def test_yaw_that_is_not_a_number_is_zero(tmp_path: Path) -> None:
    loaded = load_map(write_pair(tmp_path, origin="[1, 2, -nan]"))
    assert loaded.grid.origin == Pose2D(1, 2, 0)
    assert loaded.warnings == ("the yaw of origin is not a number (nan); 0 is used",)


def test_unknown_grey_that_becomes_open_is_counted(tmp_path: Path) -> None:
    (warning,) = load_map(write_pair(tmp_path, free_thresh="0.25")).warnings
    assert warning.startswith("1 cell of grey 205")
    assert "free_thresh: 0.196" in warning


def test_no_such_warning_where_205_is_unknown_or_absent(tmp_path: Path) -> None:
    path = write_pair(tmp_path, free_thresh="0.25")
    (tmp_path / "m.pgm").write_bytes(b"P5 3 1 255\n\x00\xfe\xfe")
    assert load_map(path).warnings == ()
    assert load_map(write_pair(tmp_path)).warnings == ()


def test_threshold_in_percent_is_warned_of(tmp_path: Path) -> None:
    loaded = load_map(write_pair(tmp_path, occupied_thresh="65"))
    assert loaded.warnings == ("occupied_thresh is 65, outside 0 to 1",)
    assert 1 not in loaded.grid.cells


def test_raw_pixels_without_meaning_are_counted(tmp_path: Path) -> None:
    assert load_map(write_pair(tmp_path, mode="raw")).warnings == (
        "2 cells with neither 0 to 100 nor 255 in the image, read as unknown",
    )


def test_image_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home"
    (home / "maps").mkdir(parents=True)
    write_pair(home / "maps")
    expected = [1, None, 0]
    assert cells(write_pair(home, image="maps/m.pgm")) == expected
    assert cells(write_pair(home, image=str(home / "maps/m.pgm"))) == expected
    assert cells(write_pair(home, image='"maps/m.pgm"')) == expected
    monkeypatch.setenv("HOME", str(home))
    assert cells(write_pair(tmp_path, image="~/maps/m.pgm")) == expected
    assert cells(Path("~/maps/m.yaml")) == expected
    monkeypatch.chdir(home / "maps")
    assert cells(Path("m.yaml")) == expected


def test_image_may_have_any_suffix(tmp_path: Path) -> None:
    path = write_pair(tmp_path, image="m.png")
    (tmp_path / "m.png").write_bytes((tmp_path / "m.pgm").read_bytes())
    assert cells(path) == [1, None, 0]


@pytest.mark.parametrize(
    "rows",
    [
        'cells: ["? 0.1 1", "0 0 1"]',
        "cells:\n- '? 0.1 1'\n- 0 0 1",
        'cells:\n- ["?", 0.1, 1]\n- [0, 0, 1]',
        "cells:\n- [null, 0.1, 1]\n- [0, 0, 1]",
        "cells: |\n  ? 0.1 1\n  0 0 1\n",
    ],
)
def test_self_contained(tmp_path: Path, rows: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(f"resolution: 0.5\norigin: [1, 2, 0]\n{rows}\n")
    loaded = load_map(path)
    expected = np.array([[Q, 0.1, 1], [0, 0, 1]], dtype=np.float32)
    assert np.array_equal(loaded.grid.cells, expected, equal_nan=True)
    assert (loaded.grid.resolution, loaded.grid.origin) == (0.5, Pose2D(1, 2, 0))
    assert loaded.format == "YAML with cells"


def test_a_few_bytes_that_claim_billions_of_cells(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(f"cells:\n- &a '{'0 ' * 5000}'\n" + "- *a\n" * 20000)
    with pytest.raises(FormatError, match=r"line 2: claims more than .* cells; expected every"):
        load_map(path)


@pytest.mark.parametrize(
    ("changes", "warning"),
    [
        (
            {"occupied_thresh": "0.196", "free_thresh": "0.65"},
            "free_thresh 0.65 is not below occupied_thresh 0.196; "
            "the cells are what map_server makes of it",
        ),
        ({"origin": "[1, 2, -nan]"}, "the yaw of origin is not a number (nan); 0 is used"),
    ],
)
def test_warnings(tmp_path: Path, changes: dict[str, str | None], warning: str) -> None:
    assert load_map(write_pair(tmp_path, **changes)).warnings[0] == warning


def test_self_contained_of_characters_and_without_place(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text('cells: ["#.?", "###"]\n')
    grid = load_map(path).grid
    assert np.array_equal(grid.cells, [[1, 0, Q], [1, 1, 1]], equal_nan=True)
    assert (grid.resolution, grid.origin) == (1, Pose2D())


def test_numbers_are_written_so_that_they_read_back(tmp_path: Path) -> None:
    grid = GridMap(np.zeros((1, 1)), 0.0125, Pose2D(12345.123, -1e-7, 0.1 + 0.2))
    assert image_meta_lines(grid, GreyRule(), "my map.pgm") == (
        'image: "my map.pgm"\n'
        "mode: trinary\n"
        "resolution: 0.0125\n"
        "origin: [12345.123, -1.0e-07, 0.30000000000000004]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n"
    )


@pytest.mark.parametrize("text", ["resolution: {}x\ncells: ['0']", "cells: ['0 {}x']"])
def test_a_long_number_that_is_none(text: str) -> None:
    """A tenth of a second; it took minutes while the pattern gave digits back."""
    start = time.process_time()
    with pytest.raises(FormatError, match="9999"):
        read_yaml(text.format("9" * 100_000).encode(), "m.yaml")
    assert time.process_time() - start < 2
