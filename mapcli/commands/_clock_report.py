"""Whether the clocks of a log agree."""

from __future__ import annotations

from mapcli.algorithms.evaluation.log_reasons import clock_reasons
from mapcli.formats.logs.open_log import Log
from mapcli.model.reason import Reason


def reasons_of_clocks(log: Log, duration_s: float) -> tuple[Reason, ...]:
    """That scans and odometry have other clocks, after the log was read.

    Args:
        duration_s: of the log, from its first to its last scan.
    """
    return tuple(clock_reasons(_recorded_after_s(log), log.outside, duration_s))


def _recorded_after_s(log: Log) -> tuple[float, float] | None:
    """How much later than stamped scans and odometry were recorded, on average, seconds, where the
    stamps are taken as they are; None where that is not known."""
    scans = [log.delays[name] for name in log.scan_topics if name in log.delays]
    known = next((delay for delay in scans if delay.count), None)
    odometry = log.delays.get(log.odom_topic or "")
    if log.clock.source != "header" or log.clock.steps or not (known and odometry):
        return None
    return (known.mean_s, odometry.mean_s) if odometry.count else None
