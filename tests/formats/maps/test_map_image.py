"""Grey values and probabilities: the trinary, scale and raw modes, in every dialect."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.errors import DataError
from mapcli.formats.maps.dialects import (
    DIALECTS,
    Dialect,
    greys_of_percents,
    percents_of_greys,
    read_percents,
)
from mapcli.formats.maps.map_image import MODES, GreyImage, GreyRule, Mode, trinary_greys

RAMP = GreyImage(np.arange(256, dtype=np.uint8).reshape(1, 256, 1))
UNKNOWN = -1


def percents(rule: GreyRule, image: GreyImage = RAMP, dialect: Dialect = "nav2") -> list[int]:
    """Percents as an OccupancyGrid has them, -1 unknown."""
    return [
        UNKNOWN if cell == 255 else int(cell) for cell in read_percents(image, rule, dialect)[0]
    ]


def pixel(*channels: int, alpha: int | None = None) -> GreyImage:
    opacity = None if alpha is None else np.array([[alpha]], dtype=np.uint8)
    return GreyImage(np.array([[channels]], dtype=np.uint8), opacity)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_trinary_with_default_thresholds(dialect: Dialect) -> None:
    assert percents(GreyRule(), dialect=dialect) == [100] * 90 + [UNKNOWN] * 116 + [0] * 50


@pytest.mark.parametrize("dialect", DIALECTS)
def test_trinary_with_old_savers_threshold_frees_the_unknown_grey(dialect: Dialect) -> None:
    found = percents(GreyRule(free_thresh=0.25), dialect=dialect)
    assert found == [100] * 90 + [UNKNOWN] * 102 + [0] * 64
    assert found[205] == 0


@pytest.mark.parametrize("dialect", DIALECTS)
def test_negate_mirrors_the_ramp(dialect: Dialect) -> None:
    found = percents(GreyRule(negate=True), dialect=dialect)
    assert found == percents(GreyRule(), dialect=dialect)[::-1]


def test_nav2_thresholds_are_inclusive_and_free_wins_a_tie() -> None:
    assert percents(GreyRule(free_thresh=0, occupied_thresh=1)) == [100] + [UNKNOWN] * 254 + [0]
    assert percents(GreyRule(free_thresh=1, occupied_thresh=1), pixel(0)) == [0]
    # 204 is 1 - 204/255 = 0.2 in float32 as well
    assert percents(GreyRule(free_thresh=0.2), pixel(204)) == [0]


@pytest.mark.parametrize("dialect", ["nav2-2024", "ros1"])
def test_thresholds_were_exclusive_before(dialect: Dialect) -> None:
    assert percents(GreyRule(free_thresh=0, occupied_thresh=1), dialect=dialect) == [UNKNOWN] * 256


def test_nav2_2024_scale_runs_from_0_to_100_rounded() -> None:
    found = percents(GreyRule("scale"), dialect="nav2-2024")
    assert (found[0], found[89], found[90], found[128], found[205], found[206]) == (
        100, 100, 99, 67, 0, 0,
    )  # fmt: skip
    # 1 - 153/255 = 0.4, of 0 to 0.8 that is 50 %
    assert percents(GreyRule("scale", 0, 0.8), pixel(153), "nav2-2024") == [50]


def test_nav2_scale_between_the_thresholds() -> None:
    found = percents(GreyRule("scale"))
    # 1 - 128/255 = 0.49804; (0.49804 - 0.196) / (0.65 - 0.196) = 0.6653
    assert (found[0], found[89], found[90], found[128], found[205], found[206]) == (
        100, 100, 99, 67, 0, 0,
    )  # fmt: skip
    assert UNKNOWN not in found


def test_ros1_scale_runs_from_1_to_99_truncated() -> None:
    found = percents(GreyRule("scale"), dialect="ros1")
    # 1 + 98 * 0.6653 = 66.2; 1 + 98 * 0.9935 = 98.4; 1 + 98 * 0.0002 = 1.02
    assert (found[89], found[90], found[128], found[205], found[206]) == (100, 98, 66, 1, 0)


def test_raw_takes_percents_as_they_are() -> None:
    expected = [*range(101)] + [UNKNOWN] * 155
    assert percents(GreyRule("raw")) == expected
    assert percents(GreyRule("raw", negate=True)) == expected, "Nav2 ignores negate"
    assert percents(GreyRule("raw", negate=True), dialect="nav2-2024") == expected
    assert percents(GreyRule("raw", negate=True), dialect="ros1") == expected[::-1]


@pytest.mark.parametrize(
    ("mode", "dialect", "image", "expected"),
    [
        ("trinary", "nav2", pixel(0, alpha=254), UNKNOWN),
        ("trinary", "nav2", pixel(0, alpha=255), 100),
        ("scale", "nav2", pixel(0, alpha=254), UNKNOWN),
        ("scale", "nav2", pixel(255, alpha=0), UNKNOWN),
        ("raw", "nav2", pixel(30, alpha=0), 30),
        ("trinary", "nav2-2024", pixel(0, 0, 0, alpha=255), 100),
        ("trinary", "nav2-2024", pixel(205, 205, 205, alpha=255), 0),  # 217.5, occ 0.147
        ("scale", "nav2-2024", pixel(0, alpha=254), UNKNOWN),
        ("raw", "nav2-2024", pixel(30, alpha=0), 30),
        ("scale", "ros1", pixel(200, 200, 0), UNKNOWN),  # blue is taken for alpha
        # the mean of (0, 0, 0, 255) is 63.75, of (255, 255, 255, 0) it is 191.25
        ("trinary", "ros1", pixel(0, 0, 0, alpha=255), 100),
        ("trinary", "ros1", pixel(255, 255, 255, alpha=0), UNKNOWN),
        ("scale", "ros1", pixel(128, alpha=0), UNKNOWN),
        ("scale", "ros1", pixel(128, alpha=1), 66),
        ("scale", "ros1", pixel(0, alpha=0), 100),
        ("raw", "ros1", pixel(30, alpha=0), 30),
    ],
)
def test_alpha(mode: Mode, dialect: Dialect, image: GreyImage, expected: int) -> None:
    assert percents(GreyRule(mode), image, dialect) == [expected]


def test_colour_is_luma_for_nav2_and_the_mean_for_ros1() -> None:
    red = pixel(255, 0, 0)  # 306 * 255 / 1024 = 76.2; 255 / 3 = 85
    assert percents(GreyRule("raw"), red) == [76]
    assert percents(GreyRule("raw"), red, "ros1") == [85]
    assert percents(GreyRule("raw"), red, "nav2-2024") == [85]
    assert percents(GreyRule("raw"), pixel(99, 99, 99)) == [99]


@pytest.mark.parametrize("free", [-1.0, 0.0, 0.196, 0.25, 0.65])
@pytest.mark.parametrize("negate", [False, True])
@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_nav2_table_equals_a_pixel_by_pixel_reading(mode: Mode, negate: bool, free: float) -> None:
    def one(grey: int) -> int:
        light = np.float32(grey) / np.float32(255)
        occ = light if negate else np.float32(1) - light
        if occ <= np.float32(free):
            return 0
        if occ >= np.float32(0.65):
            return 100
        if mode == "trinary":
            return UNKNOWN
        share = (occ - np.float32(free)) / np.float32(0.65 - free) * np.float32(100)
        return math.floor(float(share) + 0.5)

    assert percents(GreyRule(mode, free, 0.65, negate)) == [one(grey) for grey in range(256)]


@pytest.mark.parametrize(("free", "occupied"), [(math.nan, 0.65), (0, math.inf)])
def test_thresholds_that_make_no_sense(free: float, occupied: float) -> None:
    with pytest.raises(DataError, match="free_thresh"):
        GreyRule("trinary", free, occupied)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("free", "occupied"), [(1e41, 0.65), (0.2, 1e41), (-1e41, 0.65)])
def test_thresholds_beyond_float32_are_as_good_as_infinite(
    mode: Mode, free: float, occupied: float
) -> None:
    for dialect in DIALECTS:  # a warning of numpy would be an error here
        percents = percents_of_greys(GreyRule(mode, free, occupied), dialect)
        if dialect == "nav2" and mode != "raw" and free > 1:
            assert (percents == 0).all()


def test_thresholds_out_of_order_are_taken_as_map_servers_do() -> None:
    """occ of 128 is 0.498: at least 0.3 is occupied, up to 0.6 is free; who wins a tie differs."""
    rule = GreyRule("trinary", 0.6, 0.3)
    assert percents(rule, pixel(128)) == [0]
    assert percents(rule, pixel(128), "nav2-2024") == [100]
    assert percents(rule, pixel(128), "ros1") == [100]


@pytest.mark.parametrize("dialect", DIALECTS)
@given(
    negate=st.booleans(),
    thresholds=st.tuples(st.integers(1, 45), st.integers(90, 99)),
)
def test_scale_writing_inverts_reading(
    dialect: Dialect, negate: bool, thresholds: tuple[int, int]
) -> None:
    """Where the ends of the scale leave a grey for every percent, every percent survives."""
    rule = GreyRule("scale", thresholds[0] / 100, thresholds[1] / 100, negate)
    read = percents_of_greys(rule, dialect)[greys_of_percents(rule, dialect)]
    # 1 + 98 x is 99 only at the very end of the scale, where most thresholds have no grey.
    assert list(read) == [*range(99), 98 if dialect == "ros1" else 99, 100]


def test_scale_from_0_to_1_writes_the_nearest_grey_as_nav2_does() -> None:
    greys = greys_of_percents(GreyRule("scale", 0, 1)).astype(int)
    assert np.abs(greys - 2.55 * np.arange(100, -1, -1)).max() <= 0.5


def test_trinary_pixels() -> None:
    cells = np.array([[0, 0.25, 0.26, 0.64, 0.65, 1, np.nan]], dtype=np.float32)
    greys = trinary_greys(cells, 0.25, 0.65, negate=False)
    assert list(greys[0]) == [254, 254, 205, 205, 0, 0, 205]
    negated = trinary_greys(cells, 0.25, 0.65, negate=True)
    assert list(negated[0]) == [1, 1, 50, 50, 255, 255, 50]
