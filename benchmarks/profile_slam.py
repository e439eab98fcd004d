"""Where the time of a replay goes, and how it grows with the log's length and the map's size.

    python benchmarks/profile_slam.py ../shared/datasets [NAME...] [--save FILE]

Replays each log in this process, after one that loads the compiled loops, with a stopwatch around
each stage: the functions named in `STAGES` are wrapped where they are called, so a new stage is
one more line there. A stage within a stage counts for the outer one. What is in no stage is
`other`. The second table has the time per scan (reading left out) in each quarter of the log,
with the size of the map at its end; it should grow at most twofold.
"""

from __future__ import annotations

import argparse
import importlib
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from data import find_logs

from mapcli import open_log
from mapcli.algorithms.slam.replay import ReplayRun
from mapcli.algorithms.slam.slam import Slam
from mapcli.commands._replay_outputs import ReplayOutputs, write_outputs

STAGES = {
    "perceiving": ("mapcli.algorithms.slam.slam", "perceive"),
    "matching": ("mapcli.algorithms.slam.slam", "match_scan"),
    "updating": ("mapcli.algorithms.slam.local_map", "LocalMap.update"),
    "closing loops": ("mapcli.algorithms.slam.loop_closure", "LoopCloser.run"),
    "refining": ("mapcli.algorithms.slam.back_end", "refine"),
    "rebuilding": ("mapcli.algorithms.slam.back_end", "map_from_keyframes"),
}
"""Stage -> the module and the name by which it is called."""

AROUND = ("reading", *STAGES, "other", "writing")


class Stopwatch:
    """Seconds in each stage (stateful)."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(AROUND, 0.0)
        self._inside = False

    def timed(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, its time added to the stage."""

        def wrapped(*arguments: Any, **options: Any) -> Any:
            if self._inside:
                return function(*arguments, **options)
            self._inside, start = True, time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds[stage] += time.perf_counter() - start
                self._inside = False

        return wrapped

    def timed_items(self, stage: str, items: Iterable[Any]) -> Iterator[Any]:
        """The items, the time to get each added to the stage."""
        advance = self.timed(stage, iter(items).__next__)
        while True:
            try:
                item = advance()
            except StopIteration:
                return
            yield item


def wrap(place: tuple[str, str], wrapper: Callable[[Any], Any]) -> Callable[[], None]:
    """Put a wrapper around a function of a module or a method of a class; returns the undoing."""
    owner: Any = importlib.import_module(place[0])
    *path, name = place[1].split(".")
    for part in path:
        owner = getattr(owner, part)
    plain = getattr(owner, name)
    setattr(owner, name, wrapper(plain))
    return lambda: setattr(owner, name, plain)


class Profile:
    """One replay under the stopwatch.

    Attributes:
        watch: seconds in each stage.
        per_scan: seconds of each step; areas: square metres of the map's array after each.
    """

    def __init__(self, log: Path) -> None:
        self.watch = Stopwatch()
        self.per_scan: list[float] = []
        self.areas: list[float] = []
        undo = [
            wrap(place, lambda plain, stage=stage: self.watch.timed(stage, plain))
            for stage, place in STAGES.items()
        ]
        undo.append(wrap(("mapcli.algorithms.slam.slam", "Slam.step"), self._counted))
        try:
            self._run(log)
        finally:
            for restore in undo:
                restore()

    def _counted(self, step: Callable[..., Any]) -> Callable[..., Any]:
        def counted(slam: Slam, *arguments: Any) -> Any:
            start = time.perf_counter()
            pose = step(slam, *arguments)
            self.per_scan.append(time.perf_counter() - start)
            side = slam.map.parameters.resolution
            self.areas.append(slam.map.log_odds.size * side * side)
            return pose

        return counted

    def _run(self, path: Path) -> None:
        log, run = open_log([str(path)]), ReplayRun(Slam())
        start = time.perf_counter()
        for _ in run.track(self.watch.timed_items("reading", log.records())):
            pass
        run.finalise()
        replayed = run.result()
        total = time.perf_counter() - start
        self.watch.seconds["other"] = total - sum(self.watch.seconds.values())
        head = {"inputs": log.digests(), "parameters": {}}
        with tempfile.TemporaryDirectory() as folder:
            write = self.watch.timed("writing", write_outputs)
            write(ReplayOutputs.in_folder(folder), replayed, head, no_clobber=False)

    def stage_row(self, name: str) -> str:
        """Seconds per stage, and all together."""
        seconds = self.watch.seconds
        cells = [name, f"{len(self.per_scan):,}", *(f"{seconds[stage]:.2f}" for stage in AROUND)]
        return f"| {' | '.join([*cells, f'{sum(seconds.values()):.2f}'])} |"

    def growth_row(self, name: str) -> str:
        """Milliseconds per scan in each quarter, and the map's size."""
        n = len(self.per_scan)
        quarters = [self.per_scan[k * n // 4 : (k + 1) * n // 4] for k in range(4)]
        means = [1e3 * sum(quarter) / max(len(quarter), 1) for quarter in quarters]
        areas = [f"{self.areas[(k + 1) * n // 4 - 1]:,.0f}" for k in range(4)]
        times = f"{means[3] / means[0]:.2f}"
        return f"| {' | '.join([name, *(f'{m:.2f}' for m in means), times, ' / '.join(areas)])} |"


def table(head: Iterable[str], rows: Iterable[str]) -> str:
    """A Markdown table."""
    names = [*head]
    return "\n".join([f"| {' | '.join(names)} |", f"|{'---|' * len(names)}", *rows])


def main() -> None:
    parser = argparse.ArgumentParser(description="Where the time of a replay goes.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", help="logs, without .log.gz; all when none is named")
    parser.add_argument("--save", type=Path, help="write the tables to this file too")
    arguments = parser.parse_args()
    logs = find_logs(arguments.folder, arguments.names)
    Profile(min(logs.values(), key=lambda path: path.stat().st_size))  # load the compiled loops
    profiles = {name: Profile(log) for name, log in logs.items()}
    stages = table(
        ("seconds", "scans", *AROUND, "all"), (p.stage_row(n) for n, p in profiles.items())
    )
    growth = table(
        ("ms per scan", "1st quarter", "2nd", "3rd", "4th", "4th / 1st", "map, m²"),
        (p.growth_row(n) for n, p in profiles.items()),
    )
    text = f"{stages}\n\n{growth}\n"
    print(text, end="")
    if arguments.save:
        arguments.save.write_text(text)


if __name__ == "__main__":
    main()
