"""The topics of a log: names of those that mapcli writes, and the choice of those that it reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.log import ALL_TOPICS, Role, Topic

SCANS: tuple[Role, ...] = "scan", "range", "cloud"
"""Roles of topics whose messages are scans."""


class LogNames(NamedTuple):
    """Topics that records go to, and names of frames. A second mount in the same log gets
    `<laser_frame>_2`, and so on; with `topic_per_mount` its scans go to `<scan_topic>_2`."""

    scan_topic: str = "/scan"
    odom_topic: str = "/odom"
    truth_topic: str = "/ground_truth"
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    laser_frame: str = "laser"
    topic_per_mount: bool = False


def choose_scan_topics(
    topics: Sequence[Topic], wanted: Sequence[str], name: str, expected: str
) -> list[Topic]:
    """The topics to read scans from: those named, or the only candidate; without any, all range
    sensors with one beam, which have a topic each.

    Args:
        wanted: names, see `LogOptions.scan_topics`.
        expected: what would have been scans in this format.

    Raises:
        DataError: see `Log.require_scan_topics`.
    """
    candidates = considered_scan_topics(topics, wanted, name)
    if len(candidates) == 1 or (candidates and (wanted or candidates[0].role == "range")):
        return candidates
    if candidates:
        raise DataError(
            f"several scan topics{listed(candidates, ': ')}",
            file=name,
            expected="one of them named with --scan-topic, several lasers of a robot with one "
            f"--scan-topic each, or --scan-topic {ALL_TOPICS}",
        )
    raise DataError(
        f"no range scans{listed(topics, ' among ')}",
        file=name,
        expected=expected,
    )


def considered_scan_topics(
    topics: Sequence[Topic], wanted: Sequence[str], name: str
) -> list[Topic]:
    """The topics of scans that `choose_scan_topics` chooses from, or all of which are named.

    Raises:
        DataError: one that is named is none.
    """
    if wanted and ALL_TOPICS not in wanted:
        return [_named(topics, one, name) for one in dict.fromkeys(wanted)]
    roles: tuple[Role, ...] = "scan", "cloud", "range"
    return next(filter(None, (_candidates(topics, role) for role in roles)), [])


def check_sensors(named: Sequence[str], topics: Sequence[Topic], name: str) -> None:
    """Refuse sensors that are said to sit somewhere and are none of the topics that are read.

    Raises:
        DataError: one of them is not.
    """
    known = [topic.name for topic in topics]
    if unknown := sorted(set(named).difference(known)):
        raise DataError(f"no sensor {unknown[0]} among {', '.join(known)}", file=name)


def _named(topics: Sequence[Topic], wanted: str, name: str) -> Topic:
    found = [topic for role in SCANS for topic in _candidates(topics, role, wanted)]
    if len(found) != 1:
        known = [topic for role in SCANS for topic in _candidates(topics, role)]
        raise DataError(f"no scan topic {wanted}{listed(known, ' among ')}", file=name)
    return found[0]


def choose_odom_topic(topics: Sequence[Topic], wanted: str | None, name: str) -> Topic | None:
    """The topic to read odometry from: the one named, the only candidate, or else /tf. One of poses
    must be named.

    Raises:
        DataError: see `Log.find_odom_topic`.
    """
    odometry = _candidates(topics, "odometry", wanted)
    transforms = _candidates(topics, "tf", wanted)
    if wanted is not None:
        odometry += _candidates(topics, "pose", wanted)
    if len(odometry) > 1:
        raise DataError(
            f"several odometry topics{listed(odometry, ': ')}",
            file=name,
            expected="one of them named with --odom-topic",
        )
    if wanted is not None and not odometry + transforms:
        roles: tuple[Role, ...] = "odometry", "tf", "pose"
        known = [topic for role in roles for topic in _candidates(topics, role)]
        raise DataError(f"no odometry topic {wanted}{listed(known, ' among ')}", file=name)
    return next(iter(odometry + transforms), None)


def _candidates(topics: Sequence[Topic], role: Role, wanted: str | None = None) -> list[Topic]:
    return [
        t
        for t in topics
        if t.role == role and (t.count > 0 if wanted is None else t.name == wanted)
    ]


def listed(topics: Sequence[Topic], lead: str) -> str:
    """The topics with their types and counts, or nothing."""
    usual = ("cdr", "carmen")
    texts = [
        f"{t.name} ({t.type}{'' if t.encoding in usual else f' in {t.encoding}'}, "
        f"{counted(t.count, 'messages')})"
        for t in topics
    ]
    return f"{lead}{', '.join(texts)}" if texts else ""
