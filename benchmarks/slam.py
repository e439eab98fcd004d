"""Accuracy, speed and memory of `mapcli slam-replay` on the real logs, as whole commands.

    python benchmarks/slam.py ../shared/datasets [NAME...] [--save FILE] [-- REPLAY_OPTIONS...]

Runs the installed command on every log twice (the second run has the compiled loops cached and
is the one that is timed) and then `mapcli evaluate`:

- against the relations of Kuemmerle et al. 2009 where there are any (`NAME.relations.gz`), with
  the odometry of the log between scans: mean and standard deviation of translation and rotation;
- against a reference trajectory (`NAME.ref.txt`): ATE, the root mean square distance after the
  best rigid alignment.

Prints a Markdown table; `--save FILE` writes it to a file too. `data.py` says where logs come from.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from data import find_logs

MAPCLI = Path(sys.executable).parent / "mapcli"

HEAD = """\
| log | scans | wall s | CPU s | times real time | peak MB | error |
|---|---|---|---|---|---|---|"""

CLOCKS_AGREE_S = "0.05"
"""Stamps of references are rounded; scans are at least twice as far apart."""


class Cost(NamedTuple):
    """What a run of the command took: seconds by the clock and of the processor, peak memory."""

    wall_s: float
    cpu_s: float
    peak_mb: float


def replay(log: Path, out: Path, options: list[str]) -> Cost:
    """Run the command."""
    start = time.perf_counter()
    process = subprocess.Popen([MAPCLI, "slam-replay", log, "-q", "-o", out, *options])
    _, status, used = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status:
        raise SystemExit(f"{log}: exit status {status}")
    return Cost(wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def evaluate(*arguments: str | Path) -> dict[str, float]:
    """The summary of `mapcli evaluate`."""
    command = [MAPCLI, "evaluate", "-q", "--json", "-", *arguments]
    document = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return dict(document["summary"])


def error_of(log: Path, name: str, trace: Path) -> str:
    """How far the trace is from what is known about the log."""
    relations, reference = (log.with_name(f"{name}{s}") for s in (".relations.gz", ".ref.txt"))
    texts = []
    if relations.exists():
        found = evaluate(trace, relations, "--odometry", log)
        length = f"{found['relations_mean']:.4f} ± {found['relations_std']:.4f} m"
        turn = f"{found['relations_rot_mean']:.2f} ± {found['relations_rot_std']:.2f} deg"
        texts.append(f"relations {length}, {turn}")
    if reference.exists():
        found = evaluate(trace, reference, "--max-diff", CLOCKS_AGREE_S)
        texts.append(f"ATE {found['ate_rmse']:.3f} m")
    return "; ".join(texts) or "nothing to compare with"


def row(log: Path, name: str, options: list[str]) -> str:
    """A line of the table."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch)
        replay(log, out, options)
        cost = replay(log, out, options)
        trace = out / "trace.json"
        summary: dict[str, Any] = json.loads(trace.read_text())["summary"]
        error = error_of(log, name, trace)
    times = summary["duration_s"] / cost.wall_s
    return (
        f"| {name} | {summary['scans']:,} | {cost.wall_s:.2f} | {cost.cpu_s:.2f} | "
        f"{times:,.0f} | {cost.peak_mb:.0f} | {error} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="The table of accuracy, speed and memory.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", help="logs, without .log.gz; all when none is named")
    parser.add_argument("--save", type=Path, help="write the table to this file too")
    words = [*sys.argv[1:], "--"]
    ours, theirs = words[: words.index("--")], words[words.index("--") + 1 : -1]
    arguments = parser.parse_args(ours)
    logs = find_logs(arguments.folder, arguments.names)
    lines = HEAD.splitlines()
    print(HEAD, flush=True)
    for name, log in logs.items():
        lines.append(row(log, name, theirs))
        print(lines[-1], flush=True)
    if arguments.save:
        arguments.save.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
