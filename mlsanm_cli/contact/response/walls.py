"""Forces that planes of symmetry carry next to contacts.

A force at s' that pushes across the plane at which the contact ends is the more carried by it the nearer it
is, and at the plane wholly. As a function of s' this has a step there, which samples of given parity do not
represent: with J = 1, or between two planes a linear J that is 1 at the plane and 0 at the other, minus J
times the component across is integrated over the hats, and the rest is sampled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.mechanics.near_field import as_real
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

Carried: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]


def wall_forces(
    scene: Scene, drivers: Drivers, seen: Mapping[tuple[str, str], FloatArray]
) -> dict[tuple[str, str], LinearMap]:
    """Force x, y and moment (3 rows) of held surfaces, by body and name, from the functionals ``seen`` (3,
    drivers) of the drivers."""
    rows = {where: one.copy() for where, one in seen.items()}
    steps = {where: LinearMap.zeros(3, drivers.counts) for where in rows}
    for pairing in drivers.on_grids:
        grid, samples = pairing.grid, drivers.of_samples(pairing)
        units = np.repeat(np.eye(2), grid.count, axis=0)
        for where, carried in _walls(scene, pairing):
            rows[where][:, samples] -= carried(np.tile(grid.samples, 2), units)
            spans = (drivers.spans[pairing.name], drivers.tangential.get(pairing.name))
            parts = (steps[where].pressure, steps[where].traction)
            for which, (span, part) in enumerate(zip(spans, parts, strict=True)):
                if span is not None:
                    by = carried(grid.hats.points, grid.directions[which])
                    deviation = grid.deviation(np.eye(pairing.count), which)
                    part[:, span] += (grid.hats.integrals @ by.T).T @ deviation
    return {where: drivers.by_unknowns(one) + steps[where] for where, one in rows.items()}


def _walls(scene: Scene, pairing: Pairing) -> Iterator[tuple[tuple[str, str], Carried]]:
    """The held surfaces, by body and name, at planes of symmetry at which the range of a contact ends, and
    what they carry: force x, y and moment (3, e) of the steps due to forces (e, 2) at coordinates (e,)."""
    grid = pairing.grid
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
                    center = scene.center(body, name)
                    yield (body, name), partial(_carried, grid, slave, end, sign * normal, normal, center)


def _carried(
    grid: ContactGrid,
    slave: bool,
    end: float,
    along: FloatArray,
    normal: FloatArray,
    center: tuple[float, float],
    s: FloatArray,
    force: FloatArray,
) -> FloatArray:
    step = 1.0 - np.abs(s - end) / (grid.last - grid.first) * (None not in grid.mirrors)
    across = (step * (force @ normal))[:, None] * along
    return -resultant(across, as_real(grid.facing.side(s, slave)[0]), center)


def resultant(force: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment about ``center`` (3, e) of each force (e, 2) at ``points`` (e, 2)."""
    return np.stack([*force.T, cross(points - np.array(center), force)])
