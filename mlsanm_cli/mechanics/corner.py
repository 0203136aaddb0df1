"""Corners of a body near which forces act: their fields with what keeps both faces free of tractions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.mechanics.near_field import (
    ComplexArray,
    Kernel,
    SurfaceForces,
    as_complex,
    as_real,
    traction,
)
from mlsanm_cli.mechanics.wedge import Wedge, cubic, interpolated

STEP = 0.1
"""Forces along the faces stand so far apart in the logarithm of their distance from the tip."""
LOW, HIGH = 9.0, 16.0
"""They reach so far, in this logarithm, below the nearest source and beyond the farthest; those still nearer
to the tip, or farther, act at one place."""
FADING = 2.0
"""Forces along faces of a limited span fade out over so much of this logarithm."""
ON = 1e-9
"""Places off a straight face by less than this part of its length lie on it."""
ON_FACE = 1e-6
"""Places and directions that differ by less are those of one curved face."""
AT_TIP = 1e-3
"""Tractions on curved faces are looked at no nearer to the tip than this part of their span."""
ON_NORMAL = 1e-2
"""Places at the tip belong to the face whose normal differs from theirs by less, as 1 less the cosine."""
NONE = 1e-12
"""Distances from the tip are taken as at least this part of the length: fields at the tip have no value."""
ROUND_OFF = 1e-12
"""Densities below are none."""
NEAR_SURFACE = 0.2
"""Seen under less than this angle forces along a face are no row of single ones any more, but integrated."""
INNER, OUTER = 0.2, 1.6
"""Between these in the logarithm of the distance the one goes over into the other."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Gauss's points of these integrals on either side of the closest place."""
LEAST_ANGLE = 1e-6
"""Places on a face are looked at from this angle inside: on it fields jump."""

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
class Images:
    """Forces (k, 2, c) at places off the body."""

    places: SurfaceForces
    force: FloatArray

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, 2, c) at ``z`` (e,)."""
        return self.places.displacement_by(self.force, z)

    def stress(self, z: ComplexArray) -> FloatArray:
        """Stresses (e, 3, c) at ``z`` (e,)."""
        return self.places.stress_by(self.force, z)

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, 2, c) at ``z`` (e,) on outward ``normal`` vectors (e,)."""
        return traction(self.stress(z), normal)


@dataclass(frozen=True)
class Corner:
    """A corner of a body at ``tip``, between the two faces of a ``wedge``. The shorter one has a ``length``;
    forces farther from the tip than ``reach`` can do without it.

    What keeps both faces free acts along whole infinite wedges. Where faces are ``curved``, or these would
    cut the body, it acts along the faces themselves as far as ``span``, faded out before, and its fields end
    at a ``center`` in the void if there is one.
    """

    wedge: Wedge
    tip: complex
    length: float
    reach: float
    curved: tuple[Face, Face] | None = None
    span: float = np.inf
    center: complex | None = None

    @cached_property
    def faces(self) -> tuple[Face, Face]:
        """The two faces that forces act on."""
        if self.curved is not None:
            return self.curved
        wedge = self.wedge
        first, second = (
            Face(self.tip, along, inward)
            for along, inward in zip((wedge.along, wedge.second), wedge.inward, strict=True)
        )
        return first, second

    @property
    def bisector(self) -> complex:
        """The unit vector from the tip midway between the faces of the body."""
        middle = np.sqrt(self.wedge.along * self.wedge.other)
        return complex(middle if (middle * np.conj(self.wedge.inward[0])).real > 0.0 else -middle)

    def distance(self, z: ComplexArray) -> FloatArray:
        """Distances (e,) of places on the first face from the tip."""
        return self.faces[0].distance(z)

    def cleared(self, z: ComplexArray, normal: ComplexArray) -> tuple[BoolArray, BoolArray]:
        """Whether places (e,) with outward normals lie on the first face, and on another that the corner's
        forces take all tractions off."""
        found = []
        for face in self.faces[:1] if self.wedge.sliding or self.wedge.clamped else self.faces:
            w = (z - self.tip) * np.conj(face.along)
            on = (np.abs(w.imag) <= ON * self.length) & (w.real >= -ON * self.length)
            on &= np.abs((normal * np.conj(face.along)).real) <= ON
            found.append(on & (self.curved is None))
        return found[0], found[-1] if len(found) > 1 else np.zeros(len(z), dtype=bool)

    def off_tip(self, z: ComplexArray, normal: ComplexArray) -> ComplexArray:
        """Places (e,) with outward normals, those at the tip a little along their curved face."""
        least = AT_TIP * self.span
        for face in self.curved or ():
            place, inward = face.places(np.array([least]))
            at = (np.abs(z - self.tip) < least) & ((normal * np.conj(-inward[0])).real > 1.0 - ON_NORMAL)
            z = np.where(at, self.tip + place[0], z)
        return z

    def images(self, source: FloatArray, force: FloatArray) -> tuple[Images, ...]:
        """The images behind a wall of forces (k, 2, c) at the distances ``source`` (k,)."""
        acting = (source > 0.0) & (force != 0.0).any(axis=(1, 2))
        if not (self.wedge.sliding and acting.any()):
            return ()
        source, force = source[acting], force[acting]
        place = np.asarray(self.tip + source * self.wedge.second, dtype=np.complex128)
        inward = np.full(len(source), self.wedge.inward[1])
        image = np.einsum("fd,kdc->kfc", self.wedge.image, force)
        return (Images(SurfaceForces(self.wedge.kernel, place, inward), image),)

    def lines(self, source: FloatArray, force: FloatArray) -> tuple[Line, ...]:
        """The forces along both faces that go with forces (k, 2, c) at the distances ``source`` (k,); nothing
        where there are no forces."""
        acting = (source > 0.0) & (force != 0.0).any(axis=(1, 2))
        if not acting.any():
            return ()
        source, force = source[acting], force[acting]
        first, last = np.log(source.min()) - LOW, np.log(source.max()) + HIGH
        logarithm = np.arange(first, min(last, np.log(self.span)), STEP)
        before = np.arange(first - STEP, first - LOW, -STEP)
        after = np.arange(logarithm[-1] + STEP, last + LOW, STEP)
        kept = 1.0 - _step((np.log(self.span) - logarithm) / FADING)
        found = []
        for face, table in zip(self.faces, self.wedge.densities, strict=True):
            if np.abs(table).max() <= ROUND_OFF:
                continue  # walls at right angles need images alone
            by = interpolated(table, logarithm[:, None] - np.log(source))
            for row, more in ((0, before), (-1, after)):
                by[row] += interpolated(table, more[:, None] - np.log(source)).sum(axis=0)
            density = np.einsum("p,pkdf,kfc->pdc", STEP * kept, by, force, optimize=True)
            found.append(Line(self.wedge.kernel, face, logarithm, density, self.center))
        return tuple(found)

    def beyond_wedge(self, z: ComplexArray) -> FloatArray:
        """By how much unit forces at places ``z`` (k,) of the first face move these (k, k, 2, 2) otherwise
        than :meth:`Wedge.compliance` says, if faces are curved."""
        count, x = len(z), np.maximum(self.distance(z), NONE * self.length)
        unit = np.eye(2 * count).reshape(count, 2, 2 * count)
        moved = sum(
            (line.displacement(z) for line in self.lines(x, unit)), start=np.zeros((count, 2, 2 * count))
        )
        whole = [[self.wedge.compliance(x, x, c, d) for d in (0, 1)] for c in (0, 1)]
        return np.asarray(_parted(moved, count) - np.moveaxis(np.array(whole), (0, 1), (2, 3)))


@dataclass(frozen=True)
class Line:
    """Forces ``density`` (p, 2, c) at distances of even ``logarithm`` (p,) along a ``face``, which stand for
    ones that are spread over it; their fields end at a ``center`` if there is one."""

    kernel: Kernel
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
        on = (np.abs(z - self.face.tip - place) <= ON_FACE * size) & (np.abs(normal + inward) <= ON_FACE)
        total = np.zeros((len(z), 2, self.density.shape[2]))
        if not on.all():
            total[~on] = traction(self.stress(z[~on]), normal[~on])
        if on.any():
            found = self._forces.traction(z[on], normal[on], curvature[on])
            total[on] = np.einsum("epcd,pdm->ecm", found, self.density, optimize=True)
            row = (np.log(x[on]) - self.logarithm[0]) / STEP
            inside = (row <= len(self.logarithm) - 1.0)[:, None, None]
            total[on] += inside * cubic(self.density, row) / (STEP * x[on, None, None])
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
        near = np.flatnonzero((x > 0.0) & (np.abs(deep) < NEAR_SURFACE * x) & (np.abs(w.imag) <= ON_FACE * x))
        apart = self.logarithm - np.log(x[near, None])
        slope = np.maximum(deep[near] / x[near], LEAST_ANGLE)
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
        size = 0.5 * np.tile(WEIGHTS, 2) * end * slope[:, None] * np.cosh(v) / STEP * _window(away)
        row = (np.log(x)[:, None] + away - self.logarithm[0]) / STEP
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


@dataclass(frozen=True)
class CorneredForces:
    """Unit forces as :class:`SurfaceForces`, on one face, with what keeps the faces of the ``corners`` at its
    ends free of tractions."""

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
        away = [(corner, corner.distance(self.place)) for corner in self.corners]
        return tuple((*corner.lines(x, unit), *corner.images(x, unit)) for corner, x in away)

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, k, 2, 2) at places ``z`` (e,), none of which is a force's."""
        total = self.own.displacement(z)
        for lines in self._lines:
            for line in lines:
                total = total + _parted(line.displacement(z), len(self.place))
        return total

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, k, 2, 2) at places ``z`` (e,) of the surface with outward ``normal`` and
        ``curvature`` (e,); none is left on the straight faces of a corner by the forces and this corner."""
        for corner in self.corners:
            z = corner.off_tip(z, normal)
        total = self.own.traction(z, normal, curvature)
        cleared = [corner.cleared(z, normal) for corner in self.corners]
        for _, adjacent in cleared:
            total[adjacent] = 0.0
        for (own, adjacent), lines in zip(cleared, self._lines, strict=True):
            off = ~(own | adjacent)
            if off.any():
                for line in lines:
                    total[off] += _parted(line.traction(z[off], normal[off], curvature[off]), len(self.place))
        return total


Forces: TypeAlias = SurfaceForces | CorneredForces


def _parted(values: FloatArray, count: int) -> FloatArray:
    """Values (e, c, 2k) by all of ``count`` forces as (e, k, c, 2)."""
    return np.moveaxis(values.reshape(*values.shape[:2], count, 2), 2, 1)


def _window(apart: FloatArray) -> FloatArray:
    """How much of forces (...) so far along a face, in the logarithm, is integrated as seen from nearby."""
    return _step((np.abs(apart) - INNER) / (OUTER - INNER))


def _step(way: FloatArray) -> FloatArray:
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
