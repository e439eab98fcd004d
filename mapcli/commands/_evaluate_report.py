"""What `mapcli evaluate` says: counts, a table of errors, and where the worst of them are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from mapcli.algorithms.evaluation.trajectory_error import EvaluateParameters
from mapcli.model.counting import counted
from mapcli.model.evaluation import STATISTICS, Errors, Evaluation, Kind, statistics
from mapcli.model.trajectory import Trajectory

TITLES = {"ate": "ATE", "rpe": "RPE", "relations": "relations", "self_check": "self-check"}

PAIRWISE: dict[Kind, str] = {"relations": "relations", "self-check": "self_check"}

THINGS: dict[Kind, str] = {
    "trajectory": "poses",
    "relations": "relations",
    "self-check": "pairs of scans",
}

COLUMNS: dict[Kind, tuple[tuple[str, str, int], ...]] = {
    "trajectory": (
        ("ATE rmse", "ate_rmse", 4),
        ("mean", "ate_mean", 4),
        ("max", "ate_max", 4),
        ("ATE rmse", "ate_rot_rmse", 3),
        ("RPE rmse", "rpe_rmse", 4),
        ("RPE rmse", "rpe_rot_rmse", 3),
    ),
    **{
        kind: (
            ("mean", f"{measure}_mean", 4),
            ("std", f"{measure}_std", 4),
            ("mean", f"{measure}_rot_mean", 3),
            ("std", f"{measure}_rot_std", 3),
        )
        for kind, measure in PAIRWISE.items()
    },
}
"""Of the table of several traces: title, field of the summary, decimals."""

WORST = 3
"""Relations named one by one."""


def described(trajectory: Trajectory) -> str:
    """ "509 poses, 101.6 s"."""
    poses = counted(len(trajectory), "poses")
    if trajectory.stamps_ns is None:
        return f"{poses} without times"
    return f"{poses}, {trajectory.seconds()[-1]:,.1f} s"


def report_lines(
    evaluation: Evaluation, trace: str, against: str, parameters: EvaluateParameters
) -> list[str]:
    """The report, one string a line."""
    head = [("trace", f"{trace}: {described(evaluation.trace)}"), ("against", against)]
    head.append(("compared", _compared(evaluation)))
    if evaluation.reference is not None:
        head.append(("aligned", _aligned(evaluation)))
    lines = [f"{name:>11}  {text}" for name, text in head]
    lines += ["", " " * 33 + "".join(f"{name:>10}" for name in STATISTICS)]
    for measure, errors in evaluation.errors.items():
        lines += _table(_title(measure, parameters), errors)
    lines.append("")
    lines += [f"{name:>11}  {text}" for name, text in _worst(evaluation)]
    return lines


def table_lines(
    evaluations: Sequence[tuple[str, Evaluation]],
    against: str,
    parameters: EvaluateParameters,
    *,
    common_frame: bool,
) -> list[str]:
    """The report on several traces, by their names: a line for each."""
    first = evaluations[0][1]
    how = "; ".join(dict.fromkeys(evaluation.association for _, evaluation in evaluations))
    head = [("against", against), ("compared", f"{THINGS[first.kind]}, {how}")]
    if first.reference is not None:
        head.append(("aligned", f"all {_aligned(first)}" if common_frame else "each by itself"))
        head.append(("RPE", _title("rpe", parameters).removeprefix("RPE ")))
    columns = COLUMNS[first.kind]
    rows = [
        ["", *(title for title, _, _ in columns)],
        ["compared", *("deg" if "_rot_" in field else "m" for _, field, _ in columns)],
    ]
    for _, evaluation in evaluations:
        numbers = evaluation.numbers()
        errors = [f"{numbers[field]:.{decimals}f}" for _, field, decimals in columns]
        rows.append([f"{evaluation.matched:,} of {evaluation.total:,}", *errors])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    table = ["  ".join(map(str.rjust, row, widths)) for row in rows]
    names = ["", "  trace", *(f"  {name}" for name, _ in evaluations)]  # of any length, so last
    return [
        *(f"{name:>11}  {text}" for name, text in head),
        "",
        *(f"{line}{name}" for line, name in zip(table, names, strict=True)),
    ]


def _aligned(evaluation: Evaluation) -> str:
    pose = evaluation.aligned
    x, y, turn = (round(v, 3) + 0.0 for v in (pose.x, pose.y, math.degrees(pose.theta)))
    return f"by x {x:.3f} m, y {y:.3f} m, turn {turn:.2f} deg"


def _compared(evaluation: Evaluation) -> str:
    text = f"{evaluation.matched:,} of {evaluation.total:,} {THINGS[evaluation.kind]}"
    if evaluation.overlap_s is not None:
        return f"{text}, {evaluation.association}; {evaluation.overlap_s:,.1f} s in common"
    return f"{text}; {evaluation.association}"


def _title(measure: str, parameters: EvaluateParameters) -> str:
    title = TITLES[measure]
    if measure == "rpe":
        unit = "m" if parameters.delta_unit == "m" else "pose" + "s" * (parameters.delta != 1)
        title += f" over {parameters.delta:g} {unit}"
    return title


def _table(title: str, errors: Errors) -> Iterator[str]:
    for name, values, decimals in (
        ("translation, m", errors.metres, 4),
        ("rotation, deg", errors.degrees, 3),
    ):
        cells = "".join(f"{x:>10.{decimals}f}" for x in statistics(values).values())
        yield f"{title:>16}  {name:<15}{cells}"
        title = ""


def _worst(evaluation: Evaluation) -> Iterator[tuple[str, str]]:
    """Where to look first."""
    errors = next(iter(evaluation.errors.values()))
    order = np.argsort(-errors.metres, kind="stable").tolist()
    # Beside the worst pose of a path are the next worst; relations say something each.
    shown = order[:1] if evaluation.relations is None else order[:WORST]
    for name, k in zip(["worst", *[""] * WORST], shown, strict=False):
        place = _place(evaluation, k, float(errors.seconds[k]))
        yield name, f"{errors.metres[k]:.3f} m, {errors.degrees[k]:.2f} deg {place}"


def _place(evaluation: Evaluation, k: int, seconds: float) -> str:
    trace, relations = evaluation.trace, evaluation.relations
    if trace.stamps_ns is None:
        return f"at pose {int(seconds)}"
    if relations is None:
        return f"at {seconds:,.1f} s after the first pose"
    start, end = (
        int(t[k] - trace.stamps_ns[0]) * 1e-9 for t in (relations.from_ns, relations.to_ns)
    )
    return f"between {start:,.1f} and {end:,.1f} s after the first pose"
