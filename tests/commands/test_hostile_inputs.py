"""Small inputs that ask for much: one line, soon, in little memory."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import run


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
