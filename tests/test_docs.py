"""What `docs/architecture.md` says of the tree is so."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest
from conftest import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text()
PLACES = re.findall(r"`((?:[a-z]\w*/)+\w*(?:\.py)?)`", PAGE)
SYMBOLS = re.findall(r"`((?:[a-z]\w*/)+\w+\.py)`, `([\w.]+)`", PAGE.split("## Where is")[1])


@pytest.mark.parametrize("place", sorted(set(PLACES)))
def test_every_place_is_there(place: str) -> None:
    assert any((folder / place).exists() for folder in (ROOT, ROOT / "mapcli"))


@pytest.mark.parametrize(("file", "symbol"), SYMBOLS)
def test_every_symbol_is_where_it_is_said_to_be(file: str, symbol: str) -> None:
    found = import_module("mapcli." + file.removesuffix(".py").replace("/", "."))
    for name in symbol.split("."):
        fields = getattr(found, "__annotations__", {})
        found = fields[name] if name in fields else getattr(found, name)


@pytest.mark.slow
def test_the_picture_can_be_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`python docs/draw_architecture.py`: every room has its place, and there is no circle."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    drawing = import_module("draw_architecture")
    rooms, uses = drawing.read_package()
    assert set(rooms) == set(drawing.COLUMNS)
    assert drawing.draw(rooms, uses).width == drawing.WIDTH
