"""Loading a map, whatever its format: `load_map` (`save` writes).

    .txt            text, see `text`
    .yaml .yml      a map_server pair (with an image) or a self-contained map, see `yaml_map`
    .pgm .png       the image alone; mapcli's own carry resolution, origin and mode inside

Standard input (`-`) and files of other suffixes are told by their content.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mapcli.errors import FormatError
from mapcli.formats.file_kind import DRAWN, Role, expecting, kind_of, refuse_large
from mapcli.formats.input import SNIFFED_BYTES, ReadBytes, read_file
from mapcli.formats.maps.dialects import Dialect
from mapcli.formats.maps.image_cells import cells_of_image
from mapcli.formats.maps.map_image import GreyRule, MapImage
from mapcli.formats.maps.save import SUFFIXES, Format
from mapcli.formats.maps.text import read_text
from mapcli.model.grid import GridMap
from mapcli.model.pose import Pose2D

if TYPE_CHECKING:
    from mapcli.formats.maps.yaml_map import ImageMeta


@dataclass(frozen=True)
class LoadedMap:
    """A map, and what is known about its files.

    Attributes:
        grid: the map.
        format: for people: "text, numbers", "YAML with PGM P5, 8 bit".
        files: what was read, the named file first.
        rule: what the image's grey means; None for maps without an image.
        warnings: sentences for the user, each without the file's name.
        remarks: the same about where other programs would read it otherwise; for `mapcli info`.
    """

    grid: GridMap
    format: str
    files: tuple[Path, ...]
    rule: GreyRule | None = None
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def load_map(
    path: str | Path,
    *,
    dialect: Dialect = "nav2",
    resolution: float | None = None,
    origin: Pose2D | None = None,
    form: Format | None = None,
    read: ReadBytes = read_file,
    lenient: bool = False,
) -> LoadedMap:
    """Load a map of any format.

    Args:
        path: the file, or `-` for standard input.
        dialect: whose rules give an image's grey its meaning (see `dialects`).
        resolution, origin: used in the place of what the file says.
        form: the format; None goes by the suffix, else by the content.
        read: gives the bytes of a path, see `input`.
        lenient: take 0 for what is not finite in the origin, with a warning.

    Raises:
        FormatError: the file, or the image it names, does not hold a map.
        DataError: a resolution that is not positive.
    """
    refuse_large(path, "a map", Role.MAP)
    with expecting(path, "a map", Role.MAP):
        loaded = _load(Path(path), form, _Reading(dialect, resolution, origin, read, lenient))
    if resolution is None and origin is None:
        return loaded
    grid = loaded.grid
    size = grid.resolution if resolution is None else resolution
    return replace(loaded, grid=GridMap(grid.stored, size, origin or grid.origin))


@dataclass(frozen=True)
class _Reading:
    """How a map is read, see `load_map`."""

    dialect: Dialect
    resolution: float | None
    origin: Pose2D | None
    read: ReadBytes
    lenient: bool


def _load(path: Path, form: Format | None, reading: _Reading) -> LoadedMap:
    data = reading.read(path)
    if data.startswith(b"\x89PNG") and kind_of(data[:SNIFFED_BYTES]) is DRAWN:
        raise FormatError("is no map", file=path)  # though it could be read as one
    if data[:1000].isspace() or not data:
        data = data if data.strip() else b""
    if not data:
        raise FormatError("is empty", file=path, expected="a map")
    kind = form or SUFFIXES.get(path.suffix.lower()) or sniff(data)
    if kind == "txt":
        grid, cells = read_text(data, str(path))
        return LoadedMap(grid, f"text, {cells}", (path,))
    if kind == "yaml":
        return _load_yaml(path, data, reading)
    return _load_image(path, data, reading)


def sniff(data: bytes) -> Format:
    """The format by the content, for names whose suffix says none."""
    if data[:2] in (b"P2", b"P5"):
        return "pgm"
    if data.startswith(b"\x89PNG"):
        return "png"
    yaml_keys = re.compile(rb"^[ {]*[\"']?(image|cells|polygons|points)[\"']?\s*:", re.MULTILINE)
    return "yaml" if yaml_keys.search(data[:100_000]) else "txt"


def _load_yaml(path: Path, data: bytes, reading: _Reading) -> LoadedMap:
    from mapcli.formats.maps.yaml_map import CellsYaml, read_yaml

    meta = read_yaml(data, str(path), lenient=reading.lenient)
    if isinstance(meta, CellsYaml):
        found = (meta.warnings, meta.remarks)
        return LoadedMap(meta.grid, "YAML with cells", (path,), None, *found)
    folder = Path() if str(path) == "-" or meta.image.startswith("~/") else path.parent
    image_path = folder / meta.image
    try:
        pixels = reading.read(image_path)
    except FormatError as error:
        raise FormatError(
            f"image {meta.image!r}: {error.problem}",
            file=path,
            where=f"line {meta.image_line}",
            expected=f"a PGM or PNG file at {image_path}",
        ) from error
    image = _decode(pixels, image_path)
    return _map_of(image, meta, reading.dialect, f"YAML with {image.kind}", (path, image_path))


def _load_image(path: Path, data: bytes, reading: _Reading) -> LoadedMap:
    """An image alone."""
    from mapcli.formats.maps.yaml_map import ImageMeta, read_image_meta
    from mapcli.formats.yaml_mapping import YamlMapping

    image = _decode(data, path)
    if image.note:
        document = YamlMapping.parse(image.note.encode(), f"{path}: metadata inside the image")
        meta = read_image_meta(document, embedded=True, lenient=reading.lenient)
    else:
        meta = ImageMeta("", 0, 1.0, Pose2D(), GreyRule(), _assumption(path, reading))
    return _map_of(image, meta, reading.dialect, image.kind, (path,))


def _assumption(path: Path, reading: _Reading) -> tuple[str, ...]:
    """The warning about values assumed for an image without metadata."""
    assumed = [] if reading.resolution else ["1 m per cell"]
    assumed += [] if reading.origin else ["origin 0, 0, 0"]
    beside = path.with_suffix(".yaml") if path.suffix else path
    hint = f"; {beside.name} beside it may say more" if path.suffix and beside.is_file() else ""
    used = ", ".join([*assumed, "trinary grey"])
    return (f"is an image without metadata; assumed: {used}{hint}",) if assumed else ()


def _map_of(
    image: MapImage, meta: ImageMeta, dialect: Dialect, kind: str, files: tuple[Path, ...]
) -> LoadedMap:
    cells = cells_of_image(image, meta.rule, dialect)
    warnings = (*meta.warnings, *image.warnings, *cells.warnings)
    remarks = (*meta.remarks, *cells.remarks)
    grid = GridMap(cells.percents, meta.resolution, meta.origin)
    return LoadedMap(grid, kind, files, meta.rule, warnings, remarks)


def _decode(data: bytes, path: Path) -> MapImage:
    """An image by its first bytes, whatever its name."""
    if data.startswith(b"\x89PNG"):
        from mapcli.formats.maps.png import read_png

        return read_png(data, str(path))
    from mapcli.formats.maps.pgm import read_pgm

    if data[:1] == b"P" and data[:2] in (b"P2", b"P5"):
        return read_pgm(data, str(path))
    problem = f"starts with {data[:8]!r}" if data else "is empty"
    raise FormatError(problem, file=path, expected="a PGM (P2, P5) or PNG image")
