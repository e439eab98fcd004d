"""`mapcli slam-replay --explain`: what --search book compared, turn by turn."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

from mapcli.algorithms.similarity.measures import LOWER_IS_BETTER
from mapcli.algorithms.slam.book_explanation import BookExplanation, explain
from mapcli.algorithms.slam.replay import ReplayRun
from mapcli.commands._say import say
from mapcli.formats.documents.similarity_table import (
    number_text,
    pose_text,
    position_name,
    turn_name,
)
from mapcli.pictures.book_pages import BookPage, html_pages
from mapcli.pictures.similarity import before_after, panels

MOST_EXPLAINED = 100
"""Comparisons that are explained unless more are asked for: some megabytes."""


class Explainer:
    """Collects the comparisons of a run (stateful: `watch` adds the last one).

    Attributes:
        folder: where they go; most: of them; compared: how many there were.
    """

    def __init__(self, folder: str, most: int) -> None:
        self.folder, self.most, self.compared = Path(folder), most, 0
        self._pages: list[BookPage] = []
        self._files: dict[str, bytes] = {}

    @property
    def index(self) -> str:
        """The page to open."""
        return str(self.folder / "index.html")

    def watch(self, run: ReplayRun) -> None:
        """Explain the last scan, if it was compared and there is room."""
        slam = run.slam
        if slam.book_search is None:
            return
        self.compared += 1
        if self.compared > self.most:
            return
        number, similarity = len(run.poses) - 1, slam.parameters.match.similarity
        shown = explain(slam.book_search, slam.map, similarity)
        seconds = (run.poses[-1].stamp_ns - run.poses[0].stamp_ns) * 1e-9
        scores = panels(shown.before, shown.perceived, shown.robot, shown.best, similarity)
        maps = before_after(shown.before, shown.after, shown.robot)
        name = str(self.folder / f"scan-{number:05}")
        self._files |= {
            f"{name}-scores.csv": _csv(shown),
            f"{name}-scores.png": scores,
            f"{name}-map.png": maps,
        }
        self._pages.append(
            BookPage(
                f"scan-{number}", f"Scan {number}, {seconds:.2f} s", _text(shown), _table(shown),
                shown.search.chosen,
                [(scores, "map, perception and product at the position that was chosen"),
                 (maps, "the map before and after the update")],
            )
        )  # fmt: skip

    def contents(self, log: str) -> dict[str, bytes]:
        """File -> content: a page that leafs through all, and each comparison's table and
        pictures."""
        return {**self._files, self.index: html_pages(f"Algorithm 9.2 on {log}", self._pages)}

    def report(self) -> None:
        """Say what was explained, and what was not."""
        told = f"{len(self._pages):,} of {self.compared:,} comparisons in {self.index}"
        more = "; --explain-most N explains more, --start S later ones"
        say(f"    explained  {told}{more if self.compared > self.most else ''}")


def _text(shown: BookExplanation) -> str:
    search, best = shown.search, shown.best
    one = search.comparisons[best.place[0]][best.place[1]]
    name = f"{position_name(best.position, 'cell')}, {turn_name(best.turn_deg)}"
    if not one.is_better:
        return (
            f"Odometry is believed: {pose_text(search.predicted)}. No other position is better by "
            "more than chance on the cells that it shares with the odometry's."
        )
    around = "" if search.centre is search.predicted else ", around what was suspected before"
    told = (
        f"Odometry said {pose_text(search.predicted)}. Better{around}: {name}. Of the beams or "
        f"sensors that tell the two apart, {one.votes.wins} speak for it and {one.votes.losses} "
        "for odometry."
    )
    if search.is_believed:
        return told
    return f"{told} That may be chance: odometry is believed until the next comparison says so too."


def _table(shown: BookExplanation) -> list[list[str]]:
    """The scores, and in brackets how many more beams or sensors speak for each than against."""
    table = shown.table
    better = "lower" if table.similarity in LOWER_IS_BETTER else "higher"
    rows = [[f"{table.similarity} ({better} is better), votes", *map(turn_name, table.columns)]]
    for i, name in enumerate(table.rows):
        votes = [one.votes.wins - one.votes.losses for one in shown.search.comparisons[i]]
        values = zip(table.values[i], votes, strict=True)
        cells = [f"{number_text(float(value))} ({lead:+d})" for value, lead in values]
        rows.append([position_name(name, "cell"), *cells])
    return rows


def _csv(shown: BookExplanation) -> bytes:
    text, table = StringIO(), shown.table
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ("position", "turn_deg", "score", "overlap", "shared", "wins", "losses", "best")
    )
    for i, position in enumerate(table.rows):
        for j, turn in enumerate(table.columns):
            one, compared = table[i, j], shown.search.comparisons[i][j]
            best = int((i, j) == shown.search.chosen)
            writer.writerow(
                (position, f"{turn:g}", number_text(one.score), one.overlap, compared.cells,
                 *compared.votes, best)
            )  # fmt: skip
    return text.getvalue().encode()
