"""`mapcli slam-replay --save-perception`: scans with their estimated poses, as perceptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from mapcli.algorithms.scans.perception import PerceptionParameters
from mapcli.algorithms.scans.scan_extraction import scan_perception
from mapcli.errors import DataError
from mapcli.formats.documents.perception_writer import dump_perception
from mapcli.formats.logs.log import Log
from mapcli.model.scan import RangeScan
from mapcli.model.trace import PoseTrace


def perception_files(folder: str | Path, numbers: Sequence[int]) -> dict[int, str]:
    """Number of the scan -> its file."""
    return {number: str(Path(folder) / f"perception-{number}.yaml") for number in numbers}


def perception_contents(
    files: Mapping[int, str],
    scans: Mapping[int, RangeScan],
    trace: PoseTrace,
    parameters: PerceptionParameters,
    log: str,
) -> dict[str, bytes]:
    """The files of the scans asked for: name -> content.

    Raises:
        DataError: the log has no such scan, or it has no beams.
    """
    contents = {}
    for number, name in files.items():
        if number not in scans or number >= len(trace.poses):
            raise no_such_scan(number, len(trace.poses), log)
        traced = trace.poses[number]
        try:
            perception = scan_perception(scans[number], traced.pose, parameters)
        except DataError as error:
            raise DataError(f"scan {number}: {error.problem}", file=log) from error
        contents[name] = dump_perception(perception, name, traced.odom)
    return contents


def check_perceptions(files: Mapping[int, str], log: Log) -> None:
    """Say before the work that a scan asked for cannot be there.

    Raises:
        DataError: the log has fewer scans, as far as it tells.
    """
    count = log.scan_count
    for number in files if count is not None else ():
        if number >= (count or 0):
            raise no_such_scan(number, count or 0, log.name)


def no_such_scan(number: int, count: int, log: str) -> DataError:
    return DataError(
        f"--save-perception {number}: there is no such scan",
        file=log,
        expected=f"0 to {count - 1}",
    )
