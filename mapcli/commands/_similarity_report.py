"""What `mapcli similarity-table` says to people."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mapcli.algorithms.similarity.comparisons import GridsOnMap, ScanOnMap
from mapcli.commands._similarity_outputs import Answer
from mapcli.formats.documents.similarity_table import (
    number_text,
    pose_text,
    position_name,
    table_lines,
    turn_name,
)
from mapcli.model.counting import counted
from mapcli.model.local_maxima import WindowScores
from mapcli.model.similarity import ScoredCandidate, SimilarityTable

MOST_NAMED = 15
"""Ties that are named one by one."""


def report_lines(answer: Answer) -> list[str]:
    """The table, or what there is to say about a window, and the best pose."""
    lines = [_headline(answer), ""]
    lines += _window_lines(answer.scores, answer.table) if answer.scores else _best_lines(answer)
    for seen in answer.located():
        lines.append(f"  obstacle  at {seen['distance']:g}, {seen['bearing_deg']:g} deg")
        lines += [f"            {place}" for place in _places(seen)]
    return lines


def _headline(answer: Answer) -> str:
    better = "lower" if answer.table.lower else "higher"
    things = "obstacles" if answer.unit == "cell" else "equal readings"
    what = {
        "product": "S, the sum of products",
        "agreement": "share that agrees",
        "jaccard": f"{things} in both / in either",
        "correlation": "Pearson's coefficient",
        "l1": "sum of absolute differences",
        "l2": "root of the sum of squared differences",
    }[answer.table.similarity]
    return f"Similarity {answer.table.similarity}: {what} ({better} is better)"


def _best_lines(answer: Answer) -> Iterator[str]:
    yield from table_lines(answer.table, answer.unit)
    yield ""
    best, second = answer.best, answer.table.runner_up()
    if best is None:
        yield "  best      none: nothing can be concluded"
        return
    yield f"  best      {candidate_name(best, answer.unit)}: {number_text(best.score)}"
    if best.pose is not None:
        cell = _cell(answer, best)
        yield f"  pose      {pose_text(best.pose)}{cell}"
    if second is not None:
        yield f"  next      {candidate_name(second, answer.unit)}: {number_text(second.score)}"


def _cell(answer: Answer, candidate: ScoredCandidate) -> str:
    comparison = answer.loaded.comparison
    if candidate.pose is None or not isinstance(comparison, ScanOnMap | GridsOnMap):
        return ""
    row, column = comparison.grid.cells_of_world([[candidate.pose.x, candidate.pose.y]])[0]
    return f" (cell {row},{column})"


def _window_lines(scores: WindowScores, table: SimilarityTable) -> Iterator[str]:
    maxima, side = scores.maxima, len(scores.along)
    yield f"  window    {side} x {side} positions, {len(table.columns)} headings"
    yield f"  peak      {number_text(maxima.peak.score)} at {_pose(maxima.peak)}"
    if maxima.second is None:
        yield "  second    no other peak in the window"
    else:
        share = (
            "" if maxima.second_share is None else f", {100 * maxima.second_share:.0f} % as high"
        )
        yield f"  second    {number_text(maxima.second.score)} at {_pose(maxima.second)}{share}"
    x, y, theta = np.sqrt(np.diag(maxima.covariance))
    yield f"  spread    x {x:.3g}, y {y:.3g}, heading {math.degrees(theta):.3g} deg"


def _pose(candidate: ScoredCandidate) -> str:
    return "?" if candidate.pose is None else pose_text(candidate.pose)


def candidate_name(candidate: ScoredCandidate, unit: str) -> str:
    """`up one cell, 15 deg clockwise`."""
    return f"{position_name(candidate.position, unit)}, {turn_name(candidate.turn_deg)}"


def _places(seen: dict[str, dict[str, float] | None]) -> Iterator[str]:
    """Where a sighting is, from each pose that is known."""
    for name in ("best", "intended"):
        point = seen[f"from_{name}"]
        if point is not None:
            x, y = (round(point[axis], 3) + 0.0 for axis in "xy")
            yield f"x {x:.3f}, y {y:.3f} from the {name} pose"


def notes(answer: Answer) -> Iterator[str]:
    """What a reader of the table should know."""
    table, best = answer.table, answer.best
    if answer.scores is not None:
        maxima = answer.scores.maxima
        if maxima.at_border:
            yield "the peak lies at the border of the window; the true pose may be outside"
        if maxima.plateau > 1:
            yield f"{maxima.plateau:,} poses score the same as the peak; the one nearest to "\
                  "the intended pose is named"  # fmt: skip
        return
    winners = table.winners()
    if best is None:
        many = f"all {len(winners)}" if len(winners) != 2 else "both"
        yield f"{many} candidates score {_score(winners)}: "\
              "nothing can be concluded"  # fmt: skip
        return
    if len(winners) > 1:
        names = "; ".join(candidate_name(w, answer.unit) for w in winners[:MOST_NAMED])
        yield f"a tie at {_score(winners)}: {names}; the first is taken"
    most = int(table.overlap.max())
    if best.overlap < most / 2:
        yield f"the best compares only {best.overlap:,} {_compared(answer)}, others up to {most:,}"
    count = int((~table.comparable()).sum()) - table.missing
    if count:
        yield f"{counted(count, 'candidates')} without anything to compare cannot win"


def _score(winners: list[ScoredCandidate]) -> str:
    return number_text(winners[0].score) if winners else "nothing"


def _compared(answer: Answer) -> str:
    return "cells" if answer.unit == "cell" else "readings"
