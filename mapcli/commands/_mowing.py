"""`mapcli simulate --mow`: mowers over a lawn, many times (Activity 9.3)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mapcli.algorithms.simulation.sensors import WheelModel
from mapcli.commands._options import FILE, POSITIVE, Command
from mapcli.commands._output import check_outputs, progress
from mapcli.commands._say import say_lines
from mapcli.errors import DataError
from mapcli.formats.input import sha256_of
from mapcli.formats.output import output_set
from mapcli.model.world import World

if TYPE_CHECKING:
    from mapcli.algorithms.simulation.mowing import MowerModel
    from mapcli.model.mowing import Mowing, MowingPlan

_OPTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("--mow", {"is_flag": True, "help": "Mow WORLD, a lawn, back and forth, many times."}),
    ("--runs", {"default": 50, "type": click.IntRange(1, 10_000), "help": "How often to mow."}),
    ("--mow-width", {"default": 0.3, "type": POSITIVE, "help": "Metres that a lane is cut wide."}),
    ("--landmarks", {"default": 0, "type": click.IntRange(0, 1000), "metavar": "N",
                     "help": "Tape marks around the lawn that the mower recognises."}),
    ("--landmark-size", {"default": 0.4, "type": POSITIVE, "help": "Their side, metres."}),
    ("--png", {"metavar": "F", "type": FILE, "help": "A picture of the mowers' paths."}),
    ("--json", {"metavar": "F", "type": FILE, "help": "The mowers' report as JSON."}),
)  # fmt: skip


def mow_options(command: Command) -> Command:
    """The options of `--mow`."""
    for flag, settings in reversed(_OPTIONS):
        shown = "default" in settings
        command = click.option(flag, show_default=shown, **settings)(command)
    return command


def mow_lawn(
    world: str, out: str | None, wheels: WheelModel, given: dict[str, Any], *, quiet: bool
) -> None:
    """Mow, write what was asked for, report.

    Args:
        given: the options of the command line.

    Raises:
        DataError: no lawn, or marks so large that they touch.
    """
    from mapcli import load_world, plan_mowing
    from mapcli.algorithms.simulation.mowing import MowerModel, landmark_sizes

    outputs = [name for name in (out, given["png"], given["json"]) if name]
    check_outputs(outputs, [world], "maps", no_clobber=given["no_clobber"])
    loaded = load_world(world)
    try:
        lawn = loaded.world if isinstance(loaded.world, World) else None
        if lawn is None:
            raise DataError("is a grid map", expected="a lawn: `polygons:` with one polygon")
        plan = plan_mowing(lawn, given["mow_width"], given["landmarks"])
        sizes = landmark_sizes(plan, given["landmark_size"])
        mower = MowerModel(wheels, given["speed"], given["turn_rate_deg"])
        mowings = _mow_all(plan, mower, sizes, given, quiet=quiet)
    except DataError as error:
        error.file = error.file or world
        raise
    digest = sha256_of(loaded.data)
    _write(plan, mowings, out, wheels, given, {Path(world).name: digest})
    if not quiet:
        say_lines(report_lines(plan, mowings), err="-" in outputs)


def _mow_all(
    plan: MowingPlan, mower: MowerModel, sizes: list[float | None], given: dict[str, Any], *,
    quiet: bool,
) -> list[Mowing]:  # fmt: skip
    """With landmarks of each size; the mown area is measured for the first two."""
    from mapcli import mow

    work: Callable[[int], Mowing] = lambda k: mow(  # noqa: E731
        plan, mower, sizes[k], given["runs"], given["seed"], with_area=k < 2
    )
    return [work(k) for k in progress(range(len(sizes)), "Mowing", len(sizes), quiet=quiet)]


def _write(
    plan: MowingPlan, mowings: list[Mowing], out: str | None, wheels: WheelModel,
    given: dict[str, Any], digest: dict[str, str],
) -> None:  # fmt: skip
    with output_set(no_clobber=given["no_clobber"]) as results:
        if out:
            from mapcli.algorithms.simulation.mowing import mower_log
            from mapcli.formats.logs.mcap.writer import write_log

            first = mowings[min(1, len(mowings) - 1)].runs[0]
            with results.opened(out) as file:
                write_log(mower_log(plan, first, wheels.rate), file)
        if given["png"]:
            from mapcli.pictures.mowing import mowing_picture

            results.write(given["png"], mowing_picture(plan, mowings[:2]))
        if given["json"]:
            results.write(given["json"], _json(plan, mowings, given, digest))


def _json(
    plan: MowingPlan, mowings: list[Mowing], given: dict[str, Any], digest: dict[str, str]
) -> bytes:
    from mapcli.formats.documents.json_document import document, json_bytes

    names = ("seed", "runs", "mow_width", "landmarks", "landmark_size", "speed", "turn_rate_deg",
             "odom_rate", "odom_noise", "odom_scale", "odom_turn_scale",
             "odom_drift_deg")  # fmt: skip
    content = {"lanes": plan.lanes, "distance_m": round(plan.distance, 6),
               "mowings": [mowing.document() for mowing in mowings]}  # fmt: skip
    parameters = {name: given[name] for name in names}
    return json_bytes(document("mapcli.mowing", digest, parameters, content))


def report_lines(plan: MowingPlan, mowings: list[Mowing]) -> list[str]:
    """The answers to the questions of Activity 9.3."""
    (x0, y0), (x1, y1) = plan.outline.min(axis=0), plan.outline.max(axis=0)
    alone, *marked = mowings
    rows = [
        ("lawn", f"{x1 - x0:g} m x {y1 - y0:g} m, {plan.lanes} lanes of {plan.width:g} m"),
        ("runs", f"{len(alone.end_errors)} of {plan.distance:,.0f} m each"),
        ("odometry", "by odometry alone"),
        *_ending(alone, plan.width),
    ]
    if marked:
        size, count = marked[0].landmark_size, len(plan.marks)
        rows += [("landmarks", f"with {count} of {size:g} m"), *_ending(marked[0], plan.width)]
        rows.append(("noticed", f"{marked[0].detected:.0%} of the landmarks in a run"))
        rows += _by_size(marked)
    return [f"{label:>12}  {text}" for label, text in rows]


def _ending(mowing: Mowing, width: float) -> list[tuple[str, str]]:
    import numpy as np

    distances, (x, y) = mowing.distances, mowing.mean_error
    share = mowing.systematic_share
    verdict = "the same in every run" if share > 0.5 else "another one in every run"
    back = int((distances <= width).sum())
    return [
        ("returns", f"{back} of {len(distances)} runs, to within a lane's width"),
        ("station", f"ends {distances.mean():.2f} m from it on average, "
                    f"{distances.max():.2f} m at worst; "
                    f"95 % of the runs within {np.percentile(distances, 95):.2f} m"),
        ("error", f"mostly {verdict}: common to all ({x:+.2f}, {y:+.2f}) m, "
                  f"{share:.0%} of the mean square; spread {mowing.scatter:.2f} m"),
        ("mown", f"{mowing.mown.mean():.1%} of the lawn on average"),
    ]  # fmt: skip


def _by_size(marked: list[Mowing]) -> list[tuple[str, str]]:
    """How large the landmarks must be."""
    from mapcli.algorithms.simulation.mowing import RELIABLE_SHARE, smallest_reliable

    ordered = sorted(marked, key=lambda each: each.landmark_size or 0)
    rows = [
        ("", f"{each.landmark_size:>5g} m: {each.detected:4.0%} noticed, "
             f"{each.distances.mean():.2f} m from the station")
        for each in ordered
    ]  # fmt: skip
    enough, share = smallest_reliable(marked), f"{RELIABLE_SHARE:.0%}"
    verdict = (
        f"{enough:g} m: from there on {share} and more of them are noticed"
        if enough
        else f"none up to {ordered[-1].landmark_size:g} m is noticed {share} of the time"
    )
    return [("size", "of the landmarks:"), *rows, ("reliable", verdict)]
