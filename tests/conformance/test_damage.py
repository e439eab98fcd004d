"""The damaged and hostile files that were handed in: what is right for each, and what it may take.

Skipped where they are not beside the project.
"""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from conftest import SHARED, run

DAMAGE = SHARED / "cases" / "damage"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not DAMAGE.is_dir(), reason="needs the shared cases"),
]

SLOW_MACHINE = 3
"""Seconds of a machine that is shared count so many times. What is to be noticed took sixty."""

STARTED = """
import os, resource, subprocess, sys
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
process = subprocess.Popen([sys.executable, *sys.argv[1:]])
_, status, used = os.wait4(process.pid, 0)
with open("used", "w") as file:
    print(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss,
          file=file)
"""
"""A small process in between: the memory of who starts a process counts as its child's."""


@dataclass(frozen=True)
class Run:
    """What a command did: exit code, processor seconds, most megabytes, lines on stderr."""

    status: int
    seconds: float
    megabytes: float
    out: str
    err: list[str]


def measured(folder: Path, *arguments: str) -> Run:
    """A command in a process of its own, in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", STARTED, "-m", "mapcli", *arguments],
        cwd=folder, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    status, seconds, kilobytes = (folder / "used").read_text().split()
    err = done.stderr.splitlines()
    assert "Traceback" not in done.stderr
    return Run(int(status), float(seconds), int(kilobytes) / 1024, done.stdout, err)


@pytest.fixture
def folder(tmp_path: Path, kit: Path) -> Path:
    """With the handed files in it; the loops are compiled since the kit was made."""
    for path in DAMAGE.iterdir():
        (tmp_path / path.name).symlink_to(path)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "status", "said", "seconds", "megabytes"),
    [
        ("slam-replay -q middle.mcap --json t.json --fail-if used_share<0.95", 3,
         "Error: middle.mcap: used_share is 0.72888; ", 10, 512),
        ("slam-replay -q hole.mcap --json t.json --fail-if lost_share>0.5", 3,
         "Error: hole.mcap: lost_share is 0.563851; ", 10, 512),
        ("info zstd-nul-records.mcap --json t.json", 0, None, 1, 200),
        # Alone the libraries that map take 200 MB.
        ("slam-replay -q zstd-nul-records.mcap --json t.json", 0,
         "Warning: zstd-nul-records.mcap: 1 chunk with broken data (byte 26214)", 1, 300),
        ("slam-replay -q carmen-slow.log --json t.json", 0,
         "Warning: carmen-slow.log: 2 lines without a valid FLASER message (first: line 21)",
         2, 300),
        ("rasterize alias-bomb.yaml o.txt", 1, "Error: alias-bomb.yaml: aliases unfold ", 1, 200),
        ("compare compare-overflow.yaml compare-overflow.yaml --png x.png", 1,
         "Error: compare-overflow.yaml: line 4: origin: the y is -1e+308; ", 1, 200),
        ("info image-dev-zero.yaml", 1,
         "Error: image-dev-zero.yaml: line 1: image '/dev/zero': is a device; ", 1, 200),
        ("rasterize rasterize-slow2.yaml o.txt", 1,
         "Error: rasterize-slow2.yaml: the outlines pass through 19,999,996 of 4 x 9,999,997 "
         "cells; ", 2, 300),
    ],
)  # fmt: skip
def test_a_handed_file(
    command: str, status: int, said: str | None, seconds: float, megabytes: float, folder: Path
) -> None:
    ran = measured(folder, *command.split())
    assert ran.status == status, ran.err
    assert ran.err[-1:] == ([] if said is None else ran.err[-1:])
    assert said is None or ran.err[-1].startswith(said), ran.err
    if status == 1:
        assert len(ran.err) == 1
        assert {path.name for path in folder.iterdir() if not path.is_symlink()} == {"used"}
    assert ran.megabytes < megabytes
    assert ran.seconds < seconds * SLOW_MACHINE


@pytest.mark.parametrize(("name", "used"), [("middle", 371), ("hole", 222)])
def test_all_scans_of_a_damaged_log_are_accounted_for(
    name: str, used: int, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert run("slam-replay", "-q", f"{name}.mcap", "--json", "t.json") == 0
    summary = json.loads(Path("t.json").read_text())["summary"]
    assert (summary["scans"], summary["used"]) == (509, used)
    assert summary["skipped"] == {"scans lost in damaged parts of the file": 509 - used}


def test_one_reading_of_3000_m_changes_one_beam(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was 3.66 m in range-good.log; the beams without return, at 50 m, stay such."""
    monkeypatch.chdir(folder)
    documents, told = [], []
    for name in ("good", "one-3000"):
        assert run("slam-replay", "-q", f"range-{name}.log", "-o", name) == 0
        documents.append(json.loads(Path(name, "trace.json").read_text()))
        assert run("info", f"range-{name}.log") == 0
        told.append(capsys.readouterr().out.splitlines()[1:])
    assert told[0] == told[1]
    good, odd = (np.array([[p["x"], p["y"]] for p in d["poses"]]) for d in documents)
    apart = np.hypot(*(good - odd).T)
    # The log has 36 scans, 0.6 m apart: one of them misses a beam that the other log's has.
    assert np.quantile(apart, 0.95) < 0.05  # a cell
    assert apart.max() < 0.15
    # Of far rays, which lie cells apart, a hair's breadth decides which cells are known.
    compared = run("compare", "-q", "good/map.yaml", "one-3000/map.yaml",
                   "--fail-if", "changed_m2>0.02", "--fail-if", "agreement<0.99")  # fmt: skip
    assert compared == 0


def test_a_topic_gives_no_orders_to_a_terminal(folder: Path) -> None:
    outer, inner = pty.openpty()
    command = [sys.executable, "-m", "mapcli", "info", "-v", "topic-escape.mcap"]
    done = subprocess.run(command, cwd=folder, stdout=inner, stderr=inner, stdin=inner)
    os.close(inner)
    shown = b""
    while True:
        try:
            shown += os.read(outer, 1 << 16)
        except OSError:  # all is read
            break
    os.close(outer)
    assert done.returncode == 0
    assert b"\x1b" not in shown
    assert b"\x07" not in shown
    assert rb"/gt\x1b]52;c;cm0gLXJm\x07: 41 messages" in shown
