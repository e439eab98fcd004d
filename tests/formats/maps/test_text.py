"""Text maps: both forms, headers, and what can be wrong with them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mapcli.errors import FormatError
from mapcli.formats.maps.text import read_text, shortest, write_characters, write_numbers
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Q = np.float32(np.nan)


def read(text: str | bytes) -> GridMap:
    return read_text(text.encode() if isinstance(text, str) else text, "m.txt")[0]


def same(grid: GridMap, rows: list[list[float]]) -> bool:
    return np.array_equal(grid.cells, np.array(rows, dtype=np.float32), equal_nan=True)


def test_fig_9_10_cell_by_cell() -> None:
    text = """# Fig. 9.10
    ? 0.1  ?
    0.1 .1 1.0   # the wall

    ?   1    1e0
    """
    assert same(read(text), [[Q, 0.1, Q], [0.1, 0.1, 1], [Q, 1, 1]])
    assert read(text).resolution == 1
    assert read(text).origin == Pose2D()


def test_characters_cell_by_cell() -> None:
    grid, form = read_text(b"# three rows of walls\n####\n#..?\n####\n", "m.txt")
    assert form == "characters"
    assert same(grid, [[1, 1, 1, 1], [1, 0, 0, Q], [1, 1, 1, 1]])


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("?\n?\n", [[Q], [Q]]),
        ("? ?\n? ?\n", [[Q, Q], [Q, Q]]),
        ("??\n??\n", [[Q, Q], [Q, Q]]),
        ("#\n", [[1]]),
        ("1\n", [[1]]),
        ("####\n0 1\n", [[0, 1]]),  # a digit: the number form, where #### is a comment
        ("resolution: 1\n#\n", [[1]]),  # digits of headers say nothing about the form
        ("# 3 rooms\n.#\n", [[0, 1]]),  # nor do digits in comments
        ("0 1\r\n1 0\r\n", [[0, 1], [1, 0]]),
        ("\ufeff0 1", [[0, 1]]),
        ("0 1#comment", [[0, 1]]),
    ],
)
def test_which_form(text: str, rows: list[list[float]]) -> None:
    assert same(read(text), rows)


@pytest.mark.parametrize("origin", ["-7.14, -7.83, 0.5", "[-7.14, -7.83, 0.5]", "-7.14 -7.83 .5"])
def test_headers(origin: str) -> None:
    grid = read(f"resolution: 0.05 # m\nOrigin : {origin}\n0 1\n")
    assert (grid.resolution, grid.origin) == (0.05, Pose2D(-7.14, -7.83, 0.5))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 1\n\n0 1 1\n", "m.txt: line 3: a row of 3 cells; expected 2 as in the first row"),
        ("##\n###\n", "m.txt: line 2: a row of 3 cells"),
        ("0 1\n0 x\n", "m.txt: line 2, column 1: cell 'x'; expected a probability from 0 to 1"),
        ("0 1.01\n", "m.txt: line 1, column 1: cell '1.01'"),
        ("-0.1 0\n", "m.txt: line 1, column 0: cell '-0.1'"),
        ("0 nan\n", "m.txt: line 1, column 1: cell 'nan'"),
        ("0 1_0\n", "m.txt: line 1, column 1: cell '1_0'"),
        ("0 ??\n", "m.txt: line 1, column 1: cell '??'"),
        ("0 1\n??\n", "m.txt: line 2, column 0: cell '??'"),
        (".#x\n", "m.txt: line 1: row '.#x'; expected one of #, . and ? for each cell"),
        ("##\n..# a wall\n", "m.txt: line 2: row '..# a wall'; expected one of"),
        ("# nothing\n", "m.txt: no rows of cells; expected a map"),
        ("resolution: 0\n0 1\n", "m.txt: resolution 0; expected metres per cell"),
        ("resolution: x\n0 1\n", "m.txt: line 1: resolution: 'x'"),
        ("resolution: 1\nresolution: 1\n0 1\n", "m.txt: line 2: resolution"),
        ("0 1\nresolution: 1\n", "m.txt: line 2: resolution: '1'"),
        ("origin: 1, 2\n0 1\n", "m.txt: line 1: origin: '1, 2'"),
        ("size: 2\n0 1\n", "m.txt: line 1: size: '2'; expected resolution: METRES or origin"),
    ],
)
def test_malformed(text: str, message: str) -> None:
    with pytest.raises(FormatError) as raised:
        read(text)
    assert str(raised.value).startswith(message)


def test_numbers_are_written_in_columns() -> None:
    grid = GridMap(np.array([[Q, 0.1], [1, 0]], dtype=np.float32), 0.05, Pose2D(-1, 2, 0.5))
    text = b"resolution: 0.05\norigin: -1.0, 2.0, 0.5\n  ? 0.1\n  1   0\n"
    assert b"".join(write_numbers(grid)) == text


def test_characters_are_written_by_threshold() -> None:
    grid = GridMap(np.array([[Q, 0.25, 0.3], [0.65, 1, 0]], dtype=np.float32))
    assert b"".join(write_characters(grid, 0.25, 0.65)) == b"?.?\n##.\n"


@pytest.mark.parametrize(
    ("value", "text"), [(0.1, "0.1"), (1, "1"), (0, "0"), (1e-8, "1e-8"), (0.001, "0.001")]
)
def test_shortest(value: float, text: str) -> None:
    assert shortest(np.float32(value)) == text


PROBABILITIES = st.floats(0, 1, width=32) | st.just(float("nan"))


@given(
    cells=hnp.arrays(np.float32, hnp.array_shapes(min_dims=2, max_dims=2), elements=PROBABILITIES),
    resolution=st.floats(1e-6, 1e6),
    place=st.tuples(*[st.floats(-1e9, 1e9)] * 3),
)
def test_numbers_round_trip(
    cells: np.ndarray, resolution: float, place: tuple[float, float, float]
) -> None:
    grid = GridMap(cells, resolution, Pose2D(*place))
    again = read(b"".join(write_numbers(grid)))
    assert np.array_equal(again.cells, cells, equal_nan=True)
    assert (again.resolution, again.origin) == (resolution, grid.origin)


@given(
    states=hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=2, max_dims=2),
        elements=st.sampled_from([0.0, 1.0, float("nan")]),
    )
)
def test_characters_round_trip(states: np.ndarray) -> None:
    again = read(b"".join(write_characters(GridMap(states, 0.5), 0.25, 0.65)))
    assert np.array_equal(again.cells, states, equal_nan=True)
    assert again.resolution == 0.5
