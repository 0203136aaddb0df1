"""Corners near which forces act: near fields with both faces free of tractions."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import chain
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.mechanics.corner_faces import LOG_STEP, Face, FaceForces, smooth_step
from mlsanm_cli.mechanics.near_field import SURFACE_INSET, ComplexArray, SurfaceForces, summed, traction
from mlsanm_cli.mechanics.symmetry import Image
from mlsanm_cli.mechanics.wedge import Wedge, interpolated
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

RANGE_BELOW, RANGE_ABOVE = 9.0, 16.0
"""Range of the forces along the faces, in the logarithm of the distance, below the nearest source and beyond
the farthest; forces beyond are lumped at the ends."""
FADE_LENGTH = 2.0
"""Logarithmic length over which forces along faces of limited span fade out."""
NORMAL_TOLERANCE = 1e-2
"""Points at the tip belong to the face whose normal agrees to this tolerance on 1 - cos."""


@dataclass(frozen=True)
class Images:
    """Forces (k, 2, c) at points outside the body."""

    places: SurfaceForces
    force: FloatArray

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, 2, c) at ``z`` (e,)."""
        return summed(self.places.displacement, z, self.force)

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, 2, c) at ``z`` (e,) on outward ``normal`` vectors (e,)."""
        return traction(summed(self.places.stress, z, self.force), normal)


@dataclass(frozen=True)
class Corner:
    """A corner of a body at ``tip``, between the two faces of a ``wedge``. ``length`` is that of the shorter
    face; forces farther from the tip than ``reach`` do not need the corner. The force densities act along the
    whole infinite wedge. If faces are ``curved``, or would cut the body, they act along the actual faces up
    to ``span``, fading out before, and their fields end at a ``center`` in the void, if any. Those of forces
    beyond its reach are left out if it ``fades``."""

    wedge: Wedge
    tip: complex
    length: float
    reach: float
    curved: tuple[Face, Face] | None = None
    span: float = np.inf
    center: complex | None = None
    fades: bool = False

    @cached_property
    def faces(self) -> tuple[Face, Face]:
        """The two faces with force densities."""
        if self.curved is not None:
            return self.curved
        one, other = self.wedge.inward
        return Face(self.tip, self.wedge.along, one), Face(self.tip, self.wedge.second, other)

    @property
    def bisector(self) -> complex:
        """Unit vector from the tip along the bisector of the body's faces."""
        middle = np.sqrt(self.wedge.along * self.wedge.other)
        return complex(middle if (middle * np.conj(self.wedge.inward[0])).real > 0.0 else -middle)

    def distance(self, z: ComplexArray) -> FloatArray:
        """Distances (e,) of points on the first face from the tip."""
        return self.faces[0].distance(z)

    def share(self, away: FloatArray) -> FloatArray:
        """Share (k,) of the densities of forces at distances ``away`` (k,); less beyond reach if it fades."""
        return smooth_step(away / self.reach - 1.0) if self.fades else np.ones(len(away))

    def reflected(self, away: FloatArray, image: Image) -> FloatArray:
        """Distances (e,) of the images of points at distances ``away`` (e,), reflected at the face's end."""
        return np.asarray(2.0 * self.distance(np.array([image.point])) - away)

    def cleared(self, z: ComplexArray, normal: ComplexArray) -> tuple[BoolArray, BoolArray]:
        """Masks (e,) of points on the first face, and on the second face freed of all tractions."""
        found = [np.zeros(len(z), dtype=bool)] * 2
        if self.curved is None:
            for number, face in enumerate(self.faces[: 1 if self.wedge.sliding or self.wedge.clamped else 2]):
                w = (z - self.tip) * np.conj(face.along)
                on = (np.abs(w.imag) <= ROUND_OFF * self.length) & (w.real >= -ROUND_OFF * self.length)
                found[number] = on & (np.abs((normal * np.conj(face.along)).real) <= ROUND_OFF)
        return found[0], found[1]

    def mirrored(self, source: FloatArray) -> tuple[SurfaceForces, FloatArray] | None:
        """Images, behind a frictionless wall, of unit forces at distances ``source`` (k,), and their
        components (k, 2, 2) per component of the forces; None without a wall."""
        if not self.wedge.sliding:
            return None
        acts = source > 0.0
        place = np.asarray(
            self.tip + np.where(acts, source, self.length) * self.wedge.second, dtype=np.complex128
        )
        inward = np.full(len(source), self.wedge.inward[1])
        return SurfaceForces(self.wedge.kernel, place, inward), acts[:, None, None] * self.wedge.image

    def sources(self, source: FloatArray, force: FloatArray) -> tuple[FaceForces | Images, ...]:
        """Densities along the faces, and images behind a wall, of forces (k, 2, c) at ``source`` (k,)."""
        found = self.mirrored(source)
        images = () if found is None else (Images(found[0], np.einsum("kfd,kdc->kfc", found[1], force)),)
        return (*self.face_forces(source, force), *images)

    def face_forces(self, source: FloatArray, force: FloatArray) -> tuple[FaceForces, ...]:
        """The force densities alone; empty without forces."""
        acting = (source > 0.0) & (force != 0.0).any(axis=(1, 2))
        if not acting.any():
            return ()
        source, force = source[acting], force[acting]
        first, last = np.log(source.min()) - RANGE_BELOW, np.log(source.max()) + RANGE_ABOVE
        logarithm = np.arange(first, min(last, np.log(self.span)), LOG_STEP)
        before = np.arange(first - LOG_STEP, first - RANGE_BELOW, -LOG_STEP)
        after = np.arange(logarithm[-1] + LOG_STEP, last + RANGE_BELOW, LOG_STEP)
        kept = 1.0 - smooth_step((np.log(self.span) - logarithm) / FADE_LENGTH)
        found = []
        for face, table in zip(self.faces, self.wedge.densities, strict=True):
            if np.abs(table).max() <= FINE_ROUND_OFF:
                continue  # walls at right angles need images alone
            by = interpolated(table, logarithm[:, None] - np.log(source))
            for row, more in ((0, before), (-1, after)):
                by[row] += interpolated(table, more[:, None] - np.log(source)).sum(axis=0)
            density = np.einsum("p,pkdf,kfc->pdc", LOG_STEP * kept, by, force, optimize=True)
            found.append(FaceForces(self.wedge.kernel, face, logarithm, density, self.center))
        return tuple(found)

    def with_images(
        self, away: FloatArray, force: FloatArray, images: Sequence[Image]
    ) -> tuple[FloatArray, FloatArray]:
        """Distances (k + i,) and shares (k + i, 2, c) with densities of forces (k, 2, c) and ``images``."""
        places = np.concatenate([away, *(self.reflected(away, image) for image in images)])
        forces = [force, *(np.einsum("fd,kdc->kfc", image.matrix, force) for image in images)]
        return places, np.concatenate(forces) * self.share(places)[:, None, None]

    def beyond_wedge(
        self, z: ComplexArray, images: Sequence[Image] = (), seen: ComplexArray | None = None
    ) -> FloatArray:
        """Displacements (e, k, 2, 2) of points ``seen`` (e,) of the first face, by default those of the
        forces, due to unit forces at points ``z`` (k,) there, minus :meth:`Wedge.compliance`, for curved
        faces; both with their ``images``."""
        seen = z if seen is None else seen
        count, least = len(z), FINE_ROUND_OFF * self.length
        x, away = np.maximum(self.distance(z), least), np.maximum(self.distance(seen), least)
        sources, forces = self.with_images(x, _unit(count), images)
        lines, total = self.face_forces(sources, forces), np.zeros((len(seen), 2, 2 * count))
        for image in (None, *images):
            at = away if image is None else self.reflected(away, image)
            places = seen if image is None else image.points(seen)
            moved = sum((line.displacement(places) for line in lines), start=np.zeros_like(total))
            whole = [[self.wedge.compliance(at, sources, c, d) for d in (0, 1)] for c in (0, 1)]
            moved -= np.einsum("cdes,sdf->ecf", np.array(whole), forces)
            total += moved if image is None else np.einsum("dc,edf->ecf", image.matrix, moved)
        return _parted(total, count)


@dataclass(frozen=True)
class CorneredForces:
    """Unit forces on a face with the densities of the ``corners`` at its ends, and all their ``images``."""

    own: SurfaceForces
    corners: tuple[Corner, ...]
    images: tuple[Image, ...] = ()

    @property
    def place(self) -> ComplexArray:
        """Points (k,) of the forces."""
        return self.own.place

    @cached_property
    def _terms(self) -> tuple[tuple[FaceForces | Images, ...], ...]:
        """Force densities and images behind walls at other angles, per corner."""
        unit, corners = _unit(len(self.place)), self.corners
        both = (one.with_images(one.distance(self.place), unit, self.images) for one in corners)
        return tuple(one.sources(*each) for one, each in zip(corners, both, strict=True))

    def displacement(self, z: ComplexArray) -> FloatArray:
        """Displacements (e, k, 2, 2) at points ``z`` (e,) other than those of the forces."""
        total = np.zeros((len(z), len(self.place), 2, 2))
        for image in (None, *self.images):
            at = z if image is None else image.points(z)
            moved = self.own.displacement(at)
            for line in chain.from_iterable(self._terms):
                moved = moved + _parted(line.displacement(at), len(self.place))
            total += moved if image is None else image.matrix.T @ moved
        return total

    def traction(self, z: ComplexArray, normal: ComplexArray, curvature: FloatArray) -> FloatArray:
        """Tractions (e, k, 2, 2) at surface points ``z`` (e,); exactly zero on a corner's straight faces by
        the forces with this corner's densities."""
        for corner in self.corners:
            # Points at the tip are shifted along their curved face.
            least = SURFACE_INSET * corner.span
            for face in corner.curved or ():
                place, inward = face.places(np.array([least]))
                same = (normal * np.conj(-inward[0])).real > 1.0 - NORMAL_TOLERANCE
                z = np.where((np.abs(z - corner.tip) < least) & same, corner.tip + place[0], z)
        total = np.zeros((len(z), len(self.place), 2, 2))
        for image in (None, *self.images):
            at, outward = (z, normal) if image is None else (image.points(z), image.directions(normal))
            turn = np.eye(2) if image is None else image.matrix.T
            direct = turn @ self.own.traction(at, outward, curvature)
            for corner, lines in zip(self.corners, self._terms, strict=True):
                # Densities cancel the tractions on second faces.
                away = corner.distance(self.place)
                share = corner.share(away if image is None else corner.reflected(away, image))
                direct[corner.cleared(z, normal)[1]] *= (1.0 - share)[:, None, None]
                # What acts along the faces makes no tractions on these.
                off = ~np.logical_or(*corner.cleared(at, outward))
                if off.any():
                    for line in lines:
                        found = line.traction(at[off], outward[off], curvature[off])
                        total[off] += turn @ _parted(found, len(self.place))
            total += direct
        return total


Forces: TypeAlias = SurfaceForces | CorneredForces


def _unit(count: int) -> FloatArray:
    """All unit forces (k, 2, 2k) at ``count`` points."""
    return np.eye(2 * count).reshape(count, 2, 2 * count)


def _parted(values: FloatArray, count: int) -> FloatArray:
    """Values (e, c, 2k) by all of ``count`` forces as (e, k, c, 2)."""
    return np.moveaxis(values.reshape(*values.shape[:2], count, 2), 2, 1)
