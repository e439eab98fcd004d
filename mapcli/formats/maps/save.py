"""Saving a map to its files."""

from __future__ import annotations

from pathlib import Path

from mapcli.formats.maps.dump import SaveOptions, map_files
from mapcli.formats.output import output_file, write_files
from mapcli.model.grid import GridMap


def save_map(
    grid: GridMap,
    path: str | Path,
    options: SaveOptions | None = None,
    *,
    no_clobber: bool = False,
) -> list[str]:
    """Write a map in the format of its suffix (`dump.SaveOptions` has the rest), and give the
    names of its files: `x.yaml` also makes `x.pgm`.

    All files appear complete, or none. `-` is standard output. `mapcli.load_map` is the inverse.

    Raises:
        DataError: a suffix that says no format.
        OutputError: a file cannot be written, or exists and `no_clobber` is set.
    """
    files = map_files(grid, path, options)
    if str(path) == "-":
        with output_file("-") as out:
            out.writelines(files["-"])
    else:
        write_files(Path(path).parent, files, no_clobber=no_clobber)
    return list(files)
