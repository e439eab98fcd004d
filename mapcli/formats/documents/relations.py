"""Relative poses between two times, the ground truth of Kuemmerle et al., "On Measuring the
Accuracy of SLAM Algorithms", Autonomous Robots 27 (2009).

    # t1 t2 x y z roll pitch yaw    the pose at t2 as seen from the one at t1
    39.447200 48.401801 -0.153130 -0.051420 0 0 0 -2.405850

Seconds in log time, metres, radians; plain or gzip. In the plane, z, roll and pitch are not used.
"""

from __future__ import annotations

from pathlib import Path, PurePath

import numpy as np

from mapcli.errors import FormatError
from mapcli.formats.documents.text_columns import columns, rows_of_words, stamp_ns
from mapcli.formats.file_kind import Role, expecting
from mapcli.formats.input import read_file, unpacked
from mapcli.model.pose import FARTHEST_M
from mapcli.model.trajectory import Relations

COLUMNS = "t1 t2 x y z roll pitch yaw"


def is_relations(path: str) -> bool:
    """By the suffix: eight columns alone could be TUM poses as well."""
    return PurePath(path.removesuffix(".gz")).suffix.lower() == ".relations"


def load_relations(path: str | Path) -> Relations:
    """Load relative poses between two times, for the measure of Kuemmerle 2009.

    Raises:
        FormatError: no such file, no relations in it, or a line that is not one.
    """
    wanted = "a file of relations"
    with expecting(path, wanted, Role.RELATIONS):
        return read_relations(read_file(Path(path), wanted), str(path))


def read_relations(data: bytes, path: str) -> Relations:
    """Relations from their bytes; see `load_relations`."""
    data = unpacked(data, path)
    starts, ends, poses = [], [], []
    for line, words in rows_of_words(data):
        where = f"line {line}"
        numbers = columns(words, 8, path, where, COLUMNS)
        if max(map(abs, numbers[2:])) > FARTHEST_M:
            raise FormatError(
                f"{max(numbers[2:], key=abs):g}", file=path, where=where,
                expected=f"metres and radians, at most {FARTHEST_M:g}",
            )  # fmt: skip
        starts.append(stamp_ns(words[0], path, where))
        ends.append(stamp_ns(words[1], path, where))
        poses.append((numbers[2], numbers[3], numbers[7]))
    if not poses:
        raise FormatError("has no relations", file=path, expected=f"lines of {COLUMNS}")
    return Relations(
        np.array(starts, dtype=np.int64), np.array(ends, dtype=np.int64), np.array(poses)
    )
