"""Shapes of bodies: their keys, the names of their boundaries, a few points on each boundary.

Lengths are in the case's own unit.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from mlsanm_cli.case.base import Positive, Section, Vector

Point = tuple[float, float]

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


def _on_arc(center: Point, radius: float, angles: tuple[float, ...]) -> tuple[Point, ...]:
    return tuple((center[0] + radius * math.cos(a), center[1] + radius * math.sin(a)) for a in angles)


Shape = Annotated[Rectangle | Disk | HalfDisk | Sector, Field(discriminator="kind")]
SHAPES: dict[str, type[Section]] = {
    "rectangle": Rectangle,
    "disk": Disk,
    "half-disk": HalfDisk,
    "sector": Sector,
}
