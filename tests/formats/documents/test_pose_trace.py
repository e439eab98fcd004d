"""Pose traces that are moved, and those that say odd things about the files beside them."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from mapcli.errors import FormatError
from mapcli.formats.documents.load_trace import move_trace
from mapcli.formats.documents.pose_trace import torn_files
from mapcli.model.isometry import Isometry
from mapcli.model.pose import Pose2D

MIRROR = Isometry(Pose2D(1.0, 0.0, 0.0), mirrored=True)
POSE = {"stamp_ns": 5, "x": 1.0, "y": 2.0, "theta": 0.5,
        "odom": {"x": 0.0, "y": 1.0, "theta": 0.25}}  # fmt: skip
LOOP = {"from": 0, "to": 0, "dx": 1.0, "dy": 2.0, "dtheta": 0.5, "score": 0.5}


def trace(folder: Path, **changes: Any) -> Path:
    content = {"format": "mapcli.pose-trace", "version": 1, "parameters": {"a": 1}, "files": [],
               "loops": [LOOP], "poses": [POSE], **changes}  # fmt: skip
    path = folder / "t.json"
    path.write_text(json.dumps(content))
    return path


def test_a_mirrored_trace(tmp_path: Path) -> None:
    moved = json.loads(move_trace(trace(tmp_path), MIRROR))
    odom = {"x": 0.0, "y": -1.0, "theta": -0.25}
    assert moved["poses"] == [{"stamp_ns": 5, "x": 2.0, "y": -2.0, "theta": -0.5, "odom": odom}]
    assert moved["loops"] == [LOOP | {"dy": -2.0, "dtheta": -0.5}]
    moved_by = {"x": 1.0, "y": 0.0, "theta": 0.0, "mirrored": True}
    assert moved["parameters"] == {"a": 1, "moved_by": moved_by}


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"poses": [POSE, POSE | {"odom": 5}]}, "pose 1: has a value of another kind; expected od"),
        ({"poses": [POSE | {"odom": {"x": 1}}]}, "pose 0: has no 'y'; expected odom of x, y and"),
        ({"loops": 5}, "loops: has a value of another kind; expected a list of loops"),
        ({"loops": [5]}, "loops: has a value of another kind"),
        ({"loops": [{"dy": 1}]}, "loops: has no 'dtheta'; expected a list of loops with dy and"),
        ({"loops": [LOOP | {"dy": "1"}]}, "loops: has a value of another kind"),
        ({"parameters": [1]}, "parameters: has a value of another kind; expected names and values"),
        ({"summary": float("nan")}, "has a value of another kind; expected finite numbers"),
    ],
)
def test_traces_that_cannot_be_moved(changes: dict[str, Any], problem: str, tmp_path: Path) -> None:
    path = trace(tmp_path, **changes)
    with pytest.raises(FormatError) as error:
        move_trace(path, MIRROR)
    assert str(error.value).startswith(f"{path}: {problem}")


def test_torn_files(tmp_path: Path) -> None:
    (tmp_path / "whole").write_bytes(b"1")
    (tmp_path / "torn").write_bytes(b"2")
    (tmp_path / "folder").mkdir()
    names = ("whole", "torn", "folder", "gone", "", ".", "..", "/", "a\0b", "\ud800", "a" * 5000)
    digest = hashlib.sha256(b"1").hexdigest()
    files = [{"file": name, "sha256": digest} for name in names]
    assert torn_files(trace(tmp_path, files=files)) == ["torn"]
