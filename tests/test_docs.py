"""What `docs/architecture.md`, `docs/promises.md` and `SECURITY.md` say of the tree is so."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest
from conftest import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text()
PLACES = re.findall(r"`((?:[a-z]\w*/)+\w*(?:\.py)?)`", PAGE)
SYMBOLS = re.findall(r"`((?:[a-z]\w*/)+\w+\.py)`, `([\w.]+)`", PAGE.split("## Where is")[1])
TESTED_IN = re.findall(
    r"`((?:tests|benchmarks|\.ci)/[\w./]+)`", (ROOT / "docs/promises.md").read_text()
)
LIMITS = re.findall(
    r"^\| .* \| ([\d,]+) \| `([\w/]+)\.py`, `(\w+)` \|$", (ROOT / "SECURITY.md").read_text(), re.M
)


@pytest.mark.parametrize("place", sorted(set(PLACES)))
def test_every_place_is_there(place: str) -> None:
    assert any((folder / place).exists() for folder in (ROOT, ROOT / "mapcli"))


@pytest.mark.parametrize(("file", "symbol"), SYMBOLS)
def test_every_symbol_is_where_it_is_said_to_be(file: str, symbol: str) -> None:
    found = import_module("mapcli." + file.removesuffix(".py").replace("/", "."))
    for name in symbol.split("."):
        fields = getattr(found, "__annotations__", {})
        found = fields[name] if name in fields else getattr(found, name)


@pytest.mark.parametrize("file", sorted(set(TESTED_IN)))
def test_what_keeps_a_promise_is_there(file: str) -> None:
    path = ROOT / file
    assert path.is_file()
    assert not file.startswith("tests/") or "def test_" in path.read_text()


def test_every_promise_is_tested_somewhere() -> None:
    tables = (ROOT / "docs" / "promises.md").read_text().split("## Where it was run")[0]
    rows = [line for line in tables.splitlines() if line.startswith("| ")]
    promises = [line for line in rows if not line.startswith("| promise |")]
    assert len(promises) > 20
    for line in promises:
        assert re.search(r"`(tests|\.ci)/", line.split(" | ")[-1]), line


@pytest.mark.parametrize(("value", "module", "name"), LIMITS)
def test_limits_are_what_they_are_said_to_be(value: str, module: str, name: str) -> None:
    found = getattr(import_module("mapcli." + module.replace("/", ".")), name)
    assert int(value.replace(",", "")) == found


@pytest.mark.slow
def test_the_picture_can_be_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`python docs/draw_architecture.py`: every room has its place, and there is no circle."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    drawing = import_module("draw_architecture")
    rooms, uses = drawing.read_package()
    assert set(rooms) == set(drawing.COLUMNS)
    assert drawing.draw(rooms, uses).width == drawing.WIDTH


def test_every_field_is_on_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """`python docs/list_fields.py` writes its tables again."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    assert (ROOT / "docs" / "formats.md").read_text() == import_module("list_fields").page()
