"""Scans that were taken beam by beam while the robot drove and turned."""

from __future__ import annotations

import pytest
from support.sweeping import SweepingRobot, ate

from mapcli import replay
from mapcli.model.sweep import AT_ONCE, BeamTiming


def error(robot: SweepingRobot, timing: BeamTiming) -> float:
    replayed = replay(robot.records(timing))
    return ate([pose.pose for pose in replayed.trace.poses], robot.truth())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "stamp", "order"),
    [
        (SweepingRobot(), "first", "forward"),
        (SweepingRobot(mid=0.5), "middle", "forward"),
        (SweepingRobot(mid=1.0), "last", "forward"),
        (SweepingRobot(flipped=True), "first", "backward"),
        (SweepingRobot(flipped=True, mid=1.0), "last", "backward"),
    ],
)
def test_beams_are_put_where_they_were_taken(robot: SweepingRobot, stamp: str, order: str) -> None:
    timing = BeamTiming(robot.increment, stamp, order)  # type: ignore[arg-type]
    taken_in_time = error(robot, timing)
    assert taken_in_time < 0.006
    assert error(robot, AT_ONCE) > 4 * taken_in_time
