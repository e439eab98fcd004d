"""The one writer: atomic, whole sets, links, devices, and runs that were killed."""

from __future__ import annotations

import fcntl
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from mapcli.errors import OutputError
from mapcli.formats.output import check_output, output_file, output_set, write_bytes, write_files


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_long_name(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 249)
    write_bytes(path, b"whole")
    assert path.read_bytes() == b"whole"
    assert names(tmp_path) == [path.name]


def test_the_mode_of_the_file_that_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "out"
    path.write_bytes(b"old")
    path.chmod(0o640)
    write_bytes(path, b"new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_new_file_gets_the_mode_of_any_other(tmp_path: Path) -> None:
    write_bytes(tmp_path / "out", b"new")
    (tmp_path / "other").write_bytes(b"")
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "other").stat().st_mode


@pytest.mark.parametrize("exists", [True, False])
def test_of_a_link_the_target_is_written(tmp_path: Path, exists: bool) -> None:
    (tmp_path / "folder").mkdir()
    target, link = tmp_path / "folder" / "target", tmp_path / "link"
    if exists:
        target.write_bytes(b"old")
    link.symlink_to("folder/target")
    write_bytes(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert names(tmp_path / "folder") == ["target"]


def test_a_device_is_written_into() -> None:
    before = os.stat("/dev/null")
    check_output("/dev/null")
    write_bytes("/dev/null", b"gone")
    after = os.stat("/dev/null")
    assert stat.S_ISCHR(after.st_mode)
    assert (before.st_rdev, before.st_ino) == (after.st_rdev, after.st_ino)


def test_a_fifo_is_written_into(tmp_path: Path) -> None:
    fifo, heard = tmp_path / "fifo", []
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: heard.append(fifo.read_bytes()))
    reader.start()
    check_output(fifo)
    write_bytes(fifo, b"through")
    reader.join()
    assert heard == [b"through"]
    assert stat.S_ISFIFO(fifo.stat().st_mode)


def test_standard_output_by_its_other_names(tmp_path: Path) -> None:
    """Also where it is a regular file that others append to."""
    code = (
        "import sys\nfrom mapcli.formats.output import check_output, write_bytes\n"
        "for name in ('/dev/stdout', '/dev/fd/1', '/proc/self/fd/1', '-'):\n"
        "    check_output(name)\n    write_bytes(name, name.encode() + b' ')\n"
    )
    path = tmp_path / "out"
    path.write_bytes(b"before ")
    with path.open("ab") as file:
        subprocess.run([sys.executable, "-c", code], stdout=file, check=True)
    assert path.read_bytes() == b"before /dev/stdout /dev/fd/1 /proc/self/fd/1 - "


def test_a_set_appears_together_or_not_at_all(tmp_path: Path) -> None:
    write_files(tmp_path, {"a": b"old a", "b": b"old b"})
    with pytest.raises(RuntimeError), output_set() as outputs:  # noqa: PT012
        outputs.write(tmp_path / "a", b"new a")
        outputs.write(tmp_path / "b", b"new b")
        assert (tmp_path / "a").read_bytes() == b"old a"
        raise RuntimeError
    assert [(tmp_path / name).read_bytes() for name in "ab"] == [b"old a", b"old b"]
    assert names(tmp_path) == ["a", "b"]


def test_when_the_second_cannot_be_renamed_the_first_is_as_before(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a", b"old a")
    with pytest.raises(OutputError, match="c"), output_set() as outputs:  # noqa: PT012
        outputs.write(tmp_path / "a", b"new a")
        outputs.write(tmp_path / "b", b"new b")
        outputs.write(tmp_path / "c", b"new c")
        (tmp_path / "c").mkdir()  # in the way
    assert (tmp_path / "a").read_bytes() == b"old a"
    assert names(tmp_path) == ["a", "c"]


def test_no_clobber_holds_against_another_run_at_the_same_moment(tmp_path: Path) -> None:
    path = tmp_path / "out"
    with (  # noqa: PT012
        pytest.raises(OutputError, match="File exists"),
        output_file(path, no_clobber=True) as file,
    ):
        file.write(b"mine")
        path.write_bytes(b"theirs")
    assert path.read_bytes() == b"theirs"
    assert names(tmp_path) == ["out"]


def test_a_signal_while_files_appear_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal comes between two renames: both files are new when it is heard."""
    replace, seen = os.replace, []

    def interrupted(*arguments: Path) -> None:
        replace(*arguments)
        os.kill(os.getpid(), signal.SIGINT)
        seen.append(names(tmp_path))

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files(tmp_path, {"a": b"1", "b": b"2"})
    assert len(seen) == 2
    assert names(tmp_path) == ["a", "b"]


def test_what_a_killed_run_has_left_is_cleared_and_what_a_living_one_writes_is_not(
    tmp_path: Path,
) -> None:
    dead, living = tmp_path / ".mapcli-0123.part", tmp_path / ".mapcli-4567.part"
    dead.write_bytes(b"half")
    with living.open("wb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        check_output(tmp_path / "out")
        assert names(tmp_path) == [living.name]


@pytest.mark.slow
def test_killed_at_any_moment_nothing_is_half(tmp_path: Path) -> None:
    """Ten kills here; `benchmarks/RESULTS.md` has a hundred of whole replays."""
    code = (
        "import sys\nfrom mapcli.formats.output import write_files\n"
        "print('on', flush=True)\nn = 0\n"
        "while True:\n"
        "    n += 1\n"
        "    content = (b'%d' % n) * 100000\n"
        f"    write_files({str(tmp_path)!r}, {{'a': content, 'b': content}})\n"
    )
    for k in range(10):
        process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.02 + 0.013 * k)
        process.kill()
        process.wait()
        process.stdout.close()
        for name in "ab":
            content = (tmp_path / name).read_bytes()
            assert content == content[: len(content) // 100000] * 100000
    check_output(tmp_path / "a")
    assert names(tmp_path) == ["a", "b"]
