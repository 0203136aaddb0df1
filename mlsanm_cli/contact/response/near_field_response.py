"""Contribution of contact grids' near fields to the response functionals. Equations (7) and (8) of
docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.geometry.clusters import Chain
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.response.compressed import Compressed, as_array
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.contact.response.drivers import Drivers
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.mechanics.corner import Forces
from mlsanm_cli.mechanics.near_field import as_complex, by_component
from mlsanm_cli.mechanics.remainder import reaction_of, spring_pull_of
from mlsanm_cli.mechanics.scene import Probe, Scene


def near_field_response(
    scene: Scene, drivers: Drivers, places: Mapping[tuple[str, Any], slice], rows: int
) -> FloatArray:
    """Near-field part of all functionals (rows, drivers), except the singular part of contacts' response to
    themselves, and probes."""
    total = np.zeros((rows, drivers.total))
    for pairing in drivers.on_grids:
        columns = drivers.of_samples(pairing)
        for body, slave, sign in pairing.sides:
            elastic = scene.bodies[body]
            forces = pairing.grid.forces(elastic.model.kernel, slave)
            seen: dict[tuple[str, Any], FloatArray] = {
                ("contact", one.name): _on_contact(scene, one, pairing, body, forces, slave)
                for one in drivers.pairings
                if body in one.bodies
            }
            for surface in elastic.restrained:
                reaction = reaction_of(elastic, surface, scene.center(body, surface), forces)
                seen["held", (body, surface)] = reaction
            for surface in elastic.soft_springs:
                seen["spring", (body, surface)] = spring_pull_of(elastic, surface, forces)
            for key, values in seen.items():
                total[places[key], columns] += sign * values
    return total


def _on_contact(
    scene: Scene, seen: Pairing, by: Pairing, body: str, forces: Forces, slave: bool
) -> FloatArray:
    """Motions of the samples of the contact ``seen``, and of points watched beyond, due to forces at the
    samples of contact ``by``, perhaps the same one, through the near field in one body."""
    beyond = _along(seen, body, forces, seen.normal, ~seen.candidate)
    if seen.nodal:
        ways = (seen.normal, seen.tangent) if seen.friction else (seen.normal,)
        return np.concatenate([*(_along(seen, body, forces, way, seen.candidate) for way in ways), beyond])
    total = np.zeros((2 * seen.grid.count, 2 * len(forces.place)))
    for is_slave, sign in seen.sides_of(body):
        if seen.name == by.name and is_slave == slave:
            kernel = scene.bodies[body].model.kernel
            total += sign * by_component(SurfaceResponse.of(seen.grid, kernel, slave).smooth())
        else:
            place = seen.grid.facing.side(seen.grid.samples, is_slave)[0]
            total += sign * by_component(forces.displacement(place))
    return np.concatenate([total, beyond])


def _along(
    pairing: Pairing, body: str, forces: Forces, direction: FloatArray, chosen: BoolArray
) -> FloatArray:
    """Motions (e, 2k) of a contact's slave relative to its master along ``direction`` (w, 2) through the near
    field in one body, at the ``chosen`` points (w,)."""
    total = np.zeros((int(chosen.sum()), 2 * len(forces.place)))
    for slave, sign in pairing.sides_of(body):
        moved = forces.displacement(as_complex((pairing.points if slave else pairing.partner)[chosen]))
        total += sign * np.einsum("ec,ekcd->edk", direction[chosen], moved).reshape(total.shape)
    return total


def _singular(scene: Scene, pairing: Pairing) -> tuple[list[SurfaceResponse], FloatArray, FloatArray]:
    """The responses of a contact's bodies, and their tensors L and T (2, 2) summed."""
    kernels = [(scene.bodies[body].model.kernel, slave) for body, slave, _ in pairing.sides]
    responses, log, turn = [SurfaceResponse.of(pairing.grid, *each) for each in kernels], *np.zeros((2, 2, 2))
    for response in responses:
        log, turn = log + response.tensors[0], turn + response.tensors[1]
    return responses, log, turn


def add_singular(linear: LinearMap, scene: Scene, drivers: Drivers, pairing: Pairing, which: int) -> None:
    """Add to a contact's gaps (``which`` 0) or slips (1) the singular part of the response to its own
    pressures and tractions: none of nodal ones."""
    if pairing.nodal:
        return
    grid, (responses, log, turn) = pairing.grid, _singular(scene, pairing)
    spans = (drivers.spans[pairing.name], drivers.tangential.get(pairing.name))
    rows = spans[which]
    for other, (part, span) in enumerate(zip((linear.pressure, linear.traction), spans, strict=True)):
        if span is not None:
            total = grid.singular_integrals(log, turn, which, other)
            for response in responses:
                total += response.cornered(which, other)
            if grid.evened[other]:
                total = total @ grid.deviation(np.eye(len(total)), other)
            part[rows, span] += (1.0 / grid.hats.weight[:, None]) * total


def compressed_gap(scene: Scene, drivers: Drivers, rows: FloatArray, weight: FloatArray) -> LinearMap:
    """Gaps (m,) of all contacts from their smooth functionals ``rows`` (m, drivers), with the singular parts;
    the compliance is compressed. Of frictionless contacts on grids, with the ``weight`` (m,) of hats."""
    first = drivers.loads + drivers.motions
    few = LinearMap.of_rows(rows[:, :first] @ drivers.matrix[:first], drivers.counts)
    right = drivers.matrix[first:, first:].toarray()
    total = Compressed.product(rows[:, first:].copy(), right, weight)
    for pairing in drivers.pairings:
        grid, (responses, log, turn) = pairing.grid, _singular(scene, pairing)
        near, far = grid.singular_chains(log, turn)
        cornered: list[Chain] = [
            (seen, compliance, sparse.csr_array(acting.T))
            for response in responses
            for seen, compliance, acting in response.corner_terms(0, 0)
        ]
        if grid.covers:
            even = np.ones(pairing.count)
            evenly = near @ even
            for chain in (*far, *cornered):
                evenly += reduce(lambda right, one: one @ right, reversed(chain), even)
            cornered.append((-evenly[:, None], grid.mean_weights[None]))
        total = total.plus(near, far, cornered, drivers.spans[pairing.name].start, grid.hats.place)
    return replace(few, pressure=as_array(total))


def add_fields(linear: LinearMap, drivers: Drivers, scene: Scene, probe: Probe) -> None:
    """Add the near fields to a probe's functionals."""
    for pairing in drivers.on_grids:
        parts = [linear.pressure[:, drivers.spans[pairing.name]]]
        if pairing.friction:
            parts.append(linear.traction[:, drivers.tangential[pairing.name]])
        unit, nothing = np.eye(pairing.count), np.zeros((pairing.count,) * 2)
        for slave, sign in pairing.sides_of(probe.body):
            kernel = scene.bodies[probe.body].model.kernel
            fields = NearFields.at(pairing.grid, kernel, slave, as_complex(probe.point))
            for part, values in zip(parts, ((unit, nothing), (nothing, unit)), strict=False):
                part += sign * np.concatenate([field[0] for field in fields(*values)])
