"""Several recordings are no map: they are refused, with what was found and what to type."""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import SHARED, run
from support.replaying import APARTMENT, CORRIDOR, files, replay, traced, write_log

from mapcli import open_log
from mapcli.formats.logs.continuity import Continuity
from mapcli.formats.logs.odometry_track import Place
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Odometry, RangeScan, Record

DATASETS, CASES = SHARED / "datasets", SHARED / "cases" / "logs"

QUICK = "-q", "--search", "none", "--no-loop-closing"

needs_datasets = pytest.mark.skipif(not DATASETS.is_dir(), reason="needs the shared datasets")
needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason="needs the shared cases")

S = 10**9


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refusal(capsys: pytest.CaptureFixture[str], *logs: str | Path) -> str:
    """Why a replay of these is refused; it writes nothing."""
    before = files()
    assert replay(*QUICK, *map(str, logs)) == 1
    assert files() == before
    (line,) = capsys.readouterr().err.splitlines()
    return line


def after(records: Sequence[Record], seconds: float) -> list[Record]:
    """A whole log, begun so long after the corridor's end."""
    shift = CORRIDOR_END - records[0].stamp_ns + round(seconds * S)
    return [replace(record, stamp_ns=record.stamp_ns + shift) for record in records]


FIRST = list(open_log(CORRIDOR).records())
SECOND = list(open_log(APARTMENT).records())
CORRIDOR_END = FIRST[-1].stamp_ns


def test_one_file_with_two_drives(capsys: pytest.CaptureFixture[str]) -> None:
    both = write_log("both.mcap", [*FIRST, *after(SECOND, 7200)])
    assert refusal(capsys, both) == (
        "Error: both.mcap: after 10.0 s: odometry starts again after nothing was recorded for "
        "2.0 h: another recording; expected one recording; map each alone, with --end 10.0 and "
        "--start 10.0, or insist with --one-recording"
    )


def test_each_of_them_alone_by_what_the_message_says() -> None:
    both = write_log("both.mcap", [*FIRST, *after(SECOND, 7200)])
    assert traced(*QUICK, both, "--end", "10")["summary"]["used"] == 50
    second = traced(*QUICK, both, "--start", "10")["poses"]
    alone = traced(*QUICK, APARTMENT)["poses"]
    assert [(p["x"], p["y"], p["theta"]) for p in second] == [
        (p["x"], p["y"], p["theta"]) for p in alone
    ]


def test_insisting(capsys: pytest.CaptureFixture[str]) -> None:
    both = write_log("both.mcap", [*FIRST, *after(SECOND, 7200)])
    assert replay(*QUICK[1:], both, "--one-recording", "--json", "t.json") == 0
    assert json.loads(Path("t.json").read_text())["summary"]["used"] == 559
    assert (
        "Note: read as one recording, though odometry starts again after nothing was recorded "
        "for 2.0 h"
    ) in capsys.readouterr().err.splitlines()


def test_info_tells(capsys: pytest.CaptureFixture[str]) -> None:
    both = write_log("both.mcap", [*FIRST, *after(SECOND, 7200)])
    assert run("info", both) == 0
    assert (
        "  warning     after 10.0 s odometry starts again after nothing was recorded for 2.0 h: "
        "another recording, slam-replay refuses it"
    ) in capsys.readouterr().out.splitlines()


def test_import_refuses_too(capsys: pytest.CaptureFixture[str]) -> None:
    second = write_log("second.mcap", after(SECOND, 7200))
    assert run("import", CORRIDOR, second, "out.mcap") == 1
    assert "--one-recording" in capsys.readouterr().err
    assert run("import", CORRIDOR, second, "out.mcap", "--one-recording") == 0


@pytest.mark.parametrize(
    ("second", "gap", "found"),
    [
        (SECOND, 0.1, "odometry starts again, and the laser sees another place"),
        (FIRST, 0.1, "odometry starts again, and the log from its start on"),
        (FIRST, 5.0, "odometry starts again after nothing was recorded for 5.0 s"),
    ],
)
def test_one_stream_with_two_drives_and_hardly_a_gap(
    second: Sequence[Record], gap: float, found: str, capsys: pytest.CaptureFixture[str]
) -> None:
    both = write_log("both.mcap", [*FIRST, *after(second, gap)])
    said = refusal(capsys, both)
    assert f"after 10.0 s: {found}: another recording" in said
    cut = re.search(r"with --end ([0-9.]+) and --start \1,", said)
    assert cut
    assert traced(*QUICK, both, "--end", cut[1])["summary"]["used"] == 50
    used = len([record for record in second if isinstance(record, RangeScan)])
    assert traced(*QUICK, both, "--start", cut[1])["summary"]["used"] == used


@pytest.mark.parametrize("drive", [FIRST, SECOND], ids=["corridor", "apartment"])
@pytest.mark.parametrize("part", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("late_s", [0.0, 2.0])
def test_wheels_that_jump_are_one_recording(
    drive: list[Record], part: float, late_s: float
) -> None:
    """Elsewhere all of a sudden, or after they told late what the robot did: the laser goes on."""
    at = drive[int(part * len(drive))].stamp_ns
    last = next(r.pose for r in drive if isinstance(r, Odometry) and r.stamp_ns >= at)
    jump = Pose2D(20.0, -7.0, 2.0) if not late_s else Pose2D()

    def told(record: Record) -> Record:
        if not isinstance(record, Odometry) or record.stamp_ns < at:
            return record
        is_late = record.stamp_ns < at + late_s * S
        return replace(record, pose=last if is_late else jump.compose(record.pose))

    continuity = Continuity()
    for _ in continuity.watched(map(told, drive), Place):
        pass
    assert continuity.breaks == []


def test_two_files_hours_apart_in_either_order(capsys: pytest.CaptureFixture[str]) -> None:
    second = write_log("second.mcap", after(SECOND, 7200))
    said = (
        f"Error: second.mcap: is not of the recording of {CORRIDOR}: odometry starts again after "
        "nothing was recorded for 2.0 h; expected parts of one recording; map each alone "
        "(mapcli slam-replay FILE), or insist with --one-recording"
    )
    assert refusal(capsys, CORRIDOR, second) == said
    assert refusal(capsys, second, CORRIDOR) == said


def test_two_files_of_the_same_time(capsys: pytest.CaptureFixture[str]) -> None:
    assert refusal(capsys, APARTMENT, CORRIDOR) == (
        f"Error: {CORRIDOR}: overlaps {APARTMENT} by 10.0 s, so they are two recordings; expected "
        "parts of one recording; map each alone (mapcli slam-replay FILE), or insist with "
        "--one-recording"
    )


def test_one_file_twice(capsys: pytest.CaptureFixture[str]) -> None:
    Path("copy.mcap").write_bytes(Path(CORRIDOR).read_bytes())
    assert refusal(capsys, CORRIDOR, "copy.mcap") == (
        f"Error: copy.mcap: holds the same as {CORRIDOR}; expected each recording named once, or "
        "insist with --one-recording"
    )


@pytest.mark.parametrize("name", ["parts", "topics"])
@pytest.mark.parametrize("order", [1, -1])
def test_one_recording_in_files(name: str, order: int) -> None:
    """Cut in time anywhere, or by topics: the same poses as of the whole."""
    records = list(open_log(CORRIDOR).records())
    cuts = [records[:20], records[20:21], records[21:90], records[90:]]
    if name == "topics":
        cuts = [
            [record for record in records if type(record).__name__ == kind]
            for kind in ("Odometry", "RangeScan")
        ]
    parts = [write_log(f"part{number}.mcap", cut) for number, cut in enumerate(cuts)]
    whole = write_log("whole.mcap", records)
    assert traced(*QUICK, *parts[::order])["poses"] == traced(*QUICK, whole)["poses"]


def test_python_refuses_too() -> None:
    from mapcli.errors import DataError

    both = write_log("both.mcap", [*FIRST, *after(SECOND, 7200)])
    with pytest.raises(DataError, match="another recording"):
        list(open_log(both).records())
    log = open_log(both, LogOptions(one_recording=True))
    assert len(list(log.records())) == len(FIRST) + len(SECOND)
    assert len(log.breaks) == 1


@needs_datasets
@pytest.mark.parametrize(
    ("logs", "found"),
    [
        (("csail", "freiburg-101"), "overlaps {0} by 42.5 s"),
        (("freiburg-101", "csail"), "overlaps {0} by 42.5 s"),
        (("csail", "csail"), "holds the same as {0}"),
    ],
)
def test_real_drives(logs: Sequence[str], found: str, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [DATASETS / f"{name}.log.gz" for name in logs]
    assert found.format(*paths) in refusal(capsys, *paths)


@needs_datasets
def test_real_drives_in_one_file(capsys: pytest.CaptureFixture[str]) -> None:
    contents = [
        gzip.decompress((DATASETS / f"{name}.log.gz").read_bytes())
        for name in ("csail", "freiburg-101")
    ]
    Path("both.log").write_bytes(b"".join(contents))
    assert "odometry starts again where a clock was set" in refusal(capsys, "both.log")
    Path("both.log").write_bytes(b"".join(contents[::-1]))
    assert "odometry starts again where a clock was set" in refusal(capsys, "both.log")


@needs_datasets
@pytest.mark.slow
@pytest.mark.parametrize(
    "log", sorted([*DATASETS.glob("*.log.gz"), *DATASETS.glob("simulated/*.mcap")]),
    ids=lambda path: path.name,
)  # fmt: skip
def test_every_real_log_is_one_recording(log: Path) -> None:
    opened = open_log(log)
    for _ in opened.records():
        pass
    assert opened.breaks == []


@needs_cases
def test_a_clock_that_was_set_back(capsys: pytest.CaptureFixture[str]) -> None:
    """One recording; the times of recording show that the stamps do not go back in truth."""
    log = str(CASES / "clock_back_long" / "long1.mcap")
    assert replay(*QUICK[1:], log, "--json", "t.json") == 0
    told = "a clock was set back by 60 min, which is taken out"
    assert f"Note: {told}\n" in capsys.readouterr().err
    summary = json.loads(Path("t.json").read_text())["summary"]
    assert (summary["scans"], summary["used"]) == (509, 509)
    assert summary["clock"] == {"source": "header", "why": told}
    assert replay(*QUICK[1:], log, "--time-source", "header") == 0
    assert "--time-source log" in capsys.readouterr().err
    assert traced(*QUICK, log, "--time-source", "log")["summary"]["used_share"] == 1.0


@needs_cases
@pytest.mark.parametrize("order", [1, -1])
def test_a_bag_in_parts(order: int) -> None:
    parts = [str(CASES / f"split_second_half/split/split_{n}.mcap") for n in (0, 1)]
    assert traced(*QUICK, *parts[::order])["summary"]["used_share"] == 1.0
