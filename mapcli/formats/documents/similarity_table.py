"""The similarity table as text (as Table 9.1 prints it), as Markdown, as CSV and as JSON.

`mapcli.similarity-table` has `rows` (positions), `columns` (turns in degrees), `values` (null
where there is no score), `overlap` (cells or readings compared), `best` (null when nothing can be
concluded), `ties` (the others that score the same), `intended` and, on request, `located`. Of a
window, `rows` and `columns` are steps up and to the right in the map's unit and `values` the best
score of all headings there, and `peak`, `second_peak` and `covariance` are added. `summary` has
the numbers that limits may be set on. Every field: `schemas/similarity-table.json`.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.documents.json_document import document, json_bytes
from mapcli.model.local_maxima import WindowScores
from mapcli.model.pose import Pose2D
from mapcli.model.similarity import INTENDED, ScoredCandidate, SimilarityTable, TableSummary

SIMILARITY_TABLE = "mapcli.similarity-table"

Axes = tuple[NDArray[np.float64], NDArray[np.float64]]


def position_name(name: str, unit: str) -> str:
    """`up one cell` for people; `unit` is cell or unit."""
    words = name.split(" ")
    if name == INTENDED:
        return "intended position"
    if name in ("up", "down", "left", "right"):
        return f"{name} one {unit}"
    if len(words) == 2 and words[0] in ("up", "down", "left", "right"):
        return f"{name} {unit}{'' if words[1] == '1' else 's'}"
    return name


def turn_name(turn_deg: float) -> str:
    """`15 deg clockwise`."""
    if not turn_deg:
        return "intended heading"
    return f"{abs(turn_deg):g} deg {'counter-clockwise' if turn_deg > 0 else 'clockwise'}"


def number_text(value: float) -> str:
    """Whole numbers as such, others with three decimals, nothing as a dash."""
    if math.isnan(value):
        return "-"
    return f"{value:.0f}" if value == round(value) and abs(value) < 1e15 else f"{value:.3f}"


def pose_text(pose: Pose2D) -> str:
    """`x 6.5, y 4.5, heading 75 deg`."""
    degrees = math.degrees(pose.theta)
    x, y, degrees = (round(value, 4) + 0.0 for value in (pose.x, pose.y, degrees))
    return f"x {x:g}, y {y:g}, heading {degrees:g} deg"


def table_lines(table: SimilarityTable, unit: str) -> list[str]:
    """The table for a terminal; the best is marked with `*`."""
    cells = [["", *map(turn_name, table.columns)], *_marked(table, unit, "{} *", "{}  ")]
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    widths[1:] = [width + (2 if k else 0) for k, width in enumerate(widths[1:], start=1)]
    lines = []
    for number, row in enumerate(cells):
        texts = [f"{text}  " if number == 0 and k else text for k, text in enumerate(row)]
        first = texts[0].ljust(widths[0])
        rest = "  ".join(text.rjust(w) for text, w in zip(texts[1:], widths[1:], strict=True))
        lines.append(f"{first}  {rest}".rstrip())
    return lines


def markdown_lines(table: SimilarityTable, unit: str) -> list[str]:
    """The table as Markdown; the best is bold."""
    head = ["", *map(turn_name, table.columns)]
    rows = [head, ["---", *("---:" for _ in table.columns)], *_marked(table, unit, "**{}**", "{}")]
    return [f"| {' | '.join(row)} |" for row in rows]


def _marked(table: SimilarityTable, unit: str, mark: str, plain: str) -> list[list[str]]:
    best = table.best()
    winners = {winner.place for winner in table.winners()} if best else set()
    return [
        [
            position_name(name, unit),
            *(
                (mark if (r, c) in winners else plain).format(number_text(float(value)))
                for c, value in enumerate(table.values[r])
            ),
        ]
        for r, name in enumerate(table.rows)
    ]


def csv_text(rows: Sequence[Any], columns: Sequence[Any], values: NDArray[np.float64],
             head: str) -> str:  # fmt: skip
    """The scores as CSV, a line for each row; the field is empty where there is no score."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([head, *(_plain(column) for column in columns)])
    for row, line in zip(rows, values, strict=True):
        numbers = ("" if math.isnan(value) else _plain(float(value)) for value in line)
        writer.writerow([_plain(row), *numbers])
    return out.getvalue()


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else repr(rounded(float(value)))


def table_bytes(
    table: SimilarityTable,
    summary: TableSummary,
    inputs: Mapping[str, str],
    parameters: Mapping[str, Any],
    extra: Mapping[str, Any],
) -> bytes:
    """A table as a document; `extra` is `intended`, `located` or what a window adds."""
    best = table.best()
    others = [w for w in table.winners() if best is not None and w.place != best.place]
    content = {
        "similarity": table.similarity,
        "better": "lower" if table.lower else "higher",
        "rows": list(table.rows),
        "columns": [rounded(turn) for turn in table.columns],
        "values": [[_value(v) for v in row] for row in table.values.tolist()],
        "overlap": table.overlap.tolist(),
        "best": scored(best),
        "ties": [scored(other) for other in others],
        **extra,
        "summary": asdict(summary),
    }
    return json_bytes(document(SIMILARITY_TABLE, inputs, parameters, content))


def window_bytes(
    table: SimilarityTable,
    scores: WindowScores,
    summary: TableSummary,
    inputs: Mapping[str, str],
    parameters: Mapping[str, Any],
) -> bytes:
    """A window as a document."""
    along, maxima = scores.along, scores.maxima
    second = scored(maxima.second)
    content = {
        "similarity": table.similarity,
        "better": "lower" if table.lower else "higher",
        "rows": [rounded(step) for step in along[::-1]],
        "columns": [rounded(step) for step in along],
        "values": [[_value(v) for v in row] for row in scores.surface.tolist()],
        "turns_deg": [rounded(turn) for turn in table.columns],
        "best": scored(maxima.peak),
        "peak": scored(maxima.peak),
        "plateau": maxima.plateau,
        "at_border": maxima.at_border,
        "second_peak": second,
        "second_share": None if maxima.second_share is None else rounded(maxima.second_share),
        "covariance": [[float(f"{v:.6g}") for v in row] for row in maxima.covariance.tolist()],
        "summary": asdict(summary),
    }
    return json_bytes(document(SIMILARITY_TABLE, inputs, parameters, content))


def scored(candidate: ScoredCandidate | None) -> dict[str, Any] | None:
    """A candidate in a document; `theta` in radians, as in all files."""
    if candidate is None:
        return None
    return {
        "position": candidate.position,
        "turn_deg": rounded(candidate.turn_deg),
        "pose": None if candidate.pose is None else pose_content(candidate.pose),
        "score": _value(candidate.score),
        "overlap": candidate.overlap,
    }


def pose_content(pose: Pose2D) -> dict[str, float]:
    return {name: rounded(getattr(pose, name)) for name in ("x", "y", "theta")}


def _value(value: float) -> float | None:
    return None if math.isnan(value) else rounded(value)


def rounded(value: float) -> float:
    """Six decimals, whole numbers as int; 0.0 instead of -0.0."""
    rounded = round(float(value), 6) + 0.0
    return int(rounded) if rounded.is_integer() else rounded
