"""Corners of a body near which forces act: their fields with what keeps both faces free of tractions."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.near_field import ComplexArray, SurfaceForces, traction
from mlsanm_cli.mechanics.wedge import Wedge, cubic, interpolated
from mlsanm_cli.values import dataclass

STEP = 0.05
"""Forces along the faces stand so far apart in the logarithm of their distance from the tip."""
LOW, HIGH = 12.0, 16.0
"""They reach so far, in this logarithm, below the nearest source and beyond the farthest; those still nearer
to the tip act at one place."""
ON = 1e-9
BESIDE = 0.2
"""Seen under less than this angle forces along a face are no row of single ones any more, but integrated."""
INNER = 0.2
"""Between this and 1 in the logarithm of the distance the one goes over into the other."""
POINTS = 24
"""Gauss's points of these integrals on either side of the closest place."""
LEAST = 1e-6
"""Places on a face are looked at from this angle inside: on it fields jump."""


@dataclass(frozen=True)
class Corner:
    """A corner of a body at ``tip``, of a ``wedge`` of which the shorter face has a ``length``. Forces farther
    from the tip than ``reach`` can do without it."""

    wedge: Wedge
    tip: complex
    length: float
    reach: float

    @property
    def faces(self) -> tuple[complex, complex]:
        """Unit vectors along the face that bears forces, and the other, away from the tip."""
        return self.wedge.along, self.wedge.other

    def distance(self, z: ComplexArray) -> FloatArray:
        """Distances (e,) of places on the first face from the tip."""
        return np.asarray(((z - self.tip) * np.conj(self.wedge.along)).real)

    def face_of(self, z: ComplexArray, normal: ComplexArray) -> IntArray:
        """Which of the two faces (e,) places with outward normals lie on, -1 for neither."""
        found = np.full(len(z), -1)
        for face, (along, inward) in enumerate(zip(self.faces, self.wedge.inward, strict=True)):
            w = (z - self.tip) * np.conj(along)
            on = (np.abs(w.imag) <= ON * self.length) & (w.real >= -ON * self.length)
            found[on & (np.abs(normal + inward) <= ON)] = face
        return found

    def images(self, source: FloatArray) -> tuple[tuple[SurfaceForces, FloatArray], ...]:
        """Of each face the places of forces along it, and these (p, 2, k, 2), by unit forces at the distances
        ``source`` (k,)."""
        first, last = np.log(source.min()) - LOW, np.log(source.max()) + HIGH
        logarithm, before = np.arange(first, last, STEP), np.arange(first - STEP, first - 2.0 * LOW, -STEP)
        result = []
        for face, (along, inward) in enumerate(zip(self.faces, self.wedge.inward, strict=True)):
            table = self.wedge.densities[face]
            force = STEP * interpolated(table, logarithm[:, None] - np.log(source))
            force[0] += STEP * interpolated(table, before[:, None] - np.log(source)).sum(axis=0)
            places = self.tip + np.exp(logarithm) * along
            forces = SurfaceForces(self.wedge.kernel, places, np.full(len(places), inward))
            result.append((forces, np.ascontiguousarray(force.transpose(0, 2, 1, 3))))
        return tuple(result)

    def fields(
        self, z: ComplexArray, source: FloatArray, force: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Displacements (e, 2, c) and stresses (e, 3, c) at ``z`` (e,), however near, by what forces along
        the faces there are for forces (k, 2, c) at the distances ``source`` (k,)."""
        displacement = np.zeros((len(z), 2, force.shape[2]))
        stress = np.zeros((len(z), 3, force.shape[2]))
        acting = (source > 0.0) & (force != 0.0).any(axis=(1, 2))
        if not acting.any():
            return displacement, stress
        for (forces, by), along, inward in zip(
            self.images(source[acting]), self.faces, self.wedge.inward, strict=True
        ):
            density = np.einsum("pdkf,kfc->pdc", by, force[acting], optimize=True)
            w = z - self.tip
            x, deep = (w * np.conj(along)).real, (w * np.conj(inward)).real
            near = np.flatnonzero((x > 0.0) & (deep < BESIDE * x))
            single = np.ones((len(z), len(forces.place)))
            apart = np.log(np.abs(forces.place - self.tip)) - np.log(x[near, None])
            single[near] = 1.0 - _window(apart)
            for kernel, total in ((forces.displacement, displacement), (forces.stress, stress)):
                total += np.einsum("ep,epcd,pdm->ecm", single, kernel(z), density, optimize=True)
            one, other = self._beside(x[near], np.maximum(deep[near] / x[near], LEAST), forces, density)
            displacement[near] += one
            stress[near] += other
        return displacement, stress

    def _beside(
        self, x: FloatArray, slope: FloatArray, forces: SurfaceForces, density: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """The same by the ``density`` (p, 2, c) of one face around distances ``x`` (e,) along it, ``slope``
        (e,) times as far from the tip as from the face: integrals over ln(x) + slope sinh(v)."""
        nearest = forces.place[0] - self.tip
        along, inward = nearest / abs(nearest), forces.inward[0]
        z = self.tip + x * along + slope * x * inward
        end = np.arcsinh(1.0 / slope)
        displacement, stress = np.zeros((len(x), 2, density.shape[2])), np.zeros((len(x), 3, density.shape[2]))
        for place, weight in zip(*np.polynomial.legendre.leggauss(POINTS), strict=True):
            for side in (-1.0, 1.0):
                v = side * 0.5 * end * (1.0 + place)
                away = slope * np.sinh(v)
                size = 0.5 * weight * end * slope * np.cosh(v) / STEP * _window(away)
                row = (np.log(x) + away - np.log(abs(nearest))) / STEP
                inside = (row >= 0.0) & (row <= len(density) - 1.0)
                force = np.where(inside, size, 0.0)[:, None, None] * cubic(density, row)
                there = self.tip + x * np.exp(away) * along
                one = SurfaceForces(forces.kernel, there, np.full(len(x), inward))
                moved, stressed = one.at_each(z)
                displacement += moved @ force
                stress += stressed @ force
        return displacement, stress


@dataclass(frozen=True)
class CorneredForces:
    """Unit forces as :class:`SurfaceForces`, on one straight face, with what keeps the faces of the
    ``corners`` at its ends free of tractions."""

    own: SurfaceForces
    corners: tuple[Corner, ...]

    @property
    def place(self) -> ComplexArray:
        """Places (k,) of the forces."""
        return self.own.place

    def _of(self, corner: Corner, z: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Displacements (e, k, 2, 2) and stresses (e, k, 3, 2) at ``z`` (e,) by one corner."""
        count = len(self.place)
        unit = np.eye(2 * count).reshape(count, 2, 2 * count)
        both = corner.fields(z, corner.distance(self.place), unit)
        displacement, stress = (
            np.moveaxis(one.reshape(len(z), one.shape[1], count, 2), 2, 1) for one in both
        )
        return displacement, stress

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, k, 2, 2) at places ``z`` (e,), none of which is a force's."""
        total = self.own.displacement(z)
        for corner in self.corners:
            total = total + self._of(corner, z)[0]
        return total

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, k, 2, 2) at places ``z`` (e,) of the surface with outward ``normal`` and
        ``curvature`` (e,); none is left on the faces of a corner by the forces and this corner."""
        total = self.own.traction(z, normal, curvature)
        for corner in self.corners:
            face = corner.face_of(z, normal)
            total[face == 1] = 0.0
        for corner in self.corners:
            off = corner.face_of(z, normal) < 0
            if off.any():
                total[off] += traction(self._of(corner, z[off])[1], normal[off, None])
        return total


Forces: TypeAlias = SurfaceForces | CorneredForces


def _window(apart: FloatArray) -> FloatArray:
    """How much of forces (...) so far along a face, in the logarithm, is integrated as seen from nearby: a
    smooth step from 1 to 0."""
    way = np.clip((np.abs(apart) - INNER) / (1.0 - INNER), 2e-2, 1.0 - 2e-2)
    return np.asarray(1.0 / (1.0 + np.exp(1.0 / (1.0 - way) - 1.0 / way)))
