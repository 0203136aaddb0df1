"""Near-field displacements and stresses in a body under the pressures and tractions of a contact grid.

Integrals along the contact use Gauss quadrature on each interval, with more points close to it; on intervals
next to the point the arc length is substituted by s0 + d sinh(v), which removes the nearby pole (Johnston and
Elliott 2005, doi:10.1002/nme.1208). Where these are depends on the points of the body and the grid only,
which a path leaves as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import AnyArray, BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import RULE, chebyshev, lagrange
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.near_field import (
    BATCH_SIZE,
    SURFACE_INSET,
    ComplexArray,
    PointForceField,
    SurfaceForces,
    as_real,
)
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

SHARES = np.array([share for share, _ in RULE])
"""Quadrature points (q,) as fractions of their interval."""
GRID_POINT_DISTANCE = 2.0
"""Intervals farther away than this many of their lengths are integrated with the grid's quadrature points."""
GAUSS_POINTS = ((0.0, 32), (0.05, 12), (0.5, 6))
"""Distance in interval lengths, and number of Gauss points from there on, for nearby intervals."""
NEWTON_STEPS = 3
"""Newton steps to the closest point of the surface."""
FAR_DISTANCE, FAR_SAMPLES = 1.0 / 6.0, 48
"""Beyond FAR_DISTANCE ranges FAR_SAMPLES samples represent all pressures, to 1e-7."""
MAX_INTERVALS = 100
"""Largest number of intervals that are treated individually when near."""
MAX_KEPT_PAIRS = 150_000
"""Largest number of pairs of a point and a force for which unit fields are kept (12 MB), divided by that of
contacts."""
TIP_INSET = 2e-3
"""Points closer to a corner's tip than this fraction of its faces are shifted inside by as much."""


@dataclass(frozen=True)
class Intervals:
    """The intervals (i,) between the ``ends`` (i + 1,) of a contact, as they load one body, and at their
    quadrature points ``place`` and ``inward`` normal (q, i), and directions of both values (q, i, 2)."""

    grid: ContactGrid
    slave: bool
    kernel: PointForceField
    ends: FloatArray
    place: ComplexArray
    inward: ComplexArray
    directions: tuple[FloatArray, FloatArray]

    @classmethod
    def of(cls, grid: ContactGrid, slave: bool, kernel: PointForceField) -> Intervals:
        """The intervals of a grid."""
        ends = grid.hats.ends
        s = ends[:-1] + SHARES[:, None] * np.diff(ends)
        place, inward, both = grid.facing.side_and_directions(s.ravel(), slave)
        normal, tangent = (one.reshape(*s.shape, 2) for one in both)
        at_points = place.reshape(s.shape), inward.reshape(s.shape), (normal, tangent)
        return cls(grid, slave, kernel, ends, *at_points)

    @property
    def steps(self) -> FloatArray:
        """Lengths (i,) of the intervals."""
        return np.diff(self.ends)

    def forces(self, *values: FloatArray) -> FloatArray:
        """Forces (q, i, 2, c) at the quadrature points for nodal pressures and tractions (m, c)."""
        first, last = self.grid.hats.whole
        beyond, part = ((int(not first), int(not last)), (0, 0)), SHARES[:, None, None]
        total = np.zeros((*self.place.shape, 2, values[0].shape[1]))
        for direction, one in zip(self.directions, (np.pad(one, beyond) for one in values), strict=True):
            total += direction[..., None] * ((1.0 - part) * one[:-1] + part * one[1:])[:, :, None]
        length = np.array([weight for _, weight in RULE])[:, None] * self.steps
        return np.asarray(length[:, :, None, None] * total)

    def sources(self, place: ComplexArray, inward: ComplexArray) -> SurfaceForces:
        """Unit forces on the body at given points."""
        return SurfaceForces(self.kernel, place, inward, self.grid.centers[0 if self.slave else 1])

    def of_samples(self, span: slice) -> tuple[SurfaceForces, FloatArray]:
        """Unit forces at samples, and the shares (k, q i) in them of forces at the quadrature points of some
        intervals, which they represent from afar."""
        starts, steps = self.ends[:-1][span], self.steps[span]
        samples = chebyshev(float(self.ends[span.start]), float(self.ends[span.stop]), FAR_SAMPLES)
        shares = lagrange((starts + SHARES[:, None] * steps).ravel(), samples)
        return self.sources(*self.grid.facing.side(samples, self.slave)), np.ascontiguousarray(shares.T)

    def nearest(
        self, z: ComplexArray, s: FloatArray, within: tuple[FloatArray, FloatArray]
    ) -> tuple[FloatArray, ComplexArray, ComplexArray]:
        """Coordinates (p,) ``within`` bounds of the closest surface points, from ``s``, and these."""
        for _ in range(NEWTON_STEPS):
            place, inward = self.grid.facing.side(s, self.slave)
            # Coordinates increase along the slave, which is on the left.
            along = ((z - place) * np.conj(1j * inward)).real
            s = np.clip(s + (-along if self.slave else along), *within)
        return s, *self.grid.facing.side(s, self.slave)

    def inside(self, z: ComplexArray) -> ComplexArray:
        """The points, those on the contact surface shifted inside."""
        ends = self.ends
        near = cKDTree(as_real(self.grid.facing.side(ends, self.slave)[0])).query(as_real(z))[1]
        # On a closed surface the last interval is next to the first.
        beyond = 0.0 if self.grid.hats.period is None else 1.0
        bounds = ends[0] - beyond * (ends[-1] - ends[-2]), ends[-1] + beyond * (ends[1] - ends[0])
        around = np.concatenate([[bounds[0]], ends, [bounds[1]]])
        s, place, inward = self.nearest(z, ends[near], (around[near], around[near + 2]))
        step = self.steps[np.clip(np.searchsorted(ends, s) - 1, 0, len(ends) - 2)]
        deep, size = ((z - place) * np.conj(inward)).real, SURFACE_INSET * step
        on = np.abs(z - place) <= 2.0 * step
        return np.where(on & (deep < size), z + (size - deep) * inward, z)


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
    image: FloatArray | None = None
    left_out: BoolArray | None = None

    @cached_property
    def kept(self) -> FloatArray:
        """:meth:`fields` at all points, kept."""
        return self.fields(slice(None))

    def fields(self, part: slice) -> FloatArray:
        """Displacements and stresses (5, e, 2k) at some points by unit forces x, then y."""
        z = self.z[part]
        both = np.concatenate([self.sources.displacement(z), self.sources.stress(z)], axis=2)
        if self.left_out is not None:
            both[self.left_out[part]] = 0.0
        return both.transpose(2, 0, 3, 1).reshape(5, len(z), -1)

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
        intervals = Intervals.of(grid, slave, kernel)
        every, whole = np.arange(len(z)), slice(0, len(intervals.steps))
        groups, pairs = list[_Group](), list[tuple[AnyArray, ...]]()
        _arrange(intervals, intervals.inside(z), every, whole, groups, pairs)
        for corner in grid.corners_of(slave):
            if corner.wedge.sliding:
                _arrange(intervals, z, every, whole, groups, pairs, corner)
        count = sum(len(group.z) * len(group.sources.place) for group in groups)
        close = _close_matrix(intervals, len(z), pairs)
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


def _arrange(
    intervals: Intervals,
    z: ComplexArray,
    some: IntArray,
    span: slice,
    groups: list[_Group],
    pairs: list[tuple[AnyArray, ...]],
    corner: Corner | None = None,
) -> None:
    """Add the groups of points ``some`` for the intervals ``span``, and the ``pairs`` of a point, an interval
    next to it, and the closest place on its chord as a fraction. From afar few samples represent all
    pressures; nearer, those of each half of the intervals, recursively. With a ``corner``, for the images of
    the intervals behind its wall, which no point is next to."""

    def acting(sources: SurfaceForces) -> tuple[SurfaceForces, FloatArray | None]:
        found = None if corner is None else corner.mirrored(corner.distance(sources.place))
        return (sources, None) if found is None else found

    few, shares = intervals.of_samples(span)
    sources, image = acting(few)
    extent = float(intervals.ends[span.stop] - intervals.ends[span.start])
    away = np.abs(z[some, None] - sources.place).min(axis=1) / extent
    near = away <= FAR_DISTANCE
    if not near.all():
        groups.append(_Group(some[~near], z[some[~near]], span, sources, shares, image))
    adjacent = some[near]
    if not len(adjacent):
        return
    if span.stop - span.start > MAX_INTERVALS:
        middle = (span.start + span.stop) // 2
        for half in (slice(span.start, middle), slice(middle, span.stop)):
            _arrange(intervals, z, adjacent, half, groups, pairs, corner)
        return
    places = intervals.place[:, span].ravel(), intervals.inward[:, span].ravel()
    sources, image = acting(intervals.sources(*places))
    if corner is not None:
        groups.append(_Group(adjacent, z[adjacent], span, sources, None, image))
        return
    ends = intervals.grid.facing.side(intervals.ends[span.start : span.stop + 1], intervals.slave)[0]
    starts, chords, steps = ends[:-1], np.diff(ends), intervals.steps[span]
    for few_points in np.array_split(adjacent, 1 + len(adjacent) * len(sources.place) // BATCH_SIZE):
        way = ((z[few_points, None] - starts) * np.conj(chords)).real / np.abs(chords) ** 2
        foot: FloatArray = np.clip(way, 0.0, 1.0)
        beside = np.abs(z[few_points, None] - (starts + foot * chords)) < GRID_POINT_DISTANCE * steps
        left_out = np.tile(beside, len(RULE))
        groups.append(_Group(few_points, z[few_points], span, sources, left_out=left_out))
        row, interval = np.nonzero(beside)
        pairs.append((few_points[row], z[few_points[row]], span.start + interval, foot[beside]))


def _close_matrix(
    intervals: Intervals, count: int, pairs: Sequence[tuple[AnyArray, ...]]
) -> sparse.csr_array:
    """Displacements x and y and stresses xx, yy, xy (5 count, 2m), quantity by quantity, at ``count`` points
    due to nodal pressures and tractions on the intervals next to them: by Gauss rules, after a substitution
    that removes the peak at the closest point."""
    nodes = len(intervals.grid.hats.place)
    shape, skipped = (5 * count, 2 * nodes), int(not intervals.grid.hats.whole[0])
    if not pairs:
        return sparse.csr_array(shape)
    row, z, interval, foot = (np.concatenate(some) for some in zip(*pairs, strict=True))
    # Closest points on the surface, starting from those on the chords: a curved interval is not its chord.
    first, last, size = intervals.ends[interval], intervals.ends[interval + 1], intervals.steps[interval]
    s, place, _ = intervals.nearest(z, first + foot * size, (first, last))
    at, away = (s - first) / size, np.abs(z - place) / size
    values = np.zeros((len(row), 5, 2, 2))
    limits = [*(limit for limit, _ in GAUSS_POINTS[1:]), np.inf]
    for (least, points), beyond in zip(GAUSS_POINTS, limits, strict=True):
        chosen = np.flatnonzero((away >= least) & (away < beyond))
        nodes_of_rule, weights = np.polynomial.legendre.leggauss(points)
        for some in np.array_split(chosen, 1 + len(chosen) * points // BATCH_SIZE):
            distance, start = np.maximum(away[some], FINE_ROUND_OFF)[:, None], at[some, None]
            low, high = np.arcsinh(-start / distance), np.arcsinh((1.0 - start) / distance)
            v = 0.5 * (low + high) + 0.5 * (high - low) * nodes_of_rule
            share = np.clip(start + distance * np.sinh(v), 0.0, 1.0)
            step = size[some, None]
            length = 0.5 * weights * (high - low) * distance * np.cosh(v) * step
            places = (first[some, None] + share * step).ravel()
            *side, directions = intervals.grid.facing.side_and_directions(places, intervals.slave)
            sources, seen = intervals.sources(*side), np.repeat(z[some], points)
            both = sources.displacement_of_each(seen), sources.stress_of_each(seen)
            fields = np.concatenate(both, axis=1)
            by_kind = (fields @ np.stack(directions, axis=2)).reshape(*share.shape, 5, 2)
            hats = length[:, :, None] * np.stack([1.0 - share, share], axis=2)
            values[some] = np.einsum("pkfd,pke->pfed", by_kind, hats)
    rows = np.broadcast_to((row[:, None] + count * np.arange(5))[:, :, None, None], values.shape)
    node = interval[:, None] + np.arange(2) - skipped
    columns = np.broadcast_to((node[:, :, None] + nodes * np.arange(2))[:, None], values.shape)
    kept = np.broadcast_to(((node >= 0) & (node < nodes))[:, None, :, None], values.shape)
    return sparse.csr_array((values[kept], (rows[kept], columns[kept])), shape=shape)
