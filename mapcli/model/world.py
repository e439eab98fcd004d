"""The continuous map of Sect. 9.1: obstacles as polygons, landmarks as points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapcli.errors import DataError


def _no_points() -> NDArray[np.float64]:
    return np.empty((0, 2))


@dataclass(frozen=True, eq=False)
class World:
    """Solid polygons and points in the plane, in metres, x to the right and y up.

    Attributes:
        polygons: vertices of each obstacle in either turning direction, shape (n, 2), n >= 3.
            The last vertex is joined to the first; a first vertex repeated at the end is dropped,
            however often it is. Polygons may touch and overlap.
        points: landmarks, shape (m, 2). They have no size, so nothing bumps into them.

    Raises:
        DataError: a polygon with fewer than three vertices, or a coordinate that is not finite.
    """

    polygons: tuple[NDArray[np.float64], ...] = ()
    points: NDArray[np.float64] = field(default_factory=_no_points)

    def __post_init__(self) -> None:
        polygons = tuple(_polygon(p, f"polygon {i}") for i, p in enumerate(self.polygons))
        object.__setattr__(self, "polygons", polygons)
        points = _vertices(self.points, "points") if len(self.points) else _no_points()
        object.__setattr__(self, "points", points)

    @classmethod
    def of(cls, polygons: Iterable[ArrayLike], points: ArrayLike = ()) -> World:
        """A world from nested lists."""
        return cls(tuple(np.asarray(p, dtype=np.float64) for p in polygons), np.asarray(points))

    def bounds(self) -> tuple[float, float, float, float]:
        """x and y of the lower left, x and y of the upper right corner of everything.

        Raises:
            DataError: the world is empty.
        """
        everything = np.concatenate([*self.polygons, self.points])
        if everything.size == 0:
            raise DataError("an empty world has no extent", expected="polygons or points")
        (x0, y0), (x1, y1) = everything.min(axis=0), everything.max(axis=0)
        return float(x0), float(y0), float(x1), float(y1)


def _vertices(values: ArrayLike, where: str) -> NDArray[np.float64]:
    vertices = np.asarray(values, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 2:
        raise DataError(f"shape {vertices.shape}", where=where, expected="x and y of each vertex")
    if not np.isfinite(vertices).all():
        raise DataError("a coordinate is not finite", where=where)
    return vertices


def _polygon(values: ArrayLike, where: str) -> NDArray[np.float64]:
    vertices = _vertices(values, where)
    while len(vertices) > 1 and (vertices[0] == vertices[-1]).all():
        vertices = vertices[:-1]
    if len(vertices) < 3:
        raise DataError(f"{len(vertices)} vertices", where=where, expected="3 or more")
    return vertices
