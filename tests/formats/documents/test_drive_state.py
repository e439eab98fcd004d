"""States of maps of several drives: written and read to the bit, refused when damaged."""

from __future__ import annotations

import io
import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from mapcli.errors import FormatError
from mapcli.formats.documents.drive_state import read_state, write_state
from mapcli.model.loop_check import LoopCheck
from mapcli.model.pose import Pose2D
from mapcli.model.reason import Reason
from mapcli.model.saved_drive import SavedDrive, SavedKeyframe, SavedScan, SavedSweep
from mapcli.model.summary import ReplaySummary
from mapcli.model.sweep_summary import Crispness, SweepSummary
from mapcli.model.trace import TracedPose

SWEEP = SavedSweep(
    np.array([[1 / 3, 2.0]]),
    np.array([0.1]),
    np.array([0.0, 0.1]),
    np.array([[0.0] * 3, [0.1] * 3]),
)
KEYFRAME = SavedKeyframe(
    np.array([[1 / 3, 2.0], [np.pi, -1.0]]),
    np.empty((0, 2)),
    np.array([0.1, 0.2]),
    np.diag([1e-4, 2e-4, 1 / 3]),
    12.5,
    0,
    SWEEP,
)
SCANS = (
    SavedScan(TracedPose(5, Pose2D(0.1, 1 / 3, -2), Pose2D(1, 2, 3), 0.75, "first"), None,
              np.array([[1, 2]], np.float32), np.ones((1, 6), np.float32), KEYFRAME),
    SavedScan(TracedPose(9, Pose2D(), None, None, "odometry"), Pose2D(0.1),
              np.empty((0, 2), np.float32), np.empty((0, 6), np.float32)),
)  # fmt: skip
SUMMARY = ReplaySummary(
    3, 2, 1, 1, {"too few": 1}, 1.5, 2.5, 0, 0.75, 1, 2, 3, {"cut": 1}, interrupted=False,
    verdict="doubtful", reasons=(Reason("torn", 1.0, 2.0, "text", "--try", "doubtful"),),
    sweep=SweepSummary(0.1, 0.08, "forward", Crispness(0.9, 0.8)),
    loop_check=LoopCheck(-0.3, -0.2, -0.2, 1),
)  # fmt: skip
DRIVES = (
    SavedDrive("one", {"one.mcap": "0" * 64}, {"every": 1}, SUMMARY, 0.08, SCANS),
    SavedDrive("two", {"two.mcap": "1" * 64}, {}, SUMMARY, 0.0, SCANS[1:]),
)


def state() -> bytes:
    stream = io.BytesIO()
    write_state(DRIVES, stream)
    return stream.getvalue()


def flat(value: object) -> object:
    """Records as plain values, arrays as bytes."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, list | tuple):
        return [flat(one) for one in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: flat(getattr(value, name)) for name in value.__dataclass_fields__}
    return value


def test_round_trip_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "s.mcap"
    path.write_bytes(state())
    assert flat(read_state(path)) == flat([*DRIVES])


def test_the_same_drives_give_the_same_bytes() -> None:
    assert state() == state()


def test_cut_anywhere_it_is_refused(tmp_path: Path) -> None:
    path, whole = tmp_path / "s.mcap", state()
    for size in range(0, len(whole) - 1, 37):
        path.write_bytes(whole[:size])
        with pytest.raises(FormatError, match=r"s\.mcap: .*expected a state"):
            read_state(path)


def test_a_flipped_byte_never_gives_another_state(tmp_path: Path) -> None:
    path, whole, told = tmp_path / "s.mcap", state(), flat([*DRIVES])
    for place in range(0, len(whole), 23):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        with suppress(FormatError):
            assert flat(read_state(path)) == told


def test_another_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mapcli.formats.documents.drive_state.VERSION", 2)
    (tmp_path / "s.mcap").write_bytes(state())
    monkeypatch.undo()
    with pytest.raises(FormatError, match=r"s\.mcap: is of version 2; expected version 1"):
        read_state(tmp_path / "s.mcap")


def test_numbers_of_another_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dumps = json.dumps
    monkeypatch.setattr("json.dumps", lambda content, **how: dumps(
        {**content, "pose": [1, 2]} if "pose" in content else content, **how))  # fmt: skip
    (tmp_path / "s.mcap").write_bytes(state())
    with pytest.raises(FormatError, match=r"s\.mcap: drive 1, scan 1: has a value of another kind"):
        read_state(tmp_path / "s.mcap")
