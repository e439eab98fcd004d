"""Time and memory of the map commands on a map of 20,000 x 20,000 cells, as whole commands.

    python benchmarks/maps.py [SIDE]

Makes a map of rooms, corridors and noise with an unknown border in a temporary folder, runs the
installed command on it, and prints seconds and peak resident memory of each.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RUNS = (
    "info big.yaml",
    "convert big.yaml pair.yaml",
    "convert big.yaml grey.png",
    "convert grey.png again.yaml --resolution 0.05",
    "convert big.yaml scale.yaml --mode scale",
    "convert scale.yaml raw.yaml --mode raw",
    "convert big.yaml plain.pgm --plain",
    "convert plain.pgm again.yaml",
    "convert big.yaml cells.txt",
    "convert cells.txt again.yaml",
    "transform big.yaml known.yaml --crop known",
    "transform big.yaml box.yaml --crop -100,-100,300,300",
    "transform big.yaml turned.yaml --rotate 90",
    "transform big.yaml half.yaml --resample 0.1",
    "transform big.yaml slanted.yaml --rotate 10",
    "render big.yaml --png plan.png",
)


def make_map(folder: Path, side: int) -> None:
    """Rooms of 5 x 5 m with doors, single stray cells, and unknown around."""
    rng = np.random.default_rng(0)
    border = side // 20
    free = np.full(side, 254, dtype=np.uint8)
    free[::100] = 0
    with (folder / "big.pgm").open("wb") as file:
        file.write(b"P5\n%d %d\n255\n" % (side, side))
        for row in range(side):
            cells = free.copy()
            if row % 100 == 0:
                cells[:] = 0
            cells[rng.integers(0, side, side // 20)] = rng.choice([0, 205, 254], side // 20)
            cells[:border] = cells[-border:] = 205
            if not border <= row < side - border:
                cells[:] = 205
            file.write(cells.tobytes())
    corner = -side * 0.05 / 2
    (folder / "big.yaml").write_text(
        f"image: big.pgm\nresolution: 0.05\norigin: [{corner}, {corner}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def run(folder: Path, arguments: str) -> tuple[float, float, float]:
    """Wall seconds, CPU seconds and the peak memory in MB of a command."""
    command = [Path(sys.executable).parent / "mapcli", *arguments.split(), "-q"]
    start = time.perf_counter()
    process = subprocess.Popen(command, cwd=folder)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{arguments}: exit status {status}")
    wall = time.perf_counter() - start
    return wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    side = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    with tempfile.TemporaryDirectory() as scratch:
        make_map(Path(scratch), side)
        print("| command | wall s | CPU s | peak MB |\n|---|---|---|---|")
        for arguments in RUNS:
            wall, cpu, memory = run(Path(scratch), arguments)
            print(f"| `{arguments}` | {wall:.1f} | {cpu:.1f} | {memory:.0f} |", flush=True)


if __name__ == "__main__":
    main()
