"""Grey values and probabilities: the trinary, scale and raw modes, in both dialects."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapcli.errors import DataError
from mapcli.formats.grey import (
    Dialect,
    GreyImage,
    GreyRule,
    Mode,
    percent_greys,
    trinary_greys,
)

RAMP = GreyImage(np.arange(256, dtype=np.uint8).reshape(1, 256, 1))
UNKNOWN = -1


def percents(rule: GreyRule, image: GreyImage = RAMP, dialect: Dialect = "nav2") -> list[int]:
    """Percents as an OccupancyGrid has them, -1 unknown."""
    cells = rule.cells(image, dialect)[0]
    assert cells.dtype == np.float32
    return [UNKNOWN if math.isnan(cell) else round(float(cell) * 100) for cell in cells]


def pixel(*channels: int, alpha: int | None = None) -> GreyImage:
    opacity = None if alpha is None else np.array([[alpha]], dtype=np.uint8)
    return GreyImage(np.array([[channels]], dtype=np.uint8), opacity)


@pytest.mark.parametrize("dialect", ["nav2", "ros1"])
def test_trinary_with_default_thresholds(dialect: Dialect) -> None:
    assert percents(GreyRule(), dialect=dialect) == [100] * 90 + [UNKNOWN] * 116 + [0] * 50


@pytest.mark.parametrize("dialect", ["nav2", "ros1"])
def test_trinary_with_old_savers_threshold_frees_the_unknown_grey(dialect: Dialect) -> None:
    found = percents(GreyRule(free_thresh=0.25), dialect=dialect)
    assert found == [100] * 90 + [UNKNOWN] * 102 + [0] * 64
    assert found[205] == 0


@pytest.mark.parametrize("dialect", ["nav2", "ros1"])
def test_negate_mirrors_the_ramp(dialect: Dialect) -> None:
    found = percents(GreyRule(negate=True), dialect=dialect)
    assert found == percents(GreyRule(), dialect=dialect)[::-1]


def test_nav2_thresholds_are_inclusive_and_free_wins_a_tie() -> None:
    assert percents(GreyRule(free_thresh=0, occupied_thresh=1)) == [100] + [UNKNOWN] * 254 + [0]
    assert percents(GreyRule(free_thresh=1, occupied_thresh=1), pixel(0)) == [0]
    # 204 is 1 - 204/255 = 0.2 in float32 as well
    assert percents(GreyRule(free_thresh=0.2), pixel(204)) == [0]


def test_ros1_thresholds_are_exclusive() -> None:
    assert percents(GreyRule(free_thresh=0, occupied_thresh=1), dialect="ros1") == [UNKNOWN] * 256


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
    assert percents(GreyRule("raw", negate=True), dialect="ros1") == expected[::-1]


@pytest.mark.parametrize(
    ("mode", "dialect", "image", "expected"),
    [
        ("trinary", "nav2", pixel(0, alpha=254), UNKNOWN),
        ("trinary", "nav2", pixel(0, alpha=255), 100),
        ("scale", "nav2", pixel(0, alpha=254), UNKNOWN),
        ("scale", "nav2", pixel(255, alpha=0), UNKNOWN),
        ("raw", "nav2", pixel(30, alpha=0), 30),
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


@pytest.mark.parametrize(("free", "occupied"), [(0.65, 0.196), (math.nan, 0.65), (0, math.inf)])
def test_thresholds_that_make_no_sense(free: float, occupied: float) -> None:
    with pytest.raises(DataError, match="free_thresh"):
        GreyRule("trinary", free, occupied)


@given(
    negate=st.booleans(),
    thresholds=st.tuples(st.integers(0, 45), st.integers(90, 100)),
)
def test_scale_writing_inverts_reading(negate: bool, thresholds: tuple[int, int]) -> None:
    """Where the ends of the scale leave a grey for every percent, every percent survives."""
    rule = GreyRule("scale", thresholds[0] / 100, thresholds[1] / 100, negate)
    cells = (np.arange(101, dtype=np.float32) / np.float32(100))[None, :]
    greys = percent_greys(cells, rule, unknown=128)
    assert percents(rule, GreyImage(greys[:, :, None])) == list(range(101))


def test_scale_from_0_to_1_writes_the_nearest_grey_as_nav2_does() -> None:
    cells = (np.arange(101, dtype=np.float32) / np.float32(100))[None, :]
    greys = percent_greys(cells, GreyRule("scale", 0, 1), unknown=128)[0]
    assert np.abs(greys - 2.55 * np.arange(100, -1, -1)).max() <= 0.5


def test_trinary_pixels() -> None:
    cells = np.array([[0, 0.25, 0.26, 0.64, 0.65, 1, np.nan]], dtype=np.float32)
    greys = trinary_greys(cells, 0.25, 0.65, negate=False)
    assert list(greys[0]) == [254, 254, 205, 205, 0, 0, 205]
    negated = trinary_greys(cells, 0.25, 0.65, negate=True)
    assert list(negated[0]) == [1, 1, 50, 50, 255, 255, 50]
