"""Shapes of rigid obstacles, with closest points and outward normals."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, runs_of
from mlsanm_cli.cloud.curves import Arc, Curve
from mlsanm_cli.cloud.membership import MAX_PAIRS
from mlsanm_cli.cloud.splines import NodeSpline, Spline
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

CORNER_ANGLE = np.deg2rad(15.0)
"""Corners of a polyline sharper than this are intended."""
TURN_VARIATION, TURN_NEIGHBORS = 0.6, 2
"""Points are samples of a smooth curve if the turning angle differs from the mean of its neighbours by less
than TURN_VARIATION times the largest among TURN_NEIGHBORS on either side. A single corner between straight
sides differs by 1."""
MIN_SAMPLES = 3
"""Least number of consecutive samples of a curve; two corners are a chamfer."""
STRAIGHT_RATIO = 3.0
"""A side this many times as long as both neighbours is straight."""


class Shape(Protocol):
    """A rigid shape that a slave surface is pressed against."""

    @property
    def curve(self) -> Curve | None:
        """The surface as one convex curve with the obstacle on its left; None if it is not one."""

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Closest points (n, 2) of the obstacle to ``points`` (n, 2), and unit outward normals (n, 2).
        ``outward`` (n, 2) are the normals of the surface that the points belong to."""


@dataclass(frozen=True)
class Plane:
    """The half-plane behind ``point``, opposite to the unit ``normal``."""

    point: tuple[float, float]
    normal: tuple[float, float]

    curve = None

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        normal = np.array(self.normal)
        above = (points - np.array(self.point)) @ normal
        return points - above[:, None] * normal, np.tile(normal, (len(points), 1))


@dataclass(frozen=True)
class Round:
    """A disk, or with ``inside`` its complement, as around a hole."""

    center: tuple[float, float]
    radius: float
    inside: bool

    @cached_property
    def curve(self) -> Arc | None:
        return None if self.inside else Arc(self.center, self.radius, 0.5 * math.pi, 2.0 * math.pi)

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        away = points - np.array(self.center)
        distance = np.hypot(away[:, 0], away[:, 1])
        middle = distance == 0.0
        # The centre is equally far from all points of the circle.
        radial = np.where(middle[:, None], [1.0, 0.0], away / np.where(middle, 1.0, distance)[:, None])
        return np.array(self.center) + self.radius * radial, -radial if self.inside else radial


@dataclass(frozen=True, eq=False)
class Chain:
    """A polyline through ``points`` (c, 2) with the obstacle on its left.

    Around an outward corner the normal rotates with the direction from the corner. Where the points are
    samples of a smooth curve, the obstacle is a spline through them, whose pressures are bounded.
    """

    points: FloatArray

    @cached_property
    def smooth(self) -> BoolArray:
        """Mask (c,) of the points that are samples of a smooth curve; both ends are corners."""
        count = len(self.points)
        result = np.zeros(count, dtype=bool)
        if count < MIN_SAMPLES + 2:
            return result
        angle = np.arctan2(*np.diff(self.points, axis=0).T[::-1])
        turn = np.angle(np.exp(1j * np.diff(angle)))
        turn[np.abs(turn) <= ROUND_OFF] = 0.0
        # Constant extrapolation of the turning angle beyond the ends.
        wide = np.pad(turn, TURN_NEIGHBORS, mode="edge")
        window = np.lib.stride_tricks.sliding_window_view(np.abs(wide), 2 * TURN_NEIGHBORS + 1)
        mean = 0.5 * (
            wide[TURN_NEIGHBORS - 1 : -TURN_NEIGHBORS - 1]
            + wide[TURN_NEIGHBORS + 1 : count - 2 + TURN_NEIGHBORS + 1]
        )
        even = np.abs(turn - mean) <= TURN_VARIATION * window.max(axis=1)
        result[1:-1] = even & (np.abs(turn) <= CORNER_ANGLE) & (window.max(axis=1) > 0.0)
        for first, last in runs_of(result):
            result[first:last] &= last - first >= MIN_SAMPLES
        return result

    @cached_property
    def _curves(self) -> tuple[tuple[int, int, Spline], ...]:
        """First and last (exclusive) side of every smooth part, and its spline."""
        length = np.hypot(*np.diff(self.points, axis=0).T)
        neighbours = np.pad(length, 1)
        short = length <= STRAIGHT_RATIO * np.maximum(neighbours[:-2], neighbours[2:])
        curved = (self.smooth[1:] | self.smooth[:-1]) & short
        found = []
        for first, last in runs_of(curved):
            inner = np.flatnonzero(~self.smooth[first + 1 : last]) + first + 1
            ends = [first, *inner.tolist(), last]
            for a, b in pairwise(ends):
                if b - a >= MIN_SAMPLES:
                    found.append((a, b, NodeSpline(self.points[a : b + 1], False).between(0, b - a)))
        return tuple(found)

    @property
    def curve(self) -> Spline | None:
        whole = [curve for first, last, curve in self._curves if last - first == len(self.points) - 1]
        return next((one for one in whole if one.curvature(one.node_arcs).min() >= 0.0), None)

    def closest(self, points: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray]:
        start, along = self.points[:-1], np.diff(self.points, axis=0)
        length = np.hypot(*along.T)
        tangent = along / length[:, None]
        side, s = np.zeros(len(points), dtype=np.int64), np.zeros(len(points))
        for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(length) // MAX_PAIRS):
            away = points[rows, None, :] - start
            way = np.clip((away * tangent).sum(axis=2), 0.0, length)
            distance = np.linalg.norm(away - way[:, :, None] * tangent, axis=2)
            # Of two sides at a corner take the one faced more; for points at the corner, by their surface's
            # normal.
            nearest = distance <= distance.min(axis=1, keepdims=True) + ROUND_OFF * length.max()
            across = away[:, :, 0] * tangent[:, 1] - away[:, :, 1] * tangent[:, 0]
            facing = outward[rows] @ np.stack([tangent[:, 1], -tangent[:, 0]])
            faced = across - ROUND_OFF * length.max() * facing
            side[rows] = np.argmax(np.where(nearest, faced, -np.inf), axis=1)
            s[rows] = way[np.arange(len(rows)), side[rows]]
        partner = start[side] + s[:, None] * tangent[side]
        normal = np.stack([tangent[side, 1], -tangent[side, 0]], axis=1)
        # Beyond a corner the normal is the direction from it; above a side it is exactly the side's.
        past = points - partner
        size = np.hypot(past[:, 0], past[:, 1])
        turned = np.abs((past * tangent[side]).sum(axis=1)) > ROUND_OFF * length.max()
        turned &= (past * normal).sum(axis=1) > 0.0
        turned &= ((s == 0.0) & (side > 0)) | ((s == length[side]) & (side < len(length) - 1))
        normal = np.where(turned[:, None], past / np.where(size > 0.0, size, 1.0)[:, None], normal)
        sampled = ~turned | self.smooth[np.where(s == 0.0, side, side + 1)]
        for first, last, curve in self._curves:
            here = (side >= first) & (side < last) & sampled
            if here.any():
                partner[here], normal[here] = curve.closest_points(points[here])
        return partner, normal
