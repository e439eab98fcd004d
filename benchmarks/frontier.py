"""Speed of `mapcli frontier`, as whole commands.

    python benchmarks/frontier.py ../shared/maps [PART...]

Parts: depot, radius, robots, slope, trace, start-up, literal (all of them without any). Every
command runs twice, and the second run counts: it has the compiled loops cached. Depot is a
warehouse of 604x307 cells. For `slope` and `trace` it is laid out as tiles, with a way 8 cells
wide along the middle of each tile, across and along, which makes one hall of all of them.
`literal` runs the reference of the tests, which recomputes everything at each step, and would
take days on depot: it is timed on its first steps and on more of them later on, each standing
for all steps around it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from data import find_maps

from mapcli import ExplorationParameters, GridMap, SaveOptions, explore, load_map
from mapcli.formats.maps.save import dump_map
from mapcli.model.exploration_replay import ExplorationReplay

FIXTURES = Path(__file__).parent.parent / "fixtures"
MAPCLI = Path(sys.executable).parent / "mapcli"
FOUR = ("0,0", "1,0", "0,1", "1,1")
"""Places in metres: four robots side by side."""


class Summary(NamedTuple):
    steps: int
    time_steps: int
    metres: float


def run(world: Path, *options: str) -> tuple[Summary, float, float, float]:
    """Explore; returns the summary, wall seconds and CPU seconds of the second run, and MB."""
    with tempfile.TemporaryFile("w+") as said:
        command = [str(MAPCLI), "frontier", str(world), *options]
        timed(command)
        wall, cpu, megabytes = timed(command, said)
        said.seek(0)
        return summary_of(said.read()), wall, cpu, megabytes


def summary_of(text: str) -> Summary:
    """What the command says at its end."""
    numbers = re.findall(r"([\d,.]+) (step|time step|m)s?\b", text)
    of = {unit: float(number.replace(",", "")) for number, unit in numbers}
    return Summary(int(of["step"]), int(of["time step"]), of["m"])


def timed(command: list[str], said: IO[str] | int = subprocess.DEVNULL) -> tuple[float, ...]:
    """Wall seconds, CPU seconds and the peak memory in MB of a command."""
    start = time.perf_counter()
    # An installed command has its bytecode cached, whatever this shell wants.
    usual = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen(command, stdout=said, stderr=subprocess.DEVNULL, env=usual)
    _, status, used = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status:
        raise SystemExit(f"{' '.join(command)}: exit status {status}")
    return wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def row(label: str, world: Path, *options: str) -> None:
    summary, wall, cpu, megabytes = run(world, *options)
    print(
        f"| {label} | {summary.steps:,} | {summary.time_steps:,} "
        f"| {summary.metres:,.0f} | {wall:.2f} | {cpu:.2f} | {megabytes:.0f} |",
        flush=True,
    )


def depot(maps: Path) -> None:
    world = maps / "depot.yaml"
    for strategy in ("nearest", "priority", "gain"):
        at = ("--robot-xy", "0,0", "--strategy", strategy)
        row(f"{strategy}, eight neighbours", world, *at)
        row(f"{strategy}, range 100", world, *at, "--sensor-range", "100")


def radius(maps: Path) -> None:
    for cells in (1, 20, 100):
        options = ("--robot-radius", "0.2", "--sensor-range", str(cells))
        row(f"radius 0.2 m, range {cells}", maps / "depot.yaml", "--robot-xy", "0,0", *options)


def robots(maps: Path) -> None:
    for count in (1, 2, 4):
        at = [word for place in FOUR[:count] for word in ("--robot-xy", place)]
        row(f"robots: {count}", maps / "depot.yaml", *at)


def slope(maps: Path) -> None:
    tile = load_map(maps / "depot.yaml").grid
    for side in (500, 1000, 2000, 4000):
        with tempfile.TemporaryDirectory() as folder:
            world = Path(folder) / "world.yaml"
            write_map(world, tiled(tile, side))
            at = ("--robot", f"{tile.rows // 2},{tile.columns // 2}")
            summary, wall, cpu, megabytes = run(world, *at)
            fixed = run(world, *at, "--max-steps", "0")[2]
            each = 1e6 * (cpu - fixed) / summary.steps
            print(
                f"| {side**2 / 1e6:g} | {summary.steps:,} | {wall:.1f} | {cpu:.1f} "
                f"| {fixed:.1f} | {each:.2f} | {megabytes:,.0f} |",
                flush=True,
            )


def trace(maps: Path) -> None:
    """What `--json` takes on top of exploring."""
    tile = load_map(maps / "depot.yaml").grid
    for side in (1000, 2000):
        with tempfile.TemporaryDirectory() as folder:
            world, file = Path(folder) / "world.yaml", Path(folder) / "trace.json"
            write_map(world, tiled(tile, side))
            at = ("--robot", f"{tile.rows // 2},{tile.columns // 2}")
            summary, _, without, _ = run(world, *at)
            _, wall, cpu, megabytes = run(world, *at, "--json", str(file))
            print(
                f"| {summary.steps:,} | {file.stat().st_size / 1e6:.0f} | {cpu - without:.1f} "
                f"| {wall:.1f} | {megabytes:,.0f} |",
                flush=True,
            )


def tiled(tile: GridMap, side: int) -> GridMap:
    """A square map of tiles, open along the middle of each."""
    cells = tile.cells.copy()
    middle = slice(tile.rows // 2 - 4, tile.rows // 2 + 4)
    cells[middle] = 0
    middle = slice(tile.columns // 2 - 4, tile.columns // 2 + 4)
    cells[:, middle] = 0
    times = -(-side // tile.rows), -(-side // tile.columns)
    return GridMap(np.tile(cells, times)[:side, :side], tile.resolution)


def write_map(file: Path, grid: GridMap) -> None:
    for name, data in dump_map(grid, str(file), SaveOptions("trinary")).items():
        (file.parent / Path(name).name).write_bytes(data)


def start_up(_: Path) -> None:
    book = [str(FIXTURES / "fig9_9.txt"), "--known", str(FIXTURES / "fig9_4.txt")]
    commands = {
        "mapcli frontier fig9_9.txt": [str(MAPCLI), "frontier", *book, "--robot", "5,9"],
        "mapcli --help": [str(MAPCLI), "--help"],
        'python -c "import click, numpy"': [sys.executable, "-c", "import click, numpy"],
    }
    for label, command in commands.items():
        times = sorted(timed(command)[:2] for _ in range(11))
        print(f"| {label} | {times[0][0]:.3f} | {times[5][0]:.3f} | {times[5][1]:.3f} |")


def literal(maps: Path) -> None:
    """Time steps of the literal algorithm from moments of our own exploration on, whose steps are
    the same (the tests say so on small maps, and here they are compared)."""
    sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
    from support.literal_frontier import LiteralFrontier  # type: ignore[import-not-found]

    world = load_map(maps / "depot.yaml").grid
    (start,) = map(tuple, world.cells_of_world([(0.0, 0.0)]).tolist())
    began = time.perf_counter()
    ours = explore(world, [start], ExplorationParameters())
    print(f"ours: {time.perf_counter() - began:.2f} s for {len(ours.steps):,} steps")
    replay, moments, seconds = (
        ExplorationReplay(ours),
        np.linspace(1, len(ours.steps) - 3, 8, dtype=int),
        [],
    )
    for moment in moments.tolist():
        replay.advance(moment)
        at = ours.steps[moment].origin
        run = LiteralFrontier(world.cells, [at], replay.grid.cells, max_steps=2)
        sensed = ours.steps.unknowable[: ours.steps.unknowable_end[moment - 1]]
        run.sensed = set(map(tuple, sensed.tolist()))
        began = time.perf_counter()
        run.run()
        seconds.append((time.perf_counter() - began) / 2)
        assert [step["goal"] for step in run.steps] == [
            step.goal for step in ours.steps[moment : moment + 2]
        ]
        print(f"literal, steps from {moment:,}: {seconds[-1]:.2f} s each", flush=True)
    total = float(np.trapezoid(seconds, moments))
    print(f"literal, all steps: {total:,.0f} s")


PARTS: dict[str, Callable[[Path], None]] = {
    "depot": depot, "radius": radius, "robots": robots, "slope": slope, "trace": trace,
    "start-up": start_up, "literal": literal,
}  # fmt: skip


def main() -> None:
    if len(sys.argv) < 2 or not {*sys.argv[2:]} <= {*PARTS}:
        sys.exit(f"Error: expected a folder with depot.yaml, then any of {', '.join(PARTS)}")
    folder = find_maps(Path(sys.argv[1]), ["depot"])["depot"].parent
    for part in sys.argv[2:] or PARTS:
        print(f"\n{part}", flush=True)
        PARTS[part](folder)


if __name__ == "__main__":
    main()
