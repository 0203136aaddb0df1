"""The outline of the shape of a body, and the numbers of its named pieces."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

from mlsanm_cli.case.model.shapes import (
    Annulus,
    AnyShape,
    Disk,
    FileShape,
    HalfDisk,
    Mesh,
    OutlineShape,
    Points,
    Polygon,
    Rectangle,
    Sector,
    hole_names,
    side_names,
)
from mlsanm_cli.cloud import drawing
from mlsanm_cli.cloud.curves import Outline, annulus, disk, half_disk, rectangle, sector

if TYPE_CHECKING:
    from mlsanm_cli.app.scene.geometry_files import ImportedGeometry


def imported_geometry(shape: FileShape) -> ImportedGeometry:
    """The body in a shape's file. Raises GeometryError, whose message begins with the file's name."""
    # Imported for cases with such bodies only.
    from mlsanm_cli.app.scene.geometry_files import read_body

    return read_body(shape)


@lru_cache(maxsize=256)
def drawn(shape: AnyShape) -> Outline:
    """The outline of a shape: closed loops of named curves, "name/1" and so on for several pieces of a name.
    Raises GeometryError for shapes that are not the closed boundary of a body."""
    if isinstance(shape, Rectangle):
        return rectangle(shape.x, shape.y)
    if isinstance(shape, HalfDisk):
        return half_disk(shape.center, shape.radius, shape.side)
    if isinstance(shape, Sector):
        first, last = (math.radians(angle) for angle in shape.angles)
        return sector(shape.center, shape.radii, (first, last))
    if isinstance(shape, Annulus):
        return annulus(shape.center, shape.radii)
    if isinstance(shape, Mesh | Points):
        return imported_geometry(shape).traced.outline
    if isinstance(shape, Disk):
        return disk(shape.center, shape.radius)
    return _looped(shape)


def _looped(shape: Polygon | OutlineShape) -> Outline:
    holes = [
        (name, hole.center, hole.radius) for name, hole in zip(hole_names(shape), shape.holes, strict=True)
    ]
    if isinstance(shape, Polygon):
        outer = drawing.polygon(shape.points, shape.names, shape.rounding, shape.corners)
        return drawing.with_holes(outer, holes, "points")
    named = zip(side_names(shape), shape.sides, strict=True)
    outer = drawing.closed_chain([drawing.Side(name, side.to, side.points) for name, side in named])
    return drawing.with_holes(outer, holes, "sides")


def numbers_of(outline: Outline, edge: str) -> tuple[int, ...]:
    """The numbers of the curves that form a boundary."""
    return tuple(k for k, name in enumerate(outline.names) if name == edge or name.startswith(f"{edge}/"))
