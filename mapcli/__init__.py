"""mapcli: 2D robot mapping without ROS, after chapter 9 of *Elements of Robotics*.

The verbs of the tool as typed functions on records; the commands call the same. Each is imported
when it is first used, so that `import mapcli` loads nothing heavy. `docs/python.md` lists them.

    import mapcli

    log = mapcli.open_log("fixtures/corridor.mcap")
    replayed = mapcli.replay(log.records())
    mapcli.save_map(replayed.map, "corridor.yaml")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mapcli.version import __version__ as __version__

if TYPE_CHECKING:  # what type checkers and editors see; a test compares it with HOMES
    from mapcli.algorithms.evaluation.evaluate import evaluate as evaluate
    from mapcli.algorithms.evaluation.log_check import check_log as check_log
    from mapcli.algorithms.evaluation.trajectory_error import (
        EvaluateParameters as EvaluateParameters,
    )
    from mapcli.algorithms.exploration.exploration_parameters import (
        ExplorationParameters as ExplorationParameters,
    )
    from mapcli.algorithms.exploration.explore import explore as explore
    from mapcli.algorithms.exploration.explore import plan as plan
    from mapcli.algorithms.exploration.frontier_cells import frontier_cells as frontier_cells
    from mapcli.algorithms.maps.compare import compare as compare
    from mapcli.algorithms.maps.rasterize import rasterize as rasterize
    from mapcli.algorithms.maps.rectify_map import rectify_map as rectify_map
    from mapcli.algorithms.maps.rectify_trace import rectify_trace as rectify_trace
    from mapcli.algorithms.maps.registration import merge_maps as merge_maps
    from mapcli.algorithms.maps.registration import register as register
    from mapcli.algorithms.maps.transform import align_walls as align_walls
    from mapcli.algorithms.maps.transform import crop_to_box as crop_to_box
    from mapcli.algorithms.maps.transform import flip as flip
    from mapcli.algorithms.maps.transform import move as move
    from mapcli.algorithms.maps.transform import resample as resample
    from mapcli.algorithms.maps.transform import rotate as rotate
    from mapcli.algorithms.maps.vectorize import vectorize as vectorize
    from mapcli.algorithms.scans.scan_extraction import extract_scan as extract_scan
    from mapcli.algorithms.similarity.candidate_poses import CandidateWindow as CandidateWindow
    from mapcli.algorithms.similarity.comparisons import score as score
    from mapcli.algorithms.similarity.expected_perception import RangeSensor as RangeSensor
    from mapcli.algorithms.similarity.expected_perception import (
        expect_perceptions as expect_perceptions,
    )
    from mapcli.algorithms.similarity.map_update import update_map as update_map
    from mapcli.algorithms.simulation.drive import MotionLimits as MotionLimits
    from mapcli.algorithms.simulation.drive_plan import plan_drive as plan_drive
    from mapcli.algorithms.simulation.mowing import mow as mow
    from mapcli.algorithms.simulation.mowing_plan import plan_mowing as plan_mowing
    from mapcli.algorithms.simulation.sensors import LaserModel as LaserModel
    from mapcli.algorithms.simulation.sensors import WheelModel as WheelModel
    from mapcli.algorithms.simulation.simulate import Simulation as Simulation
    from mapcli.algorithms.simulation.simulate import simulate as simulate
    from mapcli.algorithms.simulation.tour import plan_tour as plan_tour
    from mapcli.algorithms.slam.replay import replay as replay
    from mapcli.algorithms.slam.slam_parameters import SlamParameters as SlamParameters
    from mapcli.formats.documents.load_trajectory import load_trajectory as load_trajectory
    from mapcli.formats.documents.perception_reader import load_perception as load_perception
    from mapcli.formats.documents.relations import load_relations as load_relations
    from mapcli.formats.documents.waypoints import load_waypoints as load_waypoints
    from mapcli.formats.documents.world import load_world as load_world
    from mapcli.formats.logs.mcap.writer import save_log as save_log
    from mapcli.formats.logs.open_log import open_log as open_log
    from mapcli.formats.maps.load import load_map as load_map
    from mapcli.formats.maps.save import SaveOptions as SaveOptions
    from mapcli.formats.maps.save import save_map as save_map
    from mapcli.model.grid import GridMap as GridMap
    from mapcli.model.log import LogOptions as LogOptions
    from mapcli.model.pose import Pose2D as Pose2D
    from mapcli.model.world import World as World
    from mapcli.pictures.map_picture import render as render

HOMES = {
    # Maps: grids of obstacle probabilities
    "load_map": "mapcli.formats.maps.load",
    "save_map": "mapcli.formats.maps.save",
    "compare": "mapcli.algorithms.maps.compare",
    "register": "mapcli.algorithms.maps.registration",
    "merge_maps": "mapcli.algorithms.maps.registration",
    "crop_to_box": "mapcli.algorithms.maps.transform",
    "move": "mapcli.algorithms.maps.transform",
    "rotate": "mapcli.algorithms.maps.transform",
    "flip": "mapcli.algorithms.maps.transform",
    "align_walls": "mapcli.algorithms.maps.transform",
    "resample": "mapcli.algorithms.maps.transform",
    "rasterize": "mapcli.algorithms.maps.rasterize",
    "vectorize": "mapcli.algorithms.maps.vectorize",
    "rectify_map": "mapcli.algorithms.maps.rectify_map",
    "render": "mapcli.pictures.map_picture",
    # Logs: odometry and range scans
    "open_log": "mapcli.formats.logs.open_log",
    "save_log": "mapcli.formats.logs.mcap.writer",
    "check_log": "mapcli.algorithms.evaluation.log_check",
    "extract_scan": "mapcli.algorithms.scans.scan_extraction",
    # Algorithm 9.2: from a log to a map and a trajectory
    "replay": "mapcli.algorithms.slam.replay",
    "load_trajectory": "mapcli.formats.documents.load_trajectory",
    "load_relations": "mapcli.formats.documents.relations",
    "evaluate": "mapcli.algorithms.evaluation.evaluate",
    "rectify_trace": "mapcli.algorithms.maps.rectify_trace",
    # Algorithm 9.1: exploration of a frontier
    "explore": "mapcli.algorithms.exploration.explore",
    "plan": "mapcli.algorithms.exploration.explore",
    "frontier_cells": "mapcli.algorithms.exploration.frontier_cells",
    # Sect. 9.5 and 9.6: similarity of perceptions
    "score": "mapcli.algorithms.similarity.comparisons",
    "expect_perceptions": "mapcli.algorithms.similarity.expected_perception",
    "update_map": "mapcli.algorithms.similarity.map_update",
    "load_perception": "mapcli.formats.documents.perception_reader",
    # Simulated robots
    "load_world": "mapcli.formats.documents.world",
    "load_waypoints": "mapcli.formats.documents.waypoints",
    "simulate": "mapcli.algorithms.simulation.simulate",
    "plan_drive": "mapcli.algorithms.simulation.drive_plan",
    "plan_tour": "mapcli.algorithms.simulation.tour",
    "plan_mowing": "mapcli.algorithms.simulation.mowing_plan",
    "mow": "mapcli.algorithms.simulation.mowing",
    # Records that the verbs take
    "GridMap": "mapcli.model.grid",
    "Pose2D": "mapcli.model.pose",
    "World": "mapcli.model.world",
    "LogOptions": "mapcli.model.log",
    "SaveOptions": "mapcli.formats.maps.save",
    "SlamParameters": "mapcli.algorithms.slam.slam_parameters",
    "EvaluateParameters": "mapcli.algorithms.evaluation.trajectory_error",
    "CandidateWindow": "mapcli.algorithms.similarity.candidate_poses",
    "RangeSensor": "mapcli.algorithms.similarity.expected_perception",
    "ExplorationParameters": "mapcli.algorithms.exploration.exploration_parameters",
    "MotionLimits": "mapcli.algorithms.simulation.drive",
    "WheelModel": "mapcli.algorithms.simulation.sensors",
    "LaserModel": "mapcli.algorithms.simulation.sensors",
    "Simulation": "mapcli.algorithms.simulation.simulate",
}
"""Name -> the module where it is defined, from which it is imported on first use."""


def __getattr__(name: str) -> Any:
    if name not in HOMES:
        raise AttributeError(f"module 'mapcli' has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(HOMES[name]), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *HOMES})
