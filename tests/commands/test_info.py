"""`mapcli info` about maps, as a user runs it."""

from __future__ import annotations

import hashlib
import io
import json
import sys
from pathlib import Path

import pytest
from conftest import run
from PIL import Image, PngImagePlugin

from mapcli import __version__

YAML = (
    "image: m.pgm\nresolution: 0.05\norigin: [-1.5, 2, 0.5]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
)
IMAGE = b"P5 3 2 255\n\x00\xfe\xfe\xcd\x80\x00"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(YAML)
    Path("m.pgm").write_bytes(IMAGE)
    Path("book.txt").write_text("? 0.1 1\n? 0.5 0\n")
    return tmp_path


def info(*arguments: str) -> int:
    return run("info", *arguments)


PAIR_REPORT = """\
m.yaml: map, YAML with PGM P5, 8 bit
  size        2 rows, 3 columns; 0.15 x 0.1 m
  resolution  0.05 m per cell
  origin      x -1.5 m, y 2 m, yaw 28.6479 deg
  mode        trinary, free up to 0.25, occupied from 0.65
  cells       3 free (50.0%), 2 occupied (33.3%), 1 unknown (16.7%)
  warning     1 cell of grey 205, which map savers write for unknown, read as open under \
free_thresh 0.25; with free_thresh: 0.196 they stay unknown
  warning     origin has a yaw of 28.6479 deg, which Nav2's costmaps and AMCL ignore; `mapcli \
transform --bake-yaw` turns the cells instead
"""

TEXT_REPORT = """\
book.txt: map, text, numbers
  size        2 rows, 3 columns; 3 x 2 m
  resolution  1 m per cell
  origin      x 0 m, y 0 m, yaw 0 deg
  cells       2 free (33.3%), 2 occupied (33.3%), 2 unknown (33.3%)
              2 of them between 0 and 1
"""


def test_pair(capsys: pytest.CaptureFixture[str]) -> None:
    assert info("m.yaml") == 0
    assert capsys.readouterr() == (PAIR_REPORT, "")


def test_several_files(capsys: pytest.CaptureFixture[str]) -> None:
    assert info("m.yaml", "book.txt") == 0
    assert capsys.readouterr().out == f"{PAIR_REPORT}\n{TEXT_REPORT}"


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert info("m.yaml", "--json", "-") == 0
    document = json.loads(capsys.readouterr().out)
    trap, yaw = document.pop("warnings")
    assert trap.startswith("1 cell of grey 205")
    assert yaw.startswith("origin has a yaw of 28.6479 deg")
    assert list(document)[:3] == ["format", "version", "mapcli"]
    assert document == {
        "format": "mapcli.map-info",
        "version": 1,
        "mapcli": __version__,
        "input": [
            {"file": "m.yaml", "sha256": hashlib.sha256(YAML.encode()).hexdigest()},
            {"file": "m.pgm", "sha256": hashlib.sha256(IMAGE).hexdigest()},
        ],
        "parameters": {"dialect": "nav2", "occupied_from": 0.5},
        "kind": "YAML with PGM P5, 8 bit",
        "rows": 2,
        "columns": 3,
        "resolution": 0.05,
        "origin": {"x": -1.5, "y": 2.0, "theta": 0.5},
        "image": {
            "mode": "trinary",
            "negate": False,
            "free_thresh": 0.25,
            "occupied_thresh": 0.65,
        },
        "cells": {"free": 3, "occupied": 2, "unknown": 1, "between_0_and_1": 0},
    }


def warnings_of(keys: dict[str, str], picture: Image.Image) -> list[str]:
    lines = dict(line.split(": ") for line in YAML.splitlines())
    lines |= {"origin": "[0, 0, 0]", "image": "m.png"} | keys
    Path("odd.yaml").write_text("".join(f"{key}: {value}\n" for key, value in lines.items()))
    picture.save("m.png")
    assert info("odd.yaml", "--json", "odd.json", "-q") == 0
    return list(json.loads(Path("odd.json").read_text())["warnings"])


GREY = Image.new("L", (2, 1), 0)
THREE = GREY.convert("RGBA")
THREE.putpixel((0, 0), (255, 0, 0, 0))


@pytest.mark.parametrize(
    ("keys", "picture", "warnings"),
    [
        ({}, GREY, []),
        ({"free_thresh": "0.7"}, GREY, ["free_thresh 0.7 is not below occupied_thresh 0.65"]),
        (
            {"origin": "[nan, .inf, 0]"},
            GREY,
            ["the x of origin is not a number (nan); 0 is", "the y of origin is infinite; 0 is"],
        ),
        ({"Mode": "scale"}, GREY, ["line 7: key 'Mode' is not used; mode is meant?"]),
        ({"frame_id": "map"}, GREY, ["line 7: key 'frame_id' is not used"]),
        (
            {},
            THREE,
            ["1 cell in colour, which Nav2 takes by", "has an alpha channel, 1 cell not opaque;"],
        ),
        ({"mode": "scale"}, THREE, ["1 cell in colour", "1 cell not opaque, read as unknown"]),
        (
            {"free_thresh": "0.2"},
            Image.new("L", (2, 1), 204),
            ["2 cells read otherwise by ros1, see --dialect"],
        ),
    ],
)
def test_warnings(keys: dict[str, str], picture: Image.Image, warnings: list[str]) -> None:
    found = warnings_of(keys, picture)
    assert len(found) == len(warnings)
    for text, start in zip(found, warnings, strict=True):
        assert text.startswith(start)


def test_json_of_several_files_is_a_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert info("m.yaml", "book.txt", "--json", "out.json", "-q") == 0
    assert capsys.readouterr() == ("", "")
    kinds = [document["kind"] for document in json.loads(Path("out.json").read_text())]
    assert kinds == ["YAML with PGM P5, 8 bit", "text, numbers"]


def test_dialect(capsys: pytest.CaptureFixture[str]) -> None:
    Path("m.yaml").write_text(YAML.replace("free_thresh: 0.25", "free_thresh: 0"))
    Path("m.pgm").write_bytes(b"P5 1 1 255\n\xff")
    assert info("m.yaml") == 0
    assert "1 free" in capsys.readouterr().out
    assert info("m.yaml", "--dialect", "ros1") == 0
    assert "1 unknown" in capsys.readouterr().out


def test_names_that_tell_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("m.pgm").rename("m")
    assert info("m") == 0
    assert capsys.readouterr().out.startswith("m: map, PGM P5, 8 bit\n")
    stream = io.BufferedReader(io.BytesIO(b"#.?\n"))  # type: ignore[arg-type]
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(stream))
    assert info("-") == 0
    assert capsys.readouterr().out.startswith("-: map, text, characters\n")


def test_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert info("no.yaml") == 1
    assert capsys.readouterr().err == "Error: no.yaml: no such file\n"
    assert info() == 2
    assert "Missing argument 'FILE...'" in capsys.readouterr().err


def test_a_picture_that_speaks_of_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its metadata has the key of a continuous map, and its name no suffix: a grid map still."""
    path = tmp_path / "picture"
    grey = YAML.replace("image: m.pgm\n", "") + "points: [[1, 1]]\n"
    note = PngImagePlugin.PngInfo()
    note.add_text("mapcli map", grey)
    Image.new("L", (3, 2), 254).save(path, "PNG", pnginfo=note)
    assert run("info", path) == 0
    assert "2 rows, 3 columns" in capsys.readouterr().out
    path.write_text(YAML.replace("image", '"\\x69mage"') + "points: [[1, 1]]\n")
    assert run("info", path) == 0
    assert "2 rows, 3 columns" in capsys.readouterr().out
