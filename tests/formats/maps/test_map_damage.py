"""Damaged map files: whatever happens to their bytes, only a sentence comes out."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapcli.errors import MapcliError
from mapcli.formats.maps.load import load_map
from mapcli.formats.maps.save import SaveOptions, dump_map
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

Q = float("nan")
GRID = GridMap(
    np.array([[0, 0.1, Q, 1], [1, Q, 0.55, 0], [0.25, 0.3, 1, Q]], dtype=np.float32),
    0.05,
    Pose2D(1.5, -2, 0.3),
)
FILES = [
    (name, dump_map(GRID, name, options))
    for name, options in [
        ("m.txt", SaveOptions()),
        ("m.txt", SaveOptions(characters=True)),
        ("m.yaml", SaveOptions()),
        ("m.yaml", SaveOptions(inline=True)),
        ("m.yaml", SaveOptions(mode="scale")),
        ("m.pgm", SaveOptions()),
        ("m.pgm", SaveOptions(plain=True)),
        ("m.pgm", SaveOptions(mode="raw", bits=16)),
        ("m.png", SaveOptions()),
        ("m.png", SaveOptions(mode="scale")),
    ]
]
INSERTS = st.sampled_from(
    [b"?", b"#", b"\n", b": ", b"[", b"]", b"{", b"&a ", b"*a", b"!!python/none ", b"-nan", b"1e9",
     b"9" * 40, b"\x00", b"\xff\xfe", b'"', b"|", b"%", b"~", b"cells:", b"image:", b"\r"]
)  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn) -> tuple[str, dict[str, bytes]]:
    """A map's files, one of them cut, with bits flipped, bytes inserted, or bytes missing."""
    name, files = draw(st.sampled_from(FILES))
    victim = draw(st.sampled_from(sorted(files)))
    data = bytearray(files[victim])
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        match draw(st.sampled_from(["cut", "flip", "insert", "lose"])):
            case "cut":
                del data[at:]
            case "flip" if data:
                data[at] ^= 1 << draw(st.integers(0, 7))
            case "insert":
                data[at:at] = draw(INSERTS)
            case _:
                del data[at : at + draw(st.integers(1, 10))]
    return name, files | {victim: bytes(data)}


@pytest.mark.slow
@given(map_files=damaged(), dialect=st.sampled_from(["nav2", "ros1"]))
@settings(max_examples=400)
def test_only_sentences_come_out(map_files: tuple[str, dict[str, bytes]], dialect: str) -> None:
    name, files = map_files

    def read(path: Path) -> bytes:
        if path.name not in files:
            raise MapcliError("no such file", file=path)
        return files[path.name]

    with contextlib.suppress(MapcliError):
        load_map(name, dialect=dialect, read=read)  # type: ignore[arg-type]
