"""Forces that planes of symmetry carry next to contacts.

A force at s' that pushes across the plane at which the contact ends is the more carried by it the nearer it
is, and at the plane wholly. As a function of s' this has a step there, which samples of given parity do not
represent: with J = 1, or between two planes a linear J that is 1 at the plane and 0 at the other, minus J
times the component across is integrated over the hats, and the rest is sampled.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.mechanics.near_field import as_real
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF


@dataclass(frozen=True)
class Wall:
    """A held ``surface`` of a ``body`` that is a plane of symmetry with unit ``normal`` (2,) at the ``end``
    of a contact's range; between two planes the step is ``sloped``."""

    pairing: Pairing
    grid: ContactGrid
    body: str
    slave: bool
    sign: float
    surface: str
    end: float
    normal: FloatArray
    sloped: bool

    @classmethod
    def of(cls, scene: Scene, pairing: Pairing) -> Iterator[Wall]:
        """The planes at which the range of a contact ends."""
        grid = pairing.grid
        if grid is None or not grid.mirrored:
            return
        sloped = None not in grid.mirrors
        for body, slave, sign in pairing.sides:
            for end, plane in zip((grid.first, grid.last), grid.mirrors, strict=True):
                if plane is None:
                    continue
                normal = np.array([-plane.along.imag, plane.along.real])
                tip = as_real(grid.facing.side(np.array([end]), slave)[0])
                for name in scene.bodies[body].held:
                    curve = scene.bodies[body].model.cloud.surfaces[name].curve
                    away = np.abs(curve.points(np.array([0.0, curve.length])) - tip).max(axis=1).min()
                    if away <= COARSE_ROUND_OFF * curve.length:
                        yield cls(pairing, grid, body, slave, sign, name, end, normal, sloped)

    def carried(self, s: FloatArray, force: FloatArray, center: tuple[float, float]) -> FloatArray:
        """Force x, y and moment about ``center`` (3, e) of the steps due to forces (e, 2) at coordinates
        ``s`` (e,)."""
        step = 1.0 - np.abs(s - self.end) / (self.grid.last - self.grid.first) * self.sloped
        across = self.sign * (step * (force @ self.normal))[:, None] * self.normal
        return -resultant_of_each(across, as_real(self.grid.facing.side(s, self.slave)[0]), center)


def wall_forces(
    scene: Scene, drivers: Drivers, seen: Mapping[tuple[str, str], FloatArray]
) -> dict[tuple[str, str], LinearMap]:
    """Force x, y and moment (3 rows) of held surfaces, by body and name, from the functionals ``seen`` (3,
    drivers) of the drivers."""
    rows = {where: one.copy() for where, one in seen.items()}
    steps = {where: drivers.unknowns.zeros(3) for where in rows}
    for pairing in drivers.pairings:
        for wall in Wall.of(scene, pairing):
            where, grid = (wall.body, wall.surface), wall.grid
            center, samples = scene.center(*where), np.split(drivers.of_samples(pairing), 2)
            for axis, columns in zip(np.eye(2), samples, strict=True):
                unit = np.tile(axis, (grid.count, 1))
                rows[where][:, columns] -= wall.carried(grid.samples, unit, center)
            spans = (drivers.spans[pairing.name], drivers.tangential.get(pairing.name))
            parts = (steps[where].pressure, steps[where].traction)
            for which, (span, part) in enumerate(zip(spans, parts, strict=True)):
                if span is not None:
                    by = wall.carried(grid.hats.points, grid.directions[which], center)
                    deviation = grid.deviation(np.eye(len(grid.hats.place)), which)
                    part[:, span] += (grid.hats.integrals @ by.T).T @ deviation
    return {where: drivers.by_unknowns(one) + steps[where] for where, one in rows.items()}


def resultant_of_each(force: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment about ``center`` (3, e) of each force (e, 2) at ``points`` (e, 2)."""
    return np.stack([*force.T, cross(points - np.array(center), force)])
