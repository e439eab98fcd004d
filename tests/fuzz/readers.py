"""The readers that are fuzzed: for each, small valid files, a grammar, and how a file is read."""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np
from conftest import FIXTURES
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan as FoxgloveScan
from fuzz import binary_grammars, text_grammars
from fuzz.bounds import Read
from fuzz.mutations import mutate, swollen
from mcap.writer import CompressionType
from PIL import Image
from support.dresses import Said, write_foxglove, write_mcap, write_ros1, write_ros2
from support.mcap_making import Sent, mcap_bytes, odom, scan, sonar, tf, tf_static, transform

from mapcli.algorithms.sessions.saving import restored
from mapcli.errors import MapcliError
from mapcli.formats.documents.drive_state import read_state
from mapcli.formats.documents.load_trace import move_trace
from mapcli.formats.documents.load_trajectory import load_trajectory
from mapcli.formats.documents.perception_reader import load_perception
from mapcli.formats.documents.pose_trace import torn_files
from mapcli.formats.documents.relations import load_relations
from mapcli.formats.documents.waypoints import load_waypoints
from mapcli.formats.documents.world import load_world
from mapcli.formats.logs.csv.sensors_file import read_sensors_file
from mapcli.formats.logs.open_log import open_log
from mapcli.formats.logs.ros import messages as ros
from mapcli.formats.maps.load import load_map
from mapcli.model.isometry import Isometry
from mapcli.model.log import LogOptions
from mapcli.model.pose import Pose2D

TURN = Isometry(Pose2D(1.0, 2.0, 0.5), mirrored=True)


@dataclass(frozen=True)
class Reader:
    """A reader and its inputs.

    Attributes:
        name: for people.
        suffix: of its files.
        seeds: valid files.
        grammar: makes a file that is mostly valid.
        read: reads a file to its last record.
    """

    name: str
    suffix: str
    seeds: tuple[bytes, ...]
    grammar: Callable[[Random], bytes]
    read: Read

    def mutated(self, random: Random) -> bytes:
        """A valid file, damaged."""
        return mutate(random.choice(self.seeds), random, self.seeds)

    def swollen(self, random: Random, size: int) -> bytes:
        """A valid file with a part of it repeated until it has `size` bytes."""
        return swollen(random.choice(self.seeds), random, size)

    def warm_up(self, path: Path) -> None:
        """Read the seeds, so that what is imported and compiled on first use is at hand."""
        for seed in self.seeds:
            path.write_bytes(seed)
            with suppress(MapcliError):
                self.read(path)

    def made(self, random: Random) -> bytes:
        """A file from the grammar."""
        return self.grammar(random)


def read_log(path: Path) -> None:
    """All that is asked of a log, of a strict one too.

    Raises:
        MapcliError: the log is of no use, or damaged.
    """
    refused: MapcliError | None = None
    for strict in (True, False):
        log = open_log(path, LogOptions(strict=strict))
        try:
            assert log.digests()
            log.topics(), log.scan_topics, log.odom_topic, log.scan_count, log.record_count
            assert all(record.stamp_ns >= 0 for record in log.records())
            assert all(line.strip() for line in log.damage.lines())
        except MapcliError as error:
            refused = error
    if refused:
        raise refused


def read_csv_log(path: Path) -> None:
    """A CSV log, of the sensors that lie beside it."""
    log = open_log(path, LogOptions(sensors_file=str(path.with_name("sensors.yaml"))))
    assert log.digests()
    assert log.topics()
    assert all(record.stamp_ns >= 0 for record in log.records())


def read_trace(path: Path) -> None:
    """All that is done with a trace."""
    torn_files(path)
    load_trajectory(path)
    move_trace(path, TURN)


def read_poses(path: Path) -> None:
    """The poses of an MCAP file, those of odometry too."""
    for topic in ("/odom", None):
        load_trajectory(path, topic)


def read_drives(path: Path) -> None:
    """The drives of a state, to the last number."""
    for drive in read_state(path):
        assert restored(drive).digest


def fixture(name: str, lines: int | None = None) -> bytes:
    """A fixture, or its first lines."""
    return b"".join((FIXTURES / name).read_bytes().splitlines(keepends=True)[:lines])


# --- maps

PIXELS = np.array([[0, 205, 254], [254, 254, 0]], dtype=np.uint8)
NOTE = b"# mapcli map\n# resolution: 0.05\n# origin: [1, 2, 0]\n# mode: trinary\n"
PGMS = (
    b"P5\n3 2\n255\n" + PIXELS.tobytes(),
    b"P5\n# CREATOR: map_server 0.05 m/pix\n3 2\n65535\n" + PIXELS.astype(">u2").tobytes(),
    b"P2\n" + NOTE + b"3 2\n255\n0 205 254\n254 254 0\n",
    b"P5\n" + NOTE + b"3 2 100 " + (PIXELS // 3).tobytes(),
)


def png_of(mode: str) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(PIXELS).convert(mode).save(stream, "png")
    return stream.getvalue()


PNGS = tuple(map(png_of, ("1", "L", "LA", "P", "RGB", "RGBA", "I;16")))
IMAGE = (
    b"image: %b\nmode: trinary\nresolution: 0.05\norigin: [-1, 2.5, 0.1]\nnegate: 0\n"
    b"occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
SCAN = (
    b"kind: scan\npose: {cell: [3, 6], heading_deg: 90}\nrange_max: 5\nno_return: clear\n"
    b"walls: thick\nlaser: {x: 0.2, y: 0, theta_deg: 0}\nsteps: 1\nturns_deg: [0, -15, 15]\n"
    b"beams: [[-15, 3.2], [0, null], [15, 4.5]]\n"
)
SENSORS = (
    b"units: {range: cm}\nrange_max: 300\nsensors:\n  r1: {x: 0, y: 0, yaw_deg: 0}\n"
    b"  r2: {x: 0, y: 0.1, yaw_deg: 90, range_min: 1, nothing: 0}\n  g1: {ground: true}\n",
    b"sensors: {r1: {x: 0, y: 0, yaw_deg: 0, range_min: 0.1, range_max: 0.1}}\nignore: [v]\n",
)
COMPANIONS = {
    "sensors.yaml": SENSORS[0],
    "map.pgm": PGMS[0],
    "map.png": PNGS[1],
    "damaged.pgm": PGMS[0][:-3],
    "damaged.png": PNGS[1][:-30],
    "scan.yaml": SCAN.replace(b"[3, 6]", b"[0, 0]"),
    **{
        name: fixture(name)
        for name in (
            "corner.txt",
            "landmarks-map.yaml",
            "fig9_10.txt",
            "corridor.yaml",
        )
    },
}
"""Files that lie beside the one that is read: for `image:`, and for commands that read two."""

TEXTS = (
    fixture("fig9_10.txt"),
    b"resolution: 0.05\norigin: -7.14, -7.83, 0\n? 0.1 0.1 1\n0 0 1 ?\n# a comment\n0.5 1 0 1\n",
    b"# characters\n##.?\n....\n?..#\n",
)
CELLS = (
    b'resolution: 0.05\norigin: [0, 1, 0]\ncells: ["? 0.1 1", "0 0 1"]\n',
    b"cells:\n  - [0, 1, null]\n  - ['?', 0.5, 1]\n",
    b'{"cells": ["?.#", "..."], "resolution": 1}\n',
)

# --- documents

WORLDS = (
    fixture("fig9_1.yaml"),
    fixture("lawn.yaml"),
    fixture("landmarks-map.yaml"),
    b"y: down\npolygons:\n  - &p [[0, 0], [4, 0], [4, 0.1]]\n  - *p\npoints: [[2, 2]]\n",
    CELLS[0],
)
PERCEPTIONS = (
    SCAN,
    fixture("landmarks.yaml"),
    fixture("corner-grids.yaml", 16),
    fixture("proximity-database.yaml", 9),
    fixture("proximity.yaml"),
    b"kind: trials\nof: readings\ntrials:\n"
    b"  - {position: intended, turn_deg: 0, readings: [1830, null, 2.5e3]}\n"
    b"  - {position: intended, turn_deg: 0, readings: [1800, 0, 2450]}\n",
    b"kind: database\nof: landmarks\nstep: 1\ncandidates:\n"
    b"  - {position: intended, turn_deg: 0, pose: {x: 0, y: 0, theta: 0}, measured: [[2, 32]]}\n",
    b'{"kind": "grids", "cells": "probability", "candidates":\n\t[{"position": "intended", '
    b'"turn_deg": 0, "rows": ["? 0.5 1", "0 0 1"]}]}',
)
PATHS = (
    fixture("corridor-path.txt"),
    b"0.5 0.5\n3.0, 0.5  speed=0.3 pause=2\n1.0 0.5  back\n",
    b"waypoints: [[0.5, 0.5], [3, 0.5, speed=0.3, pause=2], [1, 0.5, back]]\n",
)
POSES = [{"stamp_ns": k * 10**9, "x": k / 2, "y": 0.0, "theta": 0.1,
          "odom": {"x": k / 2, "y": 0.1, "theta": 0.0}, "score": 0.5, "status": "matched"}
         for k in range(3)]  # fmt: skip
TRACES = (
    json.dumps({
        "format": "mapcli.pose-trace", "version": 1, "mapcli": "0.1.0",
        "input": [{"file": "robot.mcap", "sha256": "00"}], "parameters": {}, "summary": {},
        "files": [{"file": "map.pgm", "sha256": "00"}],
        "loops": [{"from": 0, "to": 2, "dx": 1.0, "dy": 0.0, "dtheta": 0.0, "score": 0.9}],
        "poses": POSES,
    }).encode(),
)  # fmt: skip
TRAJECTORIES = (
    b"# t x y z qx qy qz qw\n1.000000001 0 0 0 0 0 0 1\n2.5 1 0.5 0 0 0 0.1 0.99499\n",
    b"1 0 0 0.1 0 1 0 0.2 0 0 1 0\n1 0 0 0.3 0 1 0 0.4 0 0 1 0\n",
    b"1.5 0.1 0.2 0.3\n2.5 0.2 0.3 0.4\n",
    b"VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0.5\nEDGE_SE2 0 1 1 0 0.5 100 0 0 100 0 400\n",
    b"VERTEX_SE3:QUAT 0 1 2 0 0 0 0 1\n",
    b"stamp_ns,x,y,theta,odom_x,odom_y,odom_theta,score,status\n"
    b"1000000000,0,0,0,0,0,0,0.5,matched\n2000000000,1,0,0,,,,,first\n",
    gzip.compress(b"1.5 0.1 0.2 0.3\n2.5 0.2 0.3 0.4\n", mtime=0),
)
RELATIONS = (b"1.5 2.5 0.1 0.2 0 0 0 0.3\n2.5 3.5 0.1 0.2 0 0 0 0.3\n",)

# --- logs

ODOM_LINE = b"ODOM 0.1 0.2 0.3 0 0 0 1.0 host 1.0\n"
FLASER_LINE = b"FLASER 5 1.0 2.0 3.5 81.9 2.0 0.1 0.2 0.3 0.1 0.2 0.3 1.5 host 1.5\n"
ROBOTLASER_LINE = (
    b"ROBOTLASER1 0 -1.57 3.14 1.57 80 0.01 0 3 1 2 3 1 7 0.2 0 0 0.1 0.2 0.3 0 0 0.3 0.3 1 2.0 "
    b"host 2.0\n"
)
CARMEN_LOGS = (
    b"# comment\nPARAM robot_frontlaser_offset 0.2 0 h 0\n" + ODOM_LINE + FLASER_LINE,
    ODOM_LINE + ROBOTLASER_LINE + ROBOTLASER_LINE.replace(b" 2.0 ", b" 3.0 "),
    gzip.compress(ODOM_LINE + FLASER_LINE, mtime=0),
)
CSV_LOGS = (
    b"# a drive\nt,x,y,theta,r1,r2,g1\n0,0,0,0,30,0,1\n0.5,0.1,0,0.1,,20,1\n1,0.2,0,0.1,300,5,1\n",
    gzip.compress(b"r1, t, y, x, theta, r2, g1\n1, 1600000000.5, 0, 0, 0, 2, 3\n", mtime=0),
)
RINGS = [
    tf_static(1, transform(0, "base_link", "left", (0, 0.1, 0), (0, 0, 90)),
              transform(0, "base_link", "floor", (0, 0, 0), (0, 90, 0))),
    odom(1), odom(3, x=1),
    *(sonar(t, t / 3, topic=f"/{one}", frame=one) for t in (1, 2) for one in ("left", "floor")),
]  # fmt: skip
MESSAGES = [
    tf_static(1, transform(0, "base_link", "laser", (0.2, 0.1, 0.3), (0, 0, 30))),
    *(m for t in range(1, 4) for m in (odom(t, x=t), scan(t + 0.5, [1, 2, t]))),
    tf(2, transform(2, "odom", "base_link", (1, 0, 0))),
]
TRUTH = [
    Sent("/ground_truth", ros.POSE_STAMPED,
         ros.build(ros.POSE_STAMPED, ros.header(t * 10**9, "map"), ros.pose_message(Pose2D(t))),
         t * 10**9)
    for t in range(1, 4)
]  # fmt: skip


def logs_of(messages: list[Sent]) -> tuple[bytes, ...]:
    """MCAP files in all ways in which they are packed."""
    return (
        mcap_bytes(*messages, use_chunking=False),
        *(mcap_bytes(*messages, compression=c, chunk_size=300) for c in CompressionType),
        mcap_bytes(*messages, compression=CompressionType.NONE, enable_crcs=False),
        mcap_bytes(*messages, compression=CompressionType.NONE, finish=False),
    )


def channels_of(messages: list[Sent]) -> list[binary_grammars.Channel]:
    """The same messages for the grammar."""
    found: dict[str, list[bytes]] = {}
    types = {sent.topic: sent.type for sent in messages}
    for sent in messages:
        data = ros.typestore().serialize_cdr(sent.message, sent.type)
        found.setdefault(sent.topic, []).append(bytes(data))
    return [(topic, types[topic], "cdr", data) for topic, data in found.items()]


HEADER = {"stamp": {"sec": 1, "nanosec": 5}, "frame_id": "laser"}
JSON_SCAN = {
    "header": HEADER, "angle_min": -0.5, "angle_max": 0.5, "angle_increment": 0.5,
    "range_min": 0.1, "range_max": 10.0, "ranges": [1.0, 2.0, None],
}  # fmt: skip
JSON_CHANNEL = ("/scan", ros.LASER_SCAN, "json", [json.dumps(JSON_SCAN).encode()] * 2)
LOG_CHANNELS, POSE_CHANNELS = channels_of(MESSAGES), channels_of(TRUTH + MESSAGES[1:3])
RING_CHANNELS = channels_of(RINGS)


def log_grammar(random: Random) -> bytes:
    channels = LOG_CHANNELS
    if random.random() < 0.2:
        channels = [c for c in channels if c[0] != "/scan"] + [JSON_CHANNEL]
    return text_grammars.packed(binary_grammars.mcap(random, channels), random)


def ring_grammar(random: Random) -> bytes:
    return text_grammars.packed(binary_grammars.mcap(random, RING_CHANNELS), random)


def pose_grammar(random: Random) -> bytes:
    return binary_grammars.mcap(random, POSE_CHANNELS)


def dressed() -> tuple[bytes, ...]:
    """The same drive in other encodings and containers."""
    said = [Said(sent.topic, sent.type, sent.log_ns, sent.message) for sent in MESSAGES]
    scans = [
        Said("/scan", "", k * 10**9, FoxgloveScan(timestamp={"seconds": k}, frame_id="laser",
                                                  end_angle=1.0, ranges=[1.0, 2.0, 3.0]))
        for k in range(1, 5)
    ]  # fmt: skip
    with TemporaryDirectory() as name:
        folder = Path(name)
        (database,) = write_ros2(folder / "bag", said).glob("*.db3")
        files = (
            write_mcap(folder / "a.mcap", said, "cdr", ""),
            write_mcap(folder / "b.mcap", said, "ros1", "ros1msg"),
            write_mcap(folder / "c.mcap", said, "json", ""),
            write_foxglove(folder / "d.mcap", scans, "protobuf"),
            write_ros1(folder / "e.bag", said),
            write_ros1(folder / "f.bag", said, "lz4", 300),
            database,
        )
        return tuple(file.read_bytes() for file in files)


DRESSED = dressed()


def dressed_grammar(random: Random) -> bytes:
    return mutate(random.choice(DRESSED), random, DRESSED)


READERS = (
    Reader("text map", ".txt", TEXTS, text_grammars.text_map, load_map),
    Reader("YAML map of cells", ".yaml", CELLS, text_grammars.cells_yaml, load_map),
    Reader("YAML map with an image", ".yaml",
           tuple(IMAGE % name.encode() for name in COMPANIONS), text_grammars.image_yaml, load_map),
    Reader("PGM", ".pgm", PGMS, binary_grammars.pgm, load_map),
    Reader("PNG", ".png", PNGS, binary_grammars.png, load_map),
    Reader("world", ".yaml", WORLDS, text_grammars.world, load_world),
    Reader("perception", ".yaml", PERCEPTIONS, text_grammars.perception, load_perception),
    Reader("waypoints", ".txt", PATHS, text_grammars.waypoints, load_waypoints),
    Reader("pose trace", ".json", TRACES, text_grammars.trace, read_trace),
    Reader("trajectory", ".tum", TRAJECTORIES, text_grammars.trajectory, load_trajectory),
    Reader("relations", ".relations", RELATIONS, text_grammars.relations, load_relations),
    Reader("MCAP poses", ".mcap", logs_of(TRUTH + MESSAGES[1:3]), pose_grammar, read_poses),
    Reader("CARMEN log", ".log", CARMEN_LOGS, text_grammars.carmen, read_log),
    Reader("CSV log", ".csv", CSV_LOGS, text_grammars.robot_csv, read_csv_log),
    Reader("sensors of a CSV log", ".yaml", SENSORS, text_grammars.sensors_yaml,
           lambda path: read_sensors_file(str(path)) and None),
    Reader("MCAP range sensors", ".mcap", logs_of(RINGS), ring_grammar, read_log),
    Reader("MCAP log", ".mcap", logs_of(MESSAGES), log_grammar, read_log),
    Reader("log in another dress", ".bag", DRESSED, dressed_grammar, read_log),
)  # fmt: skip
