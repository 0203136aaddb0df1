"""Near-field displacements and stresses in a body under the pressures and tractions of a contact grid.

Integrals along the contact use Gauss quadrature on each interval, with more points close to it. Where these
are depends on the points of the body and the grid only, which a path leaves as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import AnyArray, BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import RULE
from mlsanm_cli.contact.response.loaded_intervals import (
    Intervals,
    close_matrix,
    feet,
    halves,
    inside,
)
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.near_field import (
    BATCH_SIZE,
    NO_PAIRS,
    ComplexArray,
    PointForceField,
    SurfaceForces,
    as_complex,
)
from mlsanm_cli.records import dataclass

GRID_POINT_DISTANCE = 2.0
"""Intervals farther away than this many of their lengths are integrated with the grid's quadrature points."""
FAR_DISTANCE, FAR_SAMPLES, DISTANT_SAMPLES = 1.0 / 6.0, 48, 12
"""Beyond FAR_DISTANCE ranges FAR_SAMPLES samples represent all pressures, to 1e-7; beyond one range
DISTANT_SAMPLES samples do."""
MAX_INTERVALS = 100
"""Largest number of intervals that are treated individually when near."""
MAX_KEPT_PAIRS = 150_000
"""Largest number of pairs of a point and a force for which unit fields are kept (12 MB), divided by that of
contacts."""
TIP_INSET = 2e-3
"""Points closer to a corner's tip than this fraction of its faces are shifted inside by as much."""


@dataclass(frozen=True)
class _Group:
    """Points ``z`` (e,), by number ``some`` (e,), at which intervals ``span`` act by ``sources`` (k,): forces
    at their quadrature points, distributed by ``shares`` (k, q i) and turned by ``image`` (k, 2, 2) if there
    are any, but for pairs ``left_out`` (e, k)."""

    some: IntArray
    z: ComplexArray
    span: slice
    sources: SurfaceForces
    shares: FloatArray | None = None
    left_out: BoolArray = field(default_factory=lambda: NO_PAIRS)
    image: FloatArray | None = None

    @cached_property
    def kept(self) -> FloatArray:
        """:meth:`fields` at all points, kept."""
        return self.fields(slice(None))

    def fields(self, part: slice) -> FloatArray:
        """Displacements and stresses (5, e, 2k) at some points by unit forces x, then y."""
        both = (self.sources.displacements, self.sources.stresses)
        return np.concatenate([one(self.z[part], self.left_out[part]) for one in both])

    def add(self, forces: FloatArray, total: FloatArray, keep: bool) -> None:
        """Add displacements and stresses due to ``forces`` (q, i, 2, c) to the ``total`` (5, ., c)."""
        acting = forces[:, self.span].reshape(-1, *forces.shape[2:])
        if not acting.any():
            return
        if self.shares is not None:
            acting = (self.shares @ acting.reshape(len(acting), -1)).reshape(-1, *acting.shape[1:])
        if self.image is not None:
            acting = np.einsum("kfd,kdc->kfc", self.image, acting)
        acting = acting.transpose(1, 0, 2).reshape(-1, acting.shape[2])
        step = len(self.z) if keep else BATCH_SIZE // len(self.sources.place) + 1
        for first in range(0, len(self.z), step):
            part = slice(first, first + step)
            total[:, self.some[part]] += (self.kept if keep else self.fields(part)) @ acting


@dataclass(frozen=True)
class NearFields:
    """Displacements and stresses at fixed points ``z`` (e,) of a body for any pressures and tractions of a
    contact: by ``groups`` of points and intervals, with images behind walls, by the matrix ``close`` (5e, 2m)
    of intervals next to a point, and by forces along the faces of corners. With n images at planes of
    symmetry, ``z`` (e + n e,) are these points and their images. ``keeps`` unit fields if they are few."""

    intervals: Intervals
    z: ComplexArray
    groups: tuple[_Group, ...]
    close: sparse.csr_array
    keeps: bool

    @classmethod
    def at(
        cls, grid: ContactGrid, kernel: PointForceField, slave: bool, z: ComplexArray, contacts: int = 1
    ) -> NearFields:
        """The fields at points ``z`` (e,) of one of the bodies, in a scene with a number of ``contacts``."""
        for corner in grid.corners_of(slave):
            # At the tip itself the fields of force densities along the faces are undefined.
            at_tip = np.abs(z - corner.tip) < TIP_INSET * corner.length
            z = np.where(at_tip, corner.tip + TIP_INSET * corner.length * corner.bisector, z)
        z = np.concatenate([z, *(image.points(z) for image in grid.images_of(slave))])
        intervals, within = Intervals.of(grid, slave, kernel), inside(grid, slave, z)
        every, whole = np.arange(len(z)), slice(0, len(intervals.steps))
        groups, pairs = list[_Group](), list[tuple[AnyArray, ...]]()
        _arrange(intervals, within, every, whole, groups, pairs)
        close = close_matrix(intervals, len(z), pairs)
        for corner in grid.corners_of(slave):
            groups.extend(_images(intervals, corner, z, every, whole))
        count = sum(len(group.z) * len(group.sources.place) for group in groups)
        return cls(intervals, z, tuple(groups), close, count * contacts <= MAX_KEPT_PAIRS)

    def __call__(self, pressure: FloatArray, traction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacements (e, 2, c) and stresses (e, 3, c) due to nodal ``pressure`` and ``traction`` (m, c)
        acting on the slave; those of the master have opposite sign."""
        grid, slave, columns = self.intervals.grid, self.intervals.slave, pressure.shape[1]
        pressure, traction = grid.deviation(pressure, 0), grid.deviation(traction, 1)
        forces, images = self.intervals.forces(pressure, traction), grid.images_of(slave)
        close = np.asarray(self.close @ np.concatenate([pressure, traction]))
        total = close.reshape(5, len(self.z), columns)
        for group in self.groups:
            group.add(forces, total, self.keeps)
        displacement, stress = (part.transpose(1, 0, 2) for part in np.split(total, [2]))
        for corner in grid.corners_of(slave):
            away = corner.distance(self.intervals.place.ravel())
            both = corner.with_images(away, forces.reshape(-1, 2, columns), images)
            for line in corner.face_forces(*both):
                displacement += line.displacement(self.z)
                stress += line.stress(self.z)
        if not images:
            return displacement, stress
        own, *others = zip(*(np.split(one, 1 + len(images)) for one in (displacement, stress)), strict=True)
        for image, (moved, stressed) in zip(images, others, strict=True):
            own = own[0] + image.matrix.T @ moved, own[1] + image.stress_matrix @ stressed
        return own[0], own[1]


def _images(
    intervals: Intervals, corner: Corner, z: ComplexArray, some: IntArray, span: slice
) -> Iterator[_Group]:
    """Groups of points ``some`` for the images of intervals ``span`` behind the wall of a ``corner``, as in
    :func:`_arrange`."""
    sources, shares = intervals.of_samples(span, FAR_SAMPLES)
    found = corner.mirrored(corner.distance(sources.place))
    if found is None or not len(some):
        return
    few, image = found
    near = np.abs(z[some, None] - few.place).min(axis=1) <= FAR_DISTANCE * intervals.extent(span)
    if not near.all():
        yield _Group(some[~near], z[some[~near]], span, few, shares, image=image)
    if span.stop - span.start > MAX_INTERVALS:
        for half in halves(span):
            yield from _images(intervals, corner, z, some[near], half)
    elif near.any():
        whole = corner.mirrored(corner.distance(intervals.of_points(span).place))
        assert whole is not None
        yield _Group(some[near], z[some[near]], span, whole[0], image=whole[1])


def _arrange(
    intervals: Intervals,
    z: ComplexArray,
    some: IntArray,
    span: slice,
    groups: list[_Group],
    pairs: list[tuple[AnyArray, ...]],
) -> None:
    """Add the groups of points ``some`` for the intervals ``span``, and the ``pairs`` of a point, an interval
    next to it, and the closest place on its chord as a fraction. From afar few samples represent all
    pressures; nearer, those of each half of the intervals, recursively."""
    close, steps = intervals.of_samples(span, FAR_SAMPLES), intervals.steps[span]
    away = np.abs(z[some, None] - close[0].place).min(axis=1) / intervals.extent(span)
    near, distant = away <= FAR_DISTANCE, away > 1.0
    for chosen, count in ((distant & ~near, DISTANT_SAMPLES), (~distant & ~near, FAR_SAMPLES)):
        if chosen.any():
            seen = close if count == FAR_SAMPLES else intervals.of_samples(span, count)
            groups.append(_Group(some[chosen], z[some[chosen]], span, *seen))
    adjacent = some[near]
    if not len(adjacent):
        return
    if len(steps) > MAX_INTERVALS:
        for half in halves(span):
            _arrange(intervals, z, adjacent, half, groups, pairs)
        return
    ends = intervals.grid.facing.side(intervals.ends[span.start : span.stop + 1], intervals.slave)[0]
    sources = intervals.of_points(span)
    for few in np.array_split(adjacent, 1 + len(adjacent) * len(sources.place) // BATCH_SIZE):
        foot = feet(z[few], ends[:-1], np.diff(ends))
        beside = np.abs(z[few, None] - (ends[:-1] + foot * np.diff(ends))) < GRID_POINT_DISTANCE * steps
        groups.append(_Group(few, z[few], span, sources, left_out=np.tile(beside, len(RULE))))
        row, interval = np.nonzero(beside)
        pairs.append((few[row], z[few[row]], span.start + interval, foot[beside]))


def adjacent_traction(
    grid: ContactGrid,
    kernel: PointForceField,
    slave: bool,
    surface: Surface,
    pressure: FloatArray,
    traction: FloatArray,
) -> FloatArray:
    """Near-field tractions (b, 2) at the nodes of a body's surface due to nodal ``pressure`` and ``traction``
    (m,) on the slave, without the applied tractions themselves."""
    pressure, traction = grid.deviation(pressure, 0), grid.deviation(traction, 1)
    z = as_complex(surface.curve.points(surface.arc_length))
    curvature = surface.curve.curvature(surface.arc_length)
    normal, tangent = grid.spreads
    on = np.stack(np.split(normal @ pressure + tangent @ traction, 2), axis=1)
    found = grid.forces(kernel, slave).traction(z, as_complex(surface.normal), curvature)
    return np.asarray(np.einsum("ekcd,kd->ec", found, on))
