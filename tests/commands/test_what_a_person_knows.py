"""`--same-place`, `--not-same-place`, `--trust-odometry` on the command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.replaying import CORRIDOR, replay, traced


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_what_was_told_is_in_the_trace() -> None:
    told = traced(CORRIDOR, "--same-place", "0,1,0.1,0,0", "--trust-odometry", "2-3",
                  "--not-same-place", "0,9")["parameters"]["knowledge"]  # fmt: skip
    assert told["same"][0]["pose"]["x"] == 0.1
    assert told["trusted"][0]["last"]["seconds"] == 3
    assert told["apart"][0]["other"]["seconds"] == 9
    assert "knowledge" not in traced(CORRIDOR)["parameters"]


def test_a_wrong_line_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    line = "--same-place", "0,9,-3,2,90"
    assert replay(CORRIDOR, "--json", "t.json", *line, "--fail-if", "verdict!=good") == 3
    assert "--same-place 0,9,-3,2,90 is not so" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--same-place", "1"), "is not of the form T1,T2[,X,Y,DEG]"),
        (("--same-place", "1,2,3"), "is not of the form T1,T2[,X,Y,DEG]"),
        (("--same-place", "1,nan"), "is not of the form T1,T2[,X,Y,DEG]"),
        (("--not-same-place", "1,2,3"), "is not of the form T1,T2"),
        (("--trust-odometry", "5-2"), "is not of the form T1-T2"),
        (("--same-place", "1,2", "--no-loop-closing"), "needs loop closing"),
    ],
)
def test_wrong_usage(words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(CORRIDOR, *words) == 2
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--same-place", "1,1000"), "1000 s is not a time of the drive; expected 0 to 9.8 s"),
        (("--same-place", "1,monday:2"), "monday:2 is a time of no drive; expected SECONDS"),
    ],
)
def test_times_that_there_are_not(
    words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay(CORRIDOR, *words) == 1
    assert capsys.readouterr().err.endswith(f"Error: corridor.mcap: {said}\n")
