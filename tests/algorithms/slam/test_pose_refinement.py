"""A scan in a map at a given pose: refinement, and free-space conflicts."""

from __future__ import annotations

from support.room import HERE, NARROW, WIDE, assert_at, look, mapped, moved, seen

from mapcli.algorithms.slam.match import Match, MatchParameters
from mapcli.algorithms.slam.pose_refinement import ScanInMap
from mapcli.model.pose import Pose2D


def test_free_space_conflicts_by_hand() -> None:
    # The right wall of the room is 4.04 m ahead; a beam has passed 1.5 m ahead.
    here, ends = Pose2D(), [(4.04, 0.0), (1.5, 0.0), (4.9, 0.0)]
    scan = ScanInMap(mapped(here), seen(ends), MatchParameters(refine=False, min_hits=1))
    for pose, conflicts in (
        (here, 1),  # nothing is known beyond the wall
        (Pose2D(-0.86), 2),  # now the farthest is the wall
    ):
        assert scan.free_space_conflicts(pose) == conflicts
        assert scan.match_near(pose, NARROW).free_space_conflicts == conflicts


def test_match_near_searches_nothing() -> None:
    scan = ScanInMap(mapped(), look(HERE), MatchParameters())
    assert_at(scan.match_near(moved(HERE, 0.05, 0.03, 1), WIDE), HERE)
    far = moved(HERE, 0.6, 0.0)
    assert scan.match_near(far, NARROW).pose.distance(far) < 0.3
    few = ScanInMap(mapped(), seen([(1, 1)]), MatchParameters())
    assert few.match_near(far, NARROW) == Match(far, 0.0, 0, found=False)
