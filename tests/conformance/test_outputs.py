"""Every file that a command writes, under every kind of name."""

from __future__ import annotations

import json
import os
import stat
import threading
from collections.abc import Callable, Iterator
from itertools import permutations
from pathlib import Path

import pytest
from conformance.examples import IN_PLACE, Example, Slot, all_examples
from conformance.kit import ODD_NAMES, Ran, Sandbox

Usual = Callable[[Example], Ran]

OUTPUTS = [
    pytest.param(example, slot, id=f"{example.name}-{slot.parameter}-{slot.name}")
    for example in all_examples()
    for slot in example.slots
    if slot.written and not slot.folder
]
FOLDERS = [
    pytest.param(example, slot, id=f"{example.name}-{slot.parameter}")
    for example in all_examples()
    for slot in example.slots
    if slot.folder
]

FIRST_FILES = "map.png", "map.yaml", "index.html"
"""Of a folder, one of which is named where it cannot be written."""


def made_by(example: Example, slot: Slot, usual: Usual) -> tuple[bytes, dict[str, bytes]]:
    """What an example usually writes into a file, and into the others."""
    files = dict(usual(example).files)
    return files.pop(slot.name), files


def content(data: bytes) -> object:
    """What a file says but for the digests of the files beside it, which are not always there."""
    if not data.startswith(b"{"):
        return data
    document = json.loads(data)
    document.pop("files", None)
    return document


def contents(files: dict[str, bytes]) -> dict[str, object]:
    return {name: content(data) for name, data in files.items()}


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_file_is_replaced_and_keeps_its_mode(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    wanted = usual(example)
    path = Path(slot.name)
    path.write_bytes(b"old")
    path.chmod(0o640)
    os.link(path, "other-name")  # a file that is replaced is not written into
    ran = sandbox.run(*example.arguments())
    ran.is_fine()
    assert ran.files == wanted.files
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert Path("other-name").read_bytes() == b"old"


@pytest.mark.parametrize(
    "example",
    [example for example in all_examples() if any(slot.written for slot in example.slots)],
    ids=lambda example: example.name,
)
def test_no_clobber_keeps_every_file(example: Example, sandbox: Sandbox, usual: Usual) -> None:
    made = usual(example).files
    for name in made:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes(b"old")
        sandbox.run(*example.arguments(), "--no-clobber").is_one_error(name)
        Path(name).unlink()
        Path(name).symlink_to("nowhere")
        sandbox.run(*example.arguments(), "--no-clobber").is_one_error(name)
        Path(name).unlink()
    ran = sandbox.run(*example.arguments(), "--no-clobber")
    ran.is_fine()
    assert ran.files == made


@pytest.mark.parametrize("exists", [True, False])
@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_of_a_link_the_target_is_written(
    example: Example, slot: Slot, exists: bool, sandbox: Sandbox, usual: Usual
) -> None:
    data, others = made_by(example, slot, usual)
    Path("elsewhere").mkdir()
    target = Path("elsewhere", "target")
    if exists:
        target.write_bytes(b"old")
    Path(slot.name).symlink_to(target)
    ran = sandbox.run(*example.arguments())
    ran.is_fine()
    assert Path(slot.name).is_symlink()
    assert ran.files == {slot.name: data, str(target): data, **others}


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_device_is_written_into(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    _, others = made_by(example, slot, usual)
    if os.geteuid() == 0:  # who could replace the true one
        try:
            os.mknod(slot.name, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
            Path(slot.name).write_bytes(b"")
        except OSError:
            pytest.skip("no devices can be made here")
    else:
        Path(slot.name).symlink_to(os.devnull)
    ran = sandbox.run(*example.arguments())
    ran.is_fine()
    assert ran.files == others
    assert stat.S_ISCHR(Path(slot.name).stat().st_mode)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_full_device(example: Example, slot: Slot, sandbox: Sandbox, usual: Usual) -> None:
    usual(example)
    Path(slot.name).symlink_to("/dev/full")
    ran = sandbox.run(*example.arguments())
    ran.is_one_error(slot.name)
    assert "o space left on device" in ran.err


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_fifo_is_written_into(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    data, others = made_by(example, slot, usual)
    os.mkfifo(slot.name)
    heard: list[bytes] = []
    reader = threading.Thread(
        target=lambda: heard.append(Path(slot.name).read_bytes()), daemon=True
    )
    reader.start()
    ran = sandbox.run(*example.arguments())
    ran.is_fine()
    reader.join(5)
    assert heard == [data]
    assert ran.files == others
    assert stat.S_ISFIFO(Path(slot.name).stat().st_mode)


@pytest.mark.parametrize("link", [True, False])
@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_standard_output_by_its_name(
    example: Example, slot: Slot, link: bool, sandbox: Sandbox, usual: Usual
) -> None:
    """Here it is a regular file, which must not be replaced either."""
    data, others = made_by(example, slot, usual)
    if link:
        Path(slot.name).symlink_to("/dev/stdout")
        ran = sandbox.run(*example.arguments())
    else:
        ran = sandbox.run(*example.arguments({slot: "/dev/stdout"}))
        if ran.status == 2:  # the suffix says the format
            assert Path(slot.name).suffix in ran.err
            assert not ran.files
            return
    ran.is_fine()
    assert data in ran.out or content(data) == content(ran.out)
    assert contents(ran.files) == contents(others)


ONE_FORMAT = b"resolution: ", b"origin: ", b"? ? ", b"kind: scan", b"stamp_ns,x,y,"
"""How text maps, perceptions in YAML and traces in CSV begin: what is written without a suffix."""


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_dash_is_standard_output(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    """Where the suffix says the format, it is one format there; a map has no image then."""
    data, others = made_by(example, slot, usual)
    if slot.name.endswith(".yaml"):
        others.pop(slot.name.replace(".yaml", ".pgm"), None)
    ran = sandbox.run(*example.arguments({slot: "-"}))
    ran.is_fine()
    assert contents(ran.files) == contents(others)
    if content(ran.out) != content(data):
        assert ran.out.startswith(ONE_FORMAT)


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_missing_folder_is_made(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    data, _ = made_by(example, slot, usual)
    name = f"new/and/deep/{slot.name}"
    ran = sandbox.run(*example.arguments({slot: name}))
    ran.is_fine()
    assert content(ran.files[name]) == content(data)


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_file_in_the_place_of_its_folder(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    usual(example)
    Path("file").write_bytes(b"mine")
    ran = sandbox.run(*example.arguments({slot: f"file/{slot.name}"}))
    ran.is_one_error(f"file/{slot.name}")
    assert ran.err.count("\n") == 1


@pytest.mark.parametrize(("example", "slot"), [*OUTPUTS, *FOLDERS])
def test_a_folder_that_cannot_be_written_to(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    usual(example)
    Path("closed").mkdir(0o555)
    name = f"closed/{slot.name}"
    ran = sandbox.run(*example.arguments({slot: name}), as_nobody=True)
    ran.is_one_error(name, *(f"{name}/{file}" for file in FIRST_FILES))
    assert ran.err.count("\n") == 1
    assert "ermission denied" in ran.err


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_a_folder_in_the_place_of_a_file(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    usual(example)
    Path(slot.name).mkdir()
    ran = sandbox.run(*example.arguments())
    ran.is_one_error(slot.name)
    assert ran.err.count("\n") == 1


@pytest.mark.parametrize("letters", [249, 256])
@pytest.mark.parametrize(("example", "slot"), [*OUTPUTS, *FOLDERS])
def test_a_long_name(
    example: Example, slot: Slot, letters: int, sandbox: Sandbox, usual: Usual
) -> None:
    made = usual(example).files
    suffix = Path(slot.name).suffix
    name = "n" * (letters - len(suffix)) + suffix
    ran = sandbox.run(*example.arguments({slot: name}))
    if letters > 255:
        ran.is_one_error(name, *(f"{name}/{file}" for file in FIRST_FILES))
        assert ran.err.count("\n") == 1
    else:
        ran.is_fine()
        assert len(ran.files) == len(made)


@pytest.mark.parametrize("kind", ["control characters", "no UTF-8"])
@pytest.mark.parametrize(("example", "slot"), [*OUTPUTS, *FOLDERS])
def test_an_odd_name(
    example: Example, slot: Slot, kind: str, sandbox: Sandbox, usual: Usual
) -> None:
    made = usual(example).files
    name = ODD_NAMES[kind] + Path(slot.name).suffix
    ran = sandbox.run(*example.arguments({slot: name}), "-v")
    image = slot.name.replace(".yaml", ".pgm")
    if kind == "no UTF-8" and image != slot.name and image in made:
        ran.is_one_error(name)  # YAML cannot hold the name of its image
        return
    ran.is_fine()
    ran.is_no_fault()
    assert b"\x1b" not in ran.out
    assert len(ran.files) == len(made)


def spellings(file: str, suffix: str) -> Iterator[str]:
    """Names of a file, most of them new; a link may have the suffix that an output needs."""
    yield file
    yield f"./{file}"
    yield os.path.abspath(file)
    Path("link" + suffix).symlink_to(file)
    yield "link" + suffix
    os.link(file, "hard" + suffix)
    yield "hard" + suffix


@pytest.mark.parametrize(("example", "slot"), OUTPUTS)
def test_no_input_is_written_onto(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    usual(example)
    for read in (other for other in example.slots if not other.written):
        if (example.command, slot.parameter, read.parameter) in IN_PLACE:
            continue
        files = [read.name, "image.pgm"] if read.name == "image.yaml" else [read.name]
        for file in files:
            for name in spellings(file, Path(slot.name).suffix):
                ran = sandbox.run(*example.arguments({slot: name}))
                assert not ran.files, name
                if ran.status == 2:  # the suffix says the format
                    assert Path(name).suffix != Path(slot.name).suffix
                else:
                    ran.is_one_error(name, name.removeprefix("./"))
                    assert ran.err.count("\n") == 1
            for name in ("link", "hard"):
                Path(name + Path(slot.name).suffix).unlink()


@pytest.mark.parametrize(("command", "output", "read"), sorted(IN_PLACE))
def test_what_may_be_done_in_place(
    command: str, output: str, read: str, sandbox: Sandbox, usual: Usual
) -> None:
    (example,) = (e for e in all_examples() if e.command == command and e.number == 0)
    target, source = (
        next(s for s in example.slots if s.parameter == parameter) for parameter in (output, read)
    )
    usual(example)
    for name in (source.name, f"./{source.name}", os.path.abspath(source.name)):
        before = Path(source.name).read_bytes()
        ran = sandbox.run(*example.arguments({target: name}))
        ran.is_fine()
        Path(source.name).write_bytes(before)


@pytest.mark.parametrize("example", all_examples(), ids=lambda example: example.name)
def test_no_two_results_in_one_file(example: Example, sandbox: Sandbox, usual: Usual) -> None:
    """Also not in the image of a YAML."""
    made = usual(example).files
    written = [slot for slot in example.slots if slot.written and not slot.folder]
    for name, slot in ((name, slot) for name in made for slot in written if slot.name != name):
        if any(name == other.name for other in written):
            same = sandbox.run(*example.arguments({slot: name}))
            assert (same.status, same.files) == (2, {}), same.err
        Path(slot.name).symlink_to(name)
        ran = sandbox.run(*example.arguments())
        assert not ran.files, (name, slot.name)
        assert ran.status in (1, 2)
        assert "cannot both be written" in ran.err
        Path(slot.name).unlink()
    for slot, other in permutations(written, 2):
        ran = sandbox.run(*example.arguments({slot: "-", other: "-"}))
        assert (ran.status, ran.files) == (2, {})


@pytest.mark.parametrize(("example", "slot"), FOLDERS)
def test_a_folder_is_made_and_its_other_files_stay(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    made = [name.removeprefix(f"{slot.name}/") for name in usual(example).files
            if name.startswith(f"{slot.name}/")]  # fmt: skip
    assert made
    for name in ("new/and/deep", "there", "link"):
        if name == "link":
            Path(name).symlink_to("there")
        elif name == "there":
            Path(name).mkdir()
            Path(name, "map.png").write_bytes(b"old")
            Path(name, "mine").write_bytes(b"mine")
        ran = sandbox.run(*example.arguments({slot: name}))
        ran.is_fine()
        for file in made:
            assert Path(name, file).is_file()
    assert Path("there", "mine").read_bytes() == b"mine"
    assert Path("link").is_symlink()


@pytest.mark.parametrize(("example", "slot"), FOLDERS)
def test_a_file_in_the_place_of_a_folder(
    example: Example, slot: Slot, sandbox: Sandbox, usual: Usual
) -> None:
    usual(example)
    Path(slot.name).write_bytes(b"mine")
    ran = sandbox.run(*example.arguments())
    ran.is_one_error(*(f"{slot.name}/{file}" for file in FIRST_FILES))
    assert ran.err.count("\n") == 1
