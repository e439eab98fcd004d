"""mapcli: 2D robot mapping without ROS, after chapter 9 of *Elements of Robotics*.

The verbs of the tool as typed functions on records: the commands call the same. Each is imported
when it is first used, so `import mapcli` is fast. A first map:

    import mapcli

    log = mapcli.open_log(["fixtures/corridor.mcap"])
    replayed = mapcli.replay(log.records())
    mapcli.save_map(replayed.map, "corridor.yaml")
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mapcli.version import __version__ as __version__

if TYPE_CHECKING:
    from mapcli.algorithms.evaluation.log_check import check_log as check_log
    from mapcli.algorithms.exploration.explore import explore as explore
    from mapcli.algorithms.exploration.explore import plan as plan
    from mapcli.algorithms.slam.replay import replay as replay
    from mapcli.formats.logs.open_log import open_log as open_log
    from mapcli.formats.maps.load import load_map as load_map

VERBS = {
    "check_log": "mapcli.algorithms.evaluation.log_check",
    "explore": "mapcli.algorithms.exploration.explore",
    "load_map": "mapcli.formats.maps.load",
    "open_log": "mapcli.formats.logs.open_log",
    "plan": "mapcli.algorithms.exploration.explore",
    "replay": "mapcli.algorithms.slam.replay",
}
"""Verb -> the module that it lives in."""


def __getattr__(name: str) -> Any:
    if name not in VERBS:
        raise AttributeError(f"module 'mapcli' has no attribute {name!r}")
    verb = globals()[name] = getattr(import_module(VERBS[name]), name)
    return verb


def __dir__() -> list[str]:
    return sorted([*globals(), *VERBS])
