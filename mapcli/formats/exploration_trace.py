"""The trace of an exploration as JSON: format `mapcli.exploration-trace`.

One step per line, as traces have tens of thousands of them:

{"format": "mapcli.exploration-trace", "version": 1, "mapcli": ..., "input": [...],
 "parameters": {...}, "robots": [[row, column], ...],
 "steps": [
  {"robot": 0, "kind": "frontier", "time": 2, "from": [5, 9], "goal": [3, 9],
   "path": [[4, 9], [3, 9]], "sensed": [[2, 8, 1.0], ...], "frontier_size": 13, "priority": 0.5},
  ...],
 "frontier": [{"cell": [r, c], "unknown": a, "robot": k, "distance": d, "priority": p}, ...],
 "unreachable": [[r, c], ...], "summary": {...}}

`from`, `goal`, `path` and `sensed` are as in interface.md; robots are counted from 0. A step also
says its `kind` and `time` (see `model/exploration.py`) and, where there are any, the `unknowable`
cells: sensed, and unknown all the same. Without a known map the first step of each robot is what
it senses where it stands. `priority` is null at distance 0. With --plan there is `plan`: a list of
{"robot", "goal", "path", "priority"}.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.document import document
from mapcli.formats.text import shortest
from mapcli.model.exploration import KINDS, Exploration, StepColumns, part

FORMAT = "mapcli.exploration-trace"


def write_trace(
    exploration: Exploration, inputs: Mapping[str, str], parameters: Mapping[str, Any]
) -> bytes:
    """A trace as JSON; `inputs` and `parameters` as of `document`."""
    head = document(FORMAT, inputs, parameters, {"robots": exploration.robots})
    left = exploration.frontier
    tail: dict[str, Any] = {
        "frontier": [asdict(cell) for cell in left],
        "unreachable": [cell.cell for cell in left if cell.distance is None],
        "summary": asdict(exploration.summary),
    }
    if exploration.plan is not None:
        tail["plan"] = [asdict(goal) for goal in exploration.plan]
    steps = ",".join(f"\n  {line}" for line in step_lines(exploration.steps))
    entries = [*_entries(head), f'"steps": [{steps}]', *_entries(tail)]
    return ("{" + ",\n ".join(entries) + "}\n").encode()


def _entries(content: Mapping[str, Any]) -> list[str]:
    return [
        f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False, allow_nan=False)}"
        for key, value in content.items()
    ]


def step_lines(steps: StepColumns) -> Iterator[str]:
    """Each step as a JSON object. Lists of whole numbers look the same in Python and in JSON."""
    paths, unknowable = steps.path.tolist(), steps.unknowable.tolist()
    sensed = [[r, c, p] for (r, c), p in zip(steps.cells.tolist(), _readable(steps), strict=True)]
    columns = (
        steps.robot, steps.kind, steps.time, steps.origin, steps.goal, steps.frontier_size,
        steps.priority,
    )  # fmt: skip
    rows = zip(*(column.tolist() for column in columns), strict=True)
    for k, (robot, kind, time, origin, goal, frontier_size, priority) in enumerate(rows):
        stayed = unknowable[part(k, steps.unknowable_end)]
        yield (
            f'{{"robot": {robot}, "kind": "{KINDS[kind]}", "time": {time}, "from": {origin}, '
            f'"goal": {goal}, "path": {paths[part(k, steps.path_end)]}, '
            f'"sensed": {sensed[part(k, steps.sensed_end)]}, '
            + (f'"unknowable": {stayed}, ' if stayed else "")
            + f'"frontier_size": {frontier_size}, '
            f'"priority": {"null" if np.isnan(priority) else priority}}}'
        )


def _readable(steps: StepColumns) -> list[float]:
    """Probabilities as the shortest numbers that mean the same cell: 0.1, not 0.10000000149."""
    values, places = np.unique(steps.probabilities, return_inverse=True)
    short: NDArray[np.float64] = np.array([float(shortest(value)) for value in values])
    return [float(p) for p in short[places].tolist()] if len(values) else []
