"""What `mapcli frontier` says: summary, plan, and the map as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mapcli.algorithms.exploration.exploration_parameters import ExplorationParameters
from mapcli.algorithms.exploration.first_difference import (
    Choice,
    FirstDifference,
    first_difference,
)
from mapcli.algorithms.exploration.never_sensed import never_sensed
from mapcli.commands._frontier_outputs import Runs
from mapcli.model.counting import counted
from mapcli.model.exploration import Exploration, ExplorationSummary, FrontierCell
from mapcli.model.grid import GridMap, crop_to_known

REASONS = {
    "complete": "no frontier is left",
    "unreachable": "no frontier is left that a robot can reach",
    "max-steps": "--max-steps",
    "max-distance": "--max-distance",
    "coverage": "--coverage is reached",
}

MOST_LISTED = 10


UNSEEN = {
    "left": "not seen yet",
    "at_corners": "touch open cells at corners only, so no frontier is beside them",
    "out_of_reach": "behind obstacles",
}
"""Why cells of the world were never sensed, by the fields of `NeverSensed`."""


def summary_lines(
    exploration: Exploration, parameters: ExplorationParameters, world: GridMap
) -> list[str]:
    """The end report of one exploration."""
    summary, robots = exploration.summary, len(exploration.robots)
    steps = counted(summary.steps, "steps") + (f" of {robots} robots" if robots > 1 else "")
    rows = [
        ("strategy", parameters.strategy),
        ("steps", f"{steps}, {counted(summary.time_steps, 'time steps')}"),
        ("driven", f"{counted(summary.distance_cells, 'cells')}, {summary.distance_m:,.6g} m"),
        ("known", f"{counted(summary.known_cells, 'cells')}, coverage {summary.coverage:.1%}"),
        ("ended", REASONS[summary.reason]),
    ]
    if summary.unreachable:
        rows.append(("unreachable", _listed(exploration)))
    for kind, cells in never_sensed(world, exploration, parameters.low)._asdict().items():
        if len(cells):
            rows.append(("never seen", f"{_cells(cells.tolist(), 'cells')} ({UNSEEN[kind]})"))
    if summary.corrected:
        rows.append(("corrected", f"{counted(summary.corrected, 'cells')} of the known map"))
    if summary.not_home:
        rows.append(("not home", counted(summary.not_home, "robots")))
    return [f"{label:>12}  {text}" for label, text in rows]


def step_lines(exploration: Exploration) -> Iterator[str]:
    """The steps in their order, a line each: who went where, over how many cells, chosen from how
    many frontier cells, and how many cells were sensed there."""
    rows = [("step", "robot", "from", "to", "cells", "frontier", "p", "sensed", "")]
    for number, step in enumerate(exploration.steps, start=1):
        rows.append(
            (str(number), str(step.robot + 1), "{},{}".format(*step.origin),
             "{},{}".format(*step.goal), str(len(step.path)), str(step.frontier_size),
             "-" if step.priority is None else f"{step.priority:.3g}", str(len(step.cells)),
             "" if step.kind == "frontier" else step.kind)
        )  # fmt: skip
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    for row in rows:
        yield "  ".join(map(str.rjust, row, widths)).rstrip()


def _listed(exploration: Exploration) -> str:
    cells = [cell.cell for cell in exploration.frontier if cell.distance is None]
    return _cells(cells, "frontier cells")


def _cells(cells: Sequence[Sequence[int]], what: str) -> str:
    """How many, and the first of them."""
    shown = " ".join(f"{row},{column}" for row, column in cells[:MOST_LISTED])
    more = f" and {len(cells) - MOST_LISTED:,} more" if len(cells) > MOST_LISTED else ""
    return f"{counted(len(cells), what)}: {shown}{more}"


def comparison_lines(runs: Runs, world: GridMap, known: GridMap | None) -> list[str]:
    """Several strategies side by side, and where each parts from the first."""
    head = ("strategy", "steps", "time steps", "cells driven", "m driven", "coverage")
    rows = [head, *(_comparison(p.strategy, e.summary) for p, e in runs.items())]
    widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
    lines = [
        "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    ]
    first, *others = runs.items()
    for other in others:
        names = f"{first[0].strategy} and {other[0].strategy}"
        lines += ["", *_parting(names, first_difference(world, known, first, other))]
    return lines


def _parting(names: str, found: FirstDifference | None) -> Iterator[str]:
    """Why two strategies take different ways (Activity 9.2)."""
    if found is None:
        yield f"{names} take the same way"
        return
    row, column = found.origin
    goals = " and ".join(f"{r},{c}" for r, c in found.goals)
    yield f"{names} part at step {found.step}, from {row},{column}, to {goals}"
    for choice in found.choices or ():
        yield f"{choice.strategy:>12}  {_choice_text(choice)}"


def _choice_text(choice: Choice) -> str:
    (row, column), cell = choice.chosen.cell, choice.chosen
    text = f"{row},{column}: distance {cell.distance}, {cell.unknown} unknown"
    if choice.strategy in ("priority", "gain"):
        text += f", priority {cell.priority:.4g}"
    if choice.tied:
        text += f"; as good as {counted(choice.tied, 'others')}, taken for its {choice.rule}"
    return text


def _comparison(strategy: str, summary: ExplorationSummary) -> tuple[str, ...]:
    return (
        strategy, f"{summary.steps:,}", f"{summary.time_steps:,}", f"{summary.distance_cells:,}",
        f"{summary.distance_m:,.6g}", f"{summary.coverage:.1%}",
    )  # fmt: skip


def plan_lines(exploration: Exploration) -> list[str]:
    """The frontier with a, d and p of Sect. 9.3.3, and where the robots would go."""
    cells = exploration.frontier
    lines = [f"frontier: {counted(len(cells), 'cells')}"]
    if cells:
        lines.append(f"{'cell':>12} {'unknown':>8} {'distance':>9} {'priority':>9}")
        lines += [_plan_line(cell) for cell in cells]
    for goal in exploration.plan or ():
        way = counted(len(goal.path), "cells")
        worth = "" if goal.priority is None else f", priority {goal.priority:.4g}"
        row, column = goal.goal
        lines.append(f"robot {goal.robot + 1} goes to {row},{column}: {way}{worth}")
    if not exploration.plan:
        lines.append("nobody has anywhere to go")
    return lines


def _plan_line(cell: FrontierCell) -> str:
    row, column = cell.cell
    distance = "-" if cell.distance is None else str(cell.distance)
    priority = "-" if cell.priority is None else f"{cell.priority:.4g}"
    return f"{f'{row},{column}':>12} {cell.unknown:>8} {distance:>9} {priority:>9}"


def map_text(exploration: Exploration, low: float, width: int) -> list[str]:
    """The map as text: numbers where they fit into so many letters a line, else `#` for
    obstacles, `.` for open and `?` for unknown cells, reduced to fit."""
    from mapcli.commands._map_output import TERMINAL_DIGITS
    from mapcli.formats.maps.text import number_rows

    grid = exploration.after
    numbers = b"".join(number_rows(grid, TERMINAL_DIGITS)).decode().splitlines()
    if len(numbers[0]) <= width:
        return numbers
    known = crop_to_known(grid, margin=1)
    across = -(-known.columns // width)
    # Letters are about twice as high as wide.
    return _letters(known, low, across if across == 1 else 2 * across, across)


def _letters(grid: GridMap, low: float, down: int, across: int) -> list[str]:
    """A letter for each block of cells: an obstacle in it, or else known, or else unknown."""
    rows, columns = -(-grid.rows // down), -(-grid.columns // across)
    padded = np.full((rows * down, columns * across), np.nan, dtype=np.float32)
    padded[: grid.rows, : grid.columns] = grid.cells
    blocks = padded.reshape(rows, down, columns, across)
    obstacle = (blocks >= np.float32(low)).any(axis=(1, 3))
    known = (~np.isnan(blocks)).any(axis=(1, 3))
    letters = np.where(obstacle, "#", np.where(known, ".", "?"))
    return ["".join(line) for line in letters]
