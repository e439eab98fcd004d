"""Two runs into one folder at once: a full set of the one or of the other, never a mixture."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from conftest import run

from mapcli.formats.output import OutputError, OutputSet
from mapcli.formats.partial_file import PartialFile

NAMES = "map.png", "map.yaml", "map.pgm", "trace.json"


def opened(run: str, *, no_clobber: bool = False) -> OutputSet:
    """The files of a run, written and not yet there."""
    outputs = OutputSet(no_clobber=no_clobber)
    for name in NAMES:
        outputs.write(name, run.encode())
    return outputs


def found() -> list[str]:
    return [Path(name).read_text() for name in NAMES]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_the_last_to_finish_has_its_whole_set(order: str) -> None:
    runs = {name: opened(name) for name in "ab"}
    for name in order:
        runs[name].commit()
    assert found() == [order[-1]] * 4
    assert len(list(Path().iterdir())) == 4


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_without_clobbering_the_first_has_its_whole_set(order: str) -> None:
    runs = {name: opened(name, no_clobber=True) for name in "ab"}
    runs[order[0]].commit()
    with pytest.raises(OutputError, match=r"map.png: .*exists"):
        runs[order[1]].commit()
    assert found() == [order[0]] * 4
    assert len(list(Path().iterdir())) == 4


def test_while_one_run_renames_another_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands still between its first and its second file; the other is as far then."""
    first, second = opened("a"), opened("b")
    stands, goes_on = threading.Event(), threading.Event()
    appear = PartialFile.appear

    def slowly(partial: PartialFile, *, no_clobber: bool) -> None:
        appear(partial, no_clobber=no_clobber)
        if partial in first._partial.values():
            stands.set()
            goes_on.wait(20)

    monkeypatch.setattr(PartialFile, "appear", slowly)
    threads = [threading.Thread(target=run.commit) for run in (first, second)]
    threads[0].start()
    stands.wait(20)
    threads[1].start()
    threads[1].join(0.1)
    assert threads[1].is_alive()
    goes_on.set()
    for thread in threads:
        thread.join(20)
    assert found() == ["b"] * 4


def replay(log: str, folder: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "mapcli", "slam-replay", "-q", log, "-o", folder]
    )


@pytest.mark.slow
@pytest.mark.parametrize("order", [("log.mcap", "round.mcap"), ("round.mcap", "log.mcap")])
def test_two_replays_into_one_folder(order: tuple[str, str], kit: Path) -> None:
    """The one takes longer than the other; they are started in both orders."""
    for log in order:
        assert run("slam-replay", "-q", kit / log, "-o", log.partition(".")[0]) == 0
    runs = [replay(str(kit / log), "both") for log in order]
    assert [started.wait() for started in runs] == [0, 0]

    def files(folder: str) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in Path(folder).iterdir()}

    assert files("both") in (files("log"), files("round"))
