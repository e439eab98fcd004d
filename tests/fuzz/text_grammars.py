"""Texts made from the grammars of mapcli's formats: most of a file is right, some of it is odd."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from fuzz.mutations import NUMBERS, WORDS, mutate

ODD = 0.06
"""How often a value is not what the grammar says."""


def number(random: Random, usual: Sequence[str] = ("0", "1", "0.5", "-2.25", "3e0")) -> bytes:
    return random.choice(NUMBERS) if random.random() < ODD else random.choice(usual).encode()


def numbers(random: Random, count: int, separator: bytes = b" ") -> bytes:
    if random.random() < ODD:
        count = random.choice((0, 1, count - 1, count + 1, 3 * count))
    return separator.join(number(random) for _ in range(count))


def blank(random: Random) -> bytes:
    return random.choice((b" ", b" ", b" ", b"  ", b"\t", b", ", b",,", b"\x0b", b"\xc2\xa0"))


def ending(random: Random) -> bytes:
    return random.choice((b"\n", b"\n", b"\n", b"\n", b"\r\n", b"\r", b"\n\n", b" # c\n", b""))


def packed(data: bytes, random: Random) -> bytes:
    """Now and then as gzip, and then now and then damaged."""
    if random.random() > 0.2:
        return data
    data = gzip.compress(data, 1, mtime=0)
    return data if random.random() < 0.5 else mutate(data, random, [data])


# --- YAML and JSON

KEYS: Mapping[str, Sequence[str]] = {
    "image": ("map.pgm", "map.png", "damaged.pgm", "damaged.png", "none.pgm", "in.yaml",
              "/dev/zero"),
    "mode": ("trinary", "scale", "raw", "Trinary"),
    "resolution": ("1", "0.05", "0.0", "[1]"),
    "origin": ("[0, 0, 0]", "[-1.5, 2, 0.3]", "[0, 0]", "[nan, 0, 0]", "[1, 2, .inf]"),
    "negate": ("0", "1", "true", "no", "2"),
    "occupied_thresh": ("0.65", "1", "0.1"),
    "free_thresh": ("0.196", "0", "0.9"),
    "cells": ('["?.#", "#.."]', '["? 0.1 1", "0 0 0"]', "[[0, 1], [null, '?']]", "sign",
              "probability", '["#", "##"]', "[]", "[[[0]]]"),
    "polygons": ("[[[6, 3], [3, 7], [6, 7]]]", "[]", "", "[[[0, 0], [1, 1]]]",
                 "[[[0, 0], [0, 0], [0, 0]]]", "[[[0, 0], [2, 2], [2, 0], [0, 2]]]",
                 "[&p [[0, 0], [1, 0], [1, 1]], *p]"),
    "points": ("[[2, 2], [2, -2]]", "[]", "[[1, 2, 3]]", "[2, 2]"),
    "y": ("down", "up", "left"),
    "kind": ("scan", "landmarks", "grids", "readings", "database", "trials"),
    "of": ("scan", "landmarks", "readings"),
    "readings": ("[1830, null, 2.5]", "[]", "[null]", "[[1]]", "[1e308, -1]"),
    "trials": ("[{position: up, turn_deg: 0, readings: [1, 2]}]",
               "[{position: up, turn_deg: 0, readings: [1, 2]}, "
               "{position: up, turn_deg: 0, readings: [1]}]",
               "[{position: up, turn_deg: -15, measured: [[2, 32]]}]", "[]"),
    "pose": ("{x: 1, y: 1, theta_deg: 90}", "{cell: [1, 1], heading_deg: 90}", "{cell: [1.5, 0]}",
             "{x: 1, y: 1, theta: 0, theta_deg: 0}", "{cell: [-3, 1000000000], theta: 1}"),
    "range_max": ("5", "0", "-1"),
    "beams": ("[[-15, 3.2], [0, null], [15, 1]]", "[]", "[[0, -1]]", "[[null, 1]]"),
    "measured": ("[[2.0, 32.0], null, [1, 0]]", "[null]", "[[2]]"),
    "no_return": ("clear", "ignore"),
    "walls": ("thick", "ends"),
    "laser": ("{x: 0.2, y: 0, theta_deg: 0}", "{}"),
    "steps": ("1", "[1, 2]", "0", "[1, 1]"),
    "step": ("1", "0", "-1"),
    "turns_deg": ("[0, -15, 15]", "0", "[]", "[0, 0]"),
    "corner": ("[0, 2]", "[0.5, 1]", "[-1, -1]"),
    "candidates": ('[{position: intended, turn_deg: 0, rows: ["? 1 -1", "1 0 0"]}]',
                   '[{position: up, turn_deg: 5, rows: ["#.?"]}, {position: up, turn_deg: 5}]',
                   "[{position: intended, turn_deg: 0, measured: [[2.0, 32.0], null]}]",
                   "[{position: intended, turn_deg: 0, pose: {x: 1, y: 2, theta: 0}, "
                   "beams: [[0, 1], [2, null]]}]"),
    "waypoints": ("[[0.5, 0.5], [3, 0.5, speed=0.3, pause=2], [1, 0.5, back]]", "[[1]]", "[1, 2]"),
}  # fmt: skip
"""Keys of all YAML files, and values for them: right ones first."""

IMAGE_KEYS = (
    "image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh",
)  # fmt: skip


def mapping(random: Random, keys: Sequence[str]) -> bytes:
    """A YAML mapping with most of the keys, and now and then another one or one twice."""
    chosen = [key for key in keys if random.random() > ODD / 2]
    if random.random() < ODD:
        chosen.append(random.choice(tuple(KEYS)))
    lines = [key.encode() + b": " + _value(random, key) for key in chosen]
    return b"\n".join(lines) + b"\n"


def _value(random: Random, key: str) -> bytes:
    usual = KEYS[key]
    value = usual[0] if random.random() < 0.9 else random.choice(usual)
    data = value.encode()
    kind = random.random()
    if kind < ODD / 2:
        return random.choice(NUMBERS + WORDS)
    return mutate(data, random) if kind < ODD else data


def image_yaml(random: Random) -> bytes:
    return mapping(random, IMAGE_KEYS)


def cells_yaml(random: Random) -> bytes:
    rows, columns = random.randrange(1, 5), random.randrange(1, 5)
    lines = [b'  - "' + b" ".join(cell(random) for _ in range(columns)) + b'"' for _ in range(rows)]
    return mapping(random, ("resolution", "origin")) + b"cells:\n" + b"\n".join(lines) + b"\n"


def world(random: Random) -> bytes:
    polygon = b", ".join(
        b"[" + numbers(random, 2, b", ") + b"]" for _ in range(random.randrange(3, 7))
    )
    return mapping(random, ("y", "points")) + b"polygons: [[" + polygon + b"]]\n"


def perception(random: Random) -> bytes:
    """Of one kind, with the candidates of that kind."""
    kind = random.choice(KEYS["kind"])
    keys: Sequence[str] = {
        "scan": ("pose", "range_max", "beams", "no_return", "walls", "laser", "steps", "turns_deg"),
        "landmarks": ("pose", "measured", "steps", "turns_deg"),
        "grids": ("candidates", "cells", "corner", "pose", "steps"),
        "readings": ("pose", "readings"),
        "trials": ("of", "range_max", "trials"),
        "database": ("of", "range_max", "step", "candidates"),
    }[kind]
    head = f"kind: {kind}\n".encode()
    if kind == "database" and random.random() < 0.8:
        of, readings = random.choice((("landmarks", KEYS["candidates"][2]),
                                      ("scan", KEYS["candidates"][3])))  # fmt: skip
        head += f"of: {of}\ncandidates: {readings}\n".encode()
        keys = [key for key in keys if key not in ("of", "candidates")]
    return head + mapping(random, keys)


def waypoints(random: Random) -> bytes:
    if random.random() < 0.3:
        return mapping(random, ("waypoints",))
    words = (
        b"back",
        b"speed=0.3",
        b"pause=2",
        b"speed=",
        b"speed=nan",
        b"pause=1e300",
        b"# x",
        b"",
    )
    return b"".join(
        numbers(random, 2) + blank(random) + random.choice(words) + ending(random)
        for _ in range(random.randrange(1, 6))
    )


VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1e308, -1e308, float("nan"), float("inf"), 2**63, -(2**63), 10**30, 10**400,
    "", "1", "nan", "\x1b[31m", "\ud800", [], [0], {}, {"x": 1}, 0.5,
)  # fmt: skip
"""What a value of a JSON document may be replaced with."""


def trace(random: Random) -> bytes:
    """A pose trace of which some values, anywhere in it, are others."""
    pose = {"x": 1.0, "y": 2.0, "theta": 0.5}
    poses = [
        {"stamp_ns": k * 10**9, **pose, "odom": pose, "score": 0.5, "status": "matched"}
        for k in range(random.randrange(5))
    ]
    loop = {"from": 0, "to": 1, "dx": 0, "dy": 1, "dtheta": 2, "score": 0.5}
    content = {
        "format": "mapcli.pose-trace", "version": 1, "mapcli": "0", "input": [], "parameters": {},
        "summary": {"scans": 3}, "files": [{"file": "map.pgm", "sha256": "0"}],
        "loops": [loop], "poses": poses,
    }  # fmt: skip
    for _ in range(random.randrange(4)):
        content = _replaced(content, random)
    return packed(json.dumps(content).encode(), random)


def _replaced(content: Any, random: Random) -> Any:
    """The document with one value replaced, or a key of a mapping left out."""
    if not content or not isinstance(content, dict | list) or random.random() < 0.2:
        return random.choice(VALUES)
    keys: Sequence[Any] = list(content) if isinstance(content, dict) else range(len(content))
    key = random.choice(keys)
    changed = content.copy()
    if isinstance(changed, dict) and random.random() < 0.2:
        del changed[key]
    else:
        changed[key] = _replaced(content[key], random)
    return changed


# --- maps as text, trajectories, CARMEN


def cell(random: Random) -> bytes:
    return number(random, ("0", "1", "0.1", "0.95", "?", "1e-3", ".5"))


def text_map(random: Random) -> bytes:
    columns = random.randrange(1, 6)
    head = [b"resolution: " + number(random), b"origin: " + numbers(random, 3, b", ")]
    lines = [line for line in head if random.random() < 0.5]
    if random.random() < 0.3:
        lines += [bytes(random.choices(b"#.?", k=columns)) for _ in range(random.randrange(1, 6))]
    else:
        lines += [
            blank(random).join(cell(random) for _ in range(columns))
            for _ in range(random.randrange(1, 6))
        ]
    return b"".join(line + ending(random) for line in lines)


def trajectory(random: Random) -> bytes:
    kind = random.choice(("t x y theta", "TUM", "KITTI", "g2o", "csv"))
    lines = []
    for k in range(random.randrange(1, 6)):
        stamp = b"%d.5 " % (k + 1) if random.random() > ODD else number(random) + b" "
        if kind == "t x y theta":
            lines.append(stamp + numbers(random, 3))
        elif kind == "TUM":
            lines.append(stamp + numbers(random, 3) + b" 0 0 0.5 0.5")
        elif kind == "KITTI":
            lines.append(numbers(random, 12))
        elif kind == "g2o":
            name = random.choice((b"VERTEX_SE2", b"VERTEX_SE2", b"VERTEX_SE3:QUAT", b"EDGE_SE2"))
            lines.append(b"%b %d %b" % (name, k, numbers(random, 7 if b"3" in name else 3)))
        else:
            lines.append(stamp.strip() + b"," + numbers(random, 3, b","))
    if kind == "csv":
        lines.insert(0, random.choice((b"t,x,y,theta", b"stamp_ns,x,y,theta", b"x,y,theta,t")))
    return packed(b"".join(line + ending(random) for line in lines), random)


def robot_csv(random: Random) -> bytes:
    """A CSV log for the sensors of `readers.SENSORS`."""
    head = random.choice((b"t,x,y,theta,r1,r2,g1", b"r2, g1, t, theta, y, x, r1", b"t,x,y,r1,r2"))
    lines = [head]
    for k in range(random.randrange(1, 6)):
        stamp = b"%d.5" % k if random.random() > ODD else number(random)
        fields = [stamp, *(number(random, ("0", "0.5", "3", "")) for _ in range(head.count(b",")))]
        lines.append(b",".join(fields))
    return packed(b"".join(line + ending(random) for line in lines), random)


def sensors_yaml(random: Random) -> bytes:
    lines = [b"units: {range: cm}"] if random.random() < 0.5 else []
    lines += [b"range_max: " + number(random), b"sensors:"]
    for name in (b"r1", b"r2", b"g1"):
        place = b"x: %b, y: %b, yaw_deg: %b" % tuple(number(random) for _ in range(3))
        if random.random() < ODD:
            place = random.choice((b"ground: true", b"x: 1", b"nothing: 0", b""))
        lines.append(b"  %b: {%b}" % (name, place))
    return b"".join(line + ending(random) for line in lines)


def relations(random: Random) -> bytes:
    lines = [numbers(random, 8) + ending(random) for _ in range(random.randrange(1, 5))]
    return packed(b"".join(lines), random)


def carmen(random: Random) -> bytes:
    return packed(b"".join(_message(random) for _ in range(random.randrange(1, 8))), random)


def _message(random: Random) -> bytes:
    beams = random.randrange(1, 8)
    told = number(random) if random.random() < ODD else b"%d" % beams
    ranges = numbers(random, beams)
    stamp = b"%d.%d" % (random.randrange(9), random.randrange(10))
    tail = b"%b host %b" % (stamp if random.random() > ODD else number(random), stamp)
    kind = random.choice((b"ODOM", b"FLASER", b"FLASER", b"RLASER", b"ROBOTLASER1", b"PARAM", b""))
    if kind == b"ODOM":
        words = numbers(random, 6)
    elif kind == b"ROBOTLASER1":
        words = b"%b %b %b 0 %b %b" % (
            numbers(random, 7), told, ranges, numbers(random, 6), numbers(random, 5),
        )  # fmt: skip
    else:
        words = b"%b %b %b" % (told, ranges, numbers(random, 6))
    return b"%b %b %b" % (kind, words, tail) + ending(random)
