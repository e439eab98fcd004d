"""`mapcli convert` as a user runs it."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import run

from mapcli import Pose2D, load_map
from mapcli.commands._map_output import terminal_digits

BOOK = "resolution: 0.5\n? 0.1 0.2\n1 0.3 0.9\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("book.txt").write_text(BOOK)
    Path("grey.pgm").write_bytes(b"P5 3 1 255\n\x00\x64\xfe")
    return tmp_path


def convert(*arguments: str) -> int:
    return run("convert", *arguments)


def names() -> set[str]:
    return {path.name for path in Path().iterdir()} - {"book.txt", "grey.pgm"}


def feed(monkeypatch: pytest.MonkeyPatch, data: bytes) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BufferedReader(io.BytesIO(data))))


def test_text_to_pair_says_what_is_lost(capsys: pytest.CaptureFixture[str]) -> None:
    assert convert("book.txt", "m.yaml") == 0
    assert names() == {"m.yaml", "m.pgm"}
    assert Path("m.pgm").read_bytes() == b"P5\n3 2\n255\n\xcd\xfe\xfe\x00\xcd\x00"
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "Note: m.yaml: 3 cells whose probability changes, by up to 0.2",
        "Note: m.yaml: 1 cell known before and unknown now",
        "Note: m.yaml: --mode scale keeps whole percents, and .txt keeps everything",
    ]


def test_lossless_conversions_say_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert convert("book.txt", "m.yaml", "--mode", "scale") == 0
    assert names() == {"m.yaml", "m.png"}
    assert convert("m.yaml", "again.txt") == 0
    assert Path("again.txt").read_text() == "resolution: 0.5\n  ? 0.1 0.2\n  1 0.3 0.9\n"
    assert capsys.readouterr() == ("", "")


def test_digits_round_text_and_say_so(capsys: pytest.CaptureFixture[str]) -> None:
    Path("fine.txt").write_text("? 0.14 2.4e-6\n1 0.75 0.3\n")
    assert convert("fine.txt", "rounded.txt", "--digits", "1") == 0
    assert Path("rounded.txt").read_text() == "  ? 0.1   0\n  1 0.8 0.3\n"
    changed = "3 cells whose probability changes, by up to 0.05; 0 by more than half a digit (0.05)"
    assert capsys.readouterr().err == f"Note: rounded.txt: {changed}\n"
    assert convert("fine.txt", "fine.yaml", "--digits", "1") == 2
    assert convert("fine.txt", "-", "--digits", "1", "--characters") == 2


def test_pipes_get_every_digit_and_terminals_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("fine.txt").write_text("? 0.14 2.4e-6\n")
    assert convert("fine.txt", "-") == 0
    assert capsys.readouterr().out.split() == ["?", "0.14", "2.4e-6"]
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert terminal_digits("-") == 1
    assert terminal_digits("map.txt") is None


def test_image_alone_keeps_the_place_and_says_where(capsys: pytest.CaptureFixture[str]) -> None:
    assert convert("book.txt", "m.pgm", "--mode", "raw") == 0
    assert "map_server needs a .yaml" in capsys.readouterr().err
    assert load_map("m.pgm").grid.resolution == 0.5


def test_quiet_and_verbose(capsys: pytest.CaptureFixture[str]) -> None:
    assert convert("book.txt", "m.yaml", "-q") == 0
    assert capsys.readouterr().err == ""
    assert convert("book.txt", "m.yaml", "-v") == 0
    assert capsys.readouterr().err.endswith("m.pgm, m.yaml: 2 rows, 3 columns\n")


def test_threshold_of_sect_9_2() -> None:
    """Cells of at least 0.7 are the object, and 0.5 makes it bigger."""
    Path("object.txt").write_text("0 0.7 0.69\n? 0.5 1\n")
    assert convert("object.txt", "a.txt", "--threshold", "0.7") == 0
    assert Path("a.txt").read_text() == "0 1 0\n? 0 1\n"
    assert convert("object.txt", "b.txt", "--threshold", "0.5") == 0
    assert Path("b.txt").read_text() == "0 1 1\n? 1 1\n"


def test_place_options() -> None:
    assert convert("grey.pgm", "m.yaml", "--resolution", "0.05", "--origin", "-1,2,90") == 0
    grid = load_map("m.yaml").grid
    assert grid.resolution == 0.05
    assert grid.origin == Pose2D(-1, 2, np.pi / 2)


def test_dialects() -> None:
    Path("s.yaml").write_text(
        "image: grey.pgm\nmode: scale\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    # 1 - 100/255 = 0.6078; (0.6078 - 0.196) / 0.454 = 0.9071; 1 + 98 * 0.9071 = 89.9
    assert convert("s.yaml", "nav2.txt") == 0
    assert Path("nav2.txt").read_text() == "   1 0.91    0\n"
    assert convert("s.yaml", "ros1.txt", "--dialect", "ros1") == 0
    assert Path("ros1.txt").read_text() == "   1 0.89    0\n"


def test_ways_to_write() -> None:
    assert convert("book.txt", "c.txt", "--characters", "--free-thresh", "0.1") == 0
    assert Path("c.txt").read_text() == "resolution: 0.5\n?.?\n#?#\n"
    assert convert("book.txt", "i.yaml", "--inline") == 0
    assert '  - "  1 0.3 0.9"\n' in Path("i.yaml").read_text()
    assert convert("book.txt", "p.pgm", "--plain", "--bits", "16", "--negate") == 0
    assert (
        Path("p.pgm").read_text().endswith("\n3 2\n65535\n12850   257   257\n65535 12850 65535\n")
    )
    assert convert("book.txt", "noname", "--to", "png", "-q") == 0
    assert Path("noname").read_bytes().startswith(b"\x89PNG")
    assert names() == {"c.txt", "i.yaml", "p.pgm", "noname"}


def test_pipelines(
    capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert convert("book.txt", "-", "--to", "png", "--mode", "scale") == 0
    picture = capsysbinary.readouterr().out
    feed(monkeypatch, picture)
    assert convert("-", "-") == 0
    assert capsysbinary.readouterr() == (b"resolution: 0.5\n  ? 0.1 0.2\n  1 0.3 0.9\n", b"")
    feed(monkeypatch, BOOK.encode())
    assert convert("-", "-", "--to", "yaml") == 0
    assert b'cells:\n  - "  ? 0.1 0.2"\n' in capsysbinary.readouterr().out


def test_no_clobber_leaves_both_files_of_a_pair(capsys: pytest.CaptureFixture[str]) -> None:
    Path("m.yaml").write_text("mine")
    assert convert("book.txt", "m.yaml", "--no-clobber") == 1
    assert capsys.readouterr().err == "Error: m.yaml: exists already, and --no-clobber is set\n"
    assert names() == {"m.yaml"}
    assert Path("m.yaml").read_text() == "mine"


def test_a_pair_is_replaced_as_a_whole_or_not_at_all(capsys: pytest.CaptureFixture[str]) -> None:
    Path("m.pgm").write_text("older")
    Path("m.yaml").mkdir()
    assert convert("book.txt", "m.yaml", "-q") == 1
    assert capsys.readouterr().err == "Error: m.yaml: is a directory; expected a file name\n"
    assert Path("m.pgm").read_text() == "older"
    assert names() == {"m.pgm", "m.yaml"}


def test_parts_of_the_input_are_not_overwritten(capsys: pytest.CaptureFixture[str]) -> None:
    before = Path("grey.pgm").read_bytes()
    assert convert("grey.pgm", "grey.yaml", "-q") == 1
    message = "Error: grey.pgm: is part of IN and would change; expected another OUT\n"
    assert capsys.readouterr().err == message
    assert Path("grey.pgm").read_bytes() == before
    assert names() == set()


def test_in_place() -> None:
    assert convert("book.txt", "book.txt", "--threshold", "0.5") == 0
    assert Path("book.txt").read_text() == "resolution: 0.5\n? 0 0\n1 0 1\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no.yaml", "m.txt"], "Error: no.yaml: no such file\n"),
        ([".", "m.txt"], "Error: .: is a directory; expected a map file\n"),
        (["empty.pgm", "m.txt"], "Error: empty.pgm: is empty; expected a map\n"),
        (
            ["short.pgm", "m.txt"],
            "Error: short.pgm: holds 2 pixels; expected 4 as its header says\n",
        ),
        (
            ["book.txt", "book.txt/m.yaml"],
            "Error: book.txt/m.yaml: cannot be written: Not a directory\n",
        ),
    ],
)
def test_data_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("empty.pgm").write_bytes(b"")
    Path("short.pgm").write_bytes(b"P5 2 2 255\nab")
    Path("m.txt").write_text("older")
    assert convert(*arguments, "-q") == 1
    assert capsys.readouterr().err == message
    assert Path("m.txt").read_text() == "older"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["book.txt"], "Missing argument 'OUT'"),
        (["book.txt", "m.jpg"], "'m.jpg' says no format; end it in .txt, .yaml"),
        (
            ["book.txt", "m.yaml", "--free-thresh", "0.8"],
            "free_thresh 0.8 and occupied_thresh 0.65",
        ),
        (["book.txt", "m.yaml", "--characters"], "--characters is for txt, and OUT is yaml"),
        (["book.txt", "-", "--inline"], "--inline is for yaml, and OUT is txt"),
        (["book.txt", "m.yaml", "--threshold", "1.5"], "1.5 is not in the range 0<=x<=1"),
        (["book.txt", "m.yaml", "--resolution", "0"], "Invalid value for '--resolution'"),
        (["book.txt", "m.yaml", "--resolution", "nan"], "Invalid value for '--resolution'"),
        (
            ["book.txt", "m.yaml", "--mode", "grey"],
            "'grey' is not one of 'trinary', 'scale'",
        ),
        (["book.txt", "m.yaml", "--origin", "1,2"], "'1,2' is not of the form X,Y,YAW_DEG"),
        (
            ["book.txt", "m.yaml", "--mode", "raw", "--negate"],
            "--negate has no meaning with",
        ),
    ],
)
def test_usage_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert convert(*arguments) == 2
    assert message in capsys.readouterr().err
    assert names() == set()


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert convert("--help") == 0
    assert "mapcli convert map.yaml map.txt" in capsys.readouterr().out
