"""Every file that a command reads, in every way in which it can be bad, or odd and good."""

from __future__ import annotations

import os
import random
import re
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from conformance.examples import Example, Slot, all_examples
from conformance.kit import ODD_NAMES, Ran, Sandbox

from mapcli.errors import printable

INPUTS = [
    pytest.param(example, slot, id=f"{example.name}-{slot.parameter}-{slot.name}")
    for example in all_examples()
    for slot in example.slots
    if not slot.written
]

Usual = Callable[[Example], Ran]


def make_missing(path: Path) -> None:
    path.unlink()


def make_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def make_empty(path: Path) -> None:
    path.write_bytes(b"")


def make_noise(path: Path) -> None:
    path.write_bytes(random.Random(1).randbytes(5000))


def make_zeros(path: Path) -> None:
    path.write_bytes(bytes(5000))


def make_wrong_format(path: Path) -> None:
    is_log = path.suffix in (".mcap", ".log")
    path.write_bytes(b"points:\n  - [0, 0]\n" if is_log else b"\x89MCAP0\r\n" * 9)


def make_unreadable(path: Path) -> None:
    path.chmod(0)


def make_device(path: Path) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def make_dangling(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


def make_loop(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


BAD = {
    make.__name__.removeprefix("make_"): make
    for make in (
        make_missing, make_folder, make_empty, make_noise, make_zeros, make_wrong_format,
        make_unreadable, make_device, make_dangling, make_loop,
    )
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_a_bad_file_is_one_error(
    example: Example, slot: Slot, kind: str, sandbox: Sandbox, usual: Usual
) -> None:
    usual(example)  # what is imported late could not be, later, as another user
    BAD[kind](Path(slot.name))
    ran = sandbox.run(*example.arguments(), as_nobody=kind == "unreadable")
    if kind == "wrong_format" and example.command == "info":  # no format is wrong for it
        ran.is_fine()
    else:
        ran.is_one_error(slot.name)


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_what_is_left_of_a_file_is_used_or_an_error(
    example: Example, slot: Slot, share: float, sandbox: Sandbox
) -> None:
    data = Path(slot.name).read_bytes()
    Path(slot.name).write_bytes(data[: int(share * len(data))])
    ran = sandbox.run(*example.arguments())
    if ran.status == 0:
        ran.is_fine()
    else:  # what is left may be sound, and not go with another file
        ran.is_one_error(*(other.name for other in example.slots if not other.written))


@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_a_fifo_is_read_as_a_file(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    wanted = usual(example)
    path = Path(slot.name)
    data = path.read_bytes()
    path.unlink()
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_bytes, args=[data], daemon=True)
    writer.start()
    ran = sandbox.run(*example.arguments())
    ran.is_fine()
    assert (ran.out, ran.files) == (wanted.out, wanted.files)


@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_a_link_is_read_as_its_file(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    wanted = usual(example)
    Path("elsewhere").mkdir()
    Path(slot.name).rename(Path("elsewhere", slot.name))
    Path(slot.name).symlink_to(Path("elsewhere", slot.name))
    ran = sandbox.run(*example.arguments())
    ran.is_fine()
    assert (ran.out, ran.files) == (wanted.out, wanted.files)


@pytest.mark.parametrize("kind", ODD_NAMES)
@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_an_odd_name(
    example: Example, slot: Slot, kind: str, sandbox: Sandbox, usual: Usual
) -> None:
    wanted = usual(example)
    name = f"{ODD_NAMES[kind]}{Path(slot.name).suffix}"
    Path(slot.name).rename(name)
    ran = sandbox.run(*example.arguments({slot: name}))
    ran.is_fine()
    assert without_names(ran.files) == without_names(wanted.files)
    assert ran.out.decode().replace(printable(name), slot.name) == wanted.out.decode()
    Path(name).unlink()
    for made in ran.files:
        Path(made).unlink()
    sandbox.run(*example.arguments({slot: name})).is_one_error(name)


@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_standard_input(example: Example, slot: Slot, sandbox: Sandbox, usual: Usual) -> None:
    wanted = usual(example)
    data = Path(slot.name).read_bytes()
    Path(slot.name).unlink()
    ran = sandbox.run(*example.arguments({slot: "-"}), stdin=data)
    if Path(slot.name).suffix in TOLD_BY_SUFFIX:
        assert ran.status == 2
        assert Path(slot.name).suffix in ran.err
        return
    ran.is_fine()
    assert without_names(ran.files) == without_names(wanted.files)


def without_names(files: Mapping[str, bytes]) -> list[str]:
    """The files that were made, in order, with NAME for that of a drive in theirs."""
    names = (re.sub(r"(trace|map)-[^/]*\.", r"\1-NAME.", name) for name in files)
    return sorted(re.sub(r"(?s)^.*-slam/", "NAME-slam/", name) for name in names)


TOLD_BY_SUFFIX = {".relations"}
"""Formats that have nothing by which they could be told on standard input."""


@pytest.mark.parametrize("kind", ["empty", "noise", "zeros"])
@pytest.mark.parametrize(
    ("example", "slot"), [p for p in INPUTS if Path(p.values[1].name).suffix not in TOLD_BY_SUFFIX]
)
def test_bad_standard_input(example: Example, slot: Slot, kind: str, sandbox: Sandbox) -> None:
    path = Path(slot.name)
    BAD[kind](path)
    data = path.read_bytes()
    path.unlink()
    sandbox.run(*example.arguments({slot: "-"}), stdin=data).is_one_error("-")


@pytest.mark.parametrize(("example", "slot"), INPUTS)
def test_the_traceback_is_shown_when_asked_for(
    example: Example, slot: Slot, sandbox: Sandbox
) -> None:
    Path(slot.name).unlink()
    ran = sandbox.run(*example.arguments(), "--debug")
    assert ran.status == 1
    assert ran.err.startswith("Traceback (most recent call last):\n")
    assert ran.err.splitlines()[-1].startswith(f"Error: {slot.name}: ")
