"""A working command line of every command, with its files marked, and what click says of them.

The suite of this folder is driven by this table and by the tree of commands: a command or an option
for a file that is not in it fails `test_table.py`, which says what to add.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import click

from mapcli.cli import COMMANDS, cli

EXAMPLES = {
    "slam-replay": (
        "<log.mcap -o >folder/ --save-perception 0",
        "<log.mcap --png >p.png --search book --explain >turns/",
        "<carmen.log --known <image.yaml --initial-pose 0,0,0 --map >m.yaml --png >p.png "
        "--json >t.json --trace >t.tum --mcap >m.mcap",
        "<robot.csv --sensors <sensors.yaml --map >m.txt",
        "--sessions <log.mcap <more.mcap -o >folder/ --save-state >s.mcap",
        "<log.mcap --continue <state.mcap --map >m.yaml --png >p.png --json >t.json",
    ),
    "frontier": (
        "<room.txt --robot 5,6 --known <known.txt --json >t.json --png >p.png --gif >g.gif "
        "--map >m.yaml --curve >c.csv --max-steps 1",
    ),
    "similarity-table": (
        "<room.txt <scan.yaml --json >t.json --png >p.png --update >u.txt",
        "<points.yaml <landmarks.yaml --locate 3.162,-3.435 --update >u.yaml",
        "<measured.yaml --database <database.yaml --json >t.json",
        "<trials.yaml --database <database.yaml --json >c.json",
    ),
    "perceive": (
        "<room.txt >d.yaml --cell 4,6 --beams 8",
        "<log.mcap >d.json --at 0.5",
        "<robot.csv --sensors <sensors.yaml >d.yaml --at 2",
    ),
    "simulate": (
        "<world.yaml >o.mcap --path <path.txt --beams 8 --scan-rate 1",
        "<room.txt >o.mcap --tour 2 --beams 8 --scan-rate 1",
        "<lawn.yaml >o.mcap --mow --runs 2 --mow-width 2 --odom-rate 1 --png >p.png --json >r.json",
    ),
    "evaluate": (
        "<trace.json <truth.tum --json >e.json --png >p.png",
        "<trace.json <pairs.relations --odometry <log.mcap --json >e.json",
        "<round.tum --self-check <round.mcap --json >e.json",
        "<trace.json <other.csv <truth.tum --common-frame --json >e.json --png >p.png --csv >t.csv",
        "<trace.json <pairs.relations --odometry <robot.csv --sensors <sensors.yaml --json >e.json",
    ),
    "import": ("<log.mcap <more.mcap >o.mcap", "<carmen.log >o.mcap",
               "<robot.csv --sensors <sensors.yaml >o.mcap"),
    "convert": (
        "<image.yaml >o.txt", "<room.txt >o.yaml", "<picture.png >o.pgm",
        "<trace.json >o.tum", "<truth.tum >o.json",
    ),
    "transform": (
        "<room.txt >o.yaml --rotate 90 --merge <image.yaml@1,0,0 --trace <trace.json >t.json "
        "--json >r.json",
    ),
    "compare": ("<room.txt <image.yaml --png >p.png --json >r.json",),
    "info": (
        "<image.yaml <world.yaml <log.mcap --json >r.json",
        "<carmen.log",
        "<trace.json <truth.tum <scan.yaml <path.txt --json >r.json",
    ),
    "render": ("<room.txt --png >p.png", "<image.yaml --trace <trace.json --png >p.png"),
    "rasterize": ("<world.yaml >o.txt --json >r.json",),
    "vectorize": ("<image.yaml >o.yaml",),
    "rectify": ("<image.yaml >o.yaml --png >p.png", "<trace.json >o.json --png >p.png"),
    "schema": ("pose-trace",),
}  # fmt: skip
"""Command -> its examples. `<` marks a file to be read, one that `kit.py` makes; `>` a file to be
written (`/` at its end: a folder); what follows `@` belongs to the word and not to the name."""

IN_PLACE = {("convert", "target", "source"), ("transform", "target", "source")}
"""Command, output and the input that it may replace, since its user names one file twice."""

NOT_FILES = {"scan_topics", "odom_topic", "topic", "title"}
"""Parameters that are any text."""


@dataclass(frozen=True)
class Slot:
    """A file in an example.

    Attributes:
        place: index of its word; name: the file; tail: the rest of the word;
        parameter: click's name of what takes it; written: it is an output; folder: it is one.
    """

    place: int
    name: str
    tail: str
    parameter: str
    written: bool
    folder: bool


@dataclass(frozen=True)
class Example:
    """A command line, and the files in it."""

    command: str
    number: int
    words: tuple[str, ...]
    slots: tuple[Slot, ...]

    @property
    def name(self) -> str:
        return f"{self.command}-{self.number}"

    @property
    def reads(self) -> set[str]:
        """All files that it reads, the image of a YAML among them."""
        named = {slot.name for slot in self.slots if not slot.written}
        return named | ({"image.pgm"} if "image.yaml" in named else set())

    def arguments(self, names: dict[Slot, str] | None = None) -> list[str]:
        """The words for `mapcli`, some files under other names."""
        words = list(self.words)
        for slot in self.slots:
            words[slot.place] = (names or {}).get(slot, slot.name) + slot.tail
        return [self.command, *words]


def command(name: str) -> click.Command:
    """A command of the tree."""
    found = cli.get_command(click.Context(cli), name)
    assert found is not None
    return found


def parsed(name: str, arguments: Sequence[str]) -> dict[str, object]:
    """The parameters of a command line, as `mapcli` itself would read it.

    Below `mapcli`, because a command keeps the help options of the first context it is in.
    """
    above = click.Context(cli, info_name="mapcli", **cli.context_settings)
    with command(name).make_context(name, list(arguments), parent=above) as context:
        return context.params


def takes_file(parameter: click.Parameter) -> bool:
    """Whether a parameter is the name of a file, by its type."""
    return isinstance(parameter.type, click.Path | click.File)


@cache
def all_examples() -> tuple[Example, ...]:
    """The table, read."""
    return tuple(
        read_example(name, number, line)
        for name in COMMANDS
        for number, line in enumerate(EXAMPLES.get(name, ()))
    )


def read_example(name: str, number: int, line: str) -> Example:
    """One line of the table; what click makes of it says which parameter takes which file."""
    marked = shlex.split(line)
    words = [re.sub("^[<>]", "", word) for word in marked]
    slots = []
    for place, word in enumerate(marked):
        if word[0] not in "<>":
            continue
        file, at, tail = words[place].partition("@")
        slots.append(Slot(place, file.rstrip("/"), at + tail, _taker(name, words, place),
                          word[0] == ">", file.endswith("/")))  # fmt: skip
    return Example(name, number, tuple(words), tuple(slots))


def _taker(name: str, words: Sequence[str], place: int) -> str:
    """Which parameter takes a word: the one in which a mark put into that word is found."""
    mark = "mark-of-this-word."
    changed = [mark + word if k == place else word for k, word in enumerate(words)]
    (taker,) = (key for key, value in parsed(name, changed).items() if mark in str(value))
    return taker
