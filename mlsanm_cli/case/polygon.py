"""The polygon: sides, rounded corners and circular holes; its checks are in `polygons`.

Lengths are in the case's own unit.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.base import LENGTH, Name, Positive, Section, Vector
from mlsanm_cli.case.chains import Piece, Point, Round, Side, extent, on_round, pieces


class Hole(Section):
    """A circular hole; its boundary is called ``name``."""

    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radius: Annotated[Positive, LENGTH]
    """Radius of the circle."""
    name: Name | None = None
    """Name of its boundary; hole1, hole2 and so on by default."""


class Polygon(Section):
    """A polygon through ``points`` in either direction, with rounded corners and circular ``holes``.

    ``names[k]`` is the side from point k to the next, "side1" and so on by default; ``rounding[k]`` is the
    radius of the arc at point k, 0 where it stays sharp. Arcs are called "corner1" and so on.
    """

    kind: Literal["polygon"]
    """What the shape is."""
    points: Annotated[tuple[Vector, ...], Field(min_length=3), LENGTH]
    """Corners in either direction; the last joins the first by itself."""
    names: tuple[Name, ...] = ()
    """Names of the sides, one per point: from that point to the next; side1, side2 ... by default."""
    rounding: Annotated[tuple[Annotated[float, Field(ge=0.0)], ...], LENGTH] = ()
    """Radius of the arc at each point, 0 where it stays sharp; all sharp by default."""
    holes: tuple[Hole, ...] = ()

    @property
    def loops(self) -> tuple[tuple[Piece, ...], ...]:
        """The outer boundary counter-clockwise, then the holes clockwise."""
        outer = pieces(self.points, self.names, self.rounding)
        return outer, *((hole,) for hole in self.circles)

    @property
    def circles(self) -> tuple[Round, ...]:
        """The holes as boundaries."""
        return tuple(
            Round(hole.name or f"hole{k}", hole.center, hole.radius, 0.5 * math.pi, -2.0 * math.pi)
            for k, hole in enumerate(self.holes, 1)
        )

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return tuple(piece.name for loop in self.loops for piece in loop)

    @property
    def centre(self) -> Point:
        """Middle of the box around the points."""
        x, y = zip(*self.points, strict=True)
        return 0.5 * (min(x) + max(x)), 0.5 * (min(y) + max(y))

    @property
    def size(self) -> float:
        """Largest extent."""
        return extent(self.points)

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: the ends of a side, three on an arc, four on a hole."""
        piece = self.piece(boundary)
        if isinstance(piece, Side):
            return piece.start, piece.end
        whole = abs(piece.sweep) >= 2.0 * math.pi
        return tuple(on_round(piece, part) for part in ((0.0, 0.25, 0.5, 0.75) if whole else (0.0, 0.5, 1.0)))

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a side, None on an arc."""
        piece = self.piece(boundary)
        if isinstance(piece, Round):
            return None
        length = math.dist(piece.start, piece.end)
        x, y = (piece.end[k] - piece.start[k] for k in (0, 1))
        return y / length + 0.0, -x / length + 0.0

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        piece = self.piece(boundary)
        return math.copysign(1.0 / piece.radius, piece.sweep) if isinstance(piece, Round) else 0.0

    def piece(self, boundary: str) -> Piece:
        """A boundary's geometry."""
        return next(piece for loop in self.loops for piece in loop if piece.name == boundary)
