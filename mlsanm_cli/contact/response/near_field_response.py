"""Near fields of contact grids in the response functionals. Equations (7) and (8) of docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.contact.geometry.clusters import Chain
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.contact.response.basis import Drivers
from mlsanm_cli.contact.response.compressed import Compressed, as_array
from mlsanm_cli.contact.response.contact_fields import NearFields
from mlsanm_cli.contact.response.linear_map import LinearMap
from mlsanm_cli.mechanics.corner import Forces
from mlsanm_cli.mechanics.near_field import as_complex, as_real, by_component
from mlsanm_cli.mechanics.remainder import reaction_of, spring_pull_of
from mlsanm_cli.mechanics.scene import Probe, Scene
from mlsanm_cli.roundoff import COARSE_ROUND_OFF


def near_field_response(
    scene: Scene, drivers: Drivers, places: Mapping[tuple[str, Any], slice], rows: int
) -> FloatArray:
    """Near-field part of all functionals (rows, drivers), except singular parts and probes."""
    total = np.zeros((rows, drivers.total))
    for pairing in drivers.on_grids:
        columns = drivers.of_samples(pairing)
        for body, slave, sign in pairing.sides:
            elastic = scene.bodies[body]
            forces = SurfaceResponse.of(pairing.grid, elastic.model.kernel, slave).forces
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
    found, kernel = list[FloatArray](), scene.bodies[body].model.kernel
    ways = [(seen.normal, ~seen.candidate)]
    if seen.nodal:
        along = (seen.normal, seen.tangent) if seen.friction else (seen.normal,)
        ways = [*((way, seen.candidate) for way in along), *ways]
    else:
        total = np.zeros((2 * seen.grid.count, 2 * len(forces.place)))
        for is_slave, sign in seen.sides_of(body):
            if seen.name == by.name and is_slave == slave:
                moved = SurfaceResponse.of(seen.grid, kernel, slave).smooth()
            else:
                moved = forces.displacement(seen.grid.facing.side(seen.grid.samples, is_slave)[0])
            total += sign * by_component(moved)
        found.append(total)
    for direction, chosen in ways:
        total = np.zeros((int(chosen.sum()), 2 * len(forces.place)))
        for is_slave, sign in seen.sides_of(body):
            moved = forces.displacement(as_complex((seen.points if is_slave else seen.partner)[chosen]))
            total += sign * np.einsum("ec,ekcd->edk", direction[chosen], moved).reshape(total.shape)
        found.append(total)
    return np.concatenate(found)


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
    rows = (drivers.spans, drivers.tangential)[which][pairing.name]
    for other, part in enumerate(drivers.columns(linear, pairing.name)):
        total = grid.singular_integrals(log, turn, which, other)
        terms = (term for one in responses for term in one.corner_terms(which, other))
        for seen, compliance, acting in terms:
            total += seen @ compliance @ acting.T
        if grid.evened[other]:
            total = total @ grid.deviation(np.eye(len(total)), other)
        part[rows] += (1.0 / grid.hats.weight[:, None]) * total


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


def seen_by_probe(scene: Scene, drivers: Drivers, probe: Probe, rows: FloatArray) -> LinearMap:
    """Displacement and stress of a probe, near fields included and without thermal stress from free
    expansion, from its functionals ``rows`` (r, drivers)."""
    model, rows = scene.bodies[probe.body].model, rows.copy()
    free = model.material.stress_of_expansion
    for heating in scene.heated(probe.body):
        rows[-len(free) :, heating.number] -= free * heating.field.at(probe.point)
    linear = drivers.by_unknowns(rows)
    for pairing in drivers.on_grids:
        parts = drivers.columns(linear, pairing.name)
        unit, nothing = np.eye(pairing.count), np.zeros((pairing.count,) * 2)
        for slave, sign in pairing.sides_of(probe.body):
            fields = NearFields.at(pairing.grid, model.kernel, slave, as_complex(probe.point))
            for part, values in zip(parts, ((unit, nothing), (nothing, unit)), strict=False):
                part += sign * np.concatenate([field[0] for field in fields(*values)])
    return linear


def wall_forces(
    scene: Scene, drivers: Drivers, seen: Mapping[tuple[str, str], FloatArray]
) -> dict[tuple[str, str], LinearMap]:
    """Force x, y and moment (3 rows) of held surfaces, by body and name, from the functionals ``seen`` (3,
    drivers) of the drivers.

    A force at s' that pushes across a plane of symmetry at which the contact ends is the more carried by it
    the nearer it is, and at the plane wholly. As a function of s' this has a step there, which samples of
    given parity do not represent: with J = 1, or between two planes a linear J that is 1 at the plane and 0
    at the other, minus J times the component across is integrated over the hats, and the rest is sampled.
    """
    rows = {where: one.copy() for where, one in seen.items()}
    steps = {where: LinearMap.zeros(3, drivers.counts) for where in rows}

    def add(
        pairing: Pairing, slave: bool, sign: float, end: float, normal: FloatArray, where: tuple[str, str]
    ) -> None:
        grid, samples, center = pairing.grid, drivers.of_samples(pairing), scene.center(*where)

        def carried(s: FloatArray, force: FloatArray) -> FloatArray:
            share = 1.0 - np.abs(s - end) / (grid.last - grid.first) * (None not in grid.mirrors)
            across = (share * (force @ normal))[:, None] * (sign * normal)
            return -resultant(across, as_real(grid.facing.side(s, slave)[0]), center)

        rows[where][:, samples] -= carried(np.tile(grid.samples, 2), np.repeat(np.eye(2), grid.count, axis=0))
        for which, part in enumerate(drivers.columns(steps[where], pairing.name)):
            by = carried(grid.hats.points, grid.directions[which])
            deviation = grid.deviation(np.eye(pairing.count), which)
            part += (grid.hats.integrals @ by.T).T @ deviation

    for pairing in drivers.on_grids:
        grid = pairing.grid
        for body, slave, sign in pairing.sides:
            for end, plane in zip((grid.first, grid.last), grid.mirrors, strict=True):
                if plane is None:
                    continue
                tip = as_real(grid.facing.side(np.array([end]), slave)[0])
                for name in scene.bodies[body].held:
                    curve = scene.bodies[body].model.cloud.surfaces[name].curve
                    away = np.abs(curve.points(np.array([0.0, curve.length])) - tip).max(axis=1).min()
                    if away <= COARSE_ROUND_OFF * curve.length:
                        normal = np.array([-plane.along.imag, plane.along.real])
                        add(pairing, slave, sign, end, normal, (body, name))
    return {where: drivers.by_unknowns(one) + steps[where] for where, one in rows.items()}


def resultant(force: FloatArray, points: FloatArray, center: tuple[float, float]) -> FloatArray:
    """Force x, y and moment about ``center`` (3, e) of each force (e, 2) at ``points`` (e, 2)."""
    return np.stack([*force.T, cross(points - np.array(center), force)])
