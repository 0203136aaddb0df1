"""Contribution of contact grids' near fields to the response functionals. Equations (7) and (8) of
docs/method.md."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.clusters import Chain
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.response.compressed import Compressed, as_array, compressed
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.contact.response.observation import ResponseFunctionals
from mlsanm_cli.mechanics.corner import Forces
from mlsanm_cli.mechanics.near_field import as_complex, by_component
from mlsanm_cli.mechanics.probes import Probe
from mlsanm_cli.mechanics.remainder import reaction_of, spring_pull_of
from mlsanm_cli.mechanics.scene import Scene


def near_field_response(observation: ResponseFunctionals, drivers: Drivers) -> FloatArray:
    """Near-field part of all functionals (rows, drivers), except the singular part of contacts' response to
    themselves, and probes."""
    scene, places = observation.scene, observation.places
    total = np.zeros((observation.count, drivers.columns.total))
    for pairing in drivers.pairings:
        if pairing.grid is None:
            continue
        columns = drivers.of_samples(pairing)
        for body, slave, sign in pairing.sides:
            elastic = scene.bodies[body]
            forces = pairing.grid.forces(elastic.model.kernel, slave)
            for one in observation.pairings:
                if body in one.bodies:
                    moved = _on_contact(scene, one, pairing, body, forces, slave)
                    total[places["gap", one.name], columns] += sign * moved
            for one in observation.frictional:
                slipped = _along(one, body, forces, one.tangent)
                total[places["slip", one.name], columns] += sign * slipped
            for surface in elastic.restrained:
                reaction = reaction_of(elastic, surface, scene.center(body, surface), forces)
                total[places["held", (body, surface)], columns] += sign * reaction
            for surface in elastic.soft_springs:
                pull = spring_pull_of(elastic, surface, forces)
                total[places["spring", (body, surface)], columns] += sign * pull
    return total


def _on_contact(
    scene: Scene, seen: Pairing, by: Pairing, body: str, forces: Forces, slave: bool
) -> FloatArray:
    """Motions of the contact ``seen`` due to forces at the samples of contact ``by``, perhaps the same one,
    through the near field in one body."""
    if seen.grid is None:
        return _along(seen, body, forces, seen.normal)
    total = np.zeros((2 * seen.grid.count, 2 * len(forces.place)))
    for own, is_slave, sign in seen.sides:
        if own != body:
            continue
        if seen.name == by.name and is_slave == slave:
            kernel = scene.bodies[body].model.kernel
            total += sign * by_component(SurfaceResponse.of(seen.grid, kernel, slave).smooth())
        else:
            place = seen.grid.facing.side(seen.grid.samples, is_slave)[0]
            total += sign * by_component(forces.displacement(place))
    beyond = _along(seen, body, forces, seen.normal, ~seen.candidate)
    return np.concatenate([total, beyond])


def _along(
    pairing: Pairing,
    body: str,
    forces: Forces,
    direction: FloatArray,
    chosen: BoolArray | slice = slice(None),
) -> FloatArray:
    """Motions (e, 2k) of a contact's slave relative to its master along ``direction`` (w, 2) through the near
    field in one body, at all or the ``chosen`` points (w,)."""
    along = direction[chosen]
    total = np.zeros((len(along), 2 * len(forces.place)))
    for own, slave, sign in pairing.sides:
        if own == body:
            moved = forces.displacement(as_complex((pairing.points if slave else pairing.partner)[chosen]))
            total += sign * np.einsum("ec,ekcd->edk", along, moved).reshape(total.shape)
    return total


def with_singular(
    linear: LinearMap, scene: Scene, drivers: Drivers, pairing: Pairing, which: int
) -> LinearMap:
    """Add to a contact's gaps (``which`` 0) or slips (1) the singular part of the response to its own
    pressures and tractions."""
    grid = pairing.grid
    assert grid is not None
    log, turn = _tensors(scene, pairing)
    smooth = compressed(linear.pressure)
    if smooth is not None:
        more = _compressed(scene, smooth, drivers.spans[pairing.name].start, pairing, grid, (log, turn))
        return replace(linear, pressure=as_array(more))
    count = len(grid.hats.place)
    means = 1.0 / grid.hats.weight[:, None]

    def by(other: int) -> FloatArray:
        total = grid.singular_integrals(log, turn, which, other)
        for response in _responses(scene, pairing):
            total += response.cornered(which, other)
        return means * (total @ grid.deviation(np.eye(count), other) if grid.evened[other] else total)

    linear.pressure[:count, drivers.spans[pairing.name]] += by(0)
    if pairing.friction:
        linear.traction[:count, drivers.tangential[pairing.name]] += by(1)
    return linear


def _tensors(scene: Scene, pairing: Pairing) -> tuple[FloatArray, FloatArray]:
    """The tensors L and T (2, 2) of a contact, summed over its bodies."""
    log, turn = np.zeros((2, 2)), np.zeros((2, 2))
    for response in _responses(scene, pairing):
        log, turn = log + response.tensors[0], turn + response.tensors[1]
    return log, turn


def _responses(scene: Scene, pairing: Pairing) -> list[SurfaceResponse]:
    """The responses of a contact's bodies."""
    assert pairing.grid is not None
    kernels = [(scene.bodies[body].model.kernel, slave) for body, slave, _ in pairing.sides]
    return [SurfaceResponse.of(pairing.grid, *each) for each in kernels]


def _compressed(
    scene: Scene,
    smooth: Compressed,
    first: int,
    pairing: Pairing,
    grid: ContactGrid,
    tensors: tuple[FloatArray, FloatArray],
) -> Compressed:
    """The ``smooth`` part of a contact's compressed compliance with the singular part added; ``first`` is the
    index of its first pressure."""
    near, far = grid.singular_chains(*tensors)
    cornered: list[Chain] = [
        (seen, compliance, sparse.csr_array(acting.T))
        for response in _responses(scene, pairing)
        for seen, compliance, acting in response.corner_terms(0, 0)
    ]
    if grid.covers:
        even = np.ones(len(grid.hats.place))
        evenly = near @ even
        for chain in (*far, *cornered):
            evenly += reduce(lambda right, one: one @ right, reversed(chain), even)
        cornered.append((-evenly[:, None], grid.mean_weights[None]))
    return smooth.plus(near, far, cornered, first, grid.hats.place)


def add_fields(linear: LinearMap, drivers: Drivers, scene: Scene, probe: Probe) -> None:
    """Add the near fields to a probe's functionals."""
    for pairing in drivers.pairings:
        grid = pairing.grid
        if grid is None:
            continue
        unit, nothing = np.eye(len(grid.hats.place)), np.zeros((len(grid.hats.place),) * 2)
        for body, slave, sign in pairing.sides:
            if body != probe.body:
                continue
            fields = NearFields.at(grid, scene.bodies[body].model.kernel, slave, as_complex(probe.point))
            pressed = np.concatenate([part[0] for part in fields(unit, nothing)])
            linear.pressure[:, drivers.spans[pairing.name]] += sign * pressed
            if pairing.friction:
                sheared = np.concatenate([part[0] for part in fields(nothing, unit)])
                linear.traction[:, drivers.tangential[pairing.name]] += sign * sheared
