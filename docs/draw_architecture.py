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

SHARED_BY_ALL = (
    "errors",
    "startup",
    "notices",
    "memory",
    "version",
    "cli",
    "__main__",
    "algorithms.compiling",
    "algorithms.kernel_cache",
)
"""Modules that belong to no room: all may import them, but nobody `cli`."""

COLUMNS = {
    "commands": 2.0, "verbs": 2.0,
    "algorithms.exploration": 0.0, "algorithms.evaluation": 1.0, "algorithms.sessions": 1.0,
    "algorithms.slam": 1.0,
    "algorithms.similarity": 1.0, "algorithms.scans": 1.0,
    "algorithms.simulation": 2.0, "algorithms.maps": 2.0,
    "pictures": 3.5, "formats.documents": 3.5, "formats.maps": 3.0, "formats.logs": 4.0,
    "formats": 3.5, "model": 2.0,
}  # fmt: skip
"""From left to right, so that few arrows cross; the floors follow from the imports."""

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
    """`mapcli.formats.logs.ros.decode` -> `formats.logs`; None for what all share."""
    parts = module.split(".")[1:]
    if not parts:
        return "verbs"
    if ".".join(parts) in SHARED_BY_ALL:
        return None
    if parts == ["algorithms"]:
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


def verbs() -> Iterable[str]:
    """The modules that `mapcli/__init__.py` imports from when a verb is first used."""
    for node in ast.walk(ast.parse((PACKAGE / "__init__.py").read_text())):
        if isinstance(node, ast.Dict):
            yield from (value.value for value in node.values if isinstance(value, ast.Constant))


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
    uses["verbs"] |= {room for home in verbs() if (room := room_of(home))}
    uses["commands"].add("verbs")
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


def floors(uses: dict[str, set[str]]) -> dict[str, int]:
    """The floor of each room, counted from the top: one below the lowest that imports from it."""

    def depth(name: str) -> int:
        above = (other for other, imports in uses.items() if name in imports)
        return 1 + max((depth(other) for other in above), default=-1)

    return {name: depth(name) for name in uses}


def places(uses: dict[str, set[str]]) -> dict[str, tuple[int, int]]:
    """The top left corner of each box."""
    step = (WIDTH - 2 * MARGIN - BOX_WIDTH) / max(COLUMNS.values())
    return {
        name: (MARGIN + round(COLUMNS[name] * step), MARGIN + floor * FLOOR_HEIGHT)
        for name, floor in floors(uses).items()
    }


def draw(rooms: dict[str, Room], uses: dict[str, set[str]]) -> Image.Image:
    """The picture."""
    at = places(uses)
    height = max(y for _, y in at.values()) + BOX_HEIGHT + MARGIN
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
    size = f"{room.modules} module{'s' * (room.modules > 1)}, {room.lines:,} lines"
    pen.text((x + 12, y + 33), size, BORDER, ImageFont.load_default(13))
    for k, line in enumerate(textwrap.wrap(room.text.replace("`", ""), 34)[:4]):
        pen.text((x + 12, y + 53 + 15 * k), line, INK, ImageFont.load_default(13))


def main() -> None:
    rooms, uses = read_package()
    draw(rooms, uses).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
