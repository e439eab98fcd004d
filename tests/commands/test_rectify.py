"""Straight and perpendicular walls (Sect. 9.4, Fig. 9.11)."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import run
from numpy.typing import NDArray

from mapcli import (
    GridMap,
    Pose2D,
    World,
    load_map,
    plan_drive,
    rasterize,
)
from mapcli.algorithms.maps.rasterize import empty_map
from mapcli.formats.maps.text import write_numbers
from mapcli.model.waypoint import Waypoint

ROOM = [(0, 0), (5, 0), (5, 3), (3, 3), (3, 4.5), (0, 4.5), (0, 0)]
"""Six walls, one corner of which points inwards."""


def followed(
    corners: list[tuple[float, float]] = ROOM, drift_deg: float = 0.0, scale: float = 1.0
) -> NDArray[np.float64]:
    """What wheels say of a drive along walls, a pose every 0.1 s, shape (n, 3)."""
    drive = plan_drive([Waypoint(x, y) for x, y in corners])
    true = [drive.pose_at(k / 10) for k in range(math.ceil(drive.duration * 10) + 1)]
    pose = true[0]
    rows = [(pose.x, pose.y, pose.theta)]
    for a, b in pairwise(true):
        moved = a.between(b)
        turn = moved.theta + math.radians(drift_deg) * math.hypot(moved.x, moved.y)
        pose = pose.compose(Pose2D(moved.x * scale, moved.y * scale, turn))
        rows.append((pose.x, pose.y, pose.theta))
    return np.array(rows)


def room_map(turn_deg: float = 0.0, wobble: float = 0.0) -> GridMap:
    """A room of 6 x 4 m with walls 0.2 m thick and a pillar, at 0.1 m a cell; walls wobble."""
    rng = np.random.default_rng(1)
    inner = rasterize(World.of([[(1, 1), (7, 1), (7, 5), (1, 5)]]), empty_map((0, 0, 8, 6), 0.1))
    outer = rasterize(
        World.of([[(0.8, 0.8), (7.2, 0.8), (7.2, 5.2), (0.8, 5.2)]]), empty_map((0, 0, 8, 6), 0.1)
    )
    cells = np.where(inner.cells == 1, 0, np.where(outer.cells == 1, 1, np.nan))
    cells[28:32, 38:42] = 1
    bumps = (rng.random(cells.shape) < wobble) & (inner.cells == 1)
    edge = np.zeros(cells.shape, dtype=bool)
    edge[10, 10:70] = edge[49, 10:70] = edge[10:50, 10] = edge[10:50, 69] = True
    cells[bumps & edge] = 1
    return GridMap(cells.astype(np.float32), 0.1, Pose2D(-2, 1, math.radians(turn_deg)))


def trace_file(path: Path, poses: NDArray[np.float64]) -> str:
    rows = [
        {"stamp_ns": k * 10**8, "x": x, "y": y, "theta": theta}
        for k, (x, y, theta) in enumerate(poses.tolist())
    ]
    path.write_text(json.dumps({"format": "mapcli.pose-trace", "version": 1, "poses": rows}))
    return str(path)


def test_the_command_on_a_trace(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = trace_file(tmp_path / "t.json", followed(drift_deg=2))
    out, picture = tmp_path / "out.json", tmp_path / "out.png"
    assert run("rectify", source, str(out), "--png", str(picture)) == 0
    printed = capsys.readouterr().out
    assert "walls  6, with 5 corners, up to" in printed
    assert "0.00 m with the lengths adjusted" in printed
    document = json.loads(out.read_text())
    assert document["summary"]["gap_after_m"] == 0
    assert document["summary"]["gap_before_m"] > 1
    was = json.loads(Path(source).read_text())["poses"][90]
    assert document["poses"][90]["odom"]["x"] == pytest.approx(was["x"], abs=1e-6)
    assert document["poses"][90]["x"] != pytest.approx(was["x"], abs=1e-3)
    assert picture.read_bytes().startswith(b"\x89PNG")
    for suffix in ("tum", "csv", "g2o", "kitti"):
        assert run("rectify", "-q", source, str(tmp_path / f"o.{suffix}")) == 0
    assert capsys.readouterr().out == ""


def test_the_command_on_a_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.txt").write_bytes(b"".join(write_numbers(room_map(wobble=0.3))))
    out = tmp_path / "out.yaml"
    assert run("rectify", str(tmp_path / "m.txt"), str(out), "--png", str(tmp_path / "p.png")) == 0
    assert "2 of 2 of the open space made square" in capsys.readouterr().out
    assert load_map(out).grid.rows == 60


def test_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = trace_file(tmp_path / "one.json", followed()[:1])
    assert run("rectify", one, str(tmp_path / "o.json")) == 1
    assert capsys.readouterr().err == f"Error: {one}: 1 pose; expected a drive along walls\n"
    assert run("rectify", one, str(tmp_path / "o.txt")) == 2
    assert "IN is a trace" in capsys.readouterr().err
    assert run("rectify", one, str(tmp_path / "o.json"), "--tolerance", "-1") == 2
    assert run("rectify", str(tmp_path / "none.json"), str(tmp_path / "o.json")) == 1
