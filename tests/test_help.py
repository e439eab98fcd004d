"""Help, version, completion: what a user asks a command-line tool first."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator

import click
import pytest
from conftest import FIXTURES, run

from mapcli import __version__
from mapcli.cli import COMMANDS, cli


def command(name: str) -> click.Command:
    found = cli.get_command(click.Context(cli), name)
    assert found is not None
    return found


def parsed(name: str, arguments: list[str]) -> click.Context:
    """A command line as `mapcli` itself would read it. Below `mapcli`, because a command keeps
    the help options of the first context it is in, which those of `mapcli` must be."""
    above = click.Context(cli, info_name="mapcli", **cli.context_settings)
    return command(name).make_context(name, arguments, parent=above)


def examples(text: str | None) -> Iterator[list[str]]:
    """The words after `mapcli` of every example in a help text."""
    for line in (text or "").replace("\\\n", " ").splitlines():
        if line.strip().startswith("mapcli "):
            words = shlex.split(line, comments=True)
            yield words[1 : words.index("|") if "|" in words else None]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_with_examples(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(name, "--help") == 0
    text = capsys.readouterr().out
    assert text.startswith(f"Usage: mapcli {name} [OPTIONS] ")
    assert f"    mapcli {name} " in text
    for option in ("-q, --quiet", "-v, --verbose", "--debug", "-h, --help"):
        assert option in text


EXAMPLES = [
    words for text in (cli.help, *(command(n).help for n in COMMANDS)) for words in examples(text)
]


@pytest.mark.parametrize("words", EXAMPLES, ids=" ".join)
def test_examples_are_valid(words: list[str]) -> None:
    name, *arguments = words
    assert parsed(name, arguments).params


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_says_what_it_is_for(name: str) -> None:
    for parameter in command(name).params:
        if isinstance(parameter, click.Option):
            assert parameter.help, parameter.opts


def test_the_list_of_commands(capsys: pytest.CaptureFixture[str]) -> None:
    for flag in ("--help", "-h"):
        assert run(flag) == 0
        text = capsys.readouterr().out
        for name, sentence in COMMANDS.items():
            assert f"  {name}  " in text
            assert sentence in " ".join(text.split())


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    assert capsys.readouterr().out == f"mapcli {__version__}\n"


def test_a_slip_of_the_pen(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-repaly", "a.mcap") == 2
    assert "No such command 'slam-repaly'. Did you mean 'slam-replay'?" in capsys.readouterr().err
    assert run("xyzzy") == 2
    assert capsys.readouterr().err.endswith("No such command 'xyzzy'.\n")


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("slam", "slam-replay"), ("slam_replay", "slam-replay"), ("SLAM-Replay", "slam-replay"),
        ("similarity", "similarity-table"), ("explore", "frontier"), ("eval", "evaluate"),
        ("import_log", "import"), ("explor", "frontier"), ("help", "--help"),
    ],
)  # fmt: skip
def test_what_was_meant(line: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(line, "a.mcap") == 2
    assert capsys.readouterr().err.endswith(f"{line!r}. Did you mean {meant!r}?\n")


def test_an_option_before_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-q", "slam-replay", "a.mcap") == 2
    hint = "No such option '-q'. Options come after the command: mapcli slam-replay -q ...\n"
    assert capsys.readouterr().err.endswith(hint)
    assert run("--frobnicate", "slam-replay", "a.mcap") == 2
    assert "after the command" not in capsys.readouterr().err


def test_a_file_in_the_place_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(FIXTURES / "corridor.mcap") == 2
    hint = "It is an MCAP log; make a map of it with mapcli slam-replay.\n"
    assert capsys.readouterr().err.endswith(hint)


def test_without_a_command_the_help_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run() == 2
    alone = capsys.readouterr()
    assert run("--help") == 0
    assert (alone.out, alone.err) == (capsys.readouterr().out, "")


def completion(**environment: str) -> str:
    """What the program answers to a shell that asks for completion."""
    return subprocess.run(
        [sys.executable, "-c", "from mapcli.cli import main; main()"],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    ).stdout


def completed(words: str) -> set[str]:
    number = str(len(words.split(" ")) - 1)
    answer = completion(_MAPCLI_COMPLETE="zsh_complete", COMP_WORDS=words, COMP_CWORD=number)
    return set(answer.splitlines()) - {"_", "plain"}


@pytest.mark.slow
def test_shell_completion() -> None:
    for shell in ("bash", "zsh", "fish"):
        script = completion(_MAPCLI_COMPLETE=f"{shell}_source")
        assert f"_MAPCLI_COMPLETE={shell}_complete" in script
    assert {"slam-replay", "simulate"} <= completed("mapcli s")
    assert completed("mapcli slam-replay --search ") == {"window", "book", "none"}


@pytest.mark.parametrize("name", COMMANDS)
def test_shells_complete_the_names_of_files(name: str) -> None:
    context = click.Context(command(name))
    for parameter in context.command.params:
        if isinstance(parameter, click.Argument) and not isinstance(parameter.type, click.Choice):
            (item,) = parameter.shell_complete(context, "fixtures/a")
            assert item.type == "file"
