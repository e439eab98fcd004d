"""Which times the records of a log have, and what they say about each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from mapcli.model.scan import Odometry, RangeScan, Record

NEAR_DELAY_NS = 100_000_000
"""Recorders are late by less than this more or less."""


@dataclass
class Clock:
    """Which times a log's records have, as far as it was read (mutable).

    Attributes:
        source: stamps in the `header`, times of recording (`log`), or the `order` of the records.
        why: it is not the stamps as they are; empty if it is.
        steps: times that a clock was set, which is taken out.
    """

    source: Literal["header", "log", "order"] = "header"
    why: str = ""
    steps: int = 0

    def document(self) -> dict[str, Any]:
        return {"source": self.source, "why": self.why}

    def note(self) -> str:
        """For a person; empty if the stamps are taken as they are."""
        used = {"header": "", "log": ": times of recording are used",
                "order": ": the order of the lines is used"}  # fmt: skip
        return self.why and f"{self.why}{used[self.source]}"


@dataclass
class Delay:
    """How much later than stamped messages were recorded, nanoseconds (mutable)."""

    count: int = 0
    total_ns: int = 0
    least_ns: int = 0
    most_ns: int = 0

    def add(self, delay_ns: int) -> None:
        if delay_ns < self.least_ns or not self.count:
            self.least_ns = delay_ns
        if delay_ns > self.most_ns or not self.count:
            self.most_ns = delay_ns
        self.count += 1
        self.total_ns += delay_ns

    def is_usual(self, delay_ns: int) -> bool:
        """Whether a delay is about one of those seen, if any were."""
        near = self.least_ns - NEAR_DELAY_NS <= delay_ns <= self.most_ns + NEAR_DELAY_NS
        return near or not self.count

    @property
    def mean_s(self) -> float:
        return self.total_ns / max(self.count, 1) * 1e-9


@dataclass
class ScansOutside:
    """Scans that odometry says nothing about, since it begins later or ends before (mutable).

    Attributes:
        scans, odometry: records so far.
        before: scans before the first odometry; after: since the last one.
    """

    scans: int = 0
    odometry: int = 0
    before: int = 0
    after: int = 0

    def add(self, record: Record) -> None:
        """The next one, in stamp order."""
        if isinstance(record, Odometry):
            self.odometry += 1
            self.after = 0
        elif isinstance(record, RangeScan):
            self.scans += 1
            self.before += not self.odometry
            self.after += bool(self.odometry)

    @property
    def share(self) -> float:
        """Of all scans; 0 where there is no odometry at all."""
        return (self.before + self.after) / self.scans if self.odometry and self.scans else 0.0
