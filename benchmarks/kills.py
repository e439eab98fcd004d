"""What is left when `mapcli slam-replay` is stopped at any moment.

    python benchmarks/kills.py [COUNT]

Replays the apartment into a folder that holds an older set of files, and ends it COUNT (100) times
by SIGKILL and as often by SIGINT and by SIGTERM, at moments spread evenly over the run. Counts what
is found afterwards: the older set, the new one, a set that `mapcli info` calls torn, half files,
temporary names, tracebacks, wrong exit codes.
"""

from __future__ import annotations

import collections
import hashlib
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

APARTMENT = Path(__file__).parents[1] / "fixtures" / "apartment.mcap"
NAMES = ["map.pgm", "map.png", "map.yaml", "trace.json"]


def replay(folder: Path, *options: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "mapcli", "slam-replay", str(APARTMENT), "-o", str(folder)]
    return subprocess.Popen([*command, *options], stderr=subprocess.PIPE)


def state(folder: Path, older: dict[str, bytes]) -> str:
    """What a folder holds."""
    names = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    if names != NAMES:
        return f"files are missing: {names}"
    found = {name: (folder / name).read_bytes() for name in NAMES}
    if found == older:
        return "the older set"
    trace = json.loads(found["trace.json"])
    if all(_digest(found[file["file"]]) == file["sha256"] for file in trace["files"]):
        cut = trace["summary"]["interrupted"]
        return "the new set, of the part before the signal" if cut else "the new set"
    said = subprocess.run(
        [sys.executable, "-m", "mapcli", "info", str(folder / "map.yaml")],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    return "a torn set, and info says so" if "is not the one that" in said else "A TORN SET, UNSEEN"


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "out"
        replay(folder, "-q", "--every", "2").communicate()
        older = {name: (folder / name).read_bytes() for name in NAMES}
        start = time.perf_counter()
        replay(Path(scratch) / "whole", "-q").communicate()
        whole = time.perf_counter() - start
        for number in (signal.SIGKILL, signal.SIGINT, signal.SIGTERM):
            found: collections.Counter[str] = collections.Counter()
            for k in range(count):
                for name, content in older.items():
                    (folder / name).write_bytes(content)
                process = replay(folder, "-q")
                time.sleep(whole * (k + 0.5) / count)
                process.send_signal(number)
                _, said = process.communicate()
                found[state(folder, older)] += 1
                found["with temporary files"] += any(folder.glob(".mapcli-*"))
                if b"Traceback" in said:
                    found["with a traceback"] += 1
                    print(said.decode(errors="replace"), file=sys.stderr)
                expected = (0, -number if number == signal.SIGKILL else 128 + number)
                if process.returncode not in expected:
                    found[f"with exit code {process.returncode}"] += 1
            print(f"{number.name}, {count} times: ", end="")
            print("; ".join(f"{what} {times}" for what, times in sorted(found.items())))


if __name__ == "__main__":
    main()
