"""The polygon: sides, rounded corners and circular holes; its checks are in `polygons`.

Lengths are in the case's own unit.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.model.base import LENGTH, Name, Positive, Section, Vector
from mlsanm_cli.case.model.chains import Piece, Point, Round, Side, Smooth, extent, on_round, pieces


class Hole(Section):
    """A circular hole; its boundary is called ``name``."""

    center: Annotated[Vector, LENGTH]
    """Centre of the circle."""
    radius: Annotated[Positive, LENGTH]
    """Radius of the circle."""
    name: Name | None = None
    """Name of its boundary; hole1, hole2 and so on by default."""


def circles(holes: tuple[Hole, ...]) -> tuple[Round, ...]:
    """Holes as boundaries."""
    return tuple(
        Round(hole.name or f"hole{k}", hole.center, hole.radius, 0.5 * math.pi, -2.0 * math.pi)
        for k, hole in enumerate(holes, 1)
    )


def box_centre(points: tuple[Point, ...]) -> Point:
    """Middle of the box around points."""
    x, y = zip(*points, strict=True)
    return 0.5 * (min(x) + max(x)), 0.5 * (min(y) + max(y))


class Chained(Section):
    """A shape of loops of pieces; pieces of one name are one boundary."""

    @property
    def loops(self) -> tuple[tuple[Piece, ...], ...]:
        """The outer boundary counter-clockwise, then the holes clockwise."""
        raise NotImplementedError

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries, each once."""
        return tuple(dict.fromkeys(piece.name for loop in self.loops for piece in loop))

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: the ends of a side, three on an arc, four on a hole, five on a
        curve."""
        return tuple(point for piece in self.pieces(boundary) for point in _samples(piece))

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a straight boundary, None on a curved one and where several directions meet."""
        normals = {_normal(piece) for piece in self.pieces(boundary)}
        return normals.pop() if len(normals) == 1 else None

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary; 0 on curves without a radius and on several pieces."""
        piece = self.piece(boundary)
        return math.copysign(1.0 / piece.radius, piece.sweep) if isinstance(piece, Round) else 0.0

    def pieces(self, boundary: str) -> tuple[Piece, ...]:
        """The geometry of a boundary."""
        return tuple(piece for loop in self.loops for piece in loop if piece.name == boundary)

    def piece(self, boundary: str) -> Piece | None:
        """The geometry of a boundary of one piece, None of others."""
        found = self.pieces(boundary)
        return found[0] if len(found) == 1 else None


def _samples(piece: Piece) -> tuple[Point, ...]:
    if isinstance(piece, Side):
        return piece.start, piece.end
    if isinstance(piece, Smooth):
        last = len(piece.points) - 1
        return tuple(piece.points[round(part * last)] for part in (0.0, 0.25, 0.5, 0.75, 1.0))
    whole = abs(piece.sweep) >= 2.0 * math.pi
    return tuple(on_round(piece, part) for part in ((0.0, 0.25, 0.5, 0.75) if whole else (0.0, 0.5, 1.0)))


def _normal(piece: Piece) -> Point | None:
    if not isinstance(piece, Side):
        return None
    length = math.dist(piece.start, piece.end)
    x, y = (piece.end[k] - piece.start[k] for k in (0, 1))
    return y / length + 0.0, -x / length + 0.0


class Polygon(Chained):
    """A polygon through ``points`` in either direction, with rounded corners and circular ``holes``.

    ``names[k]`` is the side from point k to the next, "side1" and so on by default; ``rounding[k]`` is the
    radius of the arc at point k, 0 where it stays sharp. Arcs are called "corner1" and so on, or as
    ``corners`` says. Sides and arcs of one name are one boundary.
    """

    kind: Literal["polygon"]
    """What the shape is."""
    points: Annotated[tuple[Vector, ...], Field(min_length=3), LENGTH]
    """Corners in either direction; the last joins the first by itself."""
    names: tuple[Name, ...] = ()
    """Names of the sides, one per point: from that point to the next; side1, side2 ... by default."""
    rounding: Annotated[tuple[Annotated[float, Field(ge=0.0)], ...], LENGTH] = ()
    """Radius of the arc at each point, 0 where it stays sharp; all sharp by default."""
    corners: tuple[Name | Literal[""], ...] = ()
    """Names of the arcs, one per point, "" for the default: corner1 ..., or that of both sides beside it."""
    holes: tuple[Hole, ...] = ()

    @property
    def loops(self) -> tuple[tuple[Piece, ...], ...]:
        """The outer boundary counter-clockwise, then the holes clockwise."""
        outer = pieces(self.points, self.names, self.rounding, self.corners)
        return outer, *((hole,) for hole in self.circles)

    @property
    def circles(self) -> tuple[Round, ...]:
        """The holes as boundaries."""
        return circles(self.holes)

    @property
    def centre(self) -> Point:
        """Middle of the box around the points."""
        return box_centre(self.points)

    @property
    def size(self) -> float:
        """Largest extent."""
        return extent(self.points)
