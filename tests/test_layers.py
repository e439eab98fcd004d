"""Imports point down only, and start-up stays light (architecture.md)."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "mapcli"

MAY_IMPORT = {
    "errors": set(),
    "model": {"errors", "model"},
    "algorithms": {"errors", "model", "algorithms"},
    "formats": {"errors", "model", "formats"},
    "commands": {"errors", "model", "algorithms", "formats", "commands"},
}
HEAVY = {"numba", "scipy", "gtsam", "shapely", "rosbags", "mcap", "PIL", "rich", "yaml", "numpy"}


def layer_of(file: Path) -> str:
    return file.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_layers(file: Path) -> set[str]:
    names = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names.append(node.module or "")
    return {name.split(".")[1] for name in names if name.startswith("mapcli.")}


MODULES = [file for file in PACKAGE.rglob("*.py") if layer_of(file) in MAY_IMPORT]


@pytest.mark.parametrize("file", MODULES, ids=lambda f: str(f.relative_to(PACKAGE)))
def test_imports_point_down_only(file: Path) -> None:
    assert imported_layers(file) <= MAY_IMPORT[layer_of(file)]


def modules_loaded_by(code: str) -> set[str]:
    out = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()[-1]
    return {name.split(".")[0] for name in out.split()}


def test_help_loads_nothing_heavy() -> None:
    code = "from mapcli.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass"
    assert not modules_loaded_by(code) & HEAVY


def test_model_loads_numpy_only() -> None:
    code = "import mapcli.model.grid, mapcli.model.scan, mapcli.model.log"
    assert modules_loaded_by(code) & HEAVY == {"numpy"}
