"""Evaluations as JSON documents (`mapcli.evaluation`), and as a table in CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from mapcli.formats.documents.json_document import document
from mapcli.model.evaluation import Evaluation

EVALUATION = "mapcli.evaluation"


def evaluation_document(
    evaluation: Evaluation, inputs: Mapping[str, str], parameters: Mapping[str, Any]
) -> dict[str, Any]:
    """The statistics of an evaluation and its errors one by one (see `json_document`).

    `summary` holds the fields that `--fail-if` knows. The errors of a trajectory are those of the
    aligned poses (ATE), by the stamps of the trace or else by index; those of relations have the
    stamps of both ends.
    """
    aligned, overlap = evaluation.aligned, evaluation.overlap_s
    is_aligned = evaluation.reference is not None
    content = {
        "kind": evaluation.kind,
        "how": evaluation.association,
        "matched": evaluation.matched,
        "total": evaluation.total,
        "overlap_s": None if overlap is None else round(overlap, 6),
        "aligned": {name: round(getattr(aligned, name), 6) + 0.0 for name in ("x", "y", "theta")}
        if is_aligned
        else None,
        "measures": {name: errors.document() for name, errors in evaluation.errors.items()},
        "summary": {name: round(value, 6) for name, value in evaluation.numbers().items()},
        "errors": _errors(evaluation),
    }
    return document(EVALUATION, inputs, parameters, content)


def evaluations_csv(evaluations: Sequence[tuple[str, Evaluation]]) -> bytes:
    """A line for each trace, by its name: the fields of `summary`.

    Args:
        evaluations: against one reference, at least one.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["trace", *evaluations[0][1].numbers()])
    for name, evaluation in evaluations:
        writer.writerow([name, *(f"{round(x, 6):.10g}" for x in evaluation.numbers().values())])
    return text.getvalue().encode(errors="surrogateescape")


def _errors(evaluation: Evaluation) -> list[dict[str, Any]]:
    errors = next(iter(evaluation.errors.values()))
    relations, reference = evaluation.relations, evaluation.reference
    if relations is not None:
        heads = [
            {"from_ns": int(start), "to_ns": int(end)}
            for start, end in zip(relations.from_ns, relations.to_ns, strict=True)
        ]
    elif reference is not None and reference.stamps_ns is not None:
        heads = [{"stamp_ns": int(stamp)} for stamp in reference.stamps_ns]
    else:
        heads = [{"index": k} for k in range(len(errors))]
    return [
        {**head, "translation_m": round(float(m), 6), "rotation_deg": round(float(d), 6)}
        for head, m, d in zip(heads, errors.metres, errors.degrees, strict=True)
    ]
