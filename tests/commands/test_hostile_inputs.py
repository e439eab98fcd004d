"""Small inputs that ask for much: one line, soon, in little memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import SHARED, run

DAMAGE = SHARED / "cases" / "damage"

MEASURE = """
import os, resource, subprocess, sys
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
process = subprocess.Popen([sys.executable, *sys.argv[1:]], stdout=subprocess.DEVNULL)
_, status, used = os.wait4(process.pid, 0)
print(os.waitstatus_to_exitcode(status), used.ru_maxrss)
"""
"""A small process in between: the memory of who starts a process counts as its child's."""


def test_no_image_is_read_from_a_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "map.yaml"
    path.write_text("image: /dev/zero\nresolution: 1\norigin: [0, 0, 0]\n"
                    "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")  # fmt: skip
    assert run("info", str(path)) == 1
    assert "line 1: image '/dev/zero': is a device; expected a PGM" in capsys.readouterr().err


def test_aliases_that_unfold(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "world.yaml"
    many = ",".join(["*v"] * 2000)
    path.write_text(f"polygons: [&p [[0,0],&v [1,1],{many}],{','.join(['*p'] * 1000)}]\n")
    assert run("rasterize", str(path), str(tmp_path / "out.txt")) == 1
    assert "aliases unfold 10 values to" in capsys.readouterr().err


def test_a_vertex_far_away(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "world.yaml"
    path.write_text("polygons: [[[6, 3], [3, 7], [1e7, 7]]]\n")
    assert run("rasterize", str(path), str(tmp_path / "out.txt")) == 1
    said = capsys.readouterr().err
    assert "the outlines pass through" in said
    assert "4 x 9,999,997 cells" in said


@pytest.mark.slow
@pytest.mark.skipif(not DAMAGE.is_dir(), reason="needs the shared cases")
@pytest.mark.parametrize(
    "command",
    [
        "slam-replay -q carmen-slow.log -o OUT",
        "info image-dev-zero.yaml",
        "rasterize alias-bomb.yaml OUT.txt",
        "rasterize rasterize-slow2.yaml OUT.txt",
    ],
)
def test_handed_inputs(command: str, tmp_path: Path) -> None:
    """Half a gigabyte at most."""
    words = [str(DAMAGE / word) if (DAMAGE / word).is_file() else word for word in command.split()]
    words = [word.replace("OUT", str(tmp_path / "out")) for word in words]
    said = subprocess.run(
        [sys.executable, "-c", MEASURE, "-m", "mapcli", *words], capture_output=True, timeout=120
    )
    status, kilobytes = map(int, said.stdout.split()[-2:])
    assert status in (0, 1)
    assert kilobytes < 512 * 1024


def test_one_stray_reading_is_no_error_code(tmp_path: Path) -> None:
    """Where 50 m means no return, one reading of 3000 m does not change that."""
    import mapcli

    def log(first: str) -> str:
        ranges = [first] + ["50"] * 30 + ["3.2", "4.1", "2.7"] * 10
        scan = f"FLASER {len(ranges)} {' '.join(ranges)} 0 0 0 0 0 0"
        lines = [f"{scan} {k}.0 host {k}.0" for k in range(5)]
        path = tmp_path / f"{first}.log"
        path.write_text("\n".join(lines) + "\n")
        return str(path)

    for name in (log("3.0"), log("3000")):
        opened = mapcli.open_log(name)
        list(opened.records())
        assert opened.beams.no_return >= 150, name
