"""`metadata.yaml` of a ROS 2 bag: which files it has, and how many messages they hold.

A recorder that was killed leaves none, and files may have been renamed since; so it is believed
where it agrees with what is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from mapcli.formats.logs.message_file import Stream

NAME = "metadata.yaml"

MAX_BYTES = 1 << 22


def read_metadata(folder: Path) -> dict[str, Any]:
    """What a bag says of itself; empty where it says nothing, or nothing that can be read."""
    try:
        with (folder / NAME).open("rb") as file:
            content = yaml.load(file.read(MAX_BYTES), Loader=_LOADER)
        return dict(content["rosbag2_bagfile_information"])
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError):
        return {}


_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def named_files(folder: Path) -> list[Path]:
    """The files of a bag, in order, by its metadata; empty if one of them is not there."""
    names = read_metadata(folder).get("relative_file_paths")
    if not isinstance(names, list):
        return []
    files = [folder / Path(str(name)).name for name in names]
    return files if all(file.is_file() for file in files) else []


def told_counts(file: Path, streams: Mapping[int, Stream]) -> dict[int, int]:
    """Stream -> messages, by the metadata beside a file; empty unless it is the bag's only one."""
    content = read_metadata(file.parent)
    if len(content.get("relative_file_paths") or ()) != 1:
        return {}
    numbers = {stream.topic: number for number, stream in streams.items()}
    counts = {}
    for told in content.get("topics_with_message_count") or ():
        try:
            number = numbers[str(told["topic_metadata"]["name"])]
            counts[number] = int(told["message_count"])
        except (KeyError, TypeError, ValueError):
            continue
    return counts
