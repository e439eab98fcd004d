"""Every example in a help text runs, on files of the names that it has."""

from __future__ import annotations

import gzip
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from conformance.examples import command
from conformance.kit import Sandbox
from conftest import FIXTURES, run

from mapcli.cli import COMMANDS, cli

COPIES = {
    "room.txt": "map.txt",
    "image.yaml": "old.yaml mine.yaml truth.yaml today.yaml reference.yaml floor1.yaml "
    "floor2.yaml floor3.yaml map.yaml yesterday.yaml",
    "image.pgm": "image.pgm scan.pgm",
    "database.yaml": "database.yaml",
    "measured.yaml": "measured.yaml",
}
"""File of the kit -> names under which examples read it."""


def make_stand_ins(kit: Path, here: Path) -> None:
    """Every file that an example reads. The robot of all of them is the one of the apartment."""
    shutil.copytree(FIXTURES, here / "fixtures")
    for path in FIXTURES.glob("fig9_*"):
        shutil.copy(path, here)
    for source, names in COPIES.items():
        for name in names.split():
            shutil.copy(kit / source, here / name)
    shutil.copy(FIXTURES / "apartment.mcap", here / "robot.mcap")
    slam = here / "apartment-slam"
    for line in (
        f"simulate {FIXTURES}/corridor.yaml {here}/sonars.mcap --path {FIXTURES}/corridor-path.txt "
        "--range-max 1 --sensor left=0,0.05,90 --sensor right=0,-0.05,-90",
        f"rasterize {FIXTURES}/fig9_1.yaml {here}/fig9_1.txt --box 0,0,8,8",
        f"slam-replay {here}/robot.mcap -o {slam} --trace {here}/trace.tum",
        f"perceive {here}/robot.mcap {here}/scan.yaml --at 30",
        f"perceive {kit}/room.txt {here}/trials.yaml --cell 4,6 --beams 8 --noise 0.1 --times 3",
        f"transform {slam}/map.yaml {here}/depot.yaml --resample 0.2",
        f"import {FIXTURES}/apartment.mcap {here}/monday.mcap --end 30",
        f"import {FIXTURES}/apartment.mcap {here}/tuesday.mcap --start 40 --end 70",
        f"import {FIXTURES}/apartment.mcap {here}/wednesday.mcap --start 75",
        f"slam-replay {here}/monday.mcap --save-state {here}/building.state",
    ):
        assert run(*line.split(), "-q") == 0, line
    for name in ("map.yaml", "map.pgm", "trace.json"):
        shutil.copy(slam / name, here)
    shutil.copy(here / "trace.tum", here / "truth.tum")
    start = float((here / "trace.tum").read_text().split()[0])
    (here / "intel.relations.gz").write_bytes(
        gzip.compress(f"{start + 1} {start + 2} 0.1 0 0 0 0 0\n".encode())
    )
    scans = [f"FLASER 3 1 2 1 {x} 0 0 {x} 0 0 {start + x} host {start + x}\n" for x in range(4)]
    for name in ("robot.log.gz", "intel.log.gz"):
        (here / name).write_bytes(gzip.compress("".join(scans).encode()))


def examples(text: str | None) -> Iterator[list[str]]:
    """The lines of a help text that begin with `mapcli`, their comments left out."""
    for line in (text or "").replace("\\\n", " ").splitlines():
        if line.strip().startswith("mapcli "):
            yield shlex.split(line, comments=True)


EXAMPLES = [
    words for text in (cli.help, *(command(n).help for n in COMMANDS)) for words in examples(text)
]


@pytest.fixture(scope="session")
def stand_ins(kit: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stand-ins")
    make_stand_ins(kit, folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("words", EXAMPLES, ids=" ".join)
def test_an_example_runs(words: list[str], sandbox: Sandbox, kit: Path, stand_ins: Path) -> None:
    """All of a pipe that is `mapcli`; other programs at its end only show what comes out."""
    shutil.copytree(stand_ins, ".", dirs_exist_ok=True)
    if words[1] == "rectify":  # which needs a robot that went along walls
        shutil.copy(kit / "trace.json", "trace.json")
    given: bytes | None = None
    for stage in shlex.join(words).split(" '|' "):
        name, *arguments = shlex.split(stage)
        if name != "mapcli":
            break
        ran = sandbox.run(*arguments, stdin=given)
        assert ran.status == 0, (
            f"{ran.err}\nIf a file is missing: make_stand_ins of {Path(__file__).name} is the "
            "place to add it"
        )
        given = ran.out
