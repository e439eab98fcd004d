"""Pictures of maps: what is drawn where, in which colour."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from mapcli.algorithms.exploration.frontier_cells import frontier_cells
from mapcli.errors import DataError
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D
from mapcli.model.trajectory import Trajectory
from mapcli.pictures.book_figure import OBSTACLE, ROBOT, probability_label
from mapcli.pictures.drawing import (
    INK,
    RED,
    UNKNOWN,
    WHITE,
    draw_line,
    round_length,
    time_colour,
)
from mapcli.pictures.floor_plan import Marker, duration
from mapcli.pictures.map_picture import (
    BOOK_SIDE,
    book_image,
    book_picture,
    cells_passed,
    floor_plan,
    map_pixels,
    plan_image,
    render,
    window_of,
)
from mapcli.pictures.map_window import LARGEST_SIDE
from mapcli.pictures.robot_path import RobotPath

Q = float("nan")
LEVELS = np.array([[Q, Q, Q, Q], [Q, 0, 1, 0.5], [Q, 0.1, 0.9, Q]], dtype=np.float32)


def room(rows: int = 60, columns: int = 100, **place: Any) -> GridMap:
    """A walled room in an unknown world."""
    cells = np.full((rows, columns), Q, dtype=np.float32)
    cells[10:-10, 10:-10] = 1
    cells[11:-11, 11:-11] = 0
    return GridMap(cells, **place)


def pixels_of(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image)


def colours_of(image: Image.Image) -> set[Any]:
    return {colour for _, colour in image.getcolors(1 << 24) or []}


def test_cells_become_white_dark_and_light_grey() -> None:
    grid = GridMap(LEVELS)
    window = window_of(grid, scale=1, crop=False)
    colours = map_pixels(window)
    assert colours.shape == (3, 4, 3)
    assert colours[0, 0].tolist() == list(UNKNOWN)
    assert colours[1, 1].tolist() == list(WHITE)
    assert colours[1, 2].tolist() == list(INK)
    assert colours[2, 1].tolist() == list(WHITE)
    assert colours[2, 2].tolist() == list(INK)
    assert 100 < colours[1, 3].mean() < 200, "in doubt: between white and dark"


def test_view_is_cropped_to_what_is_known_and_to_the_path() -> None:
    grid = room()
    window = window_of(grid)
    assert (window.top, window.left, window.rows, window.columns) == (8, 8, 44, 84)
    far = np.array([[50.0, 30.0], [95.5, 30.0]])  # column 95, row 29
    window = window_of(grid, far)
    assert (window.left, window.columns) == (8, 90)


def test_the_frame_of_a_drive_is_what_was_really_seen() -> None:
    """A hall of 4 m by 2 m; beams through its door go 10 m on, and one through a window."""
    cells = np.full((200, 300), Q)
    cells[80:120, 100:180] = 0.1
    cells[98, 180:] = cells[104, 180:] = cells[112:, 140] = 0.1
    path = np.array([[6.0, 5.0], [8.0, 5.0]])
    whole, framed = window_of(GridMap(cells, 0.05)), window_of(GridMap(cells, 0.05), path)
    assert (whole.left + whole.columns, whole.top + whole.rows) == (304, 204)
    assert framed.top <= 78
    assert framed.left <= 98
    assert 120 <= framed.top + framed.rows <= 130
    assert 180 <= framed.left + framed.columns <= 190


def test_the_frame_of_a_drive_that_saw_little_is_what_is_known() -> None:
    cells = np.full((60, 60), Q)
    cells[20, 10:50] = 0.1
    window = window_of(GridMap(cells, 0.05), np.array([[1.0, 2.0]]))
    assert (window.left, window.columns, window.top, window.rows) == (8, 44, 18, 5)


def test_the_window_of_a_map_without_known_cells_is_the_whole_map() -> None:
    window = window_of(GridMap(np.full((5, 7), Q)))
    assert (window.top, window.left, window.rows, window.columns) == (-2, -2, 9, 11)


def test_world_points_fall_on_their_cells() -> None:
    grid = room(resolution=0.5, origin=Pose2D(3, -2, 0.7))
    window = window_of(grid, scale=4)
    rows, columns = np.array([10, 20, 49]), np.array([10, 31, 89])
    by_world = window.pixels_of_world(grid.world_of_cells(rows, columns))
    expected = np.column_stack([(columns - 8 + 0.5) * 4, (rows - 8 + 0.5) * 4])
    assert np.allclose(by_world, expected)


def test_a_turned_map_is_drawn_in_its_own_axes() -> None:
    """The same map elsewhere, with the path turned along: the same picture but for the metres."""
    path = np.array([[15.0, 15.0], [80.0, 15.0], [80.0, 45.0]])
    place = Pose2D(0, 0, 1.1)
    straight = pixels_of(plan_image(room(), path=RobotPath(path)))
    turned = pixels_of(plan_image(room(origin=place), path=RobotPath(place.apply(path))))
    assert straight.shape == turned.shape
    assert np.array_equal(straight, turned)


def test_large_maps_are_reduced_and_thin_walls_stay() -> None:
    cells = np.zeros((3, 2 * LARGEST_SIDE + 1), dtype=np.float32)
    cells[1, 1234] = 1
    cells[:, 4000] = Q
    window = window_of(GridMap(cells), crop=False)
    assert window.zoom == pytest.approx(1 / 3)
    colours = map_pixels(window)
    assert colours.shape == (1, 2667, 3)
    assert colours[0, 1234 // 3].tolist() == list(INK)
    assert colours[0, 4000 // 3].tolist() == list(WHITE)


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (2000, 30), (7, 7)])
def test_any_shape_can_be_drawn(shape: tuple[int, int]) -> None:
    grid = GridMap(np.zeros(shape), 0.05)
    middle = grid.world_of_cells([shape[0] // 2], [shape[1] // 2])
    image = plan_image(
        grid,
        path=RobotPath(middle),
        title="A title",
        caption="a caption",
        markers=[Marker(0, 0, "x")],
    )
    assert max(image.size) <= LARGEST_SIDE + 600
    assert INK in colours_of(image), "letters"


def test_path_is_coloured_by_time() -> None:
    grid = room(resolution=0.05)
    path = grid.world_of_cells(np.full(50, 30.0), np.linspace(15, 84, 50))
    stamps = np.linspace(100.0, 160.0, 50)
    window = window_of(grid, path)
    image = plan_image(grid, path=RobotPath(path, stamps, np.zeros(50)))
    offset = placed_at(image, grid, path)
    for k in (3, 22):
        x, y = np.floor(window.pixels_of_world(path[k : k + 1])[0] + offset).astype(int)
        found = np.array(image.getpixel((int(x), int(y))))
        assert np.abs(found - time_colour(k / 49)).max() < 40


def test_red_on_a_path_is_explained() -> None:
    grid, stamps = room(resolution=0.05), np.linspace(0.0, 60.0, 50)
    points = grid.world_of_cells(np.full(50, 30.0), np.linspace(15, 84, 50))
    doubtful = np.arange(50) > 25
    right, red = (
        plan_image(grid, path=RobotPath(points, stamps, np.zeros(50), doubtful & seen))
        for seen in (False, True)
    )
    assert red.height > right.height
    # Below what the colours of time mean: red, and letters.
    below = {*colours_of(red.crop((0, right.height, red.width, red.height)))}
    assert {RED, INK} <= below


def placed_at(image: Image.Image, grid: GridMap, path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the plan begins on the sheet: its frame is the first dark line from the left."""
    pixels = pixels_of(image).astype(int)
    frame = np.argwhere((np.abs(pixels - (112, 118, 126)).max(axis=2) < 3).mean(axis=0) > 0.5)[0, 0]
    top = np.argwhere((np.abs(pixels - (112, 118, 126)).max(axis=2) < 3).mean(axis=1) > 0.5)[0, 0]
    return np.array([frame + 1, top + 1], dtype=np.float64)


def test_pictures_are_deterministic_png_files() -> None:
    path = np.array([[15.0, 15.0], [80.0, 15.0], [80.0, 45.0]])
    first, second = (floor_plan(room(), path=RobotPath(path)) for _ in range(2))
    assert first == second
    assert Image.open(io.BytesIO(first)).format == "PNG"
    assert book_picture(GridMap(LEVELS)) == book_picture(GridMap(LEVELS))


def test_render_takes_the_books_look_for_small_maps_and_with_labels() -> None:
    small, large = GridMap(LEVELS), GridMap(np.zeros((BOOK_SIDE + 1, 3)))
    assert render(small, robots=[(0, 0)]) == book_picture(small, labels=False, robots=[(0, 0)])
    assert render(large, title="t") == floor_plan(large, title="t")
    assert render(large, labels=True) == book_picture(large)
    trajectory = Trajectory(np.array([[0.5, 0.5, 0], [2.5, 9.5, 1]]), np.array([0, 10**9]))
    path = RobotPath(trajectory.poses[:, :2], np.array([0.0, 1.0]), trajectory.poses[:, 2])
    assert render(large, trajectory=trajectory) == floor_plan(large, path=path)
    with pytest.raises(DataError, match="robot at 9,9; expected a cell of"):
        render(small, robots=[(9, 9)])


def test_a_path_far_away_is_bounded() -> None:
    path = np.tile(np.array([[1e9, 1e9], [50.0, 30.0], [-1e9, 30.0]]), (20, 1))
    image = plan_image(room(), path=RobotPath(path))
    assert max(image.size) < LARGEST_SIDE


def test_frontier_cells_are_red_on_a_plan() -> None:
    grid = room()
    frontier = np.zeros(grid.cells.shape, dtype=bool)
    assert RED not in colours_of(plan_image(grid, frontier=frontier))
    frontier[30, 30] = True
    assert RED in colours_of(plan_image(grid, frontier=frontier))


def test_stamped_line_covers_its_pixels_softly() -> None:
    pixels = np.full((11, 40, 3), 255, dtype=np.uint8)
    black = np.zeros((2, 3))
    draw_line(pixels, np.array([[5.0, 5.5], [35.0, 5.5]]), black, radius=1.5)
    assert pixels[5, 20].tolist() == [0, 0, 0]
    assert pixels[4, 20].mean() < 10
    assert pixels[3, 20].mean() > 200, "the rim"
    assert pixels[2, 20].tolist() == [255, 255, 255]
    assert pixels[5, 2].tolist() == [255, 255, 255]


def test_where_a_line_crosses_itself_the_later_stretch_is_on_top() -> None:
    pixels = np.full((41, 41, 3), 255, dtype=np.uint8)
    corners = np.array([[20.5, 2.0], [20.5, 38.0], [38.0, 38.0], [38.0, 20.5], [2.0, 20.5]])
    colours = np.array([[0.0] * 3, [0.0] * 3, [100.0] * 3, [200.0] * 3, [200.0] * 3])
    draw_line(pixels, corners, colours, radius=2)
    assert pixels[20, 20].tolist() == [200, 200, 200]
    assert pixels[10, 20].tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("metres", "expected"), [(1, 1), (1.9, 1), (2, 2), (4.99, 2), (70, 50), (0.31, 0.2)]
)
def test_round_length(metres: float, expected: float) -> None:
    assert round_length(metres) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(8.25, "8.25 s"), (59, "59 s"), (60, "1 min"), (200, "3 min 20 s"), (3900, "1 h 05 min")],
)
def test_duration(seconds: float, text: str) -> None:
    assert duration(seconds) == text


# The book's look


def middle(row: int, column: int, size: int, margin: int) -> tuple[int, int]:
    return round(margin + (column + 0.8) * size), round(margin + (row + 0.8) * size)


def test_book_colours() -> None:
    size, margin = 30, 10
    image = book_image(GridMap(LEVELS), robots=[(1, 1)], scale=size)
    assert image.size == (4 * size + 2 * margin, 3 * size + 2 * margin)
    assert image.getpixel(middle(0, 0, size, margin)) == WHITE
    assert image.getpixel(middle(1, 1, size, margin)) == ROBOT
    assert image.getpixel(middle(1, 2, size, margin)) == OBSTACLE
    assert image.getpixel(middle(1, 3, size, margin)) == OBSTACLE, "0.5 is no longer open"
    assert image.getpixel(middle(2, 1, size, margin)) == WHITE
    plain = book_image(GridMap(LEVELS), labels=False, scale=size)
    assert plain.getpixel(middle(0, 0, size, margin)) == UNKNOWN


def test_labels_are_in_every_cell() -> None:
    size, margin = 40, 13
    image = book_image(GridMap(LEVELS), scale=size)
    for row, column in np.ndindex(3, 4):
        left, top = margin + column * size + 6, margin + row * size + 6
        cell = np.asarray(image.crop((left, top, left + size - 12, top + size - 12)))
        assert cell.min() < 140, f"no letters in {row},{column}"


@pytest.mark.parametrize(
    ("probability", "text"), [(Q, "?"), (0.1, "0.1"), (1, "1"), (0, "0"), (0.126, "0.13")]
)
def test_probability_label(probability: float, text: str) -> None:
    assert probability_label(float(np.float32(probability))) == text


def test_frontier_marks_stand_on_edges_to_unknown_cells_only() -> None:
    cells = np.array([[Q, Q, Q], [1, 0.1, 0.1], [0.1, 0.1, Q]], dtype=np.float32)
    grid = GridMap(cells)
    size, margin = 40, 13
    image = book_image(grid, labels=False, frontier=frontier_cells(grid), scale=size)

    def edge(row: float, column: float) -> Any:
        """The middle of the edge above (row, column + 1/2) or left of (row + 1/2, column)."""
        return image.getpixel((round(margin + column * size), round(margin + row * size)))

    assert edge(1, 1.5) == RED
    assert edge(1, 2.5) == RED
    assert edge(2, 2.5) == RED
    assert edge(2.5, 2) == RED
    assert edge(1, 0.5) != RED, "an obstacle"
    assert edge(2, 1.5) != RED, "two known cells"
    assert edge(3, 0.5) != RED, "the edge of the map"


def test_frontier_of_fig_9_4() -> None:
    rows = """
        ? ? ? ? ? ? ? ? ? ? ? ? ? ? ? ?
        ? ? ? ? ? 1 ? ? ? ? ? .9 1 .9 ? ?
        ? ? ? ? ? 1 .1 .1 ? ? ? 1 .2 1 ? ?
        ? ? ? ? ? 1 .1 .1 .1 .1 .1 .1 .2 1 ? ?
        ? ? ? ? ? .9 .1 .1 .1 .1 .1 .1 .2 1 ? ?
        ? ? ? ? ? .1 .1 .1 .1 .1 .1 .1 .1 ? ? ?
        ? ? ? ? ? .1 .1 .1 .1 .1 .1 .1 .1 ? ? ?
        ? ? ? ? ? ? ? .2 .1 .1 .2 .2 .1 ? ? ?
        ? ? ? ? ? ? ? 1 1 .9 1 ? ? ? ? ?
    """
    words = [line.split() for line in rows.strip().splitlines()]
    cells = np.array([[Q if word == "?" else float(word) for word in line] for line in words])
    found = {(int(r), int(c)) for r, c in np.argwhere(frontier_cells(GridMap(cells)))}
    assert found == {
        (2, 6), (2, 7), (3, 8), (3, 9), (3, 10), (5, 5), (5, 12), (6, 5), (6, 6), (6, 12),
        (7, 7), (7, 11), (7, 12),
    }  # fmt: skip


def test_cells_passed() -> None:
    grid = GridMap(np.zeros((3, 4)))
    points = np.array([[0.5, 0.5], [0.9, 0.9], [1.5, 0.5], [9.0, 9.0], [1.5, 1.5], [0.5, 0.5]])
    assert cells_passed(grid, points) == [(2, 0), (2, 1), (1, 1), (2, 0)]


def test_time_runs_from_dark_to_bright() -> None:
    brightness = [sum(time_colour(part)) for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert brightness == sorted(brightness)
    assert math.dist(time_colour(0), time_colour(1)) > 200
