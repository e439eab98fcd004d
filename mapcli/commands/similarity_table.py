"""`mapcli similarity-table`: score the candidate poses of a perception (Sect. 9.5 and 9.6)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import click

from mapcli.algorithms.similarity.candidate_poses import CandidateWindow
from mapcli.algorithms.similarity.comparisons import (
    BEARING_WEIGHT,
    GridsOnMap,
    LandmarksOnMap,
    ReadingsInDatabase,
    ScanOnMap,
    Scoring,
    score_comparison,
)
from mapcli.algorithms.similarity.measures import SIMILARITIES
from mapcli.commands._confusion_report import confusion_json, confusion_lines, confusion_of
from mapcli.commands._limit_option import limit_option
from mapcli.commands._map_options import dialect_option
from mapcli.commands._options import (
    FILE,
    NOT_NEGATIVE,
    POSITIVE,
    Number,
    NumberList,
    common_options,
    no_clobber_option,
)
from mapcli.commands._output import check_outputs
from mapcli.commands._say import say, say_lines
from mapcli.commands._similarity_inputs import Loaded, load_comparison
from mapcli.commands._similarity_outputs import (
    Answer,
    candidates_png,
    updated_map,
    window_answer,
    write_png,
)
from mapcli.commands._similarity_report import notes, report_lines
from mapcli.errors import DataError
from mapcli.formats.maps.save import SUFFIXES
from mapcli.formats.output import output_set
from mapcli.model.grid import OCCUPIED_THRESHOLD
from mapcli.model.limit import Limit
from mapcli.model.similarity import LIMIT_FIELDS, ConfusionSummary, TableSummary

MATRICES = ScanOnMap | GridsOnMap
"""What is compared cell by cell."""

FORMATS = ("table", "json", "csv", "markdown")

SIGHTING = NumberList("D,BEARING_DEG")

USUAL_WINDOW = CandidateWindow(0.0, 15.0)


@click.command(short_help="Score the candidate poses of a perception (Table 9.1).")
@click.argument("files", metavar="MAP PERCEPTION", type=FILE, nargs=-1, required=True)
@click.option("--similarity", type=click.Choice(SIMILARITIES), help="How to compare; of l1 and l2 "
              "lower is better.  [default: product; l1 for landmarks and with "
              "--database]")  # fmt: skip
@click.option("--low", type=Number(0, 1, min_open=True), default=OCCUPIED_THRESHOLD,
              show_default=True, help="A known cell below this counts as empty.")  # fmt: skip
@click.option("--bearing-weight", type=NOT_NEGATIVE, default=BEARING_WEIGHT, show_default=True,
              help="What a radian of bearing counts against a unit of distance.")  # fmt: skip
@click.option("--database", metavar="F", type=FILE, help="Score against these perceptions, as "
              "`mapcli perceive` writes them, instead of a MAP.")  # fmt: skip
@click.option("--locate", "sightings", type=SIGHTING, multiple=True, help="Also say which point an "
              "obstacle at this distance and bearing is. Repeatable.")  # fmt: skip
@click.option("--window-xy", type=NOT_NEGATIVE, help="Score a whole window of this half-width, in "
              "the map's unit.  [default: the perception's candidates]")  # fmt: skip
@click.option("--window-theta-deg", type=Number(0, 180), help="Its half-width in degrees.  "
              "[default: 15 with --window-xy]")  # fmt: skip
@click.option("--step-xy", type=POSITIVE, help="Between the window's positions; whole cells.  "
              "[default: a cell]")  # fmt: skip
@click.option("--step-theta-deg", type=Number(0.01, 90), default=USUAL_WINDOW.step_theta_deg,
              show_default=True, help="Between its headings.")  # fmt: skip
@click.option("--format", "form", type=click.Choice(FORMATS), help="What is printed, with -q too.  "
              f"[default: {FORMATS[0]}, and nothing with -q]")  # fmt: skip
@click.option("--json", metavar="F", type=FILE, help="The table as JSON; - is standard output, "
              "here as everywhere.")  # fmt: skip
@click.option("--png", metavar="F", type=FILE, help="A picture: the map, the best perception and "
              "their product; of a window, the scores.")  # fmt: skip
@click.option("--candidates", is_flag=True, help="Of --png: the perception maps of all candidates, "
              "as in Figs. 9.19 and 9.20.")  # fmt: skip
@click.option("--update", metavar="F", type=FILE, help="The map with the best perception written "
              "into it; a points map gets the points of --locate.")  # fmt: skip
@limit_option(LIMIT_FIELDS, "ties>0")
@dialect_option
@no_clobber_option
@common_options
def command(
    files: tuple[str, ...], similarity: Any, low: float, bearing_weight: float,
    database: str | None, sightings: tuple[Any, ...], window_xy: float | None,
    window_theta_deg: float | None, step_xy: float | None, step_theta_deg: float,
    form: str | None, json: str | None, png: str | None, candidates: bool, update: str | None,
    limits: tuple[Limit, ...], dialect: Any, no_clobber: bool, quiet: bool, verbose: bool,
) -> None:  # fmt: skip
    """Score every candidate pose of PERCEPTION against MAP and name the best.

    PERCEPTION is YAML or JSON: a scan (ranges along beams), landmarks (distances and bearings to
    the points of a points map), or perception maps written out as in Fig. 9.20. Scans and
    perception maps need a grid MAP of any format. Without a window, the candidates are the book's
    fifteen: the intended cell and its four neighbours, each at three headings.

    \b
      kind: scan
      pose: {cell: [4, 6], heading_deg: 90}      # or {x: 6.5, y: 3.5, theta_deg: 90}
      range_max: 5
      beams: [[-15, 3.2], [0, null], [15, 3.6]]  # bearing in degrees, range in the map's unit

    \b
      kind: landmarks
      pose: {x: 0, y: 0, theta_deg: 0}
      measured: [[2.0, 32.0], [2.6, -20.0]]      # distance and bearing, in the order of the points

    \b
      kind: grids                                # -1 empty, 1 obstacle, 0 or ? unknown
      corner: [0, 0]                             # where they lie, if smaller than the map
      candidates: [{position: intended, turn_deg: 0, rows: ["1 1 ?", "-1 -1 1"]}]

    \b
      kind: readings                             # of any sensors, with --database
      readings: [1830, 0, 2210]                  # null: nothing

    Scans and landmarks may have `steps: 1` and `turns_deg: [0, -15, 15]`.

    \b
    Examples:
      mapcli similarity-table fixtures/corner.txt fixtures/corner-scan.yaml --png corner.png
      mapcli similarity-table fixtures/corner.txt fixtures/corner-scan.yaml --png all.png \\
          --candidates
      mapcli similarity-table fixtures/landmarks-map.yaml fixtures/landmarks.yaml \\
          --locate 3.162,-3.435
      mapcli similarity-table map.yaml scan.yaml --window-xy 1 --window-theta-deg 10 --png heat.png
      mapcli similarity-table --database database.yaml measured.yaml
      mapcli similarity-table --database database.yaml trials.yaml   # how precise?
      mapcli similarity-table --database database.yaml trials.yaml --json precise.json \\
          --fail-if 'right_share<0.9'
      mapcli similarity-table -q map.yaml scan.yaml --fail-if 'ties>0' --fail-if 'distance>0.2'
    """
    window = _window(window_xy, window_theta_deg, step_xy, step_theta_deg)
    outputs = [name for name in (json, png, update) if name]
    if form not in (None, FORMATS[0]) and "-" in outputs:
        raise click.UsageError("Two results cannot both be written to standard output.")
    check_outputs(outputs, [*files, *filter(None, [database])], "inputs", no_clobber=no_clobber)
    loaded = load_comparison(files, database, dialect, low)
    _check(loaded, window, png, update, sightings)
    _check_fields(limits, loaded)
    if candidates and (window or not png or not isinstance(loaded.comparison, MATRICES)):
        raise click.UsageError("--candidates needs --png, and a scan or perception maps on a map.")
    measure = similarity or loaded.comparison.default_similarity
    scoring = Scoring(measure, low, bearing_weight)
    if loaded.trials is not None:
        _refuse_with_trials(png or update, form)
        _confusion(loaded, scoring, form, json, no_clobber=no_clobber, quiet=quiet, limits=limits)
        return
    with _naming(loaded.perception):
        table = score_comparison(loaded.comparison, scoring, window)
        answer = Answer(loaded, scoring, table, sightings)
        if window is not None:
            answer = window_answer(answer, window)
        shown = form or (None if quiet else FORMATS[0])
        _print(answer, shown, quiet=quiet, to_stderr="-" in outputs)
        with output_set(no_clobber=no_clobber) as results:
            if json:
                results.write(json, answer.json())
            if png:
                results.write(png, candidates_png(answer) if candidates else write_png(answer))
            if update:
                results.write_beside(update, updated_map(update, answer))
    for name in outputs if verbose else ():
        say(f"written: {name}")
    for limit in limits:
        limit.check(answer.summary().values(lower=answer.table.lower), loaded.perception)


def _refuse_with_trials(picture: str | None, form: str | None) -> None:
    """Say what has no meaning for many sets of readings.

    Raises:
        click.UsageError: such options.
    """
    if picture or form not in (None, *FORMATS[:2]):
        raise click.UsageError("A set of trials has its confusion table only, as text or JSON.")


def _confusion(
    loaded: Loaded, scoring: Scoring, form: str | None, json: str | None, *, no_clobber: bool,
    quiet: bool, limits: tuple[Limit, ...],
) -> None:  # fmt: skip
    """The answer to many sets of readings: which pose was found for which."""
    with _naming(loaded.perception):
        found = confusion_of(loaded, scoring)
    if form == "json":
        click.echo(confusion_json(found, loaded, scoring).decode(), nl=False)
    elif form or not quiet:
        say_lines(confusion_lines(found, scoring), err=json == "-")
    with output_set(no_clobber=no_clobber) as results:
        if json:
            results.write(json, confusion_json(found, loaded, scoring))
    for limit in limits:
        limit.check(found.summary().values(), loaded.perception)


def _check_fields(limits: tuple[Limit, ...], loaded: Loaded) -> None:
    """Say what is not in the summary of this kind of perception.

    Raises:
        click.UsageError: a limit on it.
    """
    names = [one.name for one in fields(ConfusionSummary if loaded.trials else TableSummary)]
    for limit in limits:
        if limit.field not in names:
            kind = "a set of trials" if loaded.trials else "one perception"
            known = ", ".join(names)
            raise click.UsageError(f"--fail-if {limit.field}: the summary of {kind} has {known}.")


@contextmanager
def _naming(perception: str) -> Iterator[None]:
    """Errors about the data name the perception's file."""
    try:
        yield
    except DataError as error:
        error.file = error.file or perception
        raise


def _print(answer: Answer, form: str | None, *, quiet: bool, to_stderr: bool) -> None:
    """The table in the form asked for, if one was, and what to know about it."""
    if form == FORMATS[0]:
        say_lines(report_lines(answer), err=to_stderr)
    elif form is not None:
        click.echo(answer.text(form), nl=False)
    for text in () if quiet else answer.loaded.warnings:
        say(f"Warning: {text}")
    for text in () if quiet else notes(answer):
        say(f"Note: {text}")


def _window(
    xy: float | None, theta_deg: float | None, step_xy: float | None, step_theta_deg: float
) -> CandidateWindow | None:
    if xy is None and theta_deg is None:
        return None
    turn = USUAL_WINDOW.theta_deg if theta_deg is None else theta_deg
    return CandidateWindow(xy or 0.0, turn, step_xy, step_theta_deg)


def _check(
    loaded: Loaded, window: CandidateWindow | None, png: str | None, update: str | None,
    sightings: tuple[Any, ...],
) -> None:  # fmt: skip
    """Say what does not go together.

    Raises:
        click.UsageError: such options.
    """
    comparison = loaded.comparison
    if window is not None and not isinstance(comparison, ScanOnMap | LandmarksOnMap):
        raise click.UsageError("A window needs a scan or landmarks, and a map to move them on.")
    if isinstance(comparison, ReadingsInDatabase) and (png or update):
        option = "--png" if png else "--update"
        raise click.UsageError(f"{option} needs a MAP, which --database has not.")
    if isinstance(comparison, LandmarksOnMap) and update and not sightings:
        raise click.UsageError("--update of a points map needs --locate to say what to add.")
    if (
        update not in (None, "-")
        and not isinstance(comparison, LandmarksOnMap)
        and Path(str(update)).suffix.lower() not in SUFFIXES
    ):
        raise click.UsageError(f"--update {update}: does not end in {', '.join(SUFFIXES)}.")
