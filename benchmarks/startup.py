"""What each trick of `mapcli/startup.py` saves, as processor time of a whole command.

    python benchmarks/startup.py [RUNS]

Runs `mapcli slam-replay` on the corridor with and without each trick, in turn, RUNS (21) times
after a run that compiles, and prints the median of what leaving it out costs, in milliseconds.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

CORRIDOR = Path(__file__).parents[1] / "fixtures" / "corridor.mcap"

LEFT_OUT = {
    "nothing": "",
    "keep_blas_single_threaded": "startup.keep_blas_single_threaded = lambda: None",
    "import_module": "startup.import_module = importlib.import_module",
    "import_numba_without_scipy": "startup.import_numba_without_scipy = lambda: None",
    "leave": "startup.leave = sys.exit",
}


def cpu_ms(patch: str, folder: str) -> float:
    """User and system time of one run of the command with a patch of `mapcli.startup`."""
    code = (
        "import importlib, sys\nfrom mapcli import startup\n"
        f"{patch}\nfrom mapcli.__main__ import run\n"
        f"sys.argv = ['mapcli', 'slam-replay', '-q', {str(CORRIDOR)!r}, '-o', {folder!r}]\nrun()\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"exit status {status}")
    return 1000 * (used.ru_utime + used.ru_stime)


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 21
    times: dict[str, list[float]] = {name: [] for name in LEFT_OUT}
    with tempfile.TemporaryDirectory() as folder:
        cpu_ms("", folder)
        for _ in range(runs):
            for name, patch in LEFT_OUT.items():
                times[name].append(cpu_ms(patch, folder))
    print(f"with all of them: {statistics.median(times['nothing']):.0f} ms")
    for name in list(LEFT_OUT)[1:]:
        more = [a - b for a, b in zip(times[name], times["nothing"], strict=True)]
        print(f"without {name}: {statistics.median(more):+.0f} ms")


if __name__ == "__main__":
    main()
