"""The intervals of a contact grid as they load one body, and their integrals at points close to them. On
intervals close to the point the arc length is substituted by s0 + d sinh(v), which removes the nearby pole
(Johnston and Elliott 2005, doi:10.1002/nme.1208)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import AnyArray, FloatArray, IntArray
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import RULE, chebyshev, lagrange
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

GAUSS_POINTS = ((0.0, 32), (0.05, 12), (0.5, 6))
"""Distance in interval lengths, and number of Gauss points from there on, for nearby intervals."""
NEWTON_STEPS = 3
"""Newton steps to the closest point of the surface."""


@dataclass(frozen=True)
class Intervals:
    """The intervals (i,) between the ``ends`` (i + 1,) of a contact, as they load one body, and at the
    quadrature points (q,) of each: ``share`` (q,) of the interval, ``place`` and ``inward`` normal (q, i),
    directions of pressures and of tractions (q, i, 2)."""

    grid: ContactGrid
    slave: bool
    kernel: PointForceField
    ends: FloatArray
    share: FloatArray
    place: ComplexArray
    inward: ComplexArray
    normal: FloatArray
    tangent: FloatArray

    @classmethod
    def of(cls, grid: ContactGrid, slave: bool, kernel: PointForceField) -> Intervals:
        """The intervals of a grid."""
        ends, share = grid.hats.ends, np.array([share for share, _ in RULE])
        s = ends[:-1] + share[:, None] * np.diff(ends)
        place, inward, (normal, tangent) = grid.facing.side_and_directions(s.ravel(), slave)
        place, inward = place.reshape(s.shape), inward.reshape(s.shape)
        directions = normal.reshape(*s.shape, 2), tangent.reshape(*s.shape, 2)
        return cls(grid, slave, kernel, ends, share, place, inward, *directions)

    @property
    def steps(self) -> FloatArray:
        """Lengths (i,) of the intervals."""
        return np.diff(self.ends)

    def extent(self, span: slice) -> float:
        """Distance from the start of the first to the end of the last of some intervals."""
        return float(self.ends[span.stop] - self.ends[span.start])

    def forces(self, pressure: FloatArray, traction: FloatArray) -> FloatArray:
        """Forces (q, i, 2, c) at the quadrature points for nodal ``pressure`` and ``traction`` (m, c)."""
        first, last = self.grid.hats.whole
        beyond, part = ((int(not first), int(not last)), (0, 0)), self.share[:, None, None]
        across, along = (
            (1.0 - part) * one[:-1] + part * one[1:]
            for one in (np.pad(pressure, beyond), np.pad(traction, beyond))
        )
        length = np.array([weight for _, weight in RULE])[:, None] * self.steps
        on = self.normal[..., None] * across[:, :, None] + self.tangent[..., None] * along[:, :, None]
        return np.asarray(length[:, :, None, None] * on)

    def sources(self, place: ComplexArray, inward: ComplexArray) -> SurfaceForces:
        """Unit forces on the body at given points."""
        return SurfaceForces(self.kernel, place, inward, self.grid.centers[0 if self.slave else 1])

    def of_points(self, span: slice) -> SurfaceForces:
        """Unit forces (q i,) at the quadrature points of some intervals."""
        return self.sources(self.place[:, span].ravel(), self.inward[:, span].ravel())

    def of_samples(self, span: slice, count: int) -> tuple[SurfaceForces, FloatArray]:
        """Unit forces at ``count`` samples, and the shares (k, q i) in them of forces at the quadrature
        points of some intervals, which they represent from afar."""
        starts, steps = self.ends[:-1][span], self.steps[span]
        samples = chebyshev(float(self.ends[span.start]), float(self.ends[span.stop]), count)
        shares = lagrange((starts + self.share[:, None] * steps).ravel(), samples)
        return self.sources(*self.grid.facing.side(samples, self.slave)), np.ascontiguousarray(shares.T)


def halves(span: slice) -> tuple[slice, slice]:
    """The first and the second half of a range."""
    middle = (span.start + span.stop) // 2
    return slice(span.start, middle), slice(middle, span.stop)


def feet(z: ComplexArray, starts: ComplexArray, chords: ComplexArray) -> FloatArray:
    """Closest points (e, i) on the chords of all intervals, as fractions from 0 to 1."""
    way = ((z[:, None] - starts) * np.conj(chords)).real / np.abs(chords) ** 2
    return np.asarray(np.clip(way, 0.0, 1.0))


def _nearest(
    grid: ContactGrid, slave: bool, z: ComplexArray, s: FloatArray, within: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Coordinates (p,) of the closest surface points ``within`` bounds (p,), starting from ``s``, with points
    and inward normals (p,)."""
    for _ in range(NEWTON_STEPS):
        place, inward = grid.facing.side(s, slave)
        # Coordinates increase along the slave, which is on the left.
        along = ((z - place) * np.conj(1j * inward)).real
        s = np.clip(s + (-along if slave else along), *within)
    return s, *grid.facing.side(s, slave)


def inside(grid: ContactGrid, slave: bool, z: ComplexArray) -> ComplexArray:
    """The points, those on the contact surface shifted inside."""
    ends = grid.hats.ends
    near = cKDTree(as_real(grid.facing.side(ends, slave)[0])).query(as_real(z))[1]
    # On a closed surface the last interval is next to the first.
    beyond = 0.0 if grid.hats.period is None else 1.0
    bounds = ends[0] - beyond * (ends[-1] - ends[-2]), ends[-1] + beyond * (ends[1] - ends[0])
    around = np.concatenate([[bounds[0]], ends, [bounds[1]]])
    s, place, inward = _nearest(grid, slave, z, ends[near], (around[near], around[near + 2]))
    step = np.diff(ends)[np.clip(np.searchsorted(ends, s) - 1, 0, len(ends) - 2)]
    deep, size = ((z - place) * np.conj(inward)).real, SURFACE_INSET * step
    on = np.abs(z - place) <= 2.0 * step
    return np.where(on & (deep < size), z + (size - deep) * inward, z)


@cache
def _rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss points and weights on (-1, 1)."""
    return np.polynomial.legendre.leggauss(count)


def close_matrix(intervals: Intervals, count: int, pairs: Sequence[tuple[AnyArray, ...]]) -> sparse.csr_array:
    """Displacements x and y and stresses xx, yy, xy (5 count, 2m), quantity by quantity, at ``count`` points
    due to nodal pressures and tractions on the intervals next to them."""
    nodes = len(intervals.grid.hats.place)
    shape, skipped = (5 * count, 2 * nodes), int(not intervals.grid.hats.whole[0])
    if not pairs:
        return sparse.csr_array(shape)
    row, z, interval, foot = (np.concatenate(some) for some in zip(*pairs, strict=True))
    # Closest points on the surface, starting from those on the chords: a curved interval is not its chord.
    first, last, size = intervals.ends[interval], intervals.ends[interval + 1], intervals.steps[interval]
    s, place, _ = _nearest(intervals.grid, intervals.slave, z, first + foot * size, (first, last))
    at, away = (s - first) / size, np.abs(z - place) / size
    values = np.zeros((len(row), 5, 2, 2))
    limits = [*(limit for limit, _ in GAUSS_POINTS[1:]), np.inf]
    for (least, points), beyond in zip(GAUSS_POINTS, limits, strict=True):
        chosen = np.flatnonzero((away >= least) & (away < beyond))
        for some in np.array_split(chosen, 1 + len(chosen) * points // BATCH_SIZE):
            values[some] = _close_integrals(
                intervals, _rule(points), z[some], interval[some], at[some], away[some]
            )
    rows = np.broadcast_to((row[:, None] + count * np.arange(5))[:, :, None, None], values.shape)
    node = interval[:, None] + np.arange(2) - skipped
    columns = np.broadcast_to((node[:, :, None] + nodes * np.arange(2))[:, None], values.shape)
    kept = np.broadcast_to(((node >= 0) & (node < nodes))[:, None, :, None], values.shape)
    return sparse.csr_array((values[kept], (rows[kept], columns[kept])), shape=shape)


def _close_integrals(
    intervals: Intervals,
    rule: tuple[FloatArray, FloatArray],
    z: ComplexArray,
    interval: IntArray,
    at: FloatArray,
    away: FloatArray,
) -> FloatArray:
    """Displacements and stresses (p, 5, 2, 2) at points due to unit values at the ends of one interval each,
    of pressure and of traction, by a Gauss ``rule`` (k,) after a substitution that removes the peak at the
    closest point."""
    distance = np.maximum(away, FINE_ROUND_OFF)[:, None]
    low, high = np.arcsinh(-at[:, None] / distance), np.arcsinh((1.0 - at[:, None]) / distance)
    v = 0.5 * (low + high) + 0.5 * (high - low) * rule[0]
    share = np.clip(at[:, None] + distance * np.sinh(v), 0.0, 1.0)
    first, step = intervals.ends[interval][:, None], intervals.steps[interval][:, None]
    length = 0.5 * rule[1] * (high - low) * distance * np.cosh(v) * step
    s = (first + share * step).ravel()
    place, inward, directions = intervals.grid.facing.side_and_directions(s, intervals.slave)
    sources, seen = intervals.sources(place, inward), np.repeat(z, len(rule[0]))
    field = np.concatenate([sources.displacement_of_each(seen), sources.stress_of_each(seen)], axis=1)
    by_kind = (field @ np.stack(directions, axis=2)).reshape(*share.shape, 5, 2)
    hats = length[:, :, None] * np.stack([1.0 - share, share], axis=2)
    return np.asarray(np.einsum("pkfd,pke->pfed", by_kind, hats))
