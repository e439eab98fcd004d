"""The error boundary: one line for a person, whatever happens."""

from __future__ import annotations

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
