"""Pose traces as g2o graphs: the poses, the steps between them, the loops (g2o, GTSAM).

    VERTEX_SE2 0 x y theta
    EDGE_SE2 0 1 dx dy dtheta I11 I12 I13 I22 I23 I33    upper triangle of the information matrix

An edge from a pose to the next is a step, any other one a loop. Of poses in space, VERTEX_SE3, the
part in the plane is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

from mapcli.errors import FormatError
from mapcli.formats.documents.text_columns import Row, Words, columns, pose_text, yaw
from mapcli.model.pose import Pose2D
from mapcli.model.se2_uncertainty import InformationTriangle
from mapcli.model.trace import Loop, PoseTrace

STEP_INFORMATION: InformationTriangle = (10_000, 0, 0, 10_000, 0, 40_000)
"""Of an edge of which nothing is known: 1 cm and 0.3 degrees of standard deviation."""


def g2o_lines(trace: PoseTrace) -> Iterator[str]:
    """The lines of a file."""
    poses = [traced.pose for traced in trace.poses]
    for k, pose in enumerate(poses):
        yield f"VERTEX_SE2 {k} {pose_text(pose)}"
    steps = trace.steps or [a.between(b) for a, b in pairwise(poses)]
    for k, step in enumerate(steps):
        yield _edge(k, k + 1, step, STEP_INFORMATION)
    for loop in trace.loops:
        yield _edge(loop.from_, loop.to, loop.pose, loop.information or STEP_INFORMATION)


def _edge(start: int, end: int, motion: Pose2D, information: InformationTriangle) -> str:
    weights = " ".join(f"{value:.10g}" for value in information)
    return f"EDGE_SE2 {start} {end} {pose_text(motion)} {weights}"


def is_g2o(rows: Sequence[Words]) -> bool:
    """Whether there are vertices among the first lines."""
    return any("VERTEX_SE" in words[0] for _, words in rows[:50])


def g2o_rows(rows: Iterable[Words], file: str) -> Iterator[Row]:
    """The vertices by their ids; edges are passed over."""
    found: dict[int, Row] = {}
    for line, words in rows:
        if not words[0].startswith("VERTEX_SE"):
            continue
        where, flat = f"line {line}", words[0] == "VERTEX_SE2"
        expected = "id x y theta" if flat else "id x y z qx qy qz qw"
        numbers = columns(words[1:], 4 if flat else 8, file, where, expected)
        turn = numbers[3] if flat else yaw(numbers[4:], file, where)
        vertex = int(numbers[0])
        if vertex in found:
            raise FormatError(f"vertex {vertex} comes twice", file=file, where=where)
        found[vertex] = Row(line, None, (numbers[1], numbers[2], turn))
    for vertex in sorted(found):
        yield found[vertex]


def g2o_loops(rows: Iterable[Words], file: str) -> tuple[Loop, ...]:
    """The edges in the plane between poses that do not follow each other.

    Raises:
        FormatError: an edge without its numbers, or of a vertex that is not there.
    """
    rows = list(rows)
    ids = sorted(int(float(words[1])) for _, words in rows if words[0].startswith("VERTEX_SE"))
    index = {vertex: k for k, vertex in enumerate(ids)}
    loops = []
    for line, words in rows:
        if words[0] != "EDGE_SE2":
            continue
        where = f"line {line}"
        expected = "from to dx dy dtheta, and 6 numbers of information"
        numbers = columns(words[1:], 11, file, where, expected)
        try:
            start, end = (index[int(number)] for number in numbers[:2])
        except KeyError as error:
            raise FormatError(f"there is no vertex {error}", file=file, where=where) from None
        if end - start != 1:
            a, b, c, d, e, f = numbers[5:]
            loops.append(Loop(start, end, Pose2D(*numbers[2:5]), None, (a, b, c, d, e, f)))
    return tuple(loops)
