"""`mapcli slam-replay --save-perception`: scans with their estimated poses, as perceptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from mapcli.algorithms.scans.perception import PerceptionParameters
from mapcli.algorithms.scans.scan_extraction import scan_perception
from mapcli.errors import DataError
from mapcli.formats.documents.perception_writer import dump_perception
from mapcli.formats.output import write_bytes
from mapcli.model.scan import RangeScan
from mapcli.model.trace import PoseTrace


def perception_files(folder: str | Path, numbers: Sequence[int]) -> dict[int, str]:
    """Number of the scan -> its file."""
    return {number: str(Path(folder) / f"perception-{number}.yaml") for number in numbers}


def write_perceptions(
    files: Mapping[int, str],
    scans: Mapping[int, RangeScan],
    trace: PoseTrace,
    parameters: PerceptionParameters,
    log: str,
    *,
    no_clobber: bool,
) -> None:
    """Write the scans asked for.

    Raises:
        DataError: the log has no such scan, or it has no beams.
        OutputError: a file cannot be written.
    """
    for number, name in files.items():
        if number not in scans or number >= len(trace.poses):
            raise DataError(f"--save-perception {number}: there is no such scan", file=log,
                            expected=f"0 to {len(trace.poses) - 1}")  # fmt: skip
        traced = trace.poses[number]
        try:
            perception = scan_perception(scans[number], traced.pose, parameters)
        except DataError as error:
            raise DataError(f"scan {number}: {error.problem}", file=log) from error
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(name, dump_perception(perception, name, traced.odom), no_clobber=no_clobber)
