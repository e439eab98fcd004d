"""Pose traces as CSV: one pose a line, under a head line that names the columns.

mapcli's own head is `CSV_HEAD`. Others are read by the names of their columns: `stamp_ns`, or `t`
in seconds, or neither; `x`, `y`, `theta`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from mapcli.errors import FormatError
from mapcli.formats.documents.text_columns import Row, Words, finite, pose_text, stamp_ns
from mapcli.model.trace import STATUSES, PoseTrace

CSV_HEAD = "stamp_ns,x,y,theta,odom_x,odom_y,odom_theta,score,status"


def csv_lines(trace: PoseTrace) -> Iterator[str]:
    """The lines of a file."""
    yield CSV_HEAD
    for traced in trace.poses:
        odom = pose_text(traced.odom, ",") if traced.odom else ",,"
        score = "" if traced.score is None else f"{traced.score:.4f}"
        pose, status = pose_text(traced.pose, ","), traced.status or ""
        yield f"{traced.stamp_ns},{pose},{odom},{score},{status}"


def csv_rows(head: Sequence[str], rows: Iterable[Words], file: str) -> Iterator[Row]:
    """The poses below a head line.

    Raises:
        FormatError: a column is missing, or a line is not as the head says.
    """
    missing = [name for name in ("x", "y", "theta") if name not in head]
    if missing:
        raise FormatError(f"has no column {missing[0]}", file=file, expected=CSV_HEAD)
    places = [head.index(name) for name in ("x", "y", "theta")]
    is_own = ",".join(head) == CSV_HEAD
    for line, words in rows:
        where = f"line {line}"
        if len(words) != len(head):
            problem = f"has {len(words)} columns"
            raise FormatError(problem, file=file, where=where, expected=f"{len(head)}, as the head")
        x, y, theta = (finite(words[k], file, where, "x, y and theta") for k in places)
        stamp = None
        if "stamp_ns" in head:
            stamp = stamp_ns(f"{words[head.index('stamp_ns')]}e-9", file, where)
        elif "t" in head:
            stamp = stamp_ns(words[head.index("t")], file, where)
        row = Row(line, stamp, (x, y, theta))
        yield _with_odometry(row, words[4:], file, where) if is_own else row


def _with_odometry(row: Row, words: Sequence[str], file: str, where: str) -> Row:
    """The row with `odom_x,odom_y,odom_theta,score,status`, each of which may be empty."""
    odom = None
    if any(words[:3]):
        x, y, theta = (finite(word, file, where, "odometry's x, y and theta") for word in words[:3])
        odom = x, y, theta
    score = finite(words[3], file, where, "a score") if words[3] else None
    return row._replace(odom=odom, score=score, status=STATUSES.get(words[4]))
