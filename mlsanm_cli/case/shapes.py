"""Shapes of bodies: their keys, the names of their boundaries, a few points on each boundary.

Lengths are in the case's own unit.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.base import Name, Positive, Section, Vector
from mlsanm_cli.case.chains import Piece, Point, Round, Side, extent, on_round, pieces

_OUTWARD: dict[str, float] = {"right": 0.0, "upper": 0.5 * math.pi, "left": math.pi, "lower": 1.5 * math.pi}


class Rectangle(Section):
    """A rectangle with sides along the axes: ``x`` and ``y`` are its ranges."""

    kind: Literal["rectangle"]
    x: Vector
    y: Vector

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


class Annulus(Section):
    """A whole ring; ``radii`` are its inner and outer radius."""

    kind: Literal["annulus"]
    center: Vector
    radii: Vector

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("outer", "inner")

    @property
    def centre(self) -> Point:
        """Centre of the ring."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radii[1]

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: four on the circle."""
        quarters = tuple(0.5 * math.pi * k for k in range(4))
        return _on_arc(self.center, self.radii[boundary == "outer"], quarters)

    def normal(self, boundary: str) -> Point | None:
        """None: both boundaries are curved."""
        return None

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return {"inner": -1.0 / self.radii[0], "outer": 1.0 / self.radii[1]}[boundary]


class Disk(Section):
    """A full disk; its only boundary is ``arc``."""

    kind: Literal["disk"]
    center: Vector
    radius: Positive

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("arc",)

    @property
    def centre(self) -> Point:
        """Centre of the disk."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radius

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: four on the circle."""
        return _on_arc(self.center, self.radius, tuple(0.5 * math.pi * k for k in range(4)))

    def normal(self, boundary: str) -> Point | None:
        """None: the boundary is curved."""
        return None

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return 1.0 / self.radius


class HalfDisk(Section):
    """Half a disk on one side of its centre; ``flat`` is the cut, ``arc`` the rest."""

    kind: Literal["half-disk"]
    center: Vector
    radius: Positive
    side: Literal["lower", "upper", "left", "right"]

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("arc", "flat")

    @property
    def centre(self) -> Point:
        """Centre of the whole disk."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radius

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: the ends of the cut, three on the arc."""
        middle = _OUTWARD[self.side]
        turns = (-0.5, 0.5) if boundary == "flat" else (-0.5, 0.0, 0.5)
        return _on_arc(self.center, self.radius, tuple(middle + math.pi * turn for turn in turns))

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of the cut, None on the arc."""
        if boundary == "arc":
            return None
        normals = {"lower": (0.0, 1.0), "upper": (0.0, -1.0), "left": (1.0, 0.0), "right": (-1.0, 0.0)}
        return normals[self.side]

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return 1.0 / self.radius if boundary == "arc" else 0.0


class Sector(Section):
    """A part of a ring: ``radii`` are its inner and outer radius, ``angles`` its range in degrees.

    Angles count counter-clockwise from the x axis; ``start`` and ``end`` are the straight sides.
    """

    kind: Literal["sector"]
    center: Vector
    radii: Vector
    angles: Vector

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Names of the boundaries."""
        return ("outer", "end", "inner", "start")

    @property
    def centre(self) -> Point:
        """Centre of the ring."""
        return self.center

    @property
    def size(self) -> float:
        """Largest extent."""
        return 2.0 * self.radii[1]

    def samples(self, boundary: str) -> tuple[Point, ...]:
        """Points that span the boundary: the ends of a side, three on an arc."""
        first, last = (math.radians(angle) for angle in self.angles)
        if boundary in ("inner", "outer"):
            radius = self.radii[boundary == "outer"]
            return _on_arc(self.center, radius, (first, 0.5 * (first + last), last))
        angle = first if boundary == "start" else last
        return tuple(_on_arc(self.center, radius, (angle,))[0] for radius in self.radii)

    def normal(self, boundary: str) -> Point | None:
        """Outward normal of a straight side, None on an arc."""
        if boundary in ("inner", "outer"):
            return None
        sign, angle = (-1.0, self.angles[0]) if boundary == "start" else (1.0, self.angles[1])
        turn = math.radians(angle) + sign * 0.5 * math.pi
        # Sides along an axis have their normal along the other one, without round-off.
        return round(math.cos(turn), 15) + 0.0, round(math.sin(turn), 15) + 0.0

    def curvature(self, boundary: str) -> float:
        """1/R, positive for a convex boundary."""
        return {"inner": -1.0 / self.radii[0], "outer": 1.0 / self.radii[1]}.get(boundary, 0.0)


class Hole(Section):
    """A circular hole; its boundary is called ``name``."""

    center: Vector
    radius: Positive
    name: Name | None = None


class Polygon(Section):
    """A polygon through ``points`` in either direction, with rounded corners and circular ``holes``.

    ``names[k]`` is the side from point k to the next, "side1" and so on by default; ``rounding[k]`` is the
    radius of the arc at point k, 0 where it stays sharp. Arcs are called "corner1" and so on.
    """

    kind: Literal["polygon"]
    points: tuple[Vector, ...] = Field(min_length=3)
    names: tuple[Name, ...] = ()
    rounding: tuple[Annotated[float, Field(ge=0.0)], ...] = ()
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


def _on_arc(center: Point, radius: float, angles: tuple[float, ...]) -> tuple[Point, ...]:
    return tuple((center[0] + radius * math.cos(a), center[1] + radius * math.sin(a)) for a in angles)


AnyShape = Rectangle | Disk | HalfDisk | Sector | Annulus | Polygon
Shape = Annotated[AnyShape, Field(discriminator="kind")]
SHAPES: dict[str, type[Section]] = {
    "rectangle": Rectangle,
    "disk": Disk,
    "half-disk": HalfDisk,
    "sector": Sector,
    "annulus": Annulus,
    "polygon": Polygon,
}
