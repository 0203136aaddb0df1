"""Displacements and stresses in a body under the pressures and tractions of a contact grid, in closed form.

Integrals along the contact are Gauss's; over intervals close to the point that is looked at, the arc length
is s0 + d sinh(v), which takes the near pole of the fields away (Johnston and Elliott 2005,
doi:10.1002/nme.1208).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import AnyArray, BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.grid import RULE
from mlsanm_cli.mechanics.near_field import ComplexArray, Kernel, SurfaceForces, as_complex

FAR = 2.0
"""Intervals farther away than so many of their lengths are integrated by the points of the grid."""
POINTS = ((0.0, 32), (0.05, 12), (0.5, 6))
"""Gauss's points over an interval nearby, from so many of its lengths away on."""
NEAR_SURFACE = 1e-3
"""Points nearer to the surface than this part of the interval beneath are moved so far inside: on it, fields
jump."""
BEYOND, CLOSE = 1.0 / 6.0, 48
"""Farther away than this part of the range so many samples stand for all pressures, to 1e-7."""
AT_TIP = 2e-3
"""Points nearer to a corner's tip than this part of its faces are moved so far inside."""
AT_ONCE = 100_000
"""Pairs of points and places that are worked on together, for the sake of memory."""


@dataclass(frozen=True)
class _Loads:
    """``pressure`` and ``traction`` (i + 1, c) at the ends of a contact's intervals, and where they act on
    one body."""

    grid: ContactGrid
    slave: bool
    kernel: Kernel
    pressure: FloatArray
    traction: FloatArray

    @classmethod
    def of(
        cls, grid: ContactGrid, slave: bool, kernel: Kernel, pressure: FloatArray, traction: FloatArray
    ) -> _Loads:
        """Those of nodal ``pressure`` and ``traction`` (m, c)."""
        first, last = grid.hats.whole
        beyond = ((int(not first), int(not last)), (0, 0))
        return cls(grid, slave, kernel, *(np.pad(one, beyond) for one in (pressure, traction)))

    @cached_property
    def ends(self) -> FloatArray:
        """Where intervals begin and end (i + 1,)."""
        return self.grid.hats.ends

    @cached_property
    def steps(self) -> FloatArray:
        """Lengths (i,) of the intervals."""
        return np.diff(self.ends)

    def forces(self, interval: IntArray, share: FloatArray) -> tuple[SurfaceForces, FloatArray]:
        """Unit forces at places (e,) within intervals (e,), by the share of the way along these, and the
        tractions (e, 2, c) on the slave there."""
        s = self.ends[interval] + share * self.steps[interval]
        place, inward, (normal, tangent) = self.grid.facing.loaded(s, self.slave)
        part = share[:, None]
        pressure, traction = (
            (1.0 - part) * one[interval] + part * one[interval + 1] for one in (self.pressure, self.traction)
        )
        total = normal[:, :, None] * pressure[:, None] + tangent[:, :, None] * traction[:, None]
        return SurfaceForces(self.kernel, place, inward, self.grid.centers[0 if self.slave else 1]), total

    @cached_property
    def even(self) -> list[tuple[float, SurfaceForces, FloatArray]]:
        """Weights of the rule for whole intervals, with :meth:`forces` at its points in all of them."""
        interval = np.arange(len(self.steps))
        return [(weight, *self.forces(interval, np.full(len(interval), share))) for share, weight in RULE]


def fields_of(
    grid: ContactGrid,
    kernel: Kernel,
    slave: bool,
    z: ComplexArray,
    pressure: FloatArray,
    traction: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Displacements (e, 2, c) and stresses (e, 3, c) at points ``z`` (e,) of a body by nodal ``pressure`` and
    ``traction`` (m, c) on the hats, as these act on the slave: on the master it is the opposite."""
    pressure, traction = grid.uneven(pressure), grid.uneven(traction)
    for corner in grid.corners_of(slave):
        # At the tip itself fields of what is spread along both faces have no meaning.
        within = np.abs(z - corner.tip) < AT_TIP * corner.length
        z = np.where(within, corner.tip + AT_TIP * corner.length * corner.bisector, z)
    close = replace(grid, count=CLOSE)
    away = np.abs(z[:, None] - close.facing.side(close.samples, slave)[0]).min(axis=1, initial=np.inf)
    away = away / (grid.last - grid.first)
    displacement, stress = np.zeros((len(z), 2, pressure.shape[1])), np.zeros((len(z), 3, pressure.shape[1]))
    # From afar few samples of the range stand for all the pressures, as they do for the remainder.
    for some, sampled in ((away > 1.0, grid), ((away <= 1.0) & (away > BEYOND), close)):
        if some.any():
            forces, on = sampled.own_forces(kernel, slave), _on_samples(sampled, pressure, traction)
            displacement[some] = forces.displacement_by(on, z[some])
            stress[some] = forces.stress_by(on, z[some])
    adjacent = away <= BEYOND
    if adjacent.any():
        displacement[adjacent], stress[adjacent] = _close_fields(
            grid, kernel, slave, z[adjacent], pressure, traction
        )
    corners = grid.corners_of(slave)
    if not corners:
        return displacement, stress
    place, force = grid.facing.side(grid.hats.points, slave)[0], _on_points(grid, pressure, traction)
    few, on = close.facing.side(close.samples, slave)[0], _on_samples(close, pressure, traction)
    for corner in corners:
        for line in corner.lines(corner.distance(place), force):
            displacement += line.displacement(z)
            stress += line.stress(z)
        whole = corner.images(corner.distance(place), force)
        for image, distant in zip(whole, corner.images(corner.distance(few), on), strict=True):
            # Behind a wall all but those near it are far away.
            away = np.abs(z[:, None] - distant.places.place).min(axis=1) / (grid.last - grid.first)
            for some, one in ((away > BEYOND, distant), (away <= BEYOND, image)):
                displacement[some] += one.displacement(z[some])
                stress[some] += one.stress(z[some])
    return displacement, stress


def _on_points(grid: ContactGrid, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """The forces (g, 2, c) at the hats' points that nodal ``pressure`` and ``traction`` (m, c) are."""
    (normal, tangent), unit = grid.directions, grid.hats.integrals.T
    across, along = unit @ pressure, unit @ traction
    return np.asarray(normal[:, :, None] * across[:, None] + tangent[:, :, None] * along[:, None])


def _on_samples(grid: ContactGrid, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """The forces (k, 2, ...) at the samples that stand for nodal values (m, ...), seen from afar."""
    normal, tangent = grid.spreads
    return np.stack(np.split(normal @ pressure + tangent @ traction, 2), axis=1)


def _close_fields(
    grid: ContactGrid,
    kernel: Kernel,
    slave: bool,
    z: ComplexArray,
    pressure: FloatArray,
    traction: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """The same at points near the contact."""
    loads = _Loads.of(grid, slave, kernel, pressure, traction)
    ends, size = grid.facing.side(loads.ends, slave)[0], loads.steps
    parts, pairs = [], []
    step = max(1, AT_ONCE // (len(RULE) * len(size)))
    for first in range(0, len(z), step):
        some = z[first : first + step]
        foot = _feet(some, ends)
        some = _inside(loads, some, ends, foot)
        away = np.abs(some[:, None] - (ends[:-1] + foot * np.diff(ends)))
        close = away < FAR * size
        parts.append(_far(loads, some, close))
        row, interval = np.nonzero(close)
        pairs.append((row + first, some[row], interval, foot[close], away[close] / size[interval]))
    displacement, stress = (np.concatenate(some) for some in zip(*parts, strict=True))
    chosen = [np.concatenate(some) for some in zip(*pairs, strict=True)]
    _add_close(loads, chosen, displacement, stress)
    return displacement, stress


def _feet(z: ComplexArray, ends: ComplexArray) -> FloatArray:
    """Where on the chord of every interval the place closest to each point is (e, i), from 0 to 1."""
    chord = np.diff(ends)
    way = ((z[:, None] - ends[:-1]) * np.conj(chord)).real / np.abs(chord) ** 2
    return np.asarray(np.clip(way, 0.0, 1.0))


def _inside(loads: _Loads, z: ComplexArray, ends: ComplexArray, foot: FloatArray) -> ComplexArray:
    """The points, those on the contact's surface a little inside."""
    away = z[:, None] - (ends[:-1] + foot * np.diff(ends))
    interval = np.argmin(np.abs(away), axis=1)
    every = np.arange(len(z))
    step = loads.steps[interval]
    s = loads.ends[interval] + foot[every, interval] * step
    place, inward = loads.grid.facing.side(s, loads.slave)
    deep, size = ((z - place) * np.conj(inward)).real, NEAR_SURFACE * step
    on = np.abs(away[every, interval]) <= 2.0 * step
    return np.where(on & (deep < size), z + (size - deep) * inward, z)


def _far(loads: _Loads, z: ComplexArray, close: BoolArray) -> tuple[FloatArray, FloatArray]:
    """What intervals that are not ``close`` (e, i) do."""
    columns = loads.pressure.shape[1]
    displacement, stress = np.zeros((len(z), 2, columns)), np.zeros((len(z), 3, columns))
    for weight, forces, traction in loads.even:
        force = (weight * loads.steps)[:, None, None] * traction
        displacement += forces.displacement_by(force, z, close)
        stress += forces.stress_by(force, z, close)
    return displacement, stress


def _add_close(
    loads: _Loads, pairs: Sequence[AnyArray], displacement: FloatArray, stress: FloatArray
) -> None:
    """Add to displacements and stresses (e, ., c) what intervals close by do. Pairs (p,) are a row of these,
    its place, an interval, where on it the foot is, and the distance from there over its length."""
    last = [first for first, _ in POINTS[1:]] + [np.inf]
    for (first, count), beyond in zip(POINTS, last, strict=True):
        chosen = np.flatnonzero((pairs[4] >= first) & (pairs[4] < beyond))
        rule = np.polynomial.legendre.leggauss(count)
        for some in np.array_split(chosen, 1 + len(chosen) * count // AT_ONCE):
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
    """Displacements (p, 2, c) and stresses (p, 3, c) at places by one interval each, by a Gaussian ``rule``
    (k,) after a substitution that takes out their peak at the foot."""
    distance = np.maximum(away, 1e-12)[:, None]
    low, high = np.arcsinh(-at[:, None] / distance), np.arcsinh((1.0 - at[:, None]) / distance)
    v = 0.5 * (low + high) + 0.5 * (high - low) * rule[0]
    share = np.clip(at[:, None] + distance * np.sinh(v), 0.0, 1.0)
    length = 0.5 * rule[1] * (high - low) * distance * np.cosh(v) * loads.steps[interval][:, None]
    count = len(rule[0])
    forces, traction = loads.forces(np.repeat(interval, count), share.ravel())
    traction *= length.ravel()[:, None, None]
    seen = np.repeat(z, count)
    found = (field @ traction for field in (forces.displacement_of_each(seen), forces.stress_of_each(seen)))
    moved, stressed = (one.reshape(len(z), count, *one.shape[1:]).sum(axis=1) for one in found)
    return moved, stressed


def adjacent_traction(
    grid: ContactGrid,
    kernel: Kernel,
    slave: bool,
    surface: Surface,
    pressure: FloatArray,
    traction: FloatArray,
) -> FloatArray:
    """Tractions (b, 2) at the nodes of a body's surface of the fields by nodal ``pressure`` and ``traction``
    (m,) on the slave, less these themselves where they act."""
    pressure, traction = grid.uneven(pressure), grid.uneven(traction)
    if grid.corners_of(slave):
        # What is left near corners changes little along the contact.
        z = as_complex(surface.curve.points(surface.arc_length))
        on = _on_samples(grid, pressure, traction)
        curvature = surface.curve.curvature(surface.arc_length)
        found = grid.forces(kernel, slave).traction(z, as_complex(surface.normal), curvature)
        return np.asarray(np.einsum("ekcd,kd->ec", found, on))
    loads = _Loads.of(grid, slave, kernel, pressure[:, None], traction[:, None])
    z = as_complex(surface.curve.points(surface.arc_length))
    curvature = surface.curve.curvature(surface.arc_length)
    total = np.zeros((len(z), 2))
    for weight, forces, on in loads.even:
        found = forces.traction(z, as_complex(surface.normal), curvature)
        total += np.einsum("i,eicd,id->ec", weight * loads.steps, found, on[:, :, 0])
    return total
