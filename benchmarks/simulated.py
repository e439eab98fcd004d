"""`mapcli slam-replay` against the truth that only a simulator knows, with odometry that fails.

    python benchmarks/simulated.py

Drives the fixtures' apartment with wheels that are noisy, count backwards, slip, freeze or are not
there at all, and prints how far the poses are from the true ones after the best rigid alignment.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from slam import MAPCLI, evaluate

from mapcli import open_log
from mapcli.formats.logs.mcap.writer import McapLogWriter
from mapcli.model.scan import RangeScan

FIXTURES = Path(__file__).parent.parent / "fixtures"

CASES = {
    "as in the fixtures, 10 scans a second": [],
    "5 scans a second, turns at 90 deg/s": ["--scan-rate", "5", "--turn-rate-deg", "90"],
    "wheels count backwards for 5 s, twice": [
        "--odom-fault", "reverse-sign@20-25", "--odom-fault", "reverse-sign@60-65",
    ],
    "wheels slip for 3 s, twice": ["--odom-fault", "slip@20-23", "--odom-fault", "slip@60-63"],
    "wheels count nothing for 3 s": ["--odom-fault", "freeze@40-43"],
    "wheels see 10 % too little of every turn": ["--odom-turn-scale", "0.9"],
    "180 deg laser": ["--fov-deg", "180", "--beams", "181"],
}  # fmt: skip


def error(log: Path, truth: Path, out: Path) -> float:
    """Replay and compare: root mean square distance from the truth, metres."""
    subprocess.run([MAPCLI, "slam-replay", "-q", log, "-o", out], check=True)
    return evaluate(out / "trace.json", truth)["ate_rmse"]


def main() -> None:
    print(f"{'apartment, 40 m':45} ATE m")
    with tempfile.TemporaryDirectory() as scratch:
        for name, options in CASES.items():
            log = Path(scratch) / "log.mcap"
            world, path = FIXTURES / "apartment.yaml", FIXTURES / "apartment-path.txt"
            subprocess.run(
                [MAPCLI, "simulate", "-q", world, "--path", path, *options, log], check=True
            )
            print(f"{name:45} {error(log, log, Path(scratch)):.4f}", flush=True)
        blind = Path(scratch) / "blind.mcap"
        with blind.open("wb") as file, McapLogWriter(file) as writer:
            for record in open_log([str(log)]).records():
                if isinstance(record, RangeScan):
                    writer.write(record)
        print(f"{'180 deg laser, no odometry at all':45} {error(blind, log, Path(scratch)):.4f}")


if __name__ == "__main__":
    main()
