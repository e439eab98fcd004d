"""`import mapcli`: the verbs are there, lazy, typed, documented and listed."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from conftest import FIXTURES, ROOT

import mapcli
from mapcli import HOMES

VERBS = [name for name in HOMES if name[0].islower()]


def seen_by_type_checkers() -> dict[str, str]:
    tree = ast.parse((ROOT / "mapcli" / "__init__.py").read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    return {
        alias.name: node.module or ""
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_type_checkers_see_what_is_there() -> None:
    assert seen_by_type_checkers() == HOMES


@pytest.mark.parametrize("name", HOMES)
def test_every_name_is_defined_where_it_is_said_to_be(name: str) -> None:
    assert getattr(mapcli, name).__module__ == HOMES[name]
    assert name in dir(mapcli)


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_is_documented_and_typed(name: str) -> None:
    verb = getattr(mapcli, name)
    signature = inspect.signature(verb)
    assert verb.__doc__
    assert signature.return_annotation is not inspect.Signature.empty
    assert all(p.annotation is not p.empty for p in signature.parameters.values())


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        mapcli.fly  # noqa: B018


def test_importing_loads_nothing() -> None:
    code = "import sys, mapcli; print(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numpy", "numba", "click", "yaml"} & set(out.stdout.split())


def test_the_page_lists_every_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """`python docs/list_verbs.py` writes its tables again."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    assert (ROOT / "docs" / "python.md").read_text() == import_module("list_verbs").page()


@pytest.mark.slow
def test_what_the_page_shows_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "fixtures").symlink_to(FIXTURES)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "python.md").read_text()
    code = "".join(re.findall(r"(?<=```python\n).*?(?=```\n)", text, re.DOTALL))
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines() == [
        "509 scans, 2 loops closed",
        "28 steps, complete",
        "0.003 m",
        "intended, -15 deg: 59",
    ]
    assert (tmp_path / "apartment.pgm").exists()


def test_a_log_becomes_a_map_and_a_trajectory_that_can_be_evaluated() -> None:
    log = mapcli.open_log([str(FIXTURES / "corridor.mcap")])
    replayed = mapcli.replay(log.records(), damage=log.damage)
    assert (replayed.summary.used, replayed.summary.damage) == (50, {})
    assert len(replayed.trace.poses) == 50
    assert replayed.map.resolution == 0.05


def test_a_map_is_explored() -> None:
    world, known = (mapcli.load_map(FIXTURES / f"{name}.txt").grid for name in ("fig9_9", "fig9_4"))
    explored = mapcli.explore(world, [(5, 9)], known=known)
    assert [step.goal for step in explored.steps[:3]] == [(3, 9), (2, 9), (2, 7)]
    assert mapcli.plan(world, [(5, 9)], known=known).plan[0].goal == (3, 9)
