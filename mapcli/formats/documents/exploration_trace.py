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

A robot (counted from 0) goes from the cell `from` to the cell `goal` over the cells of `path`,
which leaves out the first and has the last, and there senses `sensed`: row, column, probability.
A step also says its `kind` and `time` (see `model/exploration`) and, where there are any, the
`unknowable` cells: sensed, and unknown all the same. Without a known map the first step of each
robot is what it senses where it stands. `priority` is null at distance 0. With --plan there is
`plan`: a list of {"robot", "goal", "path", "priority"}.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from functools import lru_cache
from io import BytesIO
from itertools import islice
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.documents.json_document import document, utf8
from mapcli.formats.maps.text import shortest
from mapcli.model.exploration import KINDS, Exploration, StepColumns, between

FORMAT = "mapcli.exploration-trace"

PART = 4096
"""Steps that are turned into text at a time."""


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
    text = BytesIO()
    text.write(utf8(f'{{{_entries(head)},\n "steps": ['))
    separator = "\n  "
    for line in step_lines(exploration.steps):
        text.write(f"{separator}{line}".encode())
        separator = ",\n  "
    text.write(utf8(f"],\n {_entries(tail)}}}\n"))
    return text.getvalue()


def _entries(content: Mapping[str, Any]) -> str:
    return ",\n ".join(
        f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False, allow_nan=False)}"
        for key, value in content.items()
    )


def step_lines(steps: StepColumns) -> Iterator[str]:
    """Each step as a JSON object.

    A part of them at a time: the objects of millions of steps would take gigabytes at once, and
    Python's garbage collection would go through them again and again.
    """
    for first in range(0, len(steps), PART):
        yield from lines_between(steps, first, min(first + PART, len(steps)))


def lines_between(steps: StepColumns, first: int, last: int) -> Iterator[str]:
    """The steps from `first` up to `last` (excluded)."""
    numbers = (steps.robot, steps.kind, steps.time, steps.frontier_size, steps.priority)
    found = between(first, last, steps.sensed_end)
    sensed = map(sensed_text, *steps.cells[found].T.tolist(), steps.probabilities[found].tolist())
    path = cell_texts(steps.path[between(first, last, steps.path_end)])
    stayed = cell_texts(steps.unknowable[between(first, last, steps.unknowable_end)])
    rows = zip(
        *(column[first:last].tolist() for column in numbers),
        cell_texts(steps.origin[first:last]),
        cell_texts(steps.goal[first:last]),
        lists(path, steps.path_end, first, last),
        lists(sensed, steps.sensed_end, first, last),
        lists(stayed, steps.unknowable_end, first, last),
        strict=True,
    )
    for robot, kind, time, frontier_size, priority, origin, goal, path_, sensed_, stayed_ in rows:
        unknowable = "" if stayed_ == "[]" else f'"unknowable": {stayed_}, '
        yield (
            f'{{"robot": {robot}, "kind": "{KINDS[kind]}", "time": {time}, "from": {origin}, '
            f'"goal": {goal}, "path": {path_}, "sensed": {sensed_}, {unknowable}'
            f'"frontier_size": {frontier_size}, '
            f'"priority": {"null" if isnan(priority) else priority}}}'
        )


def cell_texts(cells: NDArray[np.int32]) -> Iterator[str]:
    """Each cell, from shape (n, 2), as a JSON list."""
    return map("[{}, {}]".format, *cells.T.tolist())


def sensed_text(row: int, column: int, probability: float) -> str:
    return f"[{row}, {column}, {readable(probability)}]"


@lru_cache(maxsize=4096)
def readable(probability: float) -> str:
    """The shortest number that means the same float32: 0.1, not 0.10000000149."""
    return str(float(shortest(np.float32(probability))))


def lists(items: Iterable[str], ends: NDArray[np.int64], first: int, last: int) -> Iterator[str]:
    """The list of each step's own items, from the items of the steps from `first` up to `last`
    (excluded) one after the other."""
    before, following = ends[first - 1] if first else 0, iter(items)
    for length in np.diff(ends[first:last], prepend=before).tolist():
        yield f"[{', '.join(islice(following, length))}]"
