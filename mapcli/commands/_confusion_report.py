"""What `mapcli similarity-table` says of many sets of readings: the confusion table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from mapcli.algorithms.similarity.comparisons import ReadingsInDatabase, Scoring
from mapcli.algorithms.similarity.confusion import Confusion, confusion
from mapcli.commands._similarity_inputs import Loaded
from mapcli.formats.documents.confusion_table import confusion_bytes
from mapcli.formats.documents.similarity_table import position_name, turn_name


def confusion_of(loaded: Loaded, scoring: Scoring) -> Confusion:
    """Find the pose of every trial."""
    comparison = loaded.comparison
    assert isinstance(comparison, ReadingsInDatabase)
    assert loaded.trials is not None
    weight = scoring.bearing_weight
    return confusion(comparison.database, loaded.trials, scoring.similarity, weight)


def confusion_json(found: Confusion, loaded: Loaded, scoring: Scoring) -> bytes:
    """The table as a document."""
    parameters = asdict(scoring)
    return confusion_bytes(found.poses, found.counts, found.summary(), loaded.digests, parameters)


def confusion_lines(found: Confusion, scoring: Scoring) -> Iterator[str]:
    """The table, a line for each true pose and a column for each that was found, and its sums."""
    count, total = len(found.poses), int(found.counts.sum())
    names = [f"{position_name(p, 'step')}, {turn_name(t)}" for p, t in found.poses]
    wide = max(map(len, names))
    each = max(len(str(total)), 2) + 1
    yield f"Similarity {scoring.similarity}: the true pose, and how often which one was found"
    yield ""
    head = "".join(f"{k:>{each}}" for k in range(1, count + 1))
    yield f"{'':>{wide + 4}}{head}{'tie':>{max(each, 4)}}"
    for k, (name, row) in enumerate(zip(names, found.counts.tolist(), strict=True), start=1):
        cells = "".join(f"{n or '.':>{each}}" for n in row[:-1])
        yield f"{name:>{wide}} {k:>3}{cells}{row[-1] or '.':>{max(each, 4)}}"
    yield ""
    yield f"  pose      {found.right:,} of {total:,} found ({found.right / total:.1%})"
    share = found.right_position / total
    yield f"  position  {found.right_position:,} of {total:,} found ({share:.1%})"
