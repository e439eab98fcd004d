"""What a file is, by its content."""

from __future__ import annotations

import bz2
import gzip
import lzma
import os
from pathlib import Path

import pytest
import zstandard

from mapcli.errors import FormatError
from mapcli.formats.documents.world import load_world
from mapcli.formats.file_kind import Role, expecting, kind_at, kind_of
from mapcli.formats.logs.open_log import open_log
from mapcli.formats.maps.load import load_map

MCAP = b"\x89MCAP0\r\n" + bytes(range(256)) * 4
TUM = b"# a comment\n1.5 1 2 0 0 0 0 1\n1.6 1.1 2 0 0 0 0.6 0.8\n"
KITTI = b"1 0 0 0.5 0 1 0 0.25 0 0 1 0\n0 -1 0 1 1 0 0 0 0 0 1 0\n"

KINDS = {
    "an MCAP log": MCAP,
    "a ROS 1 bag": b"#ROSBAG V2.0\n\x00",
    "a ROS 2 bag in SQLite": b"SQLite format 3\0\x10",
    "an SQLite database, and no ROS 2 bag": b"SQLite format 3\0CREATE TABLE people(id)",
    "a coverage curve in CSV": b"strategy,step,time_steps\nnearest,0,0\n",
    "a similarity table in CSV": b"position\\turn_deg,0,-15,15\nintended,47,59,43\n",
    "a GMapping log (.gfs)": b"FRAME 1 0.5 0.1\nODOM 0 0 0 1.5\nODO_UPDATE 1 0 0 0 0.000000 1.5\n",
    "a CARMEN log": b"# CARMEN Logfile\nPARAM robot_length 0.5 0 h 0\n",
    "a PGM map": b"P5 2 2 255\n\0\0\0\0",
    "a PNG image": b"\x89PNG\r\n\x1a\n\0",
    "a JPEG picture": b"\xff\xd8\xff\xe0",
    "a zip archive": b"PK\x03\x04",
    "a tar archive": b"map.yaml".ljust(257, b"\0") + b"ustar\x0000",
    "a web page": b"\n<!DOCTYPE html>\n<html>",
    "a YAML map": b"resolution: 0.05\nimage: map.pgm\n",
    "a continuous map": b"# of Fig. 9.1\npolygons:\n  - [[0, 0], [1, 0], [1, 1]]\n",
    "a perception": b'{"pose": {"cell": [1, 2]}, "kind": "scan", "beams": []}',
    "a list of waypoints": b"0.5 0.5\n3 0.5 speed=0.3 pause=2\n1, 0.5 back\n",
    "the metadata of a ROS 2 bag": b"rosbag2_bagfile_information:\n  version: 5\n",
    "a pose trace": b'{\n "format": "mapcli.pose-trace",\n "version": 1,',
    "a mapcli.evaluation document": b'{\n "format": "mapcli.evaluation",\n "version": 1,',
    "a TUM trace": TUM,
    "a KITTI trace": KITTI,
    "a g2o trace": b"VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n",
    "a CSV trace": b"stamp_ns,x,y,theta\n1,0,0,0\n",
    "a trace of `t x y theta`": b"1.5 0 0 0\n2.5 1 0 0\n",
    "a text map": b"resolution: 0.05\n? 0.5 1\n0 0 1\n",
    "an MCAP log, packed with gzip": gzip.compress(MCAP),
    "an MCAP log, packed with bzip2": bz2.compress(MCAP),
    "an MCAP log, packed with xz": lzma.compress(MCAP),
    "an MCAP log, packed with zstd": zstandard.compress(MCAP),
    "a TUM trace, packed with gzip": gzip.compress(TUM),
    "a tar archive, packed with gzip": gzip.compress(bytes(257) + b"ustar\x0000"),
    "a file packed with bzip2": b"BZh91AY&SY",
}


@pytest.mark.parametrize("name", KINDS)
def test_what_a_file_is(name: str) -> None:
    kind = kind_of(KINDS[name])
    assert kind is not None
    assert kind.name == name


@pytest.mark.parametrize(
    "content", [b"", b" \n", b"hello\n", b"\0\1\2", bytes(5000), b"# no row\n"]
)
def test_what_is_not_known(content: bytes) -> None:
    assert kind_of(content) is None


def test_the_characters_of_a_map_are_no_comments() -> None:
    kind = kind_of(b"####\n#..#\n####\n")
    assert kind is not None
    assert kind.role is Role.MAP


@pytest.mark.parametrize(
    ("name", "content", "role"),
    [
        ("t.txt", b"0 0 0 0\n1 0 0 0\n", Role.MAP),
        ("t.tum", b"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", Role.TRACE),
        ("t.txt", b"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", Role.MAP),
        ("t.relations", b"1.5 2.5 1 0 0 0 0 1\n", Role.RELATIONS),
        ("t.txt", b"1.5 2.5 1 0 0 0 0 1\n", Role.TRACE),
        ("t.relations", MCAP, Role.LOG),
    ],
)
def test_the_name_decides_between_columns(name: str, content: bytes, role: Role) -> None:
    kind = kind_of(content, name)
    assert kind is not None
    assert kind.role is role


def test_a_line_that_is_cut_off_is_not_looked_at() -> None:
    rows = b"1500000000.25 10.25 2 0 0 0 0 1\n" * 4000
    kind = kind_of(rows[: 1 << 16])
    assert kind is not None
    assert kind.name == "a TUM trace"


def test_what_is_large_and_no_map_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.mcap"
    with path.open("wb") as file:
        file.write(MCAP)
        file.truncate(1 << 40)  # a hole, which nobody could read
    for load in (load_map, load_world):
        with pytest.raises(FormatError, match="is an MCAP log; make a map of it"):
            load(path)


def test_a_pipe_that_is_not_kept_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert kind_at(tmp_path / "pipe") is None


def test_a_name_that_is_nearly_right(tmp_path: Path) -> None:
    (tmp_path / "robot.mcap").write_bytes(MCAP)
    said = r"robto.mcap: no such file; did you mean .*/robot.mcap\?"
    for load in (load_map, open_log):
        with pytest.raises(FormatError, match=said):
            load(tmp_path / "robto.mcap")
    with pytest.raises(FormatError, match=r"no such file$"):
        load_map(tmp_path / "quite-another-one.yaml")


def test_folders(tmp_path: Path) -> None:
    assert kind_at(tmp_path) is None
    (tmp_path / "map.yaml").touch()
    (tmp_path / "trace.json").touch()
    assert "name a file in it: map.yaml, trace.json" in str(kind_at(tmp_path))
    inner = tmp_path / "inner"
    for folder in (inner, inner / "bag 1", inner / "bag 2"):
        folder.mkdir()
    assert kind_at(inner) is None
    (inner / "bag 2" / "rec.db3.zstd").touch()
    assert "name one of them, such as bag 2" in str(kind_at(inner))
    (tmp_path / "bag_0.db3").touch()
    assert str(kind_at(tmp_path)) == "a folder with a bag; make a map of it with mapcli slam-replay"


def test_an_error_about_a_file_of_another_kind_says_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "robot"
    path.write_bytes(MCAP)
    said = "robot: is an MCAP log; make a map of it with mapcli slam-replay; expected a map"
    with pytest.raises(FormatError, match=said), expecting(path, "a map", Role.MAP):
        raise FormatError("cell '?'", file=path)
    with pytest.raises(FormatError, match="robot: cut"), expecting(path, "a log", Role.LOG):
        raise FormatError("cut", file=path)
    with pytest.raises(FormatError, match="other: cut"), expecting(path, "a map", Role.MAP):
        raise FormatError("cut", file="other")
    path.unlink()
    with pytest.raises(FormatError, match="no such file"), expecting(path, "a map", Role.MAP):
        raise FormatError("no such file", file=path)
