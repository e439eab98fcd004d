"""Where the benchmarks find logs and maps, and where these come from.

None of the data is part of this repository. The logs are CARMEN logs with the raw odometry, the
references are poses at the scans as the authors of GMapping corrected them, the relations between
poses are those of Kuemmerle et al. 2009, made by hand.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

LOGS = {
    "intel": "Intel Research Lab, Seattle; D. Haehnel; Radish; github.com/1988kramer/intel_dataset",
    "intel-dense": "the same, every fifth of its 13,631 scans; relations: SLAM benchmarking",
    "aces": "ACES building, Austin; P. Beeson; Radish",
    "csail": "MIT CSAIL; C. Stachniss; SLAM benchmarking",
    "mit-csail": "the same at full density; relations: SLAM benchmarking",
    "freiburg-101": "building 101, Freiburg; C. Stachniss; SLAM benchmarking",
    "freiburg-campus": "campus, Freiburg; C. Stachniss; SLAM benchmarking",
    "belgioioso": "Belgioioso castle; D. Haehnel; Radish; github.com/acschaefer/ple",
    "acapulco": "Acapulco convention center; N. Roy, D. Haehnel; Radish; github.com/acschaefer/ple",
}
"""Name of `NAME.log.gz` -> the building, who recorded it, and where it is published."""

MAPS = {
    "depot": "warehouse of nav2_bringup; github.com/ros-navigation/navigation2 (Apache-2.0)",
    "tb3_sandbox": "TurtleBot3 world; the same",
}
"""Name of `NAME.yaml` -> where the map is published."""


def find_logs(folder: Path, names: Sequence[str] = ()) -> dict[str, Path]:
    """The logs asked for, or all that are in a folder, by name; ends the program if one is
    missing."""
    return _find(folder, names, LOGS, ".log.gz")


def find_maps(folder: Path, names: Sequence[str]) -> dict[str, Path]:
    """The same of maps."""
    return _find(folder, names, MAPS, ".yaml")


def _find(
    folder: Path, names: Sequence[str], known: dict[str, str], suffix: str
) -> dict[str, Path]:
    if not folder.is_dir():
        _fail(f"{folder}: no such folder", known, suffix)
    files = {path.name.removesuffix(suffix): path for path in sorted(folder.glob(f"*{suffix}"))}
    missing = [name for name in names if name not in files]
    if missing or not files:
        _fail(f"{folder}: no {', '.join(missing) or '*'}{suffix}", known, suffix)
    return {name: files[name] for name in names} if names else files


def _fail(problem: str, known: dict[str, str], suffix: str) -> NoReturn:
    lines = [f"  {name}{suffix}: {source}" for name, source in known.items()]
    sys.exit("\n".join([f"Error: {problem}; expected a folder with any of these:", *lines]))
