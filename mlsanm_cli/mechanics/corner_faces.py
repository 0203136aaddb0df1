"""Faces of a corner, and fields of forces along them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.mechanics.near_field import (
    ComplexArray,
    PointForceField,
    SurfaceForces,
    as_complex,
    as_real,
    traction,
)
from mlsanm_cli.mechanics.wedge import cubic

LOG_STEP = 0.1
"""Distance of the forces along the faces in the logarithm of their distance from the tip."""
FACE_TOLERANCE = 1e-6
"""Difference below which places and directions belong to one curved face."""
INTEGRATION_ANGLE = 0.2
"""Angle to a face below which forces along it are integrated instead of summed."""
INNER, OUTER = 0.2, 1.6
"""Between these in the logarithm of the distance the one goes over into the other."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss's points of these integrals on either side of the closest place."""
MIN_ANGLE = 1e-6
"""Least angle from a face at which fields are evaluated: on it they are discontinuous."""
Field: TypeAlias = Callable[[SurfaceForces, ComplexArray], FloatArray]


@dataclass(frozen=True)
class Face:
    """One of both faces of a corner, from its ``tip``: straight, ``along`` a unit vector with the material on
    the side ``inward``, or a ``curve`` that has the tip at its end (``at_end``) or its beginning."""

    tip: complex
    along: complex
    inward: complex
    curve: Curve | None = None
    at_end: bool = False

    def distance(self, z: ComplexArray) -> FloatArray:
        """How far (e,) along the face the places closest to ``z`` (e,) are."""
        if self.curve is None:
            return np.asarray(((z - self.tip) * np.conj(self.along)).real)
        arc = self.curve.closest(as_real(z))
        return np.asarray(self.curve.length - arc if self.at_end else arc)

    def places(self, x: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Places (e,) at distances ``x`` (e,), as seen from the tip, and unit normals (e,) into the body."""
        if self.curve is None:
            return np.asarray(x * self.along, dtype=np.complex128), np.full(len(x), self.inward)
        past = np.maximum(x - self.curve.length, 0.0)
        arc = np.maximum(self.curve.length - x, 0.0) if self.at_end else x - past
        inward = -as_complex(self.curve.normals(arc))
        # Straight on beyond the end, where there are no forces, so that none of the places is the end.
        ahead = 1j * inward if self.at_end else -1j * inward
        return as_complex(self.curve.points(arc)) - self.tip + past * ahead, inward


@dataclass(frozen=True)
class Line:
    """Forces ``density`` (p, 2, c) at distances of even ``logarithm`` (p,) along a ``face``, which stand for
    ones that are spread over it; their fields end at a ``center`` if there is one."""

    kernel: PointForceField
    face: Face
    logarithm: FloatArray
    density: FloatArray
    center: complex | None = None

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, 2, c) at ``z`` (e,), however near."""
        forces = SurfaceForces
        return self._field(z, forces.displacement_by, forces.displacement, forces.displacement_of_each)

    def stress(self, z: ComplexArray) -> FloatArray:
        """Stresses (e, 3, c) at ``z`` (e,), however near; on the face those inside."""
        forces = SurfaceForces
        return self._field(z, forces.stress_by, forces.stress, forces.stress_of_each)

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, 2, c) at places ``z`` (e,) of the surface with outward ``normal`` and ``curvature``
        (e,)."""
        x = np.maximum(self.face.distance(z), np.exp(self.logarithm[0]))
        place, inward = self.face.places(x)
        size = np.exp(self.logarithm[-1])
        on = (np.abs(z - self.face.tip - place) <= FACE_TOLERANCE * size) & (
            np.abs(normal + inward) <= FACE_TOLERANCE
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
        """Unit forces at the places."""
        place, inward = self.face.places(np.exp(self.logarithm))
        return SurfaceForces(self.kernel, self.face.tip + place, inward, self.center)

    def _field(
        self,
        z: ComplexArray,
        by_all: Callable[[SurfaceForces, FloatArray, ComplexArray], FloatArray],
        field: Field,
        field_of_each: Field,
    ) -> FloatArray:
        x = self.face.distance(z)
        place, inward = self.face.places(x)
        w = (z - self.face.tip - place) * np.conj(inward)
        deep = w.real
        near = np.flatnonzero(
            (x > 0.0) & (np.abs(deep) < INTEGRATION_ANGLE * x) & (np.abs(w.imag) <= FACE_TOLERANCE * x)
        )
        apart = self.logarithm - np.log(x[near, None])
        slope = np.maximum(deep[near] / x[near], MIN_ANGLE)
        inside = np.array(z)
        inside[near] += (slope * x[near] - deep[near]) * inward[near]
        total = by_all(self._forces, self.density, inside)
        if len(near):
            by = field(self._forces, inside[near]) * (1.0 - _window(apart))[..., None, None]
            by += self._near_face(x[near], slope, field_of_each)
            total[near] = np.einsum("epcd,pdm->ecm", by, self.density, optimize=True)
        return total

    def _near_face(self, x: FloatArray, slope: FloatArray, field_of_each: Field) -> FloatArray:
        """What forces (e, p, c, 2) around distances ``x`` (e,) along the face do, seen from ``slope`` (e,)
        times as far from the face: integrals over ln(x) + slope sinh(v)."""
        end = np.arcsinh(OUTER / slope)[:, None]
        v = np.concatenate([0.5 * side * end * (1.0 + NODES) for side in (-1.0, 1.0)], axis=1)
        away = slope[:, None] * np.sinh(v)
        size = 0.5 * np.tile(WEIGHTS, 2) * end * slope[:, None] * np.cosh(v) / LOG_STEP * _window(away)
        row = (np.log(x)[:, None] + away - self.logarithm[0]) / LOG_STEP
        size[(row < 0.0) | (row > len(self.logarithm) - 1.0)] = 0.0
        place, inward = self.face.places(x)
        seen = np.repeat(place + slope * x * inward, away.shape[1])
        # As seen from the tip: far from the origin digits are lost.
        center = None if self.center is None else self.center - self.face.tip
        forces = SurfaceForces(self.kernel, *self.face.places((x[:, None] * np.exp(away)).ravel()), center)
        found = field_of_each(forces, seen) * size.ravel()[:, None, None]
        first, shares = _cubic_shares(row.ravel(), len(self.logarithm))
        count = len(self.logarithm)
        at = np.repeat(np.arange(len(x)), away.shape[1]) * count + first
        gathered = sparse.csr_array(
            (shares.ravel(), (at[:, None] + np.arange(4)).ravel(), 4 * np.arange(len(at) + 1)),
            shape=(len(at), len(x) * count),
        )
        total = gathered.T @ found.reshape(len(at), math.prod(found.shape[1:]))
        return np.asarray(total).reshape(len(x), count, *found.shape[1:])


def _window(apart: FloatArray) -> FloatArray:
    """How much of forces (...) so far along a face, in the logarithm, is integrated as seen from nearby."""
    return smooth_step((np.abs(apart) - INNER) / (OUTER - INNER))


def smooth_step(way: FloatArray) -> FloatArray:
    """A smooth step (...) from 1 to 0 on the ``way`` (...) from 0 to 1."""
    way = np.clip(way, 2e-2, 1.0 - 2e-2)
    return np.asarray(1.0 / (1.0 + np.exp(1.0 / (1.0 - way) - 1.0 / way)))


def _cubic_shares(at: FloatArray, count: int) -> tuple[IntArray, FloatArray]:
    """The first (e,) of the four rows, out of ``count``, that values ``at`` numbers of rows (e,) come from,
    and the shares (e, 4) of these."""
    at = np.clip(at, 1.0, count - 3.0)
    first = np.minimum(at.astype(np.int64), count - 4)
    u = at - first
    low, high = u * (u - 1.0) / 6.0, (u + 1.0) * (u - 2.0) / 2.0
    shares = np.stack([-low * (u - 2.0), high * (u - 1.0), -high * u, low * (u + 1.0)], axis=1)
    return first - 1, shares
