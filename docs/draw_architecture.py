"""Draws `docs/architecture.png`: the rooms of the package and who imports whom, from the imports.

    python docs/draw_architecture.py

A box is a folder of the package (or a module at its top), with the first line of its docstring
and how many modules and lines it has. An arrow says that modules of one room import from another;
arrows that follow from others are left out.
"""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from PIL import Image, ImageDraw, ImageFont

PACKAGE = Path(__file__).parents[1] / "mapcli"
PICTURE = Path(__file__).with_name("architecture.png")

APART = "formats", "algorithms"
"""Folders whose folders are rooms of their own."""

UNDER_ALL = "errors", "startup", "version", "cli", "__main__"
"""Modules that belong to no room: everybody may import `errors`, nobody `cli`."""

WIDTH, BOX_WIDTH, BOX_HEIGHT, FLOOR_HEIGHT, MARGIN = 1680, 250, 118, 190, 30
INK, PAPER, BORDER, ARROW = (30, 30, 34), (255, 255, 255), (90, 100, 120), (110, 125, 150)
COLOURS = {"algorithms": (226, 238, 250), "formats": (247, 238, 222), "pictures": (236, 246, 228)}
PLAIN = (242, 242, 244)


class Room(NamedTuple):
    """What a box shows."""

    name: str
    text: str
    modules: int
    lines: int


def room_of(module: str) -> str | None:
    """`mapcli.formats.logs.ros.decode` -> `formats.logs`; None for what is under all."""
    parts = module.split(".")[1:]
    if not parts:
        return "verbs"
    if parts[0] in UNDER_ALL:
        return None
    inner = parts[:2] if parts[0] in APART and (PACKAGE / Path(*parts[:2])).is_dir() else parts[:1]
    return ".".join(inner)


def module_name(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(file: Path) -> Iterable[str]:
    """Full names of what a module imports from the package."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                path = PACKAGE.parent / inner.replace(".", "/")
                is_module = path.is_dir() or path.with_suffix(".py").exists()
                yield inner if is_module else node.module


def read_package() -> tuple[dict[str, Room], dict[str, set[str]]]:
    """The rooms by name, and for each the rooms that it imports from."""
    files: dict[str, list[Path]] = {}
    uses: dict[str, set[str]] = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        room = room_of(module_name(file))
        if room is None:
            continue
        files.setdefault(room, []).append(file)
        names = (name for name in imported(file) if name.split(".")[0] == "mapcli")
        uses.setdefault(room, set()).update(other for name in names if (other := room_of(name)))
    rooms = {}
    for name, own in files.items():
        head = PACKAGE / ("" if name == "verbs" else name.replace(".", "/")) / "__init__.py"
        text = (ast.get_docstring(ast.parse(head.read_text())) or "").splitlines() or [""]
        count = sum(len(file.read_text().splitlines()) for file in own)
        rooms[name] = Room(name, text[0], len(own), count)
    return rooms, {name: others - {name} for name, others in uses.items()}


def below(name: str, uses: dict[str, set[str]]) -> set[str]:
    """Every room that a room imports from, and what these import from."""
    return uses[name].union(*(below(other, uses) for other in uses[name]))


def reduced(uses: dict[str, set[str]]) -> dict[str, set[str]]:
    """The arrows that do not follow from others."""
    return {
        name: {one for one in others if not any(one in below(two, uses) for two in others)}
        for name, others in uses.items()
    }


def floors(uses: dict[str, set[str]]) -> list[list[str]]:
    """Rooms by the length of the longest way down from them, the lowest floor first."""

    def height(name: str) -> int:
        return 1 + max((height(other) for other in uses[name]), default=-1)

    by_height: dict[int, list[str]] = {}
    for name in sorted(uses):
        by_height.setdefault(height(name), []).append(name)
    return [by_height[key] for key in sorted(by_height)]


def places(storeys: list[list[str]]) -> dict[str, tuple[int, int]]:
    """The top left corner of each box."""
    found = {}
    for level, names in enumerate(reversed(storeys)):
        gap = (WIDTH - len(names) * BOX_WIDTH) / (len(names) + 1)
        for k, name in enumerate(names):
            left = round(gap + k * (BOX_WIDTH + gap))
            found[name] = left, MARGIN + level * FLOOR_HEIGHT
    return found


def draw(rooms: dict[str, Room], uses: dict[str, set[str]]) -> Image.Image:
    """The picture."""
    storeys = floors(uses)
    at = places(storeys)
    height = 2 * MARGIN + (len(storeys) - 1) * FLOOR_HEIGHT + BOX_HEIGHT
    image = Image.new("RGB", (WIDTH, height), PAPER)
    pen = ImageDraw.Draw(image)
    for name, others in reduced(uses).items():
        for k, other in enumerate(sorted(others)):
            draw_arrow(pen, at[name], at[other], (k + 1) / (len(others) + 1))
    for name, room in rooms.items():
        draw_box(pen, at[name], room)
    return image


def draw_arrow(
    pen: ImageDraw.ImageDraw, above: tuple[int, int], under: tuple[int, int], share: float
) -> None:
    """From the bottom edge of one box to the top edge of another."""
    start = above[0] + share * BOX_WIDTH, above[1] + BOX_HEIGHT
    end = under[0] + BOX_WIDTH / 2 + 30 * (share - 0.5), under[1]
    pen.line([start, (end[0], end[1] - 8)], ARROW, 2)
    pen.polygon([end, (end[0] - 6, end[1] - 11), (end[0] + 6, end[1] - 11)], ARROW)


def draw_box(pen: ImageDraw.ImageDraw, place: tuple[int, int], room: Room) -> None:
    x, y = place
    colour = COLOURS.get(room.name.split(".")[0], PLAIN)
    pen.rounded_rectangle((x, y, x + BOX_WIDTH, y + BOX_HEIGHT), 8, colour, BORDER, 2)
    title = "mapcli (the verbs)" if room.name == "verbs" else room.name.replace(".", "/")
    pen.text((x + 12, y + 8), title, INK, ImageFont.load_default(19))
    size = f"{room.modules} modules, {room.lines:,} lines"
    pen.text((x + 12, y + 33), size, BORDER, ImageFont.load_default(13))
    for k, line in enumerate(textwrap.wrap(room.text, 38)[:4]):
        pen.text((x + 12, y + 53 + 15 * k), line, INK, ImageFont.load_default(13))


def main() -> None:
    rooms, uses = read_package()
    draw(rooms, uses).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
