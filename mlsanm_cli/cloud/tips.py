"""Sharp corners of an outline that point into the material, where stresses have no bound."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray

MIN_REENTRANT_ANGLE = 0.3
"""Re-entrant corners with a smaller turning angle (radian) count as smooth: their displacements are nearly
linear."""
REGULAR_EXPONENT = 0.97
"""Displacements r^exponent with larger exponents count as linear."""


@dataclass(frozen=True)
class Tips:
    """Corners at ``place`` (t, 2) between free faces, the unit vectors ``axis`` (t, 2) midway between the
    faces into the material, which takes up the angle ``half`` (t,) on either side. The nearest other one is
    ``apart`` (t,), in edges of the outline at the corner, twice as far if it is seen across the material. Its
    material has Muskhelishvili's constant ``kappa``, once it is known."""

    place: FloatArray
    axis: FloatArray
    half: FloatArray
    apart: FloatArray
    kappa: float = math.nan

    @cached_property
    def modes(self) -> tuple[tuple[tuple[float, bool], ...], ...]:
        """Of each corner the powers of the distance that displacements grow with and that are no more than
        REGULAR_EXPONENT, and whether these open it or shear it: sin(2 power half) = -+ power sin(2 half)
        (Williams 1952, doi:10.1115/1.4010553)."""
        return tuple(_modes(2.0 * float(half)) for half in self.half)


def tips_of(points: FloatArray, edges: IntArray, index: IntArray, normal: FloatArray) -> Tips | None:
    """The corners of an outline of ``edges`` (e, 2), numbers of ``points`` (n, 2), the material on the left,
    whose surfaces have the nodes ``index`` (b,) with outward ``normal`` (b, 2); None where there are none."""
    place, axis, half, edge = [], [], [], []
    before = dict(zip(edges[:, 1].tolist(), edges[:, 0].tolist(), strict=True))
    after = dict(zip(edges[:, 0].tolist(), edges[:, 1].tolist(), strict=True))
    node, count = np.unique(index, return_counts=True)
    for corner in node[count == 2].tolist():
        if corner not in before or corner not in after:
            continue
        ways = points[corner] - points[before[corner]], points[after[corner]] - points[corner]
        one, other = _in_order(normal[index == corner], *ways)
        turn = float(np.arctan2(one[0] * other[1] - one[1] * other[0], one @ other))
        if turn < -MIN_REENTRANT_ANGLE:
            place.append(points[corner])
            # Halfway between the faces: their normals might cancel.
            axis.append(one * np.cos(0.5 * turn) + np.array([-one[1], one[0]]) * np.sin(0.5 * turn))
            half.append(0.5 * (np.pi - turn))
            edge.append(max(float(np.hypot(*way)) for way in ways))
    if not place:
        return None
    at, into = np.array(place), -np.array(axis)
    way = at - at[:, None]
    away = np.hypot(*way.T)
    np.fill_diagonal(away, np.inf)
    # Across the material fields of both add up; along a face one of them is unknown beyond the other's void.
    across = (way * into[:, None]).sum(axis=2) > np.cos(np.array(half) - MIN_REENTRANT_ANGLE)[:, None] * away
    counted = np.where(across & across.T, 2.0 * away, away)
    return Tips(at, into, np.array(half), counted.min(axis=1) / np.array(edge))


def _in_order(normals: FloatArray, arriving: FloatArray, leaving: FloatArray) -> FloatArray:
    """Two normals (2, 2), that of the face which arrives at a corner first, by the ways of both."""
    right = [np.array([way[1], -way[0]]) / np.hypot(*way) for way in (arriving, leaving)]
    straight = sum(float(a @ b) for a, b in zip(normals, right, strict=True))
    crossed = sum(float(a @ b) for a, b in zip(normals[::-1], right, strict=True))
    return normals if straight >= crossed else normals[::-1]


def _modes(angle: float) -> tuple[tuple[float, bool], ...]:
    """The powers of a corner with an interior ``angle`` between free faces, and whether they open it."""
    grid = np.linspace(0.4, REGULAR_EXPONENT, 400)
    found = []
    for opens, sign in ((True, 1.0), (False, -1.0)):
        value = np.sin(grid * angle) + sign * grid * np.sin(angle)
        for i in np.flatnonzero((value[:-1] * value[1:] <= 0.0) & (value[:-1] != 0.0)).tolist():
            low, high = grid[i], grid[i + 1]
            for _ in range(50):
                middle = 0.5 * (low + high)
                here = np.sin(middle * angle) + sign * middle * np.sin(angle)
                low, high = (middle, high) if here * value[i] > 0.0 else (low, middle)
            found.append((float(0.5 * (low + high)), opens))
    return tuple(sorted(found, key=lambda mode: mode[0]))
