"""Odd names, odd terminals, closed streams and pipes: nothing of it is a fault."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import FIXTURES

from mapcli.cli import main
from mapcli.errors import FormatError, printable

MAPCLI = f"{sys.executable} -m mapcli"
CORNER, CORRIDOR = FIXTURES / "corner.txt", FIXTURES / "corridor.mcap"
CLIPBOARD = "\x1b]52;c;eA==\x07"
"""Puts `x` on the clipboard of a terminal that obeys."""


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        ["bash", "-c", command], capture_output=True, env={**os.environ, **environment}
    )


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as leaving:
        main(list(arguments))
    assert isinstance(leaving.value.code, int)
    return leaving.value.code


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("map.yaml", "map.yaml"),
        ("Grün ⊙ 地図", "Grün ⊙ 地図"),
        ("a\x1b[2Jb", r"a\x1b[2Jb"),
        ("a\nb\r\t\x7f", r"a\nb\r\t\x7f"),
        ("\x9b31m", r"\x9b31m"),
        ("txt\u202egnp", r"txt\u202egnp"),
        (os.fsdecode(b"n\xff"), r"n\xff"),
    ],
)
def test_what_a_terminal_would_obey_is_shown(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_an_error_is_one_line_whatever_its_file_is_called() -> None:
    error = FormatError("bad\n  thing", file=f"a\n{CLIPBOARD}", where="line 1\x1b")
    assert str(error) == r"a\n\x1b]52;c;eA==\x07: line 1\x1b: bad thing"


@pytest.mark.parametrize(
    "arguments",
    [
        ["info", "{}.txt"],
        ["info", "{}.mcap"],
        ["slam-replay", "{}.mcap"],
        ["evaluate", "{}.tum", "{}.tum"],
        ["convert", "{}.txt", "{}.foo"],
        ["{}"],
        ["info", "--{}", "x"],
        ["convert", "x", "y", "--mode", "{}"],
    ],
)
def test_a_name_that_commands_the_terminal(
    arguments: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(*(part.format(CLIPBOARD) for part in arguments)) in (1, 2)
    out, err = capfd.readouterr()
    assert "\x1b" not in out + err
    assert r"\x1b]52;c;eA" in err


def test_a_value_that_commands_the_terminal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    odd = tmp_path / "odd.yaml"
    odd.write_text(
        'image: "none\\e]52;c;eA==\\a.pgm"\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.196\n"key\\e[2J": 1\n'
    )
    assert run("info", str(odd)) == 1
    err = capfd.readouterr().err
    assert "\x1b" not in err
    assert r"none\x1b]52;c;eA==\x07.pgm" in err


@pytest.mark.parametrize(
    ("command", "out"),
    [
        ("info {corner} >&-", b""),
        ("info {corner} 2>&- | head -1", f"{CORNER}: map, text, numbers\n".encode()),
        ("--help >&-", b""),
        ("convert {corner} x.yaml >&- 2>&- <&- && cat x.pgm | head -c 2", b"P5"),
    ],
)
def test_closed_streams(command: str, out: bytes, tmp_path: Path) -> None:
    done = shell(f"cd {tmp_path}; {MAPCLI} " + command.format(corner=CORNER))
    assert (done.returncode, done.stdout, done.stderr) == (0, out, b"")


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        ("info {corner} --json - >&-", "Error: -: standard output is closed\n"),
        ("convert {corner} - >&-", "Error: -: standard output is closed\n"),
        ("info - <&-", "Error: -: standard input is closed\n"),
        ("info - <&- 2>&-", ""),
        ("slam-replay - <&-", "Error: -: standard input is closed\n"),
    ],
)
def test_a_closed_stream_that_is_needed(command: str, problem: str, tmp_path: Path) -> None:
    done = shell(f"cd {tmp_path}; {MAPCLI} " + command.format(corner=CORNER))
    assert (done.returncode, done.stderr.decode()) == (1, problem)


@pytest.mark.slow
def test_a_replay_with_all_streams_closed(tmp_path: Path) -> None:
    shell(f"{MAPCLI} slam-replay {CORRIDOR} -o {tmp_path}/open")
    done = shell(f"{MAPCLI} slam-replay {CORRIDOR} -o {tmp_path}/closed <&- >&- 2>&-")
    assert done.returncode == 0
    for name in ("map.yaml", "map.pgm", "map.png"):
        assert (tmp_path / "open" / name).read_bytes() == (tmp_path / "closed" / name).read_bytes()


@pytest.mark.parametrize("pack", ["cat", "gzip -c"])
def test_a_log_from_a_pipe(pack: str) -> None:
    piped, plain = shell(f"{MAPCLI} info <({pack} {CORRIDOR})"), shell(f"{MAPCLI} info {CORRIDOR}")
    assert piped.stderr == b""
    assert piped.stdout.splitlines()[1:] == plain.stdout.splitlines()[1:]
    assert piped.stdout.startswith(b"/dev/fd/")


@pytest.mark.parametrize(
    "command",
    [
        "info {corner}",
        "compare {corner} {corner} --json -",
        "perceive {corner} --cell 4,6 --dialect ros1 -",  # reads its map twice
        "similarity-table {corner} {scan}",
    ],
)
def test_maps_and_documents_from_pipes(command: str) -> None:
    files = {"corner": CORNER, "scan": FIXTURES / "corner-scan.yaml"}
    plain = shell(f"{MAPCLI} " + command.format(**files))
    piped = shell(f"{MAPCLI} " + command.format(**{k: f"<(cat {f})" for k, f in files.items()}))
    assert (plain.returncode, piped.returncode) == (0, 0)
    wanted = [line for line in plain.stdout.splitlines() if b"corner" not in line]
    found = [line for line in piped.stdout.splitlines() if b"/dev/fd" not in line]
    assert [line for line in found if b'"file"' not in line] == [
        line for line in wanted if b'"file"' not in line
    ]


@pytest.mark.slow
def test_a_replay_of_a_pipe(tmp_path: Path) -> None:
    shell(f"{MAPCLI} slam-replay {CORRIDOR} -q -o {tmp_path}/plain")
    done = shell(f"{MAPCLI} slam-replay <(gzip -c {CORRIDOR}) -q -o {tmp_path}/piped")
    assert (done.returncode, done.stderr) == (0, b"")
    assert (tmp_path / "plain/map.pgm").read_bytes() == (tmp_path / "piped/map.pgm").read_bytes()


@pytest.mark.parametrize("locale", ["C", "C.UTF-8"])
def test_a_name_that_is_no_utf8(locale: str, tmp_path: Path) -> None:
    name = tmp_path / os.fsdecode(b"n\xff.txt")
    name.write_bytes(CORNER.read_bytes())
    quoted = shlex.quote(str(name))
    done = shell(f"{MAPCLI} info {quoted}", LC_ALL=locale)
    assert done.stdout.startswith(rb"%s/n\xff.txt: map, text" % os.fsencode(tmp_path))
    document = json.loads(shell(f"{MAPCLI} info {quoted} --json -", LC_ALL=locale).stdout)
    assert document["input"][0]["file"] == name.name
    other = shlex.quote(str(name.with_suffix(".png")))
    assert shell(f"{MAPCLI} convert {quoted} {other}", LC_ALL=locale).returncode == 0
    done = shell(f"{MAPCLI} convert {quoted} {shlex.quote(str(name.with_suffix('.yaml')))}")
    assert done.returncode == 1
    assert rb"n\xff.yaml: its image would have a name that is no UTF-8" in done.stderr


def test_a_terminal_of_few_letters(tmp_path: Path) -> None:
    (tmp_path / "ü⊙.txt").write_bytes(CORNER.read_bytes())
    done = shell(f"cd {tmp_path}; {MAPCLI} info ü⊙.txt", PYTHONIOENCODING="latin-1")
    assert done.stdout.startswith(b"\xfc\\u2299.txt: map")


FAR = {
    "resolution.yaml": "cells:\n  - [0, 1]\nresolution: 1e308\norigin: [0, 0, 0]\n",
    "fine.yaml": "cells:\n  - [0, 1]\nresolution: 1e-308\norigin: [0, 0, 0]\n",
    "origin.yaml": "cells:\n  - [0, 1]\nresolution: 1\norigin: [1e308, -1e308, 0]\n",
    "yaw.yaml": "cells:\n  - [0, 1]\nresolution: 1\norigin: [0, 0, 1e308]\n",
    "polygon.yaml": "polygons:\n  - [[0, 0], [1e308, 0], [1e308, 1e308]]\n",
    "points.yaml": "points: [[1e308, 1e308], [0, -1e308]]\n",
    "path.tum": "0 1e308 0 0 0 0 0 1\n1 -1e308 0 0 0 0 0 1\n",
    "pairs.relations": "0 1 1e308 1e308 0 0 0 0\n",
}


@pytest.mark.parametrize("name", FAR)
@pytest.mark.parametrize(
    "command",
    [
        "info {far}", "convert {far} out.txt", "render {far} --png out.png",
        "compare {far} ok.txt", "compare ok.txt {far}", "frontier {far} --robot 0,0",
        "transform {far} out.yaml --rotate 30", "transform ok.txt out.yaml --merge {far}",
        "rasterize {far} out.txt", "vectorize {far} out.yaml", "rectify {far} out.yaml",
        "perceive {far} --pose 0,0,0 out.yaml", "similarity-table {far} scan.yaml",
        "evaluate {far} ok.tum", "evaluate ok.tum {far}", "simulate {far} --mow --json out.json",
    ],
)  # fmt: skip
def test_coordinates_that_are_no_places(
    command: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("ok.txt").write_text("0 0\n0 1\n")
    Path("ok.tum").write_text("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n")
    Path("scan.yaml").write_text((FIXTURES / "corner-scan.yaml").read_text())
    Path(name).write_text(FAR[name])
    if run(*command.format(far=name).split()) == 1:  # else it is of another kind: wrong usage
        err = capfd.readouterr().err
        assert err.startswith("Error: ")
        assert name in err
        assert "fault" not in err
        assert len(err) < 300


@pytest.mark.parametrize(
    "arguments",
    [
        ["transform", "ok.txt", "out.txt", "--align"],
        ["transform", "ok.txt", "out.txt", "--rotate", "30", "--crop", "50,50,60,60"],
        ["compare", "ok.txt", "one.txt", "--align"],
    ],
)
def test_an_error_that_knows_no_file_names_all_that_were_read(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("ok.txt").write_text("0 0\n0 1\n")
    Path("one.txt").write_text("0\n")
    assert run(*arguments) == 1
    err = capfd.readouterr().err
    assert err.startswith(("Error: ok.txt: ", "Error: ok.txt, one.txt: "))


def test_numbers_of_options_that_are_no_places(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("transform", str(CORNER), "out.txt", "--shift", "1e308,0") == 2
    assert "'1e308,0' has a number beyond 1e+09" in capfd.readouterr().err


def test_libraries_do_not_warn() -> None:
    code = (
        "import atexit, sys, warnings\nfrom mapcli.__main__ import run\n"
        "sys.argv = ['mapcli', '-h']\n"
        "atexit.register(warnings.warn, 'divide by zero', RuntimeWarning)\nrun()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
