"""Imports point down only, and start-up stays light: the rules of `docs/architecture.md`."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "mapcli"

RULES = """
errors ->
memory -> errors
notices ->
startup ->
version ->
model -> errors
algorithms -> startup notices memory
algorithms.scans -> model
algorithms.similarity -> algorithms.scans
algorithms.slam -> algorithms.similarity
algorithms.sessions -> algorithms.slam
algorithms.evaluation -> algorithms.sessions
algorithms.maps -> model
algorithms.simulation -> algorithms.scans algorithms.maps
algorithms.exploration -> algorithms.maps
formats -> model version memory
formats.maps -> formats
formats.logs -> formats
formats.documents -> formats.maps formats.logs
pictures -> formats.documents
commands -> pictures algorithms.evaluation algorithms.simulation algorithms.exploration
cli ->
"""
"""Room -> the rooms that it may import from; what these may import, it may too."""

ALL_ALGORITHMS = "algorithms", "startup", "notices", "memory", "model"
"""Every room of `algorithms` may import how loops are compiled, and records."""

HEAVY = {"numba", "scipy", "gtsam", "shapely", "rosbags", "mcap", "PIL", "yaml", "numpy",
         "google"}  # fmt: skip


def rules() -> dict[str, set[str]]:
    """Room -> every room that it may import from, itself included."""
    direct = {room: names.split() for room, _, names in
              (line.partition(" ->") for line in RULES.strip().splitlines())}  # fmt: skip
    allowed: dict[str, set[str]] = {}

    def reach(room: str) -> set[str]:
        if room not in allowed:
            common = ALL_ALGORITHMS if room.startswith("algorithms.") else ()
            allowed[room] = {room}.union(*(reach(name) for name in (*direct[room], *common)))
        return allowed[room]

    return {room: reach(room) for room in direct}


MAY_IMPORT = rules()


def room_of(module: str) -> str:
    """`mapcli.algorithms.slam._kernels.tiles` -> `algorithms.slam`; the whole package is `cli`."""
    parts = module.split(".")[1:]
    names = (".".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((name for name in names if name in MAY_IMPORT), "cli")


def module_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(file: Path) -> set[str]:
    """The modules of mapcli that a module imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                is_module = (PACKAGE.parent / (inner.replace(".", "/") + ".py")).exists()
                names.add(inner if is_module else module)
    return {name for name in names if name.split(".")[0] == "mapcli"}


MODULES = {module_of(file): file for file in sorted(PACKAGE.rglob("*.py"))}
BELOW = {name: file for name, file in MODULES.items() if room_of(name) != "cli"}


@pytest.mark.parametrize("module", BELOW)
def test_a_room_imports_from_the_rooms_below_it_only(module: str) -> None:
    imported = {room_of(name) for name in imports_of(BELOW[module]) if name != "mapcli"}
    assert imported <= MAY_IMPORT[room_of(module)]


@pytest.mark.parametrize("module", BELOW)
def test_kernels_are_used_by_their_own_room_only(module: str) -> None:
    kernels = [name for name in imports_of(BELOW[module]) if "._kernels" in name]
    assert all(room_of(name) == room_of(module) for name in kernels)


@pytest.mark.parametrize(("reader", "others"), [("carmen", "ros mcap"), ("ros", "carmen mcap")])
def test_a_reader_of_logs_imports_no_other(reader: str, others: str) -> None:
    logs = "mapcli.formats.logs."
    own = [file for name, file in MODULES.items() if name.startswith(logs + reader)]
    imported = {name.removeprefix(logs) for file in own for name in imports_of(file)}
    assert own
    assert not [name for name in imported if name.startswith(tuple(others.split()))]


@pytest.mark.parametrize("module", [name for name in BELOW if room_of(name) != "commands"])
def test_functions_outside_commands_have_seven_parameters_at_most(module: str) -> None:
    for node in ast.walk(ast.parse(BELOW[module].read_text())):
        if isinstance(node, ast.FunctionDef):
            parameters = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            own = [one for one in parameters if one.arg not in ("self", "cls")]
            assert len(own) <= 7, node.name


def test_the_rules_have_no_circle() -> None:
    for room, allowed in MAY_IMPORT.items():
        assert all(room not in MAY_IMPORT[other] for other in allowed - {room})


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


def test_protobuf_is_loaded_for_logs_in_protobuf_only() -> None:
    log = PACKAGE.parent / "fixtures" / "corridor.mcap"
    code = f"import mapcli\nnext(mapcli.open_log({str(log)!r}).records())"
    assert not modules_loaded_by(code) & {"google", "mcap_protobuf"}


def test_commands_print_at_one_place() -> None:
    own = [file for name, file in MODULES.items() if name.startswith("mapcli.commands.")]
    printing = {file.name for file in own if "click.echo(" in file.read_text()}
    assert printing == {"_say.py", "similarity_table.py"}  # the latter prints data
