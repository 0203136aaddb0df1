"""Shapes of bodies: their keys, the names of their boundaries, a few points on each boundary.

Lengths are in the case's own unit.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.base import LENGTH, Section, Vector
from mlsanm_cli.case.model.chains import Point
from mlsanm_cli.case.model.files import Mesh, Points
from mlsanm_cli.case.model.outline import OutlineShape
from mlsanm_cli.case.model.polygon import Polygon
from mlsanm_cli.case.model.round_shapes import Annulus, Disk, HalfDisk, Sector


class Rectangle(Section):
    """A rectangle with sides along the axes: ``x`` and ``y`` are its ranges."""

    kind: Literal["rectangle"]
    """What the shape is."""
    x: Annotated[Vector, LENGTH]
    """Range in x, the smaller number first."""
    y: Annotated[Vector, LENGTH]
    """Range in y, the smaller number first."""

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("left", "right", "bottom", "top")

    @property
    def centre(self) -> Point:
        """Middle of the rectangle."""
        return 0.5 * (self.x[0] + self.x[1]), 0.5 * (self.y[0] + self.y[1])

    @property
    def size(self) -> float:
        """Largest extent."""
        return max(self.x[1] - self.x[0], self.y[1] - self.y[0])

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: its two ends."""
        (x0, x1), (y0, y1) = self.x, self.y
        ends: dict[str, tuple[Point, ...]] = {
            "left": ((x0, y0), (x0, y1)),
            "right": ((x1, y0), (x1, y1)),
            "bottom": ((x0, y0), (x1, y0)),
            "top": ((x0, y1), (x1, y1)),
        }
        return ends[boundary]

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a straight boundary, None on a curved one."""
        normals = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "bottom": (0.0, -1.0), "top": (0.0, 1.0)}
        return normals[boundary]

    def curvature(self, boundary: str) -> float:
        """0: all sides are straight."""
        return 0.0


DrawnShape = Rectangle | Disk | HalfDisk | Sector | Annulus | Polygon | OutlineShape
"""Shapes whose geometry stands in the case file."""
AnyShape = DrawnShape | Mesh | Points
Shape = Annotated[AnyShape, Field(discriminator="kind")]
SHAPES: dict[str, type[Section]] = {
    "rectangle": Rectangle,
    "disk": Disk,
    "half-disk": HalfDisk,
    "sector": Sector,
    "annulus": Annulus,
    "polygon": Polygon,
    "outline": OutlineShape,
    "mesh": Mesh,
    "points": Points,
}
