"""Areas of the polygons of continuous maps (Sect. 9.1), and the polygons at a point."""

from __future__ import annotations

from typing import Any

import shapely

from mapcli.errors import DataError
from mapcli.model.world import World

Area = Any
"""A geometry of shapely."""


def polygon_areas(world: World) -> list[Area]:
    """The polygons of a world as areas, in their order.

    Raises:
        DataError: a polygon that crosses or touches itself, or has no area; it names the polygon.
    """
    areas = [shapely.Polygon(polygon) for polygon in world.polygons]
    for i, area in enumerate(areas):
        flat = area.convex_hull.area == 0
        reason = "has no area" if flat else _fault(shapely.is_valid_reason(area))
        if reason:
            raise DataError(
                reason, where=f"polygons[{i}]", expected="an outline that never meets itself"
            )
    return areas


def _fault(reason: str) -> str | None:
    """Shapely's reason why a polygon is invalid, "Self-intersection[1 1]", as a sentence."""
    what, _, place = reason.partition("[")
    if what == "Valid Geometry":
        return None
    where = f" at ({', '.join(place.rstrip(']').split())})" if place else ""
    return f"is no simple outline: {what.lower()}{where}"


def solid_area(world: World) -> Area:
    """Everything solid, where polygons overlap only once.

    Raises:
        DataError: as of `polygon_areas`.
    """
    return shapely.union_all(polygon_areas(world))


def polygons_at(world: World, x: float, y: float) -> list[int]:
    """Indices of the polygons that a point lies in; their boundary belongs to them.

    Raises:
        DataError: as of `polygon_areas`.
    """
    point = shapely.Point(x, y)
    return [i for i, area in enumerate(polygon_areas(world)) if area.intersects(point)]


def world_of_area(area: Area) -> World:
    """An area as polygons without holes: an area with a hole is cut in two through the hole."""
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and part.area]
    rings = [simple for part in parts for simple in _without_holes(part)]
    return World(tuple(shapely.get_coordinates(ring.exterior) for ring in rings))


def _without_holes(polygon: Area) -> list[Area]:
    if not polygon.interiors:
        return [polygon]
    left, bottom, right, top = polygon.bounds
    hole = polygon.interiors[0].bounds
    middle = (hole[0] + hole[2]) / 2
    halves = (left, bottom, middle, top), (middle, bottom, right, top)
    cut = [shapely.intersection(polygon, shapely.box(*half)) for half in halves]
    parts = [part for half in cut for part in shapely.get_parts(half)]
    return [ring for part in parts if part.area for ring in _without_holes(part)]
