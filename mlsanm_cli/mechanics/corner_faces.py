"""Faces of a corner, and the fields of force distributions along them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.mechanics.near_field import (
    ComplexArray,
    PointForceField,
    SurfaceForces,
    as_complex,
    as_real,
    summed,
    traction,
)
from mlsanm_cli.mechanics.wedge import cubic
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

LOG_STEP = 0.1
"""Step of the forces along a face in the logarithm of their distance from the tip."""
NEAR_ANGLE = 0.2
"""Below this angle to the face the distribution is integrated instead of summed."""
BLEND_START, BLEND_END = 0.2, 1.6
"""Blending interval between both, in the logarithm of the distance."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss points of these integrals on either side of the closest point."""
Field: TypeAlias = Callable[[SurfaceForces, ComplexArray], FloatArray]


@dataclass(frozen=True)
class Face:
    """A face of a corner from its ``tip``: straight with unit tangent ``along`` and unit normal ``inward``,
    or a ``curve`` that has the tip at its end (``at_end``) or at its start."""

    tip: complex
    along: complex
    inward: complex
    curve: Curve | None = None
    at_end: bool = False

    def distance(self, z: ComplexArray) -> FloatArray:
        """Distance (e,) along the face of the points closest to ``z`` (e,)."""
        if self.curve is None:
            return np.asarray(((z - self.tip) * np.conj(self.along)).real)
        arc = self.curve.closest(as_real(z))
        return np.asarray(self.curve.length - arc if self.at_end else arc)

    def places(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Points (e,) at distances ``x`` (e,), relative to the tip, and unit normals (e,) into the body."""
        if self.curve is None:
            return np.asarray(x * self.along, dtype=np.complex128), np.full(len(x), self.inward)
        past = np.maximum(x - self.curve.length, 0.0)
        arc = np.maximum(self.curve.length - x, 0.0) if self.at_end else x - past
        inward = -as_complex(self.curve.normals(arc))
        # Extended straight beyond the end, where no forces act, so that no two points coincide.
        ahead = 1j * inward if self.at_end else -1j * inward
        return as_complex(self.curve.points(arc)) - self.tip + past * ahead, inward


@dataclass(frozen=True)
class FaceForces:
    """Point forces ``density`` (p, 2, c) along a ``face`` at equidistant ``logarithm`` (p,) of the distance
    that represent a smooth density; the fields end at a ``center``, if any."""

    kernel: PointForceField
    face: Face
    logarithm: FloatArray
    density: FloatArray
    center: complex | None = None

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, 2, c) at ``z`` (e,), however near to the face."""
        return self._field(z, SurfaceForces.displacement_of_each)

    def stress(self, z: ComplexArray) -> FloatArray:
        """Stresses (e, 3, c) at ``z`` (e,), however near to the face; on it, the limit from inside."""
        return self._field(z, SurfaceForces.stress_of_each)

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, 2, c) at surface points ``z`` (e,) with outward ``normal`` and ``curvature`` (e,)."""
        x = np.maximum(self.face.distance(z), np.exp(self.logarithm[0]))
        place, inward = self.face.places(x)
        # Not the length of the face, which may be infinite: other sides may be parallel to it.
        size = np.abs(z - self.face.tip).max(initial=0.0)
        on = (np.abs(z - self.face.tip - place) <= COARSE_ROUND_OFF * size) & (
            np.abs(normal + inward) <= COARSE_ROUND_OFF
        )
        total = np.zeros((len(z), 2, self.density.shape[2]))
        if not on.all():
            total[~on] = traction(self.stress(z[~on]), normal[~on])
        if on.any():
            found = self._forces.traction(z[on], normal[on], curvature[on])
            total[on] = np.einsum("epcd,pdm->ecm", found, self.density, optimize=True)
            row = (np.log(x[on]) - self.logarithm[0]) / LOG_STEP
            inside = (row <= len(self.logarithm) - 1.0)[:, None, None]
            total[on] += inside * cubic(self.density, row) / (LOG_STEP * x[on, None, None])
        return total

    @cached_property
    def _forces(self) -> SurfaceForces:
        """Unit forces at all points of the distribution."""
        place, inward = self.face.places(np.exp(self.logarithm))
        return SurfaceForces(self.kernel, self.face.tip + place, inward, self.center)

    def _field(self, z: ComplexArray, of_each: Field) -> FloatArray:
        x = self.face.distance(z)
        place, inward = self.face.places(x)
        w = (z - self.face.tip - place) * np.conj(inward)
        deep = w.real
        near = np.flatnonzero(
            (x > 0.0) & (np.abs(deep) < NEAR_ANGLE * x) & (np.abs(w.imag) <= COARSE_ROUND_OFF * x)
        )
        apart = self.logarithm - np.log(x[near, None])
        slope = np.maximum(deep[near] / x[near], COARSE_ROUND_OFF)
        inside = np.array(z)
        inside[near] += (slope * x[near] - deep[near]) * inward[near]
        total = summed(lambda at: of_each(self._forces, at[:, None]), inside, self.density)
        if len(near):
            by = of_each(self._forces, inside[near, None]) * (1.0 - _window(apart))[..., None, None]
            by += self._integrated(x[near], slope, of_each)
            total[near] = np.einsum("epcd,pdm->ecm", by, self.density, optimize=True)
        return total

    def _integrated(self, x: FloatArray, slope: FloatArray, field_of_each: Field) -> FloatArray:
        """Fields (e, p, c, 2) of the forces near distances ``x`` (e,), seen from a height of ``slope`` (e,)
        times x above the face: integrals over ln(x) + slope sinh(v)."""
        end = np.arcsinh(BLEND_END / slope)[:, None]
        v = np.concatenate([0.5 * side * end * (1.0 + NODES) for side in (-1.0, 1.0)], axis=1)
        away = slope[:, None] * np.sinh(v)
        size = 0.5 * np.tile(WEIGHTS, 2) * end * slope[:, None] * np.cosh(v) / LOG_STEP * _window(away)
        row = (np.log(x)[:, None] + away - self.logarithm[0]) / LOG_STEP
        size[(row < 0.0) | (row > len(self.logarithm) - 1.0)] = 0.0
        place, inward = self.face.places(x)
        seen = np.repeat(place + slope * x * inward, away.shape[1])
        # Relative to the tip, to avoid cancellation far from the origin.
        center = None if self.center is None else self.center - self.face.tip
        forces = SurfaceForces(self.kernel, *self.face.places((x[:, None] * np.exp(away)).ravel()), center)
        found = field_of_each(forces, seen) * size.ravel()[:, None, None]
        # Shares of the four nearest rows in a cubic interpolation: densities have more columns than rows.
        count = len(self.logarithm)
        row = np.clip(row.ravel(), 1.0, count - 3.0)
        first = np.minimum(row.astype(np.int64), count - 4)
        u = row - first
        low, high = u * (u - 1.0) / 6.0, (u + 1.0) * (u - 2.0) / 2.0
        shares = np.stack([-low * (u - 2.0), high * (u - 1.0), -high * u, low * (u + 1.0)], axis=1)
        at = np.repeat(np.arange(len(x)), away.shape[1]) * count + first - 1
        gathered = sparse.csr_array(
            (shares.ravel(), (at[:, None] + np.arange(4)).ravel(), 4 * np.arange(len(at) + 1)),
            shape=(len(at), len(x) * count),
        )
        total = gathered.T @ found.reshape(len(at), math.prod(found.shape[1:]))
        return np.asarray(total).reshape(len(x), count, *found.shape[1:])


def _window(apart: FloatArray) -> FloatArray:
    """Fraction (...) that is integrated of forces at a logarithmic distance ``apart`` (...)."""
    return smooth_step((np.abs(apart) - BLEND_START) / (BLEND_END - BLEND_START))


def smooth_step(way: FloatArray) -> FloatArray:
    """Smooth step (...) from 1 to 0 as ``way`` (...) goes from 0 to 1."""
    way = np.clip(way, 2e-2, 1.0 - 2e-2)
    return np.asarray(1.0 / (1.0 + np.exp(1.0 / (1.0 - way) - 1.0 / way)))
