"""The README says what is so: its commands and its Python run, and they print what it shows.

Run as a program, this file writes the real output of every command into the README, and the
picture that the first one draws beside it:

    python tests/test_readme.py
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from conftest import ROOT
from test_help import parsed

from mapcli.cli import COMMANDS

README = (ROOT / "README.md").read_text()
PICTURE = ROOT / "docs" / "apartment.png"
DRAWN = "apartment-slam/map.png"

CONSOLE = re.compile(r"(?<=```console\n).*?(?=```\n)", re.DOTALL)
PYTHON = re.compile(r"(?<=```python\n).*?(?=```\n)", re.DOTALL)

MACHINE_DEPENDENT = ((r"took  .*", "took  (depends on the machine)"),)
"""All that is not compared: how long a replay took and how much faster than real time that is."""

SET_UP = ("python3 -m venv .venv", ".venv/bin/pip install ", ".venv/bin/pytest")
"""Parts of command lines that are not run here; .ci/run runs them."""


def commands(block: str) -> list[str]:
    return [line[2:] for line in block.splitlines() if line.startswith("$ ")]


def runnable(command: str) -> str:
    """The command line without what sets up the environment."""
    parts = [part for part in command.split(" && ") if not part.startswith(SET_UP)]
    return " && ".join(part.replace(".venv/bin/", "") for part in parts)


def run_in(folder: str, command: str) -> str:
    """What a terminal shows when the command runs there."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    return subprocess.run(
        ["bash", "-c", runnable(command)],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    ).stdout


def with_real_output(folder: str, page: str = README) -> str:
    """A page as it would be if every command and the Python in it had just been run."""

    def rerun(block: re.Match[str]) -> str:
        return "".join(f"$ {line}\n{run_in(folder, line)}" for line in commands(block[0]))

    def recompute(code: re.Match[str]) -> str:
        said = run_in(folder, f"python -c {shlex.quote(code[0])}")
        return f"{code[0].rpartition('  # ')[0]}  # {said}"

    shutil.copytree(ROOT / "fixtures", Path(folder, "fixtures"))
    return PYTHON.sub(recompute, CONSOLE.sub(rerun, page))


def masked(text: str) -> str:
    for pattern, mask in MACHINE_DEPENDENT:
        text = re.sub(pattern, mask, text)
    return text


@pytest.mark.slow
def test_commands_print_what_is_shown(tmp_path: Path) -> None:
    shown, real = masked(README), masked(with_real_output(str(tmp_path)))
    assert shown.splitlines() == real.splitlines()
    assert len(PICTURE.read_bytes()) < 100_000
    drawn = (tmp_path / DRAWN).read_bytes()
    assert PICTURE.read_bytes()[:8] == drawn[:8] == b"\x89PNG\r\n\x1a\n"


def test_there_are_commands() -> None:
    lines = [line for block in CONSOLE.findall(README) for line in commands(block)]
    assert len([line for line in lines if runnable(line)]) > 8
    assert lines[0].endswith("mapcli slam-replay fixtures/apartment.mcap")
    assert lines[1].endswith(".venv/bin/pytest -n auto")


def in_the_text() -> Iterator[list[str]]:
    for code in re.findall(r"`(mapcli [^`]+)`", CONSOLE.sub("", README)):
        words = shlex.split(code)
        if words[1:] and words[1] in COMMANDS and words[2:]:
            yield words[1:]


@pytest.mark.parametrize("words", list(in_the_text()), ids=" ".join)
def test_commands_within_the_text_are_valid(words: list[str]) -> None:
    name, *arguments = words
    with contextlib.suppress(click.exceptions.Exit):  # of --help
        assert parsed(name, arguments).params


def test_the_table_of_commands() -> None:
    rows = dict(re.findall(r"^\| `mapcli ([\w-]+)` \| (.*) \|$", README, re.MULTILINE))
    assert rows == COMMANDS


def test_links_and_pictures_are_there() -> None:
    targets = re.findall(r"\]\(([^)#]+)[^)]*\)", README)
    local = [target for target in targets if not target.startswith("https://")]
    assert "docs/apartment.png" in local
    for target in local:
        assert (ROOT / target).exists(), target


def test_figures_are_those_that_were_measured() -> None:
    results = (ROOT / "benchmarks" / "RESULTS.md").read_text()
    rows = [line for line in README.splitlines() if line.startswith("| **mapcli**")]
    (simulated,) = re.findall(r"^.*mapcli is [\d.]+ m off.*$", README, re.MULTILINE)
    figures = re.findall(r"\d+\.\d+", " ".join([simulated, *rows]))
    assert len(figures) == 13
    for figure in figures:
        assert figure in results, figure


def rewrite() -> None:
    """Put the real output and the real picture in their places."""
    with tempfile.TemporaryDirectory() as folder:
        (ROOT / "README.md").write_text(with_real_output(folder))
        shutil.copy(Path(folder, DRAWN), PICTURE)


if __name__ == "__main__":
    rewrite()
