"""Near-field displacements and stresses in a body under the pressures and tractions of a contact grid.

Integrals along the contact use Gauss quadrature on each interval, with more points close to it. Where these
are depends on the points of the body and the grid only, which a path leaves as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import AnyArray, BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import RULE
from mlsanm_cli.contact.response.loaded_intervals import BATCH_SIZE, Intervals, close_matrix, feet, inside
from mlsanm_cli.mechanics.near_field import (
    NO_PAIRS,
    ComplexArray,
    PointForceField,
    SurfaceForces,
    as_complex,
)

GRID_POINT_DISTANCE = 2.0
"""Intervals farther away than this many of their lengths are integrated with the grid's quadrature points."""
FAR_DISTANCE, FAR_SAMPLES, DISTANT_SAMPLES = 1.0 / 6.0, 48, 12
"""Beyond FAR_DISTANCE ranges FAR_SAMPLES samples represent all pressures, to 1e-7; beyond one range
DISTANT_SAMPLES samples do."""
MAX_INTERVALS = 100
"""Largest number of intervals that are treated individually when near."""
TIP_INSET = 2e-3
"""Points closer to a corner's tip than this fraction of its faces are shifted inside by as much."""


@dataclass(frozen=True)
class _Group:
    """Points, by number ``some`` (e,), at which intervals ``span`` act by ``sources`` (k,): forces at their
    quadrature points, distributed by ``shares`` (k, q i) if there are any, but for pairs ``left_out`` (e,
    k)."""

    some: IntArray
    span: slice
    sources: SurfaceForces
    shares: FloatArray | None = None
    left_out: BoolArray = field(default_factory=lambda: NO_PAIRS)

    def add(self, z: ComplexArray, forces: FloatArray, displacement: FloatArray, stress: FloatArray) -> None:
        """Add displacements and stresses (e, ., c) at points ``z`` due to ``forces`` (q, i, 2, c)."""
        acting = forces[:, self.span].reshape(-1, *forces.shape[2:])
        if not acting.any():
            return
        if self.shares is not None:
            acting = (self.shares @ acting.reshape(len(acting), -1)).reshape(-1, *acting.shape[1:])
        seen = z[self.some]
        displacement[self.some] += self.sources.displacement_by(acting, seen, self.left_out)
        stress[self.some] += self.sources.stress_by(acting, seen, self.left_out)


@dataclass(frozen=True)
class NearFields:
    """Displacements and stresses at fixed points ``z`` (e,) of a body for any pressures and tractions of a
    contact: by ``groups`` of points and intervals, by the matrix ``close`` (5e, 2m) of intervals next to a
    point, and by corners. ``inside`` (e,) are the points, those on the contact surface shifted inside."""

    intervals: Intervals
    z: ComplexArray
    inside: ComplexArray
    groups: tuple[_Group, ...]
    close: sparse.csr_array

    @classmethod
    def at(cls, grid: ContactGrid, kernel: PointForceField, slave: bool, z: ComplexArray) -> NearFields:
        """The fields at points ``z`` (e,) of one of the bodies."""
        for corner in grid.corners_of(slave):
            # At the tip itself the fields of force densities along the faces are undefined.
            at_tip = np.abs(z - corner.tip) < TIP_INSET * corner.length
            z = np.where(at_tip, corner.tip + TIP_INSET * corner.length * corner.bisector, z)
        intervals, within = Intervals.of(grid, slave, kernel), inside(grid, slave, z)
        groups, pairs = list[_Group](), list[tuple[AnyArray, ...]]()
        _arrange(intervals, within, np.arange(len(z)), slice(0, len(intervals.steps)), groups, pairs)
        return cls(intervals, z, within, tuple(groups), close_matrix(intervals, len(z), pairs))

    def __call__(self, pressure: FloatArray, traction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Displacements (e, 2, c) and stresses (e, 3, c) due to nodal ``pressure`` and ``traction`` (m, c)
        acting on the slave; those of the master have opposite sign."""
        grid, count, columns = self.intervals.grid, len(self.z), pressure.shape[1]
        pressure, traction = grid.deviation(pressure), grid.deviation(traction)
        displacement, stress = np.zeros((count, 2, columns)), np.zeros((count, 3, columns))
        forces = self.intervals.forces(pressure, traction)
        for group in self.groups:
            group.add(self.inside, forces, displacement, stress)
        close = np.asarray(self.close @ np.concatenate([pressure, traction])).reshape(5, count, columns)
        displacement += close[:2].transpose(1, 0, 2)
        stress += close[2:].transpose(1, 0, 2)
        self._add_corners(pressure, traction, displacement, stress)
        return displacement, stress

    def _add_corners(
        self, pressure: FloatArray, traction: FloatArray, displacement: FloatArray, stress: FloatArray
    ) -> None:
        """Add what corners change."""
        grid, slave, z = self.intervals.grid, self.intervals.slave, self.z
        corners = grid.corners_of(slave)
        if not corners:
            return
        close = replace(grid, count=FAR_SAMPLES)
        place, force = grid.places(slave), _on_points(grid, pressure, traction)
        few, on = close.facing.side(close.samples, slave)[0], _on_samples(close, pressure, traction)
        for corner in corners:
            for line in corner.face_forces(corner.distance(place), force):
                displacement += line.displacement(z)
                stress += line.stress(z)
            whole = corner.images(corner.distance(place), force)
            for image, distant in zip(whole, corner.images(corner.distance(few), on), strict=True):
                # Images are near only for points close to the wall.
                away = np.abs(z[:, None] - distant.places.place).min(axis=1) / (grid.last - grid.first)
                for some, one in ((away > FAR_DISTANCE, distant), (away <= FAR_DISTANCE, image)):
                    displacement[some] += one.displacement(z[some])
                    stress[some] += one.stress(z[some])


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
    starts, steps = intervals.ends[:-1][span], intervals.steps[span]
    close = intervals.of_samples(span, FAR_SAMPLES)
    extent = float(starts[-1] + steps[-1] - starts[0])
    away = np.abs(z[some, None] - close[0].place).min(axis=1, initial=np.inf) / extent
    near, distant = away <= FAR_DISTANCE, away > 1.0
    for chosen, count in ((distant & ~near, DISTANT_SAMPLES), (~distant & ~near, FAR_SAMPLES)):
        if chosen.any():
            seen = close if count == FAR_SAMPLES else intervals.of_samples(span, count)
            groups.append(_Group(some[chosen], span, *seen))
    adjacent = some[near]
    if not len(adjacent):
        return
    if len(steps) > MAX_INTERVALS:
        middle = (span.start + span.stop) // 2
        for half in (slice(span.start, middle), slice(middle, span.stop)):
            _arrange(intervals, z, adjacent, half, groups, pairs)
        return
    ends = intervals.grid.facing.side(intervals.ends[span.start : span.stop + 1], intervals.slave)[0]
    sources = intervals.of_points(span)
    for few in np.array_split(adjacent, 1 + len(adjacent) * len(sources.place) // BATCH_SIZE):
        foot = feet(z[few], ends[:-1], np.diff(ends))
        beside = np.abs(z[few, None] - (ends[:-1] + foot * np.diff(ends))) < GRID_POINT_DISTANCE * steps
        groups.append(_Group(few, span, sources, left_out=np.tile(beside, len(RULE))))
        row, interval = np.nonzero(beside)
        pairs.append((few[row], z[few[row]], span.start + interval, foot[beside]))


def _on_points(grid: ContactGrid, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """Forces (g, 2, c) at the hats' points for nodal ``pressure`` and ``traction`` (m, c)."""
    (normal, tangent), unit = grid.directions, grid.hats.integrals.T
    across, along = unit @ pressure, unit @ traction
    return np.asarray(normal[:, :, None] * across[:, None] + tangent[:, :, None] * along[:, None])


def _on_samples(grid: ContactGrid, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """Forces (k, 2, ...) at the samples that represent nodal values (m, ...) from afar."""
    normal, tangent = grid.spreads
    return np.stack(np.split(normal @ pressure + tangent @ traction, 2), axis=1)


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
    pressure, traction = grid.deviation(pressure), grid.deviation(traction)
    if grid.corners_of(slave):
        # Only a smooth remainder is left near corners.
        z = as_complex(surface.curve.points(surface.arc_length))
        on = _on_samples(grid, pressure, traction)
        curvature = surface.curve.curvature(surface.arc_length)
        found = grid.forces(kernel, slave).traction(z, as_complex(surface.normal), curvature)
        return np.asarray(np.einsum("ekcd,kd->ec", found, on))
    intervals = Intervals.of(grid, slave, kernel)
    z = as_complex(surface.curve.points(surface.arc_length))
    curvature = surface.curve.curvature(surface.arc_length)
    total = np.zeros((len(z), 2))
    forces = intervals.forces(pressure[:, None], traction[:, None])[..., 0]
    for place, inward, force in zip(intervals.place, intervals.inward, forces, strict=True):
        loaded = force.any(axis=1)
        sources = intervals.sources(place[loaded], inward[loaded])
        found = sources.traction(z, as_complex(surface.normal), curvature)
        total += np.einsum("eicd,id->ec", found, force[loaded])
    return total
