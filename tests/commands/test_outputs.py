"""What all commands owe their users: inputs stay, and a set that was torn is found out."""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path

import pytest
from conftest import FIXTURES, run

from mapcli.commands._output import read_files

FILES = (
    "corridor.mcap", "corridor.yaml", "corridor-path.txt", "corner.txt", "corner-scan.yaml",
    "fig9_1.yaml", "fig9_9.txt", "lawn.yaml",
)  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current folder, with inputs in it and a map with its image."""
    monkeypatch.chdir(tmp_path)
    for name in FILES:
        shutil.copy(FIXTURES / name, name)
    assert run("convert", "corner.txt", "map.yaml", "-q") == 0
    os.link("map.pgm", "hard.png")
    Path("soft.json").symlink_to("corridor.mcap")


def state() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path().iterdir() if path.is_file()}


@pytest.mark.parametrize(
    "command",
    [
        "import corridor.mcap ./corridor.mcap",
        "import corridor.mcap {here}/corridor.mcap",
        "simulate corridor.yaml --path corridor-path.txt ./corridor.yaml",
        "simulate corridor.yaml --path corridor-path.txt {here}/corridor-path.txt",
        "simulate lawn.yaml --mow --json lawn.yaml",
        "render map.yaml --png map.pgm",
        "render map.yaml --png hard.png",
        "info map.yaml --json ./map.yaml",
        "info corridor.mcap --json soft.json",
        "transform corner.txt out.txt --merge map.yaml --trace corridor.mcap corner.txt",
        "transform corner.txt map.pgm --merge map.yaml",
        "transform corner.txt out.txt --crop known --json corner.txt",
        "slam-replay corridor.mcap --json {here}/corridor.mcap",
        "slam-replay corridor.mcap --known map.yaml --png map.pgm",
        "frontier map.yaml --robot 2,2 --png hard.png",
        "similarity-table corner.txt corner-scan.yaml --json {here}/corner-scan.yaml",
        "perceive map.yaml --pose 6.5,3.5,90 map.yaml",
        "compare map.yaml corner.txt --png map.pgm",
        "rasterize fig9_1.yaml ./fig9_1.yaml",
        "vectorize map.yaml {here}/map.pgm",
        "rectify map.yaml map.pgm",
        "evaluate corridor.mcap corridor.mcap --json soft.json",
    ],
)
def test_no_command_writes_onto_an_input(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = state()
    arguments = command.format(here=Path.cwd()).split()
    assert run(*arguments) == 1
    assert "to be read" in capsys.readouterr().err
    assert state() == before


def test_a_torn_set_is_found_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("slam-replay", "-q", "corridor.mcap", "-o", "out") == 0
    named = {one["file"] for one in json.loads(Path("out/trace.json").read_text())["files"]}
    assert named == {"map.png", "map.yaml", "map.pgm"}
    assert run("info", "out/map.yaml") == 0
    assert "warning" not in capsys.readouterr().out
    shutil.copy("map.pgm", "out/map.pgm")
    assert run("info", "out/map.yaml") == 0
    expected = "map.pgm is not the one that trace.json was written with"
    assert expected in capsys.readouterr().out
    assert run("evaluate", "out/trace.json", "corridor.mcap", "-v") == 0
    expected = "Warning: out/trace.json: map.pgm beside it is not the one that it was written with"
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize("image", ["a\0b", "a" * 5000])
def test_an_image_name_that_no_file_can_have(
    image: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is compared with the outputs' names before the file is read, which says what is wrong."""
    Path("odd.yaml").write_text(f"image: {image}\n")
    assert run("convert", "odd.yaml", "other.txt") == 1
    said = capsys.readouterr().err
    assert said.startswith("Error: odd.yaml: ")
    assert "a fault in mapcli" not in said


def test_a_yaml_of_empty_lines() -> None:
    """Whoever looks for its image must not begin anew at each of them."""
    Path("empty.yaml").write_text("\n" * 60_000 + "image : map.pgm\n")
    start = time.process_time()
    assert read_files(["empty.yaml"]) == [Path("empty.yaml"), Path("map.pgm")]
    assert time.process_time() - start < 1
