"""Corners of a body near which forces act: their fields with what keeps both faces free of tractions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.mechanics.near_field import ComplexArray, Kernel, SurfaceForces, traction
from mlsanm_cli.mechanics.wedge import Wedge, cubic, interpolated

STEP = 0.1
"""Forces along the faces stand so far apart in the logarithm of their distance from the tip."""
LOW, HIGH = 9.0, 16.0
"""They reach so far, in this logarithm, below the nearest source and beyond the farthest; those still nearer
to the tip, or farther, act at one place."""
ON = 1e-9
NEAR_SURFACE = 0.2
"""Seen under less than this angle forces along a face are no row of single ones any more, but integrated."""
INNER, OUTER = 0.2, 1.6
"""Between these in the logarithm of the distance the one goes over into the other."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss's points of these integrals on either side of the closest place."""
LEAST = 1e-6
"""Places on a face are looked at from this angle inside: on it fields jump."""


@dataclass(frozen=True)
class Images:
    """Forces (k, 2, c) at places off the body."""

    places: SurfaceForces
    force: FloatArray

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, 2, c) at ``z`` (e,)."""
        return np.asarray(np.einsum("ekcd,kdm->ecm", self.places.displacement(z), self.force, optimize=True))

    def stress(self, z: ComplexArray) -> FloatArray:
        """Stresses (e, 3, c) at ``z`` (e,)."""
        return np.asarray(np.einsum("ekcd,kdm->ecm", self.places.stress(z), self.force, optimize=True))


@dataclass(frozen=True)
class Corner:
    """A corner of a body at ``tip``, between the two faces of a ``wedge``. The shorter one has a ``length``;
    forces farther from the tip than ``reach`` can do without it."""

    wedge: Wedge
    tip: complex
    length: float
    reach: float

    @property
    def faces(self) -> tuple[complex, complex]:
        """Unit vectors away from the tip along the two faces that forces act on."""
        return self.wedge.along, self.wedge.second

    @property
    def bisector(self) -> complex:
        """The unit vector from the tip midway between the faces of the body."""
        middle = np.sqrt(self.wedge.along * self.wedge.other)
        return complex(middle if (middle * np.conj(self.wedge.inward[0])).real > 0.0 else -middle)

    def distance(self, z: ComplexArray) -> FloatArray:
        """Distances (e,) of places on the first face from the tip."""
        return np.asarray(((z - self.tip) * np.conj(self.wedge.along)).real)

    def cleared(self, z: ComplexArray, normal: ComplexArray) -> tuple[BoolArray, BoolArray]:
        """Whether places (e,) with outward normals lie on the first face, and on another that the corner's
        forces take all tractions off."""
        found = []
        for along in self.faces[:1] if self.wedge.sliding else self.faces:
            w = (z - self.tip) * np.conj(along)
            on = (np.abs(w.imag) <= ON * self.length) & (w.real >= -ON * self.length)
            found.append(on & (np.abs((normal * np.conj(along)).real) <= ON))
        return found[0], found[-1] if len(found) > 1 else np.zeros(len(z), dtype=bool)

    def lines(self, source: FloatArray, force: FloatArray) -> tuple[Line | Images, ...]:
        """What acts besides forces (k, 2, c) at the distances ``source`` (k,); nothing where there are no
        forces."""
        acting = (source > 0.0) & (force != 0.0).any(axis=(1, 2))
        if not acting.any():
            return ()
        source, force = source[acting], force[acting]
        first, last = np.log(source.min()) - LOW, np.log(source.max()) + HIGH
        logarithm = np.arange(first, last, STEP)
        before = np.arange(first - STEP, first - LOW, -STEP)
        after = np.arange(logarithm[-1] + STEP, last + LOW, STEP)
        found = []
        for face, (along, inward) in enumerate(zip(self.faces, self.wedge.inward, strict=True)):
            table = self.wedge.densities[face]
            by = interpolated(table, logarithm[:, None] - np.log(source))
            for row, more in ((0, before), (-1, after)):
                by[row] += interpolated(table, more[:, None] - np.log(source)).sum(axis=0)
            density = np.einsum("pkdf,kfc->pdc", STEP * by, force, optimize=True)
            found.append(Line(self.wedge.kernel, self.tip, along, inward, logarithm, density))
        return (*found, *self._images(source, force))

    def _images(self, source: FloatArray, force: FloatArray) -> Iterator[Images]:
        """The images of forces behind a wall."""
        if self.wedge.sliding:
            place = np.asarray(self.tip + source * self.wedge.second, dtype=np.complex128)
            inward = np.full(len(source), self.wedge.inward[1])
            image = np.einsum("fd,kdc->kfc", self.wedge.image, force)
            yield Images(SurfaceForces(self.wedge.kernel, place, inward), image)


@dataclass(frozen=True)
class Line:
    """Forces ``density`` (p, 2, c) at distances of even ``logarithm`` (p,) from a ``tip`` ``along`` a
    straight face, which stand for ones that are spread over it."""

    kernel: Kernel
    tip: complex
    along: complex
    inward: complex
    logarithm: FloatArray
    density: FloatArray

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, 2, c) at ``z`` (e,), however near."""
        return self._field(z, SurfaceForces.displacement)

    def stress(self, z: ComplexArray) -> FloatArray:
        """Stresses (e, 3, c) at ``z`` (e,), however near; on the face those inside."""
        return self._field(z, SurfaceForces.stress)

    def _field(
        self, z: ComplexArray, field: Callable[[SurfaceForces, ComplexArray], FloatArray]
    ) -> FloatArray:
        w = z - self.tip
        x, deep = (w * np.conj(self.along)).real, (w * np.conj(self.inward)).real
        near = np.flatnonzero((x > 0.0) & (deep < NEAR_SURFACE * x))
        apart = self.logarithm - np.log(x[near, None])
        single = np.ones((len(z), len(self.logarithm)))
        single[near] = 1.0 - _window(apart)
        found = field(self._at(np.exp(self.logarithm)), z)
        total = np.einsum("ep,epcd,pdm->ecm", single, found, self.density, optimize=True)
        if len(near):
            total[near] += self._near_face(x[near], np.maximum(deep[near] / x[near], LEAST), field)
        return np.asarray(total)

    def _at(self, distance: FloatArray) -> SurfaceForces:
        """Unit forces at distances (k,) from the tip."""
        return SurfaceForces(
            self.kernel,
            np.asarray(self.tip + distance * self.along, dtype=np.complex128),
            np.full(len(distance), self.inward),
        )

    def _near_face(
        self,
        x: FloatArray,
        slope: FloatArray,
        field: Callable[[SurfaceForces, ComplexArray], FloatArray],
    ) -> FloatArray:
        """What is around distances ``x`` (e,) along the face, seen from ``slope`` (e,) times as far from the
        face: integrals over ln(x) + slope sinh(v)."""
        end = np.arcsinh(OUTER / slope)[:, None]
        v = np.concatenate([0.5 * side * end * (1.0 + NODES) for side in (-1.0, 1.0)], axis=1)
        away = slope[:, None] * np.sinh(v)
        size = 0.5 * np.tile(WEIGHTS, 2) * end * slope[:, None] * np.cosh(v) / STEP * _window(away)
        row = (np.log(x)[:, None] + away - self.logarithm[0]) / STEP
        inside = (row >= 0.0) & (row <= len(self.logarithm) - 1.0)
        force = np.where(inside, size, 0.0)[..., None, None] * cubic(self.density, row)
        seen = x * (self.along + slope * self.inward)
        # Each place by itself: as if all were seen from one, on a line through it.
        there = x[:, None] * np.exp(away)
        w = seen[:, None] - there * self.along
        found = field(SurfaceForces(self.kernel, np.zeros(1, complex), np.array([self.inward])), w.ravel())
        found = found[:, 0].reshape(*w.shape, -1, 2)
        return np.asarray(np.einsum("evcd,evdm->ecm", found, force, optimize=True))


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

    @cached_property
    def _lines(self) -> tuple[tuple[Line | Images, ...], ...]:
        """Corner by corner the forces along its faces."""
        count = len(self.place)
        unit = np.eye(2 * count).reshape(count, 2, 2 * count)
        return tuple(corner.lines(corner.distance(self.place), unit) for corner in self.corners)

    def _parted(self, values: FloatArray) -> FloatArray:
        """Values (e, c, 2k) of all forces as (e, k, c, 2)."""
        return np.moveaxis(values.reshape(*values.shape[:2], len(self.place), 2), 2, 1)

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, k, 2, 2) at places ``z`` (e,), none of which is a force's."""
        total = self.own.displacement(z)
        for lines in self._lines:
            for line in lines:
                total = total + self._parted(line.displacement(z))
        return total

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, k, 2, 2) at places ``z`` (e,) of the surface with outward ``normal`` and
        ``curvature`` (e,); none is left on the faces of a corner by the forces and this corner."""
        total = self.own.traction(z, normal, curvature)
        cleared = [corner.cleared(z, normal) for corner in self.corners]
        for _, adjacent in cleared:
            total[adjacent] = 0.0
        for (own, adjacent), lines in zip(cleared, self._lines, strict=True):
            off = ~(own | adjacent)
            if off.any():
                for line in lines:
                    total[off] += traction(self._parted(line.stress(z[off])), normal[off, None])
        return total


Forces: TypeAlias = SurfaceForces | CorneredForces


def _window(apart: FloatArray) -> FloatArray:
    """How much of forces (...) so far along a face, in the logarithm, is integrated as seen from nearby: a
    smooth step from 1 to 0."""
    way = np.clip((np.abs(apart) - INNER) / (OUTER - INNER), 2e-2, 1.0 - 2e-2)
    return np.asarray(1.0 / (1.0 + np.exp(1.0 / (1.0 - way) - 1.0 / way)))
