"""Coverage over driven distance as CSV, of one exploration strategy or several (Activity 9.2)."""

from __future__ import annotations

from collections.abc import Mapping

from mapcli.model.exploration import CoverageCurve

CSV_HEAD = "strategy,step,time_steps,distance_cells,distance_m,known_cells,coverage\n"


def write_curve_csv(curves: Mapping[str, CoverageCurve]) -> bytes:
    """One line per strategy and step; step 0 is the start.

    Args:
        curves: name of the strategy -> its curve.
    """
    lines = [CSV_HEAD]
    for strategy, curve in curves.items():
        columns = (
            curve.time_steps, curve.distance_cells, curve.distance_m, curve.known_cells,
            curve.coverage,
        )  # fmt: skip
        rows = zip(*(column.tolist() for column in columns), strict=True)
        lines += [
            f"{strategy},{step},{time},{cells},{metres:.6g},{known},{coverage:.6g}\n"
            for step, (time, cells, metres, known, coverage) in enumerate(rows)
        ]
    return "".join(lines).encode()
