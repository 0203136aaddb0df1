"""Near-field displacements and stresses in a body under the pressures and tractions of a contact grid.

Integrals along the contact use Gauss quadrature; on intervals close to the observation point after the
substitution s0 + d sinh(v) for the arc length, which removes the nearby pole (Johnston and Elliott 2005,
doi:10.1002/nme.1208).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from mlsanm_cli.arrays import AnyArray, BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import RULE
from mlsanm_cli.contact.geometry.panels import chebyshev, lagrange
from mlsanm_cli.mechanics.near_field import ComplexArray, PointForceField, SurfaceForces, as_complex, as_real
from mlsanm_cli.startup import cKDTree

GRID_POINT_DISTANCE = 2.0
"""Intervals farther away than this many of their lengths are integrated with the grid's quadrature points."""
GAUSS_POINTS = ((0.0, 32), (0.05, 12), (0.5, 6))
"""Distance in interval lengths, and number of Gauss points from there on, for nearby intervals."""
SURFACE_INSET = 1e-3
"""Points closer to the surface than this fraction of the interval are shifted inside by as much, as fields
jump on it."""
FAR_DISTANCE, FAR_SAMPLES, DISTANT_SAMPLES = 1.0 / 6.0, 48, 12
"""Beyond FAR_DISTANCE ranges FAR_SAMPLES samples represent all pressures, to 1e-7; beyond one range
DISTANT_SAMPLES samples do."""
NEWTON_STEPS = 3
"""Newton steps to the closest point of the surface."""
MAX_INTERVALS = 100
"""Largest number of intervals that are treated individually when near."""
TIP_INSET = 2e-3
"""Points closer to a corner's tip than this fraction of its faces are shifted inside by as much."""
BATCH_SIZE = 100_000
"""Point-source pairs processed at once, to limit memory."""


@dataclass(frozen=True)
class _Loads:
    """The loaded intervals of a contact, as they act on one body.

    ``pressure`` and ``traction`` (2, i, c) are given at both ``ends`` (2, i) of the intervals. At the
    quadrature points (q,) of each interval: ``place`` and ``inward`` normal (q, i), ``force`` (q, i, 2, c).
    """

    grid: ContactGrid
    slave: bool
    kernel: PointForceField
    ends: FloatArray
    pressure: FloatArray
    traction: FloatArray
    place: ComplexArray
    inward: ComplexArray
    force: FloatArray

    @classmethod
    def of(
        cls,
        grid: ContactGrid,
        slave: bool,
        kernel: PointForceField,
        pressure: FloatArray,
        traction: FloatArray,
    ) -> _Loads:
        """The loads of nodal ``pressure`` and ``traction`` (m, c)."""
        first, last = grid.hats.whole
        beyond = ((int(not first), int(not last)), (0, 0))
        bounds = grid.hats.ends, np.pad(pressure, beyond), np.pad(traction, beyond)
        loaded = (bounds[1] != 0.0).any(axis=1) | (bounds[2] != 0.0).any(axis=1)
        some = np.flatnonzero(loaded[:-1] | loaded[1:])
        ends, across, along = (one[np.stack([some, some + 1])] for one in bounds)
        steps, weights = ends[1] - ends[0], np.array([weight for _, weight in RULE])
        share = np.repeat([[share] for share, _ in RULE], len(steps), axis=1)
        interval = np.broadcast_to(np.arange(len(steps)), share.shape)
        nothing = np.zeros(0, dtype=np.complex128)
        bare = cls(grid, slave, kernel, ends, across, along, nothing, nothing, np.zeros(0))
        place, inward, on = bare.at(interval.ravel(), share.ravel())
        force = (weights[:, None] * steps)[:, :, None, None] * on.reshape(*share.shape, *on.shape[1:])
        return replace(
            bare, place=place.reshape(share.shape), inward=inward.reshape(share.shape), force=force
        )

    @property
    def steps(self) -> FloatArray:
        """Lengths (i,) of the intervals."""
        return np.asarray(self.ends[1] - self.ends[0])

    @property
    def extent(self) -> float:
        """Distance from the start of the first interval to the end of the last."""
        return float(self.ends[1, -1] - self.ends[0, 0])

    def halves(self) -> Iterator[_Loads]:
        """The first and the last half of the intervals."""
        middle = len(self.steps) // 2
        for first, last in ((0, middle), (middle, len(self.steps))):
            names = ("ends", "pressure", "traction", "place", "inward", "force")
            yield replace(self, **{name: getattr(self, name)[:, first:last] for name in names})

    def sources(self, place: ComplexArray, inward: ComplexArray) -> SurfaceForces:
        """Unit forces on the body at given points."""
        return SurfaceForces(self.kernel, place, inward, self.grid.centers[0 if self.slave else 1])

    def at(self, interval: IntArray, share: FloatArray) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """Points (e,) and inward normals (e,) at the fraction ``share`` of intervals (e,), and tractions (e,
        2, c) on the slave there."""
        s = self.ends[0, interval] + share * self.steps[interval]
        place, inward, (normal, tangent) = self.grid.facing.side_and_directions(s, self.slave)
        part = share[:, None]
        pressure, traction = (
            (1.0 - part) * one[0, interval] + part * one[1, interval]
            for one in (self.pressure, self.traction)
        )
        return place, inward, normal[:, :, None] * pressure[:, None] + tangent[:, :, None] * traction[:, None]

    def quadrature_forces(self) -> Iterator[tuple[SurfaceForces, FloatArray]]:
        """Unit forces at each quadrature point of all intervals, and the forces (i, 2, c) there."""
        for place, inward, force in zip(self.place, self.inward, self.force, strict=True):
            yield self.sources(place, inward), force

    def sampled(self, count: int) -> tuple[SurfaceForces, FloatArray]:
        """Unit forces at ``count`` samples, and forces (k, 2, c) there that represent the loads from afar."""
        first, rule = self.ends[0], np.array([share for share, _ in RULE])
        samples = chebyshev(float(first[0]), float(self.ends[1, -1]), count)
        shares = lagrange((first + rule[:, None] * self.steps).ravel(), samples)
        force = shares.T @ self.force.reshape(len(shares), -1)
        return self.sources(*self.grid.facing.side(samples, self.slave)), force.reshape(
            count, *self.force.shape[2:]
        )


def fields_of(
    grid: ContactGrid,
    kernel: PointForceField,
    slave: bool,
    z: ComplexArray,
    pressure: FloatArray,
    traction: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Displacements (e, 2, c) and stresses (e, 3, c) at points ``z`` (e,) of a body due to nodal ``pressure``
    and ``traction`` (m, c) acting on the slave; those of the master have opposite sign."""
    pressure, traction = grid.deviation(pressure), grid.deviation(traction)
    for corner in grid.corners_of(slave):
        # At the tip itself the fields of force densities along the faces are undefined.
        within = np.abs(z - corner.tip) < TIP_INSET * corner.length
        z = np.where(within, corner.tip + TIP_INSET * corner.length * corner.bisector, z)
    loads = _Loads.of(grid, slave, kernel, pressure, traction)
    if not loads.ends.size:
        return np.zeros((len(z), 2, pressure.shape[1])), np.zeros((len(z), 3, pressure.shape[1]))
    displacement, stress = _own_fields(loads, _inside(grid, slave, z))
    corners = grid.corners_of(slave)
    if not corners:
        return displacement, stress
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
    return displacement, stress


def _own_fields(loads: _Loads, z: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """The same without corners: from afar few samples represent all pressures; nearer, those of each half of
    the intervals, recursively."""
    columns = loads.pressure.shape[2]
    displacement, stress = np.zeros((len(z), 2, columns)), np.zeros((len(z), 3, columns))
    close = loads.sampled(FAR_SAMPLES)
    away = np.abs(z[:, None] - close[0].place).min(axis=1, initial=np.inf) / loads.extent
    for some, count in ((away > 1.0, DISTANT_SAMPLES), ((away <= 1.0) & (away > FAR_DISTANCE), FAR_SAMPLES)):
        if some.any():
            sources, force = close if count == FAR_SAMPLES else loads.sampled(count)
            displacement[some] = sources.displacement_by(force, z[some])
            stress[some] = sources.stress_by(force, z[some])
    adjacent = np.flatnonzero(away <= FAR_DISTANCE)
    if len(adjacent) and len(loads.steps) <= MAX_INTERVALS:
        displacement[adjacent], stress[adjacent] = _close_fields(loads, z[adjacent])
    elif len(adjacent):
        for half in loads.halves():
            found = _own_fields(half, z[adjacent])
            displacement[adjacent] += found[0]
            stress[adjacent] += found[1]
    return displacement, stress


def _on_points(grid: ContactGrid, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """Forces (g, 2, c) at the hats' points for nodal ``pressure`` and ``traction`` (m, c)."""
    (normal, tangent), unit = grid.directions, grid.hats.integrals.T
    across, along = unit @ pressure, unit @ traction
    return np.asarray(normal[:, :, None] * across[:, None] + tangent[:, :, None] * along[:, None])


def _on_samples(grid: ContactGrid, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """Forces (k, 2, ...) at the samples that represent nodal values (m, ...) from afar."""
    normal, tangent = grid.spreads
    return np.stack(np.split(normal @ pressure + tangent @ traction, 2), axis=1)


def _close_fields(loads: _Loads, z: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """The same at points near the contact."""
    size, count = loads.steps, len(loads.steps)
    ends = loads.grid.facing.side(loads.ends.ravel(), loads.slave)[0]
    starts, chords = ends[:count], ends[count:] - ends[:count]
    parts, pairs = [], []
    step = max(1, BATCH_SIZE // (len(RULE) * count))
    for first in range(0, len(z), step):
        some = z[first : first + step]
        foot = _feet(some, starts, chords)
        away = np.abs(some[:, None] - (starts + foot * chords))
        close = away < GRID_POINT_DISTANCE * size
        parts.append(_far(loads, some, close))
        row, interval = np.nonzero(close)
        pairs.append((row + first, some[row], interval, foot[close]))
    displacement, stress = (np.concatenate(some) for some in zip(*parts, strict=True))
    row, seen, interval, at = (np.concatenate(some) for some in zip(*pairs, strict=True))
    _add_close(loads, (row, seen, interval, *_on_curve(loads, seen, interval, at)), displacement, stress)
    return displacement, stress


def _feet(z: ComplexArray, starts: ComplexArray, chords: ComplexArray) -> FloatArray:
    """Closest points (e, i) on the chords of all intervals, as fractions from 0 to 1."""
    way = ((z[:, None] - starts) * np.conj(chords)).real / np.abs(chords) ** 2
    return np.asarray(np.clip(way, 0.0, 1.0))


def _on_curve(
    loads: _Loads, z: ComplexArray, interval: IntArray, foot: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Closest points (p,) on the surface within intervals (p,), as fractions, starting from those on the
    chords, and distances over the interval lengths: a curved interval is not where its chord is."""
    (first, last), size = loads.ends[:, interval], loads.steps[interval]
    s, place, _ = _nearest(loads.grid, loads.slave, z, first + foot * size, (first, last))
    return (s - first) / size, np.abs(z - place) / size


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


def _inside(grid: ContactGrid, slave: bool, z: ComplexArray) -> ComplexArray:
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


def _far(loads: _Loads, z: ComplexArray, close: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Contribution of intervals that are not ``close`` (e, i)."""
    columns = loads.pressure.shape[2]
    displacement, stress = np.zeros((len(z), 2, columns)), np.zeros((len(z), 3, columns))
    for sources, force in loads.quadrature_forces():
        displacement += sources.displacement_by(force, z, close)
        stress += sources.stress_by(force, z, close)
    return displacement, stress


@cache
def _rule(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss points and weights on (-1, 1)."""
    return np.polynomial.legendre.leggauss(count)


def _add_close(
    loads: _Loads, pairs: Sequence[AnyArray], displacement: FloatArray, stress: FloatArray
) -> None:
    """Add the contribution of close intervals to displacements and stresses (e, ., c). Pairs (p,) consist of
    row, point, interval, closest fraction of the interval, and distance over its length."""
    last = [first for first, _ in GAUSS_POINTS[1:]] + [np.inf]
    for (first, count), beyond in zip(GAUSS_POINTS, last, strict=True):
        chosen = np.flatnonzero((pairs[4] >= first) & (pairs[4] < beyond))
        rule = _rule(count)
        for some in np.array_split(chosen, 1 + len(chosen) * count // BATCH_SIZE):
            row, *places = (one[some] for one in pairs)
            moved, stressed = _close_integrals(loads, rule, *places)
            np.add.at(displacement, row, moved)
            np.add.at(stress, row, stressed)


def _close_integrals(
    loads: _Loads,
    rule: tuple[FloatArray, FloatArray],
    z: ComplexArray,
    interval: IntArray,
    at: FloatArray,
    away: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Displacements (p, 2, c) and stresses (p, 3, c) at points due to one interval each, by a Gauss ``rule``
    (k,) after a substitution that removes the peak at the closest point."""
    distance = np.maximum(away, 1e-12)[:, None]
    low, high = np.arcsinh(-at[:, None] / distance), np.arcsinh((1.0 - at[:, None]) / distance)
    v = 0.5 * (low + high) + 0.5 * (high - low) * rule[0]
    share = np.clip(at[:, None] + distance * np.sinh(v), 0.0, 1.0)
    length = 0.5 * rule[1] * (high - low) * distance * np.cosh(v) * loads.steps[interval][:, None]
    count = len(rule[0])
    *places, traction = loads.at(np.repeat(interval, count), share.ravel())
    sources, force = loads.sources(*places), traction * length.ravel()[:, None, None]
    seen = np.repeat(z, count)
    found = (field @ force for field in (sources.displacement_of_each(seen), sources.stress_of_each(seen)))
    moved, stressed = (one.reshape(len(z), count, *one.shape[1:]).sum(axis=1) for one in found)
    return moved, stressed


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
    loads = _Loads.of(grid, slave, kernel, pressure[:, None], traction[:, None])
    z = as_complex(surface.curve.points(surface.arc_length))
    curvature = surface.curve.curvature(surface.arc_length)
    total = np.zeros((len(z), 2))
    for sources, force in loads.quadrature_forces():
        found = sources.traction(z, as_complex(surface.normal), curvature)
        total += np.einsum("eicd,id->ec", found, force[:, :, 0])
    return total
