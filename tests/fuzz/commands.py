"""Commands on fuzzed files: what reads them also works with what they say.

Exit code 0, or 1 with one line about the file; warnings before it are printable lines too.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from random import Random

from fuzz import binary_grammars, text_grammars
from fuzz.bounds import FaultError, Read
from fuzz.readers import (
    CARMEN_LOGS,
    CELLS,
    IMAGE,
    MESSAGES,
    PATHS,
    PERCEPTIONS,
    PGMS,
    PNGS,
    RELATIONS,
    TEXTS,
    TRACES,
    TRAJECTORIES,
    WORLDS,
    Reader,
    log_grammar,
    logs_of,
)

from mapcli.cli import main
from mapcli.errors import MapcliError


def command(line: str) -> Read:
    """A reader that runs a command line; IN is the file, BESIDE its folder, OUT another one.

    Raises:
        MapcliError: the command's error message.
        FaultError: the command's error boundary has caught a fault, an exit code other than 0 and
            1, or a line that a terminal would obey.
    """

    def read(path: Path) -> None:
        out = path.parent.parent / "out"
        out.mkdir(exist_ok=True)
        names = {"IN": str(path), "OUT": str(out), "BESIDE": str(path.parent)}
        words = line.split()
        for name, place in names.items():
            words = [word.replace(name, place) for word in words]
        _run(words)

    return read


def _run(words: list[str]) -> None:
    said, code = io.StringIO(), 0
    with redirect_stdout(io.TextIOWrapper(io.BytesIO())), redirect_stderr(said):
        try:
            main(words)
        except SystemExit as leaving:
            code = int(leaving.code or 0)
    lines = said.getvalue().split("\n")[:-1]
    if not all(text.isprintable() for text in lines):
        raise FaultError(f"lines that are not printable: {lines}")
    last = lines[-1] if lines else ""
    known = last.startswith("Error: ") and not last.startswith("Error: out of memory")
    if code not in (0, 1) or (code and not known) or "a fault in mapcli" in last:
        raise FaultError(f"exit code {code}: {last[:300]}")
    if code:
        raise MapcliError(last)


def any_map(random: Random) -> bytes:
    grammar: Callable[[Random], bytes] = random.choice(
        (text_grammars.text_map, text_grammars.cells_yaml, text_grammars.image_yaml,
         binary_grammars.pgm, binary_grammars.png)
    )  # fmt: skip
    return grammar(random)


DOCUMENT = (
    b'{"format": "mapcli.exploration-trace", "version": 1, "robots": [[1, 2]], "steps": [], '
    b'"summary": {"coverage": 1.0, "reason": "complete"}}'
)
MAPS = (*TEXTS, *CELLS, IMAGE % b"map.png", *PGMS, *PNGS)
LOGS = (*CARMEN_LOGS, *logs_of(MESSAGES))

POSES = (*TRAJECTORIES, *TRACES)
OTHERS = (*PERCEPTIONS, *PATHS, *RELATIONS, DOCUMENT)

OPEN = b"0 0 0\n? 0 0\n1 0 ?\n"
"""A map with room for a robot in its first cell."""

COMMANDS = (
    Reader("info on a map", "", MAPS, any_map, command("info IN --json -")),
    Reader("info on a log", ".log", LOGS, log_grammar, command("info IN")),
    Reader("info on a trace", "", POSES, text_grammars.trajectory, command("info IN --json -")),
    Reader("info on other files", "", OTHERS, text_grammars.perception, command("info IN")),
    Reader("convert a trace", "", POSES, text_grammars.trace, command("convert IN OUT/trace.json")),
    Reader("convert a trace to g2o", "", POSES, text_grammars.trace,
           command("convert IN OUT/trace.g2o")),
    Reader("render a trace", "", POSES, text_grammars.trajectory,
           command("render BESIDE/corner.txt --trace IN --png OUT/map.png")),
    Reader("simulate along a trace", "", POSES, text_grammars.trajectory,
           command("simulate --odom-rate 0.001 --scan-rate 0.001 BESIDE/landmarks-map.yaml "
                   "OUT/log.mcap --path IN")),
    Reader("convert", "", MAPS, any_map, command("convert IN OUT/map.yaml")),
    Reader("convert to text", "", MAPS, any_map, command("convert IN OUT/map.txt --dialect ros1")),
    Reader("transform", "", MAPS, any_map, command("transform --rotate 30 IN OUT/turned.yaml")),
    Reader("render", "", MAPS, any_map, command("render IN --png OUT/map.png")),
    Reader("compare", "", MAPS, any_map, command("compare IN BESIDE/fig9_10.txt")),
    Reader("vectorize", "", MAPS, any_map, command("vectorize IN OUT/world.yaml")),
    Reader("rasterize", ".yaml", WORLDS, text_grammars.world, command("rasterize IN OUT/map.txt")),
    Reader("frontier", ".txt", (*TEXTS, OPEN), text_grammars.text_map,
           command("frontier IN --robot 0,0")),
    Reader("similarity-table of a perception", ".yaml", PERCEPTIONS, text_grammars.perception,
           command("similarity-table BESIDE/corner.txt IN")),
    Reader("similarity-table in a map", "", MAPS, any_map,
           command("similarity-table IN BESIDE/scan.yaml")),
    Reader("similarity-table of landmarks", ".yaml", PERCEPTIONS, text_grammars.perception,
           command("similarity-table BESIDE/landmarks-map.yaml IN")),
    Reader("perceive", ".yaml", WORLDS, text_grammars.world,
           command("perceive IN --pose 1,1,0 OUT/seen.yaml")),
    Reader("simulate", ".txt", PATHS, text_grammars.waypoints,
           command("simulate --odom-rate 0.001 --scan-rate 0.001 BESIDE/corridor.yaml --path IN "
                   "OUT/log.mcap")),
    Reader("evaluate", ".tum", TRAJECTORIES + TRACES, text_grammars.trajectory,
           command("evaluate IN IN")),
    Reader("rectify", ".json", TRACES, text_grammars.trace, command("rectify IN OUT/trace.json")),
    Reader("import", ".log", LOGS, text_grammars.carmen, command("import IN OUT/log.mcap")),
    Reader("slam-replay", ".log", LOGS, text_grammars.carmen, command("slam-replay IN -o OUT/map")),
)  # fmt: skip
