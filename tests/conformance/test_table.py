"""The table of examples is complete: every command, every parameter for a file."""

from __future__ import annotations

import os
from collections.abc import Callable

import click
import pytest
from conformance.examples import EXAMPLES, NOT_FILES, Example, all_examples, command, takes_file
from conformance.kit import Ran, Sandbox

from mapcli.cli import COMMANDS


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_an_example(name: str) -> None:
    assert EXAMPLES.get(name), (
        f"`mapcli {name}` is not in EXAMPLES of tests/conformance/examples.py: add a command line "
        "that works, on files of the kit, with < before each input and > before each output"
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_every_parameter_for_a_file_is_in_an_example(name: str) -> None:
    taken = {slot.parameter for example in all_examples() if example.command == name
             for slot in example.slots}  # fmt: skip
    for parameter in command(name).params:
        if takes_file(parameter):
            assert parameter.name in taken, (
                f"`mapcli {name}`: no example has {'/'.join(parameter.opts)}: add it to EXAMPLES "
                "of tests/conformance/examples.py, marked with < or >"
            )


@pytest.mark.parametrize("name", COMMANDS)
def test_every_text_is_a_file_or_known_to_be_none(name: str) -> None:
    for parameter in command(name).params:
        if isinstance(parameter.type, type(click.STRING)):
            assert parameter.name in NOT_FILES, (
                f"`mapcli {name}`: is {'/'.join(parameter.opts)} a file? Then its type is FILE of "
                "mapcli/commands/_options.py; else it belongs to NOT_FILES of "
                "tests/conformance/examples.py"
            )


@pytest.mark.parametrize("example", all_examples(), ids=lambda example: example.name)
def test_every_example_works_and_writes_all_its_files(
    example: Example, sandbox: Sandbox, usual: Callable[[Example], Ran]
) -> None:
    made = usual(example).files
    for slot in example.slots:
        if slot.written:
            assert [name for name in made if name.split(os.sep)[0] == slot.name], slot.name
