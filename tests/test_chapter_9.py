"""The walk through chapter 9 says what is so: its commands run and print what it shows.

Run as a program, this file writes the real output of every command into the page, and the
pictures that they draw beside it, small and with few colours:

    python tests/test_chapter_9.py
"""

from __future__ import annotations

import io
import re
import shlex
import tempfile
from pathlib import Path

import pytest
from conftest import ROOT
from PIL import Image
from test_help import parsed
from test_readme import CONSOLE, README, commands, masked, with_real_output

PAGE = ROOT / "docs" / "chapter-9.md"
TEXT = PAGE.read_text()
FOLDER = PAGE.parent / "chapter-9"
SHOWN = re.findall(r"!\[[^]]+\]\(chapter-9/([\w-]+\.png)\)", TEXT)

DRAWN = {"book.png": "book/map.png", "update.png": "turns/scan-00038-map.png"}
"""Picture of the page -> the file that a command draws, where it has another name."""

MOST_BYTES = 400_000
WIDEST = 800
COLOURS = 64


def small(picture: bytes) -> bytes:
    """A picture as the page shows it: a palette, and at most so many pixels wide."""
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    if image.width > WIDEST:
        size = WIDEST, round(image.height * WIDEST / image.width)
        image = image.resize(size, Image.Resampling.LANCZOS)
    out = io.BytesIO()
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()


@pytest.mark.slow
def test_commands_print_what_is_shown(tmp_path: Path) -> None:
    shown, real = masked(TEXT), masked(with_real_output(str(tmp_path), TEXT))
    assert shown.splitlines() == real.splitlines()
    for name in SHOWN:
        drawn, kept = ((path / DRAWN.get(name, name)) for path in (tmp_path, FOLDER))
        with Image.open(drawn) as new, Image.open(FOLDER / name) as old:
            assert old.width == min(new.width, WIDEST), kept


def test_pictures_are_small_and_all_are_shown() -> None:
    kept = {path.name: len(path.read_bytes()) for path in FOLDER.iterdir()}
    assert set(SHOWN) == set(kept)
    assert sum(kept.values()) < MOST_BYTES


def test_every_command_line_is_valid() -> None:
    lines = [line for block in CONSOLE.findall(TEXT) for line in commands(block)]
    parts = [part for line in lines for part in re.split(r" && | \| ", line)]
    mine = [shlex.split(part)[1:] for part in parts if part.startswith("mapcli ")]
    assert len(mine) > 40
    for name, *arguments in mine:
        assert parsed(name, arguments).params


def test_every_figure_and_activity_is_there() -> None:
    table = TEXT.partition("**What cannot")[0]
    named = set(re.findall(r"Figs?\. 9\.(\d+)", table))
    for first, last in re.findall(r"9\.(\d+) (?:to|and) 9\.(\d+)", table):
        named |= {str(k) for k in range(int(first), int(last) + 1)} if int(last) - int(first) > 2 \
            else {first, last}  # fmt: skip
    assert {str(k) for k in range(1, 24)} <= named
    assert all(f"Activity 9.{k}" in table and f"### Activity 9.{k}:" in TEXT for k in range(1, 6))


def test_the_table_leads_to_the_sections() -> None:
    heads = re.findall(r"^#+ (.+)$", TEXT, re.MULTILINE)
    places = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}
    links = re.findall(r"\]\(#([^)]+)\)", TEXT)
    assert len(links) > 10
    assert set(links) <= places


def test_the_readme_links_the_walk_in_its_first_screen() -> None:
    assert "(docs/chapter-9.md)" in "\n".join(README.splitlines()[:10])


def rewrite() -> None:
    """Put the real outputs and the real pictures in their places."""
    with tempfile.TemporaryDirectory() as folder:
        PAGE.write_text(with_real_output(folder, TEXT))
        FOLDER.mkdir(exist_ok=True)
        for name in SHOWN:
            drawn = Path(folder, DRAWN.get(name, name))
            (FOLDER / name).write_bytes(small(drawn.read_bytes()))


if __name__ == "__main__":
    rewrite()
