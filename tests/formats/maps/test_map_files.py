"""Loading and saving maps of every format: exact inverses where the format can hold the data."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SHARED
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from mapcli.errors import DataError, FormatError
from mapcli.formats.maps.dialects import DIALECTS
from mapcli.formats.maps.load import LoadedMap, load_map, sniff
from mapcli.formats.maps.losses import LossKind, losses
from mapcli.formats.maps.map_image import MODES, GreyRule
from mapcli.formats.maps.pgm import read_pgm
from mapcli.formats.maps.png import read_png
from mapcli.formats.maps.save import SaveOptions, dump_map
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Q = float("nan")
STATES = np.array([[1, 0, Q], [Q, 1, 0]], dtype=np.float32)
PLACED = GridMap(STATES, 0.05, Pose2D(-7.14, -7.83, 0.25))
SHAPES = hnp.array_shapes(min_dims=2, max_dims=2, max_side=6)


def stored(files: dict[str, bytes]) -> Callable[[Path], bytes]:
    return lambda path: files[path.name]


def reload(grid: GridMap, name: str, options: SaveOptions | None = None) -> LoadedMap:
    return load_map(name, read=stored(dump_map(grid, name, options)))


def assert_same(found: GridMap, grid: GridMap) -> None:
    assert np.array_equal(found.cells, grid.cells, equal_nan=True)
    assert (found.resolution, found.origin) == (grid.resolution, grid.origin)


PLACES = st.builds(
    lambda *parts: Pose2D(*parts), *[st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-3, 3)]
)
RESOLUTIONS = st.floats(1e-4, 1e3)
THREE_STATES = hnp.arrays(np.float32, SHAPES, elements=st.sampled_from([0.0, 1.0, Q]))
PERCENTS = hnp.arrays(np.int16, SHAPES, elements=st.integers(0, 101)).map(
    lambda percents: np.where(percents > 100, np.nan, percents).astype(np.float32) / np.float32(100)
)
ANY = hnp.arrays(np.float32, SHAPES, elements=st.floats(0, 1, width=32) | st.just(Q))


@pytest.mark.parametrize("name", ["m.txt", "m.yaml", "m.pgm", "m.png"])
@given(cells=THREE_STATES, resolution=RESOLUTIONS, origin=PLACES)
@settings(max_examples=40)
def test_default_settings_keep_the_three_states_and_the_place(
    name: str, cells: Any, resolution: float, origin: Pose2D
) -> None:
    grid = GridMap(cells, resolution, origin)
    loaded = reload(grid, name)
    assert_same(loaded.grid, grid)
    assert loaded.warnings == ()


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("negate", [False, True])
@pytest.mark.parametrize("suffix", ["yaml", "pgm", "png"])
def test_trinary_reads_the_same_in_every_dialect(dialect: Any, negate: bool, suffix: str) -> None:
    files = dump_map(PLACED, f"m.{suffix}", SaveOptions(negate=negate))
    assert_same(load_map(f"m.{suffix}", dialect=dialect, read=stored(files)).grid, PLACED)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("m.yaml", SaveOptions(mode="scale")),
        ("m.png", SaveOptions(mode="scale")),
        ("m.png", SaveOptions(mode="scale", negate=True)),
        ("m.png", SaveOptions(mode="scale", free_thresh=0.196, occupied_thresh=0.65)),
        ("m.yaml", SaveOptions(mode="raw")),
        ("m.pgm", SaveOptions(mode="raw")),
        ("m.pgm", SaveOptions(mode="raw", plain=True)),
        ("m.pgm", SaveOptions(mode="raw", bits=16)),
        ("m.pgm", SaveOptions(mode="raw", plain=True, bits=16)),
        ("m.png", SaveOptions(mode="raw")),
    ],
    ids=str,
)
@given(cells=PERCENTS, origin=PLACES)
@settings(max_examples=25)
def test_scale_and_raw_keep_percents(
    name: str, options: SaveOptions, cells: Any, origin: Pose2D
) -> None:
    grid = GridMap(cells, 0.05, origin)
    assert_same(reload(grid, name, options).grid, grid)


@pytest.mark.parametrize(
    ("name", "options"), [("m.txt", SaveOptions()), ("m.yaml", SaveOptions(inline=True))]
)
@given(cells=ANY, resolution=RESOLUTIONS, origin=PLACES)
@settings(max_examples=40)
def test_text_and_cells_in_yaml_keep_every_probability(
    name: str, options: SaveOptions, cells: Any, resolution: float, origin: Pose2D
) -> None:
    grid = GridMap(cells, resolution, origin)
    assert_same(reload(grid, name, options).grid, grid)


def test_a_pair_byte_by_byte() -> None:
    assert dump_map(PLACED, "some/folder/m.yaml") == {
        "m.pgm": b"P5\n3 2\n255\n\x00\xfe\xcd\xcd\x00\xfe",
        "m.yaml": b"image: m.pgm\nmode: trinary\nresolution: 0.05\norigin: [-7.14, -7.83, 0.25]\n"
        b"negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    }


def test_files_come_in_the_order_of_writing() -> None:
    assert list(dump_map(PLACED, "m.yaml")) == ["m.pgm", "m.yaml"]
    assert list(dump_map(PLACED, "m.yml", SaveOptions(mode="scale"))) == ["m.png", "m.yml"]
    assert list(dump_map(PLACED, "-", SaveOptions(format="yaml"))) == ["-"]
    assert list(dump_map(PLACED, "map", SaveOptions(format="pgm"))) == ["map"]


@pytest.mark.parametrize(
    "name", ["my map.yaml", "42.yaml", 'a"b\\c.yaml', "a\tb\n.yaml", "karte-ö.yaml"]
)
def test_image_names_are_quoted_where_yaml_needs_it(name: str) -> None:
    assert_same(reload(PLACED, name).grid, PLACED)


def test_a_yaml_and_its_image_never_share_a_name() -> None:
    files = dump_map(PLACED, "m.pgm", SaveOptions(format="yaml"))
    assert list(files) == ["m.pgm.pgm", "m.pgm"]


def test_metadata_inside_an_image_are_comments_for_others() -> None:
    (data,) = dump_map(PLACED, "m.pgm").values()
    assert data.startswith(
        b"P5\n# mapcli map\n# mode: trinary\n# resolution: 0.05\n# origin: [-7.14"
    )
    loaded = reload(PLACED, "m.pgm", SaveOptions(mode="raw"))
    assert loaded.rule == GreyRule("raw")


def test_trinary_thresholds_are_those_of_the_cells_not_of_the_file() -> None:
    grid = GridMap(np.array([[0.1, 0.3, 0.5, 0.7]], dtype=np.float32))
    options = SaveOptions(free_thresh=0.4, occupied_thresh=0.6)
    files = dump_map(grid, "m.yaml", options)
    assert b"occupied_thresh: 0.65\nfree_thresh: 0.196\n" in files["m.yaml"]
    assert_same(reload(grid, "m.yaml", options).grid, GridMap(np.array([[0, 0, Q, 1]])))


def test_deterministic() -> None:
    for name in ("m.txt", "m.yaml", "m.pgm", "m.png"):
        assert dump_map(PLACED, name) == dump_map(PLACED, name)


def test_graded_map_of_a_real_size_in_every_format() -> None:
    rng = np.random.default_rng(0)
    percents = rng.integers(0, 102, (300, 200)).astype(np.float32)
    cells = np.where(percents > 100, np.float32(np.nan), percents / np.float32(100))
    grid = GridMap(cells, 0.05)
    for name, mode in (("m.txt", "raw"), ("m.yaml", "raw"), ("m.png", "scale")):
        assert_same(reload(grid, name, SaveOptions(mode=mode)).grid, grid)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("free", "occupied"), [(0.7, 0.6), (0.5, 0.5), (-0.1, 0.5), (0.5, 1.1), (math.nan, 0.5)]
)
def test_save_thresholds_out_of_order(free: float, occupied: float) -> None:
    with pytest.raises(DataError, match="free_thresh"):
        SaveOptions(free_thresh=free, occupied_thresh=occupied)


def test_name_without_a_format() -> None:
    with pytest.raises(DataError, match=r"'m\.jpg' says no map format; expected a name in \.txt"):
        dump_map(PLACED, "m.jpg")


def test_image_alone_is_trinary_with_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "m.pgm"
    path.write_bytes(b"P5 3 1 255\n\x00\xcd\xfe")
    loaded = load_map(path)
    assert np.array_equal(loaded.grid.cells, [[1, Q, 0]], equal_nan=True)
    assert (loaded.grid.resolution, loaded.grid.origin) == (1, Pose2D())
    assert loaded.warnings == (
        "is an image without metadata; assumed: 1 m per cell, origin 0, 0, 0, trinary grey",
    )
    (tmp_path / "m.yaml").write_text("")
    assert load_map(path).warnings[0].endswith("; m.yaml beside it may say more")


def test_place_given_by_the_caller(tmp_path: Path) -> None:
    path = tmp_path / "m.pgm"
    path.write_bytes(b"P5 1 1 255\n\x00")
    loaded = load_map(path, resolution=0.05, origin=Pose2D(1, 2, 3))
    assert (loaded.grid.resolution, loaded.grid.origin) == (0.05, Pose2D(1, 2, 3))
    assert loaded.warnings == ()
    (warning,) = load_map(path, resolution=0.05).warnings
    assert "assumed: origin 0, 0, 0, trinary grey" in warning
    with pytest.raises(DataError, match="resolution 0"):
        load_map(path, resolution=0)


@pytest.mark.parametrize(
    ("data", "form"),
    [
        (b"P2 1 1 1 1", "pgm"),
        (b"P5 1 1 255 .", "pgm"),
        (b"\x89PNG\r\n\x1a\n", "png"),
        (b"# a map\nimage: m.pgm\n", "yaml"),
        (b'{"cells": ["0"]}', "yaml"),
        (b"resolution: 1\ncells:\n", "yaml"),
        (b"resolution: 1\n0 1\n", "txt"),
        (b"#.?\n", "txt"),
    ],
)
def test_sniffing(data: bytes, form: str) -> None:
    assert sniff(data) == form


@pytest.mark.parametrize("name", ["m.txt", "m.pgm", "m.png"])
def test_standard_input(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (data,) = dump_map(PLACED, name).values()
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data)))
    assert_same(load_map("-").grid, PLACED)


@pytest.mark.parametrize("suffix", [".txt", ".yaml", ".pgm", ".png", ""])
def test_no_map_in_the_file(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"m{suffix}"
    with pytest.raises(FormatError, match="no such file"):
        load_map(path)
    path.write_bytes(b"")
    with pytest.raises(FormatError, match="is empty; expected a map"):
        load_map(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(FormatError, match="is a directory; expected a map file"):
        load_map(path)


def test_suffix_and_content_of_images_may_differ(tmp_path: Path) -> None:
    (data,) = dump_map(PLACED, "m.png").values()
    (tmp_path / "m.pgm").write_bytes(data)
    assert_same(load_map(tmp_path / "m.pgm").grid, PLACED)
    (tmp_path / "m.png").write_bytes(b"GIF89a")
    with pytest.raises(
        FormatError, match=r"is a GIF picture; mapcli reads PNG and PGM, as maps; expected a map"
    ):
        load_map(tmp_path / "m.png")


def test_damaged_metadata_inside_an_image(tmp_path: Path) -> None:
    path = tmp_path / "m.pgm"
    path.write_bytes(b"P5\n# mapcli map\n# mode: trinary\n# resolution: 0\n1 1\n255\n\x00")
    with pytest.raises(FormatError) as raised:
        load_map(path)
    assert str(raised.value).startswith(f"{path}: metadata inside the image: line 2: resolution")


def test_losses() -> None:
    kinds: list[LossKind] = []

    def lost(cells: Any, name: str, **options: Any) -> list[str]:
        grid = GridMap(np.array(cells, dtype=np.float32), 0.05, Pose2D(1, 2))
        found = losses(grid, name, SaveOptions(**options))
        kinds[:] = [loss.kind for loss in found]
        return [loss.text for loss in found]

    assert lost([[0.3, Q, 1]], "m.txt") == []
    assert lost([[0.1, 0.3, Q]], "m.yaml") == [
        "1 cell whose probability changes, by up to 0.1",
        "1 cell known before and unknown now",
    ]
    assert kinds == [LossKind.PROBABILITY, LossKind.KNOWN_TO_UNKNOWN]
    assert lost([[0.123, 1]], "m.png", mode="scale") == [
        "1 cell whose probability changes, by up to 0.003"
    ]
    assert lost([[Q, 1]], "m.pgm", mode="scale") == ["1 cell unknown before and 0.5 now"]
    assert kinds == [LossKind.UNKNOWN_TO_KNOWN]
    assert lost([[0.3, 1]], "m.txt", characters=True) == ["1 cell known before and unknown now"]


WAYS = [
    ("m.txt", SaveOptions()),
    ("m.txt", SaveOptions(characters=True)),
    ("m.yaml", SaveOptions(inline=True)),
    ("m.pgm", SaveOptions(plain=True)),
    ("m.pgm", SaveOptions(bits=16)),
    *((name, SaveOptions(mode, negate=negate, dialect=dialect))
      for name in ("m.yaml", "m.png") for mode in MODES for dialect in DIALECTS
      for negate in (False, True) if not (negate and mode == "raw")),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ["depot", "tb3_sandbox"])
def test_real_maps_survive_every_format_and_dialect(name: str) -> None:
    path = SHARED / "maps" / f"{name}.yaml"
    if not path.exists():
        pytest.skip("needs the shared maps")
    grid = load_map(path).grid
    for out, options in WAYS:
        files = dump_map(grid, out, options)
        assert_same(load_map(out, dialect=options.dialect, read=stored(files)).grid, grid)
        for file, data in files.items():
            if file.endswith((".pgm", ".png")):
                assert_pillow_agrees(data, file)


def assert_pillow_agrees(data: bytes, file: str) -> None:
    """Pillow sees the pixels that our own reader sees."""
    image = (read_png if file.endswith(".png") else read_pgm)(data, file).whole()
    pixels = np.asarray(Image.open(io.BytesIO(data)))
    if pixels.ndim == 3:
        assert image.alpha is not None
        assert np.array_equal(pixels[:, :, 3], image.alpha)
        pixels = pixels[:, :, 0]
    deep = pixels.dtype != np.uint8
    assert np.array_equal(pixels // 257 if deep else pixels, image.channels[:, :, 0])
