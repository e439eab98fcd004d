"""`mapcli compare`: how alike two maps are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from mapcli import load_map
from mapcli.commands._limit_option import limit_option
from mapcli.commands._map_operations import hashing, motion_words
from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import (
    FILE,
    Number,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, warn
from mapcli.formats.output import output_set
from mapcli.model.comparison import LIMIT_FIELDS, STATES, Comparison
from mapcli.model.counting import counted
from mapcli.model.grid import OCCUPIED_THRESHOLD
from mapcli.model.limit import Limit


@click.command(short_help="Compare two maps: cells, overlap, walls.")
@click.argument("a", metavar="A", type=FILE)
@click.argument("b", metavar="B", type=FILE)
@click.option("--align", is_flag=True, help="Find where B lies in A first, whatever their origins.")
@click.option(
    "--low", type=Number(0, 1), default=OCCUPIED_THRESHOLD, show_default=True, metavar="P",
    help="Known cells are free below this probability, and occupied from it on.",
)  # fmt: skip
@click.option("--png", metavar="F", type=FILE, help="A picture of what differs.")
@click.option(
    "--json", "json_file", metavar="F", type=FILE, help="Write it as JSON; - is standard output."
)
@limit_option(LIMIT_FIELDS, "iou_occupied<0.5")
@dialect_option
@no_clobber_option
@common_options
def command(
    a: str, b: str, align: bool, low: float, png: str | None, json_file: str | None,
    limits: tuple[Limit, ...], dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Compare two maps: cells, overlap, walls.

    The maps lie where their origins say, or with --align where they fit best. B is looked up at
    the centres of A's cells.

    \b
      agreement     of the cells that both know, the share in which they agree
      agreement_all the same of the cells that either knows
      iou_occupied  cells occupied in both, by cells occupied in either; iou_free likewise
      wall_mean_m, wall_p95_m, wall_max_m   from each wall cell of either map, where the other
                    knows something, to the nearest one of the other: mean, 95th percentile, largest
      changed_m2    cells occupied in one map where the other is free and has no wall in the next
                    cell either, as places that appeared in B or vanished from A

    \b
    Examples:
      mapcli compare today.yaml reference.yaml
      mapcli compare mine.yaml truth.yaml --align --png differences.png
      mapcli compare yesterday.yaml today.yaml --fail-if 'changed_m2>0.5'
      mapcli compare -q mine.yaml truth.yaml --fail-if 'iou_occupied<0.5' --fail-if 'wall_p95_m>0.1'
    """
    from mapcli import compare

    outputs = [name for name in (png, json_file) if name]
    check_outputs(outputs, (a, b), "maps", no_clobber=no_clobber)
    digests: dict[str, str] = {}
    maps = [load_map(file, dialect=dialect, read=hashing(digests)) for file in (a, b)]
    comparison = compare(maps[0].grid, maps[1].grid, align=align, threshold=low)
    with output_set(no_clobber=no_clobber) as results:
        if png:
            from mapcli.pictures.difference import difference_picture

            results.write(png, difference_picture(comparison, _names(a, b)))
        if json_file:
            parameters = {"align": align, "low": low, "dialect": dialect}
            results.write(json_file, _json(comparison, digests, parameters))
    if not quiet:
        for file, loaded in zip((a, b), maps, strict=True):
            warn(file, loaded.warnings)
        for name, text in _lines(comparison):
            say(f"{name:>13}  {text}", err="-" in outputs)
    for limit in limits:
        limit.check(comparison.limits(), f"{a}, {b}")


def _names(a: str, b: str) -> tuple[str, str]:
    """The maps' names, with their folders when they would be the same."""
    paths = Path(a), Path(b)
    names = [path.name for path in paths]
    if names[0] == names[1]:
        names = [f"{path.absolute().parent.name}/{path.name}" for path in paths]
    return names[0], names[1]


def _json(comparison: Comparison, inputs: dict[str, str], parameters: dict[str, Any]) -> bytes:
    from mapcli.formats.documents.json_document import document, json_bytes

    pose = comparison.alignment
    content = {
        **comparison.document(),
        "alignment": None if pose is None else {
            name: round(float(getattr(pose, name)), 6) + 0.0 for name in ("x", "y", "theta")
        },
        "cells": {
            f"{STATES[i]}_{STATES[j]}": int(comparison.cells[i, j])
            for i in range(3) for j in range(3) if (i, j) != (2, 2)
        },
        "changes": [one.document() for one in comparison.changes],
    }  # fmt: skip
    return json_bytes(document("mapcli.map-comparison", inputs, parameters, content))


def _lines(comparison: Comparison) -> list[tuple[str, str]]:
    """The facts for a person."""
    facts, cells, pose = comparison.document(), comparison.cells, comparison.alignment
    lines = []
    if pose is not None:
        lines.append(("alignment", f"B {motion_words(pose)}; score {comparison.score:.2f}"))
    both, either = int(cells[:2, :2].sum()), int(cells.sum())
    lines += [
        ("agreement", f"{facts['agreement']:.1%} of {both:,} cells that both know"),
        ("", f"{facts['agreement_all']:.1%} of {either:,} cells that either knows"),
        ("IoU", f"occupied {facts['iou_occupied']:.3f}, free {facts['iou_free']:.3f}"),
    ]
    walls = "none that both could know"
    if facts["wall_mean_m"] is not None:
        mean, p95, most = (facts[f"wall_{name}_m"] for name in ("mean", "p95", "max"))
        walls = f"{mean:.3f} m apart on average, 95 % within {p95:.3f} m, all within {most:.3f} m"
    return [*lines, ("walls", walls), *_changes(comparison)]


def _changes(comparison: Comparison) -> Iterator[tuple[str, str]]:
    """The places where something has changed, numbered as in the picture."""
    found = comparison.changes
    if not found:
        yield "changed", "nothing"
        return
    appeared, vanished = (comparison.changed_m2(kind) for kind in ("appeared", "vanished"))
    area = f"{appeared:.2f} m2 appeared, {vanished:.2f} m2 vanished"
    yield "changed", f"{counted(len(found), 'places')}: {area}"
    for number, one in enumerate(found[:MOST_LISTED], 1):
        size = f"{one.width:.2f} m x {one.height:.2f} m, {one.area_m2:.3f} m2"
        yield str(number), f"{one.kind} at {one.x:.2f}, {one.y:.2f}: {size}"
    if len(found) > MOST_LISTED:
        yield "", f"and {len(found) - MOST_LISTED:,} smaller ones (--json lists all)"


MOST_LISTED = 10
"""Places that a person is told."""
