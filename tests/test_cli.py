"""The error boundary: one line for a person, whatever happens."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import pytest

import mapcli.cli
from mapcli.cli import main


def fail_with(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def command(*args: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(mapcli.cli.cli, "main", command)


def test_a_fault_of_our_own_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fail_with(ZeroDivisionError("division\nby zero"), monkeypatch)
    with pytest.raises(SystemExit) as leaving:
        main(["info", "x"])
    assert leaving.value.code == 1
    assert capsys.readouterr().err == (
        "Error: a fault in mapcli: ZeroDivisionError: division by zero (--debug says more)\n"
    )


def test_debug_shows_where(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fail_with(ZeroDivisionError("division by zero"), monkeypatch)
    with pytest.raises(SystemExit):
        main(["info", "x", "--debug"])
    assert "Traceback" in capsys.readouterr().err


def test_a_full_disk(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    fail_with(OSError(28, "No space left on device", "map.png"), monkeypatch)
    with pytest.raises(SystemExit) as leaving:
        main([])
    assert leaving.value.code == 1
    assert capsys.readouterr().err == "Error: map.png: no space left on device\n"


def test_no_memory(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    fail_with(MemoryError(), monkeypatch)
    with pytest.raises(SystemExit):
        main([])
    assert capsys.readouterr().err == "Error: out of memory\n"


def test_a_near_miss_is_guessed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        main(["slam-repla"])
    assert leaving.value.code == 2
    assert "Did you mean 'slam-replay'?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "status", "where"),
    [(["--version"], 0, "out"), (["info", "missing.txt"], 1, "err"), (["--nothing"], 2, "err")],
)
def test_leaving_at_once_loses_nothing(arguments: list[str], status: int, where: str) -> None:
    done = subprocess.run([sys.executable, "-m", "mapcli", *arguments], capture_output=True)
    assert done.returncode == status
    said = {"out": done.stdout, "err": done.stderr}
    assert said.pop(where)
    assert not any(said.values())


def test_what_is_to_be_done_at_the_end_is_done() -> None:
    program = """
        import atexit
        from mapcli.__main__ import run
        atexit.register(print, "tidied up")
        run()
    """
    leave = [sys.executable, "-c", textwrap.dedent(program), "--version"]
    done = subprocess.run(leave, capture_output=True, text=True)
    assert done.stdout.endswith("tidied up\n")
    assert done.returncode == 0


def test_nobody_reads_any_more() -> None:
    command = f"{sys.executable} -m mapcli --help | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("0\n", "")
