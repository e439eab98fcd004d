"""The one reader of whole files and the one writer of outputs: `input.py` and `output.py`."""

from __future__ import annotations

import gzip
import hashlib
import os
import tempfile
import threading
from pathlib import Path

import pytest

from mapcli.errors import FormatError, OutputError
from mapcli.formats.input import DigestingReader, read_file, spooled, unpacked
from mapcli.formats.output import check_output, output_file, write_bytes, write_files


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    with output_file(tmp_path / "out") as file:
        file.write(b"new")
        assert "out" not in names(tmp_path)
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out").read_bytes() == b"new"


def test_a_failure_leaves_the_older_file(tmp_path: Path) -> None:
    write_bytes(tmp_path / "out", b"old")

    def fail_half_way() -> None:
        with output_file(tmp_path / "out") as file:
            file.write(b"new")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out").read_bytes() == b"old"


def test_files_of_one_result_appear_together_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    with pytest.raises(OutputError, match="b: is a directory; expected a file name"):
        write_files(tmp_path, {"a": b"1", "b": [b"2", b"3"]})
    assert names(tmp_path) == ["b"]
    (tmp_path / "b").rmdir()
    write_files(tmp_path, {"a": b"1", "b": [b"2", b"3"]})
    assert (tmp_path / "a").read_bytes() + (tmp_path / "b").read_bytes() == b"123"


def test_no_clobber_keeps_a_file(tmp_path: Path) -> None:
    write_bytes(tmp_path / "out", b"old", no_clobber=True)
    for write in (check_output, lambda path, **how: write_bytes(path, b"new", **how)):
        with pytest.raises(OutputError, match="exists already, and --no-clobber is set"):
            write(tmp_path / "out", no_clobber=True)
    assert (tmp_path / "out").read_bytes() == b"old"


def test_an_early_check_leaves_no_file(tmp_path: Path) -> None:
    check_output(tmp_path / "folder" / "that" / "is" / "not" / "there")
    check_output("-")
    assert names(tmp_path) == []


def test_reading_names_the_file_and_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"nowhere: no such file$"):
        read_file(tmp_path / "nowhere")
    with pytest.raises(FormatError, match=r"is a directory; expected a world$"):
        read_file(tmp_path, "a world")


def test_digests_are_of_the_bytes_that_were_read(tmp_path: Path) -> None:
    write_bytes(tmp_path / "one", b"1")
    read = DigestingReader()
    assert read(tmp_path / "one") == b"1"
    assert read.digests == {"one": hashlib.sha256(b"1").hexdigest()}


def test_gzip_is_unpacked_by_content() -> None:
    packed = gzip.compress(b"content")
    assert unpacked(packed, "a") == unpacked(b"content", "a") == b"content"
    with pytest.raises(FormatError, match=r"a: cannot be unpacked: .*; expected gzip"):
        unpacked(packed[:-9], "a")


def test_a_pipe_is_read_without_a_command(tmp_path: Path) -> None:
    fifo = tmp_path / "map.txt"
    os.mkfifo(fifo)
    writer = threading.Thread(target=fifo.write_bytes, args=[b"0 1\n"])
    writer.start()
    assert read_file(fifo) == b"0 1\n"
    writer.join()


def test_the_copy_of_a_pipe_has_no_name_that_could_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    copy = spooled([b"one ", b"two"])
    assert [copy.path.read_bytes(), copy.path.read_bytes()] == [b"one two", b"one two"]
    assert not list(tmp_path.iterdir())


def test_where_there_is_no_proc_the_copy_goes_with_its_last_reference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("mapcli.formats.input.OPEN_FILES", tmp_path / "none")
    copy = spooled([b"one"])
    assert copy.path.read_bytes() == b"one"
    del copy
    assert not list(tmp_path.iterdir())
