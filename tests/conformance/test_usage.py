"""Wrong usage, options that every command has, and standard streams that are closed."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from conformance.examples import Example, all_examples, command
from conformance.kit import Ran, Sandbox

from mapcli.cli import COMMANDS

Usual = Callable[[Example], Ran]

ODD = "\x1b]52;c;eA==\x07"
"""What is no value of anything, and is an order to a terminal."""

FIRST = [example for example in all_examples() if example.number == 0]
INTO_FILES = [example for example in FIRST if any(slot.written for slot in example.slots)]


def is_wrong_usage(ran: Ran) -> bool:
    ran.is_no_fault()
    errors = [line for line in ran.err.splitlines() if line.startswith("Error: ")]
    return ran.status == 2 and len(errors) == 1 and not ran.files


@pytest.mark.parametrize("example", FIRST, ids=lambda example: example.command)
def test_what_is_no_option_and_no_argument(example: Example, sandbox: Sandbox) -> None:
    for extra in ("--no-such-option", f"--{ODD}", "-Z", "--debug=1"):
        assert is_wrong_usage(sandbox.run(*example.arguments(), extra)), extra
    assert is_wrong_usage(sandbox.run(example.command))


OPTIONS = [
    pytest.param(name, parameter, id=f"{name}{parameter.opts[0]}")
    for name in COMMANDS
    for parameter in command(name).params
    if isinstance(parameter, click.Option)
    and not parameter.is_flag
    and not isinstance(parameter.type, click.Path | type(click.STRING))
]


@pytest.mark.parametrize(("name", "parameter"), OPTIONS)
def test_a_value_that_is_none(name: str, parameter: click.Option, sandbox: Sandbox) -> None:
    example = next(example for example in FIRST if example.command == name)
    for value in (ODD, "", "nan", "1e999"):
        ran = sandbox.run(*example.arguments(), f"{parameter.opts[0]}={value}")
        assert is_wrong_usage(ran), value
    assert is_wrong_usage(sandbox.run(*example.arguments(), parameter.opts[0]))


@pytest.mark.parametrize("example", all_examples(), ids=lambda example: example.name)
def test_quiet_is_quiet(example: Example, sandbox: Sandbox, usual: Usual) -> None:
    wanted = usual(example)
    ran = sandbox.run(*example.arguments(), "-q")
    ran.is_fine()
    assert (ran.files, ran.err) == (wanted.files, "")
    assert ran.out == b"" or example.command == "schema"  # which has no other result
    loud = sandbox.run(*example.arguments(), "-v", "--debug")
    loud.is_fine()
    assert "Traceback" not in loud.err


def streams_closed(examples: list[Example]) -> str:
    """A program that runs them all, as a shell with `<&- >&- 2>&-` would; the exit code says
    which one failed."""
    lines = [example.arguments() for example in examples]
    return (
        "from mapcli import startup\n"
        "startup.guard_streams()\n"
        "import os\n"
        "from mapcli.cli import main\n"
        f"for number, line in enumerate({lines!r}, 1):\n"
        "    try:\n"
        "        main(line)\n"
        "    except SystemExit as leaving:\n"
        "        if leaving.code:\n"
        "            os._exit(number)\n"
    )


def test_all_streams_closed(kit: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(kit, tmp_path, dirs_exist_ok=True)
    before = set(os.listdir(tmp_path))
    program = f"{shlex.quote(sys.executable)} -c {shlex.quote(streams_closed(INTO_FILES))}"
    done = subprocess.run(["bash", "-c", f"{program} <&- >&- 2>&-"], cwd=tmp_path)
    assert done.returncode == 0, INTO_FILES[done.returncode - 1].command
    written = {slot.name for example in INTO_FILES for slot in example.slots if slot.written}
    assert written <= set(os.listdir(tmp_path)) - before | {"image.pgm"}


@pytest.mark.parametrize(
    "line",
    ["frontier - --known - --robot 1,1", "similarity-table - -", "similarity-table --database - -",
     "compare - -", "evaluate - -", "evaluate - --self-check -", "info - -", "slam-replay - -",
     "slam-replay - --known -", "import - - out.mcap", "render - --png out.png --trace -",
     "simulate - out.mcap --path -", "transform - out.yaml --merge -",
     "transform - out.yaml --crop known --trace - out.json"],
)  # fmt: skip
def test_two_inputs_on_standard_input(line: str, sandbox: Sandbox) -> None:
    ran = sandbox.run(*line.split())
    assert is_wrong_usage(ran)
    assert "Two inputs cannot both be standard input." in ran.err
