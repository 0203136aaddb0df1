"""Corners of a body near which forces act: their fields with what keeps both faces free of tractions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.mechanics.corner_faces import LOG_STEP, Face, Line, smooth_step
from mlsanm_cli.mechanics.near_field import (
    ComplexArray,
    SurfaceForces,
    traction,
)
from mlsanm_cli.mechanics.wedge import Wedge, interpolated

REACH_INWARD, REACH_OUTWARD = 9.0, 16.0
"""Extent of the forces along the faces, in the logarithm of their distance from the tip, below the nearest
source and beyond the farthest; the forces beyond act at one place."""
FADE_LENGTH = 2.0
"""Length of the logarithm over which forces along faces of limited span decrease to zero."""
FACE_TOLERANCE = 1e-9
"""Distance from a straight face, relative to its length, below which a point lies on it."""
TIP_INSET = 1e-3
"""Least distance from the tip at which tractions on curved faces are evaluated, relative to their span."""
NORMAL_TOLERANCE = 1e-2
"""Points at the tip belong to the face whose normal differs by less (1 - cosine)."""
MIN_TIP_DISTANCE = 1e-12
"""Least distance from the tip, relative to the length, at which fields are evaluated: at the tip they have no
value."""
ROUND_OFF = 1e-12
"""Densities below are none."""


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
            on = (np.abs(w.imag) <= FACE_TOLERANCE * self.length) & (w.real >= -FACE_TOLERANCE * self.length)
            on &= np.abs((normal * np.conj(face.along)).real) <= FACE_TOLERANCE
            found.append(on & (self.curved is None))
        return found[0], found[-1] if len(found) > 1 else np.zeros(len(z), dtype=bool)

    def off_tip(self, z: ComplexArray, normal: ComplexArray) -> ComplexArray:
        """Places (e,) with outward normals, those at the tip a little along their curved face."""
        least = TIP_INSET * self.span
        for face in self.curved or ():
            place, inward = face.places(np.array([least]))
            at = (np.abs(z - self.tip) < least) & (
                (normal * np.conj(-inward[0])).real > 1.0 - NORMAL_TOLERANCE
            )
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
        first, last = np.log(source.min()) - REACH_INWARD, np.log(source.max()) + REACH_OUTWARD
        logarithm = np.arange(first, min(last, np.log(self.span)), LOG_STEP)
        before = np.arange(first - LOG_STEP, first - REACH_INWARD, -LOG_STEP)
        after = np.arange(logarithm[-1] + LOG_STEP, last + REACH_INWARD, LOG_STEP)
        kept = 1.0 - smooth_step((np.log(self.span) - logarithm) / FADE_LENGTH)
        found = []
        for face, table in zip(self.faces, self.wedge.densities, strict=True):
            if np.abs(table).max() <= ROUND_OFF:
                continue  # walls at right angles need images alone
            by = interpolated(table, logarithm[:, None] - np.log(source))
            for row, more in ((0, before), (-1, after)):
                by[row] += interpolated(table, more[:, None] - np.log(source)).sum(axis=0)
            density = np.einsum("p,pkdf,kfc->pdc", LOG_STEP * kept, by, force, optimize=True)
            found.append(Line(self.wedge.kernel, face, logarithm, density, self.center))
        return tuple(found)

    def beyond_wedge(self, z: ComplexArray) -> FloatArray:
        """By how much unit forces at places ``z`` (k,) of the first face move these (k, k, 2, 2) otherwise
        than :meth:`Wedge.compliance` says, if faces are curved."""
        count, x = len(z), np.maximum(self.distance(z), MIN_TIP_DISTANCE * self.length)
        unit = np.eye(2 * count).reshape(count, 2, 2 * count)
        moved = sum(
            (line.displacement(z) for line in self.lines(x, unit)), start=np.zeros((count, 2, 2 * count))
        )
        whole = [[self.wedge.compliance(x, x, c, d) for d in (0, 1)] for c in (0, 1)]
        return np.asarray(_parted(moved, count) - np.moveaxis(np.array(whole), (0, 1), (2, 3)))


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
