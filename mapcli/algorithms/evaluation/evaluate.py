"""The errors of a trajectory: ATE and RPE, measured relations, or the loops of its own log."""

from __future__ import annotations

from collections.abc import Iterable

from mapcli.algorithms.evaluation.relations import evaluate_relations
from mapcli.algorithms.evaluation.trajectory_error import EvaluateParameters, evaluate_trajectory
from mapcli.model.evaluation import Evaluation
from mapcli.model.pose import Pose2D
from mapcli.model.scan import Record
from mapcli.model.trajectory import Relations, Trajectory

Reference = Trajectory | Relations | Iterable[Record]


def evaluate(
    trajectory: Trajectory,
    reference: Reference,
    parameters: EvaluateParameters | None = None,
    *,
    odometry: Trajectory | None = None,
    alignment: Pose2D | None = None,
) -> Evaluation:
    """The errors of a trajectory, by what it is held against.

    Args:
        reference: another trajectory gives ATE and RPE (`trajectory_error`); measured relations
            between poses give what is left of each (`relations`); the records of the log that the
            trajectory was made from give the relations of scans at places visited twice
            (`self_check`).
        parameters: association and RPE distance, against a trajectory.
        odometry: against relations, it carries poses on between those of the trajectory.
        alignment: against a trajectory, the motion to align by; by default the best one.

    Raises:
        DataError: nothing can be compared; it says what would be needed.
    """
    if isinstance(reference, Trajectory):
        return evaluate_trajectory(trajectory, reference, parameters, alignment)
    if isinstance(reference, Relations):
        return evaluate_relations(trajectory, reference, odometry)
    from mapcli.algorithms.evaluation.self_check import self_check

    return self_check(trajectory, reference)
