"""The state of a map of several drives (`--save-state`): an MCAP file of JSON messages.

/drive  mapcli.drive  one message a drive, before its scans: its name, inputs, parameters, summary
/scan   mapcli.scan   one message a scan, logged at its stamp, in the order of tracking

Arrays are objects {"shape": [n, 2], "f4" or "f8": little-endian numbers in base64}, so that what is
read back is the same to the bit. `docs/formats.md` explains every field. A state that is damaged or
cut is refused: a map of a part of its scans would be another map.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from mapcli.errors import FormatError
from mapcli.formats.file_kind import STATE_PROFILE, Role, expecting
from mapcli.formats.input import ReadBytes, read_file
from mapcli.model.clock import Clock
from mapcli.model.loop_check import LoopCheck
from mapcli.model.pose import Pose2D
from mapcli.model.reason import Reason
from mapcli.model.saved_drive import SavedDrive, SavedKeyframe, SavedScan, SavedSweep
from mapcli.model.summary import ReplaySummary
from mapcli.model.sweep_summary import Crispness, SweepSummary
from mapcli.model.trace import STATUSES, TracedPose
from mapcli.version import __version__

VERSION = 1
"""Of the messages."""

WANTED = "a state that --save-state wrote"

KINDS: dict[str, np.dtype[Any]] = {"f4": np.dtype("<f4"), "f8": np.dtype("<f8")}
"""Of numbers in arrays."""


def write_state(drives: Sequence[SavedDrive], stream: BinaryIO) -> None:
    """Write drives, each with all of its scans."""
    from mcap.writer import CompressionType, Writer

    from mapcli.formats.logs.mcap.writer import CountedStream

    writer = Writer(CountedStream(stream), compression=CompressionType.ZSTD)  # type: ignore[arg-type]
    writer.start(profile=STATE_PROFILE, library=f"mapcli {__version__}")
    channels = {
        name: writer.register_channel(f"/{name}", "json", _schema(writer, name))
        for name in ("drive", "scan")
    }
    for drive in drives:
        scans = list(drive.scans)
        head = _head(drive, len(scans))
        begin_ns = scans[0].traced.stamp_ns if scans else 0
        for name, stamp_ns, content in (
            ("drive", begin_ns, head),
            *(("scan", scan.traced.stamp_ns, _scan(scan)) for scan in scans),
        ):
            data = json.dumps(content, separators=(",", ":")).encode()
            writer.add_message(channels[name], max(stamp_ns, 0), data, max(stamp_ns, 0))
    writer.finish()  # type: ignore[no-untyped-call]


def _schema(writer: Any, name: str) -> int:
    number: int = writer.register_schema(f"mapcli.{name}", "jsonschema", b'{"type": "object"}')
    return number


def read_state(path: str | Path, read: ReadBytes = read_file) -> list[SavedDrive]:
    """The drives of a state.

    Raises:
        FormatError: no state, one of another version, or one that is cut or damaged.
    """
    file = str(path)
    with expecting(file, WANTED, Role.STATE):
        drives: list[SavedDrive] = []
        scans: list[SavedScan] = []
        missing = 0
        for topic, content in _messages(read(Path(path)), file):
            if topic == "/drive":
                _refuse_missing(missing, file)
                scans = []
                with _told(file, f"drive {len(drives) + 1}"):
                    missing = int(content["scans"])
                    drives.append(_drive_of(content, scans, file))
            else:
                missing -= 1
                with _told(file, f"drive {len(drives)}, scan {len(scans) + 1}"):
                    scans.append(_scan_of(content))
        _refuse_missing(missing, file)
        if not drives:
            raise FormatError("holds no drive", file=file, expected=WANTED)
    return drives


def _refuse_missing(scans: int, file: str) -> None:
    if scans:
        raise FormatError(
            f"{abs(scans):,} scans {'are missing' if scans > 0 else 'too many'}", file=file,
            expected=WANTED,
        )  # fmt: skip


def _messages(data: bytes, file: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Topic and content of each message, in the order in which they were written.

    Raises:
        FormatError: no state, or one that is cut or damaged.
    """
    from mcap.exceptions import McapError
    from mcap.records import Channel, Footer, Header, Message
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    topics, ended = dict[int, str](), False
    records = iter(StreamReader(BytesIO(data), validate_crcs=True).records)
    while True:
        try:
            record = next(records, None)
        except (McapError, ZstdError, *BROKEN) as error:
            problem = f"is cut or damaged: {str(error) or type(error).__name__}"
            raise FormatError(problem, file=file, expected=WANTED) from error
        if record is None:
            break
        ended |= isinstance(record, Footer)
        if isinstance(record, Header) and record.profile != STATE_PROFILE:
            raise FormatError("is no state", file=file, expected=WANTED)
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            with _told(file, f"byte {data.find(record.data[:32])}"):
                yield topics[record.channel_id], json.loads(record.data)
    if not ended:
        raise FormatError("is cut", file=file, expected=WANTED)


BROKEN = ValueError, EOFError, OSError, LookupError, OverflowError, MemoryError, struct.error
"""What a damaged file makes a reader raise that believes it."""


@contextmanager
def _told(file: str, where: str | None) -> Iterator[None]:
    """What a value of another type makes Python raise becomes a FormatError."""
    try:
        yield
    except (KeyError, TypeError, *BROKEN, RecursionError) as error:
        missing = f"no {error}" if isinstance(error, KeyError) else "a value of another kind"
        raise FormatError(f"has {missing}", file=file, where=where, expected=WANTED) from error


def _head(drive: SavedDrive, scans: int) -> dict[str, Any]:
    return {
        "format": "mapcli.drive",
        "version": VERSION,
        "name": drive.name,
        "input": [{"file": name, "sha256": digest} for name, digest in drive.inputs.items()],
        "parameters": dict(drive.parameters),
        "summary": asdict(drive.summary) | {"seconds": 0.0},
        "longest_sweep_s": drive.longest_sweep_s,
        "scans": scans,
    }


def _drive_of(content: Mapping[str, Any], scans: list[SavedScan], file: str) -> SavedDrive:
    if content["version"] != VERSION:
        version = content["version"]
        raise FormatError(f"is of version {version}", file=file, expected=f"version {VERSION}")
    summary = dict(content["summary"])
    summary["reasons"] = tuple(Reason(**reason) for reason in summary["reasons"])
    summary["clock"] = summary.get("clock") and Clock(**summary["clock"])
    if sweep := summary["sweep"]:
        crispness = sweep["crispness"] and Crispness(**sweep["crispness"])
        summary["sweep"] = SweepSummary(**{**sweep, "crispness": crispness})
    if check := summary["loop_check"]:
        summary["loop_check"] = LoopCheck(**check)
    inputs = {str(one["file"]): str(one["sha256"]) for one in content["input"]}
    name, longest_s = str(content["name"]), float(content["longest_sweep_s"])
    parameters = dict(content["parameters"])
    return SavedDrive(name, inputs, parameters, ReplaySummary(**summary), longest_s, scans)


def _scan(scan: SavedScan) -> dict[str, Any]:
    traced = scan.traced
    return {
        "stamp_ns": traced.stamp_ns,
        "pose": _pose(traced.pose),
        "odom": traced.odom and _pose(traced.odom),
        "score": traced.score,
        "status": traced.status,
        "step": scan.step and _pose(scan.step),
        "points": _array(scan.points, "f4"),
        "beams": None if scan.beams is None else _array(scan.beams, "f4"),
        "keyframe": scan.keyframe and _keyframe(scan.keyframe),
    }


def _scan_of(content: Mapping[str, Any]) -> SavedScan:
    odom, step, score = content["odom"], content["step"], content["score"]
    beams, keyframe, status = content["beams"], content["keyframe"], content["status"]
    traced = TracedPose(
        int(content["stamp_ns"]),
        _pose_of(content["pose"]),
        odom and _pose_of(odom),
        None if score is None else float(score),
        None if status is None else STATUSES[status],
    )
    return SavedScan(
        traced,
        step and _pose_of(step),
        _numbers(content["points"], 2),
        None if beams is None else _numbers(beams, 6),
        keyframe and _keyframe_of(keyframe),
    )


def _keyframe(one: SavedKeyframe) -> dict[str, Any]:
    sweep = one.sweep
    return {
        "hits": _array(one.hits),
        "open_ends": _array(one.open_ends),
        "laser": one.laser.tolist(),
        "covariance": one.covariance.tolist(),
        "metres": one.metres,
        "lost_since": one.lost_since,
        "sweep": sweep and {
            "raw": _array(sweep.raw),
            "seconds": _array(sweep.seconds),
            "motion_seconds": _array(sweep.motion_seconds),
            "motion_poses": _array(sweep.motion_poses),
        },
    }  # fmt: skip


def _keyframe_of(content: Mapping[str, Any]) -> SavedKeyframe:
    sweep, lost_since = content["sweep"], content["lost_since"]
    return SavedKeyframe(
        _numbers(content["hits"], 2),
        _numbers(content["open_ends"], 2),
        np.array(content["laser"], np.float64).reshape(2),
        np.array(content["covariance"], np.float64).reshape(3, 3),
        float(content["metres"]),
        None if lost_since is None else int(lost_since),
        sweep and SavedSweep(
            _numbers(sweep["raw"], 2),
            _numbers(sweep["seconds"]),
            _numbers(sweep["motion_seconds"]),
            _numbers(sweep["motion_poses"], 3),
        ),
    )  # fmt: skip


def _pose(pose: Pose2D) -> list[float]:
    return [pose.x, pose.y, pose.theta]


def _pose_of(numbers: Sequence[float]) -> Pose2D:
    x, y, theta = map(float, numbers)
    if not np.isfinite((x, y, theta)).all():
        raise ValueError(numbers)
    return Pose2D(x, y, theta)


def _array(array: NDArray[Any], kind: str = "f8") -> dict[str, Any]:
    numbers = np.ascontiguousarray(array, KINDS[kind]).tobytes()
    return {"shape": list(array.shape), kind: base64.b64encode(numbers).decode()}


def _numbers(content: Mapping[str, Any], columns: int | None = None) -> NDArray[Any]:
    """An array, of so many columns if it is no list.

    Raises:
        ValueError: one of another shape, or with numbers that are not finite.
    """
    kind = "f4" if "f4" in content else "f8"
    numbers = np.frombuffer(base64.b64decode(content[kind], validate=True), KINDS[kind])
    array: NDArray[Any] = numbers.reshape(content["shape"]).astype(kind)
    if array.shape[1:] != (() if columns is None else (columns,)) or not np.isfinite(array).all():
        raise ValueError(array.shape)
    return array
