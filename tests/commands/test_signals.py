"""SIGINT and SIGTERM at any moment: the exit code, no traceback, nothing half."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import FIXTURES

APARTMENT = str(FIXTURES / "apartment.mcap")


def started(folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "mapcli", "slam-replay", APARTMENT, *arguments]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("seconds", [0.06, 0.15, 0.4, 0.6, 0.8, 1.0])
def test_a_signal_at_any_moment(tmp_path: Path, number: int, seconds: float) -> None:
    process = started(tmp_path, "-o", "out")
    time.sleep(seconds)
    process.send_signal(number)
    _, said = process.communicate(timeout=10)
    assert process.returncode in (128 + number, 0)  # 0: it was done before
    assert b"Traceback" not in said
    assert not list(tmp_path.rglob("*.part"))
    names = sorted(path.name for path in tmp_path.rglob("*") if path.is_file())
    assert names in ([], ["map.pgm", "map.png", "map.yaml", "trace.json"])
    if names and process.returncode:
        summary = json.loads((tmp_path / "out" / "trace.json").read_text())["summary"]
        assert summary["interrupted"] is True
        assert b"Stopped after" in said


def test_terminated_in_this_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from mapcli import cli, startup

    def command(*arguments: object, **options: object) -> None:
        raise startup.Terminated

    monkeypatch.setattr(cli.cli, "main", command)
    with pytest.raises(SystemExit) as leaving:
        cli.main([])
    assert leaving.value.code == 143
    assert capsys.readouterr().err == "Terminated.\n"


def test_an_import_is_not_interrupted(tmp_path: Path) -> None:
    # A module half made would be a fault: "ImportError: initialization failed".
    (tmp_path / "slow.py").write_text(
        "import os, signal\n"
        "os.kill(os.getpid(), signal.SIGTERM)\n"
        "for _ in range(10**5): pass\n"
        "print('imported', flush=True)\n"
    )
    program = (
        "import time\n"
        "from mapcli import startup\n"
        "startup.raise_on_signals()\n"
        "try:\n"
        "    import slow\n"
        "    time.sleep(5)\n"
        "except startup.Terminated:\n"
        "    print('terminated')\n"
    )
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(FIXTURES.parent)]),
    }
    said = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, timeout=10
    ).stdout
    assert said.split() == [b"imported", b"terminated"]
