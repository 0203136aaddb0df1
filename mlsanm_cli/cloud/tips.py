"""Reentrant corners of an outline, at which stresses are singular."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.membership import joints
from mlsanm_cli.records import dataclass

SMOOTH_TURN = 0.3
"""Corners that turn inward by less (radians) count as smooth: their displacements are nearly linear."""
MAX_EXPONENT = 0.97
"""Singular exponents above this are as good as 1 (linear displacements)."""


@dataclass(frozen=True)
class Tips:
    """Reentrant corners at ``place`` (t, 2) between traction-free faces. ``axis`` (t, 2) is the unit bisector
    into the material, which fills the angle ``half`` (t,) on either side of it. ``apart`` (t,) is the
    distance to the nearest other corner in outline edges, doubled if that one is seen across the material.
    ``kappa`` is Muskhelishvili's constant of the material, nan until it is known."""

    place: FloatArray
    axis: FloatArray
    half: FloatArray
    apart: FloatArray
    kappa: float = math.nan

    @cached_property
    def modes(self) -> tuple[tuple[tuple[float, bool], ...], ...]:
        """Singular exponents of each corner up to MAX_EXPONENT, and whether their modes open (else shear) it.
        Displacements r^p with sin(2 p half) = -+ p sin(2 half) (Williams 1952, doi:10.1115/1.4010553)."""
        grid, modes = np.linspace(0.4, MAX_EXPONENT, 400), []
        for angle in 2.0 * self.half:
            found = []
            for opens, sign in ((True, 1.0), (False, -1.0)):
                value = np.sin(grid * angle) + sign * grid * np.sin(angle)
                for i in np.flatnonzero((value[:-1] * value[1:] <= 0.0) & (value[:-1] != 0.0)).tolist():
                    low, high = grid[i], grid[i + 1]
                    for _ in range(50):
                        middle = 0.5 * (low + high)
                        at = np.sin(middle * angle) + sign * middle * np.sin(angle)
                        low, high = (middle, high) if at * value[i] > 0.0 else (low, middle)
                    found.append((float(0.5 * (low + high)), opens))
            modes.append(tuple(sorted(found)))
        return tuple(modes)


def tips_of(points: FloatArray, index: IntArray, normal: FloatArray, names: Sequence[str]) -> Tips | None:
    """Reentrant corners of the outline of a body with nodes ``points`` (n, 2), whose boundary nodes ``index``
    (b,) have outward ``normal`` (b, 2) and belong to surfaces ``names`` (b,); None without any."""
    place, axis, half, edge = [], [], [], []
    for last, first, turn in sorted(joints(index, normal, names), key=lambda joint: int(index[joint[1]])):
        if turn < -SMOOTH_TURN:
            tip, (x, y) = points[index[first]], normal[last]
            place.append(tip)
            # Rotated by half the turn: at a crack the two normals would cancel.
            axis.append(np.array([x, y]) * np.cos(0.5 * turn) + np.array([-y, x]) * np.sin(0.5 * turn))
            half.append(0.5 * (np.pi - turn))
            edge.append(float(np.hypot(*(points[index[[last - 1, first + 1]]] - tip).T).max()))
    if not place:
        return None
    at, into, angle = np.array(place), -np.array(axis), np.array(half)
    way = at - at[:, None]
    away = np.hypot(*way.T)
    np.fill_diagonal(away, np.inf)
    seen = (way * into[:, None]).sum(axis=2) > np.cos(angle - SMOOTH_TURN)[:, None] * away
    # Across the material both singular fields add; along a face one is undefined beyond the other's void.
    counted = np.where(seen & seen.T, 2.0 * away, away)
    return Tips(at, into, angle, counted.min(axis=1) / np.array(edge))
