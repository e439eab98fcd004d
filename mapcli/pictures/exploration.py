"""An exploration as a picture: small maps in the book's look (Figs. 9.4 to 9.10), large ones as a
floor plan with a coloured path for each robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mapcli.model.exploration import Exploration
from mapcli.model.grid import GridMap
from mapcli.pictures.book_figure import BESIDE_LABELS, cell_size
from mapcli.pictures.drawing import (
    BLUE,
    FAINT_INK,
    INK,
    WHITE,
    Colour,
    draw_disc,
    draw_line,
    draw_text,
    font,
    round_length,
)
from mapcli.pictures.map_picture import (
    RobotPath,
    book_image,
    map_pixels,
    mark_cells,
    plan_image,
    png_bytes,
    window_of,
)

ROBOT_COLOURS: tuple[Colour, ...] = (
    BLUE, (222, 110, 20), (22, 138, 90), (150, 60, 170), (0, 140, 170), (150, 90, 40),
    (200, 60, 110), (110, 130, 20),
)  # fmt: skip
"""By the robot's number; they begin anew for the ninth."""

FRONTIER: Colour = (226, 61, 61)


def exploration_picture(exploration: Exploration, *, small: bool, low: float) -> bytes:
    """A PNG of what is known at the end, the paths that led there, and the frontier that is left.

    Args:
        small: in the book's look, with probabilities and `?`; else a floor plan.
        low: cells from this probability on are obstacles.
    """
    paths = [path_of(exploration, robot) for robot in range(len(exploration.robots))]
    if small:
        return png_bytes(book_look(exploration, paths, low))
    if len(paths) > 1:
        return png_bytes(robots_plan(exploration, paths))
    return png_bytes(
        plan_image(
            exploration.after,
            path=RobotPath(world_points(exploration.after, paths[0])),
            frontier=frontier_mask(exploration),
            caption=caption_of(exploration),
        )
    )


def path_of(exploration: Exploration, robot: int) -> NDArray[np.int32]:
    """All cells of a robot's path, its start first, shape (n, 2)."""
    steps = exploration.steps
    of_moves = np.repeat(steps.robot, np.diff(steps.path_end, prepend=0))
    return np.vstack([[exploration.robots[robot]], steps.path[of_moves == robot]])


def world_points(grid: GridMap, path: NDArray[np.int32]) -> NDArray[np.float64]:
    """Corners of a path as world points; cells on a straight line are left out."""
    steps = np.diff(path, axis=0)
    turns = np.ones(len(path), dtype=bool)
    turns[1:-1] = (steps[1:] != steps[:-1]).any(axis=1)
    return grid.world_of_cells(path[turns, 0], path[turns, 1])


def frontier_mask(exploration: Exploration) -> NDArray[np.bool_]:
    """Where the frontier is at the end, shape (rows, columns)."""
    mask = np.zeros(exploration.after.stored.shape, dtype=bool)
    for cell in exploration.frontier:
        mask[cell.cell] = True
    return mask


def caption_of(exploration: Exploration) -> str:
    summary = exploration.summary
    left = f", {summary.unreachable:,} frontier cells out of reach" if summary.unreachable else ""
    return (
        f"{summary.distance_m:,.1f} m in {summary.steps:,} steps, "
        f"coverage {summary.coverage:.1%}{left}"
    )


def book_look(
    exploration: Exploration, paths: Sequence[NDArray[np.int32]], low: float
) -> Image.Image:
    """The map with its numbers; one robot's path in the book's blue, several in their colours."""
    alone = len(paths) == 1
    image = book_image(
        exploration.after,
        frontier=frontier_mask(exploration),
        robots=[(int(path[-1, 0]), int(path[-1, 1])) for path in paths],
        path=paths[0].tolist() if alone else (),
        low=low,
    )
    return image if alone else draw_paths(image, exploration.after, paths)


def draw_paths(
    image: Image.Image, grid: GridMap, paths: Sequence[NDArray[np.int32]]
) -> Image.Image:
    """Several robots' paths over a picture in the book's look, side by side where they meet."""
    size = cell_size(grid, labels=True)
    margin = (image.width - grid.columns * size) / 2
    pixels = np.array(image)
    for robot, path in enumerate(paths):
        aside = BESIDE_LABELS + 0.08 * (robot - (len(paths) - 1) / 2)
        points = (path[:, ::-1].astype(np.float64) + 0.5 + aside) * size + margin
        draw_line(pixels, points, colours_of(robot, len(points)), size / 30)
    image = Image.fromarray(pixels)
    for robot, path in enumerate(paths):
        row, column = path[0]
        x, y = (column + 0.5) * size + margin, (row + 0.5) * size + margin
        draw_disc(image, x, y, size * 0.22, robot_colour(robot), WHITE, size / 30)
        draw_text(image, (x, y), str(robot + 1), round(size * 0.28), fill=WHITE, halo=None)
    return image


def robot_colour(robot: int) -> Colour:
    return ROBOT_COLOURS[robot % len(ROBOT_COLOURS)]


def colours_of(robot: int, count: int) -> NDArray[np.float64]:
    """The robot's colour so many times, shape (count, 3)."""
    return np.tile(np.array(robot_colour(robot), dtype=np.float64), (count, 1))


def robots_plan(exploration: Exploration, paths: Sequence[NDArray[np.int32]]) -> Image.Image:
    """A floor plan with the robots' paths in their colours, and a legend."""
    grid = exploration.after
    window = window_of(grid)
    pixels = map_pixels(window)
    mark_cells(pixels, window, np.argwhere(frontier_mask(exploration)), FRONTIER)
    unit = min(max(max(window.width, window.height) / 1600, 0.7), 2.5)
    lines = [window.pixels_of_world(world_points(grid, path)) for path in paths]
    for robot, points in enumerate(lines):
        draw_line(pixels, points, np.full((len(points), 3), 255.0), 3.0 * unit)
        draw_line(pixels, points, colours_of(robot, len(points)), 1.8 * unit)
    plan = Image.fromarray(pixels)
    for robot, points in enumerate(lines):
        x, y = (float(v) for v in points[0])
        draw_disc(plan, x, y, 14 * unit, robot_colour(robot), WHITE, 2 * unit)
        draw_text(plan, (x, y), str(robot + 1), round(18 * unit), fill=WHITE, halo=None)
    return with_legend(plan, exploration, window.zoom / grid.resolution, unit)


def with_legend(
    plan: Image.Image, exploration: Exploration, pixels_per_metre: float, unit: float
) -> Image.Image:
    """The plan on a sheet, with a scale bar, the robots' distances and the caption below."""
    margin, letters = round(40 * unit), round(24 * unit)
    sheet = Image.new(
        "RGB", (plan.width + 2 * margin, plan.height + margin + round(letters * 6)), WHITE
    )
    sheet.paste(plan, (margin, margin))
    draw = ImageDraw.Draw(sheet)
    frame = (margin - 1, margin - 1, margin + plan.width, margin + plan.height)
    draw.rectangle(frame, outline=FAINT_INK)
    y = margin + plan.height + letters * 1.5
    metres = round_length(max(plan.width, 300 * unit) / pixels_per_metre / 5)
    end = margin + metres * pixels_per_metre
    draw.rectangle((margin, y, end, y + 3 * unit), fill=INK)
    draw_text(sheet, (end + letters / 2, y), f"{metres:g} m", letters, anchor="lm", halo=None)
    x = sheet.width - margin
    for robot in reversed(range(len(exploration.robots))):
        text = f"robot {robot + 1}"
        x -= round(font(letters).getlength(text) + letters * 1.6)
        draw_disc(sheet, x, y, 9 * unit, robot_colour(robot), WHITE, 0)
        draw_text(sheet, (x + letters * 0.7, y), text, letters, anchor="lm", halo=None)
    below = sheet.height - margin * 0.8
    caption = caption_of(exploration)
    draw_text(sheet, (margin, below), caption, letters, anchor="ls", fill=FAINT_INK, halo=None)
    return sheet
