"""What a run may take is asked for before it is taken, and refused with the number."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
from conftest import run

from mapcli import memory
from mapcli.algorithms.exploration.explore import explore
from mapcli.algorithms.slam.map_parameters import MapParameters
from mapcli.algorithms.slam.occupancy_grid import OccupancyGrid
from mapcli.cli import cli
from mapcli.commands._options import SizeType
from mapcli.model.grid import GridMap


@pytest.fixture(autouse=True)
def usual_limit() -> Iterator[None]:
    yield
    memory.limit_to(None)


def test_half_of_the_machine_by_default() -> None:
    memory.limit_to(None)
    assert memory.limit() == memory.allowed() // 2
    assert memory.allowed() <= memory.os.sysconf("SC_PHYS_PAGES") * 4096 * 16


def test_a_control_group_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_text("max\n")
    new.write_text("300000000\n")
    monkeypatch.setattr(memory, "_CONTROL_GROUPS", (str(old), str(new), str(tmp_path / "none")))
    assert memory.allowed() == 300_000_000


@pytest.mark.parametrize(
    ("text", "size"),
    [("500M", 500_000_000), ("2G", 2_000_000_000), ("1.5GB", 1_500_000_000), ("7", 7)],
)
def test_sizes(text: str, size: int) -> None:
    assert SizeType().convert(text, None, None) == size


@pytest.mark.parametrize("text", ["", "G", "-1G", "0", "nan", "1e9", "1X", "9" * 40])
def test_no_sizes(text: str) -> None:
    with pytest.raises(click.UsageError):
        SizeType().convert(text, None, None)


def test_the_message_names_both_numbers() -> None:
    memory.limit_to(1_000_000_000)
    memory.require(1e9, "a map")
    with pytest.raises(memory.MemoryLimitError) as caught:
        memory.require(2.46e9, "a map", file="big.png")
    assert str(caught.value) == (
        "big.png: a map would take about 2.5 GB of memory; "
        "expected at most 1.0 GB (--max-memory allows more)"
    )


def test_an_image_is_refused_before_it_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from PIL import Image

    name = tmp_path / "white.png"
    Image.new("L", (4000, 4000), 254).save(name)
    assert run("info", name, "--max-memory", "10M") == 1
    said = capsys.readouterr().err
    assert said.startswith(
        f"Error: {name}: an image of 4,000 x 4,000 pixels would take about 32 MB"
    )
    assert run("info", name, "--max-memory", "100M") == 0


def test_a_small_file_is_not_unpacked_to_more_than_a_gigabyte(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from PIL import Image

    monkeypatch.setattr(memory, "SMALL_FILE_LIMIT", 10_000_000)
    name = tmp_path / "white.png"
    Image.new("L", (4000, 4000), 254).save(name)
    assert run("info", name) == 1
    assert "would take about 32 MB of memory; expected at most 10 MB" in capsys.readouterr().err
    assert run("info", name, "--max-memory", "1G") == 0
    monkeypatch.setattr(memory, "SMALL_FILE", 1000)
    assert run("info", name) == 0


def test_an_exploration_is_refused_before_it_begins() -> None:
    memory.limit_to(1_000_000)
    world = GridMap(np.zeros((500, 500), np.float32))
    with pytest.raises(memory.MemoryLimitError, match="exploring a map of 500 x 500 cells"):
        explore(world, [(0, 0)])


def test_a_map_that_grows_is_refused() -> None:
    memory.limit_to(4_000_000)
    grid = OccupancyGrid(MapParameters())
    grid.extend_to(np.zeros(2), np.full(2, 5.0))
    with pytest.raises(memory.MemoryLimitError, match=r"a map of 2,\d\d\d x 2,\d\d\d cells"):
        grid.extend_to(np.zeros(2), np.full(2, 100.0))


def test_every_command_takes_the_option() -> None:
    context = click.Context(cli)
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        assert "max_memory" in {option.name for option in command.params}
