"""Node spacing h(x): a far value, and zones around points or curves where it is smaller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Curve, Segment
from mlsanm_cli.cloud.mirror import IMAGE_TOLERANCE, SymmetryLine
from mlsanm_cli.cloud.search import BLOCK_SIZE, in_pieces
from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.fill import spacing_at

MAX_CURVE_NODES = 2_000_000
"""Largest number of nodes along one curve; with the interior nodes more would not fit in memory."""

MIN_DISTANCE = 0.5
"""Least distance of requested nodes from ends and from each other, in spacings."""


@dataclass(frozen=True)
class Zone:
    """``spacing`` within ``radius`` of ``curve``, growing by ``growth`` per unit length outside."""

    curve: Curve
    spacing: float
    radius: float
    growth: float

    @classmethod
    def around(cls, point: tuple[float, float], spacing: float, radius: float, growth: float) -> Zone:
        """Zone about a point."""
        return cls(Segment(point, point), spacing, radius, growth)


@dataclass(frozen=True)
class Spacing:
    """Spacing field: the smallest of ``far`` and of what each zone asks for."""

    far: float
    zones: tuple[Zone, ...] = ()

    def table(self) -> FloatArray:
        """Zones as the rows (z, 9) that the kernels read."""
        rows = [
            (*part, zone.spacing, zone.radius, zone.growth)
            for zone in self.zones
            for part in zone.curve.zones()
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 9)

    def at(self, points: FloatArray) -> FloatArray:
        """Spacing (n,) at ``points`` (n, 2)."""
        table = self.table()
        piece = BLOCK_SIZE * 8 // (len(table) + 1) + 1
        return in_pieces(lambda some: spacing_at(self.far, table, some), np.ascontiguousarray(points), piece)

    def with_zones(self, zones: tuple[Zone, ...]) -> Spacing:
        """The same with further zones."""
        return replace(self, zones=(*self.zones, *zones))

    def symmetric(self, line: SymmetryLine) -> bool:
        """Whether it is its own mirror image: every zone has one among the zones."""
        marks, asked = _marks(self.table())
        images = line.reflect(marks.reshape(-1, 2)).reshape(marks.shape)
        slack = IMAGE_TOLERANCE * asked[:, :1, None]
        for image, wanted in zip(images, asked, strict=True):
            like = np.isclose(asked, wanted, rtol=IMAGE_TOLERANCE, atol=0.0).all(axis=1)
            near = [np.abs(marks - way).max(axis=(1, 2)) <= slack[:, 0, 0] for way in (image, image[::-1])]
            if not (like & (near[0] | near[1])).any():
                return False
        return True

    @property
    def finest(self) -> float:
        """Smallest spacing anywhere."""
        return min([self.far, *(zone.spacing for zone in self.zones)])

    def steps_along(
        self, curve: Curve, line: SymmetryLine | None = None, places: Sequence[float] = ()
    ) -> FloatArray:
        """Arc lengths of nodes on ``curve``, both ends included, at equal increments of the integral of ds/h
        between them and the ``places`` that are to have a node; so is its middle if it is on the ``line``.
        Places closer than half a spacing to an end or to another place get none.

        Equal increments of the integral, and not steps of h rescaled at the end, keep a fine zone where it
        was asked for; two bodies' fine zones would otherwise no longer face each other. Raises RunError for
        more than MAX_CURVE_NODES.
        """
        if not curve.length <= MAX_CURVE_NODES * self.far:
            raise _too_many()
        s = np.linspace(0.0, curve.length, 257)
        for _ in range(40):
            # Sample until 1/h changes by little from sample to sample, then the trapezoid rule is enough.
            h = self.at(curve.points(s))
            coarse = np.maximum(h[1:], h[:-1]) > 1.05 * np.minimum(h[1:], h[:-1])
            # A zone can hide between two samples that see nothing of it.
            coarse |= np.diff(s) > 2.0 * np.minimum(h[1:], h[:-1])
            if not coarse.any():
                break
            s = np.sort(np.concatenate([s, (0.5 * (s[1:] + s[:-1]))[coarse]]))
            if len(s) > 2 * MAX_CURVE_NODES:
                raise _too_many()
        density = 1.0 / self.at(curve.points(s))
        integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(s) * (density[1:] + density[:-1]))])
        if not integral[-1] <= MAX_CURVE_NODES:
            raise _too_many()
        total, halved = float(integral[-1]), line is not None and _halved(curve, line)
        ends, wanted = [0.0, *([0.5 * total] if halved else ()), total], np.zeros(0)
        if len(places):
            wanted = np.interp(places, s, integral)
        for place in wanted.tolist():
            if min(abs(place - end) for end in ends) > MIN_DISTANCE:
                ends.append(place)
        # The small shift decides ties the same way in every system of units.
        if len(ends) == 2 + halved:
            part, least = 1 + halved, 8 if curve.closed else 2
            even = np.linspace(0.0, total, max(least, part * int(total / part + 0.5 - 1e-6)) + 1)
        else:
            least = 4 if curve.closed else 1
            parts = [
                np.linspace(low, high, max(least, int(high - low + 0.5 - 1e-6)) + 1)
                for low, high in pairwise(sorted(ends))
            ]
            even = np.append(np.concatenate([part[:-1] for part in parts]), total)
        steps = np.interp(even, integral, s)
        steps[0], steps[-1] = 0.0, curve.length
        return steps


def _halved(curve: Curve, line: SymmetryLine) -> bool:
    """Whether the middle of a curve is on the ``line``."""
    middle = curve.points(np.array([0.5 * curve.length]))[0, line.axis]
    return bool(abs(middle - line.at) <= IMAGE_TOLERANCE * curve.length)


def _marks(table: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Three points (z, 3, 2) of every zone's line or arc, of a whole circle its centre, and what is asked for
    there (z, 4): spacing, radius, growth, and the circle's radius."""
    first, last = table[:, 1:3], table[:, 3:5]
    marks = np.stack([first, 0.5 * (first + last), last], axis=1)
    asked = np.concatenate([table[:, 6:9], np.zeros((len(table), 1))], axis=1)
    for zone in np.flatnonzero(table[:, 0] == 1.0):
        center, (radius, start, sweep) = table[zone, 1:3], table[zone, 3:6]
        angle = start + sweep * np.array([0.0, 0.5, 1.0])
        around = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        marks[zone] = center + (around if sweep < 2.0 * np.pi else 0.0)
        asked[zone, 3] = radius
    return marks, asked


def _too_many() -> RunError:
    return RunError(f"more than {MAX_CURVE_NODES} nodes along one boundary", "use larger spacings")
