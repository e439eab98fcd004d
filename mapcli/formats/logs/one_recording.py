"""Recordings that are not one are refused: they would become one map of several places."""

from __future__ import annotations

import filecmp
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from mapcli.errors import DataError
from mapcli.formats.logs.recording_break import Break, duration
from mapcli.model.scan import NANOSECONDS, RangeScan, Record

Spans = Mapping[str, tuple[int, int]]
"""Topic -> the first and the last stamp of its messages in a file, nanoseconds."""

OVERLAP_S = 1.0
"""Parts of one recording follow each other, but for the disorder of what a recorder had not
written yet."""

MAP_ALONE, INSIST = "map each alone (mapcli slam-replay FILE)", "insist with --one-recording"


@dataclass(frozen=True)
class Part:
    """One file of a recording.

    Attributes:
        name: what the user typed; path: where the bytes are.
        spans: of the topics that are read.
    """

    name: str
    path: Path
    spans: Spans


def refuse_overlap(parts: Sequence[Part]) -> None:
    """Refuse files that were recorded at the same time.

    Files that hold different topics of one time are one recording.

    Raises:
        DataError: two of them hold messages of one topic at the same time.
    """
    for one, other in combinations(parts, 2):
        overlap = max((_overlap_s(one, other, topic) for topic in one.spans), default=0.0)
        if overlap <= 0:
            continue
        if filecmp.cmp(one.path, other.path, shallow=False):
            raise DataError(
                f"holds the same as {one.name}",
                file=other.name,
                expected=f"each recording named once, or {INSIST}",
            )
        raise DataError(
            f"overlaps {one.name} by {duration(overlap)}, so they are two recordings",
            file=other.name,
            expected=f"parts of one recording; {MAP_ALONE}, or {INSIST}",
        )


def _overlap_s(one: Part, other: Part, topic: str) -> float:
    """For how long both hold the topic, seconds; 0 for as little as disorder explains."""
    spans = [part.spans[topic] for part in (one, other) if topic in part.spans]
    if len(spans) < 2:
        return 0.0
    seconds = (min(last for _, last in spans) - max(first for first, _ in spans)) / NANOSECONDS
    shorter = min(last - first for first, last in spans) / NANOSECONDS
    return seconds if seconds > min(OVERLAP_S, shorter / 2) else 0.0


def refuse_breaks(
    records: Iterable[Record],
    breaks: Sequence[Break],
    names: Sequence[str],
    start_ns: Callable[[], int],
) -> Iterator[Record]:
    """The records, up to a break between two of the scans.

    Args:
        breaks: of the log, as far as it was read.
        names: of its files.
        start_ns: tells where its time starts, once records are read.

    Raises:
        DataError: there are scans of two recordings.
    """
    earliest: int | None = None
    for record in records:
        if isinstance(record, RangeScan):
            earliest = record.stamp_ns if earliest is None else earliest
            for found in breaks:
                if found.mixed or earliest < found.after_ns <= record.stamp_ns:
                    raise _refusal(found, names, start_ns())
        yield record


def _refusal(found: Break, names: Sequence[str], start_ns: int) -> DataError:
    before, after = (names[part] for part in found.parts)
    if before != after:
        return DataError(
            f"is not of the recording of {before}: {found.what}",
            file=after,
            expected=f"parts of one recording; {MAP_ALONE}, or {INSIST}",
        )
    elapsed_s = (found.before_ns - start_ns) / NANOSECONDS
    way = ""
    if len(names) == 1 and not found.mixed:
        cut = _between(found.before_ns - start_ns, found.after_ns - start_ns)
        way = f"; map each alone, with --end {cut} and --start {cut}"
    return DataError(
        f"{found.what}: another recording",
        file=after,
        where=f"after {elapsed_s:.1f} s",
        expected=f"one recording{way}, or {INSIST}",
    )


def _between(before_ns: int, after_ns: int) -> str:
    """A number of seconds that parts two moments, with as few decimals as that takes, one at
    least."""
    for decimals in range(1, 9):
        unit = 10 ** (9 - decimals)
        cut = -(-before_ns // unit)
        if cut * unit < after_ns:
            break
    return f"{cut * unit / NANOSECONDS:.{decimals}f}"
