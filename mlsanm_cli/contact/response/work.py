"""Work of all forces on a body: final forces times final displacements. For a linear body this is twice the
strain energy, whatever the contact history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.pairing import Pairing, facing_parts, opposed
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.contact_fields import adjacent_traction
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.energy import along_surface, extended, inner_work, over_body, rigid_part
from mlsanm_cli.mechanics.scene import Scene, SurfaceLoad
from mlsanm_cli.mechanics.springs import FREE, NO_SPRING
from mlsanm_cli.roundoff import FINE_ROUND_OFF


def work_on(
    scene: Scene,
    condensed: Condensed,
    body: str,
    unknowns: Sequence[FloatArray],
    displacement: FloatArray,
    stress: FloatArray,
    near: FloatArray,
    single: Sequence[tuple[int, int]] = (),
) -> float:
    """Work on a body per unit thickness in a state f, q, p, t, minus that of its stress on free expansion.

    ``displacement`` (n, 2) and ``stress`` (n, 3), due to elastic strain, are nodal; ``single`` are
    (node, component) pairs held at zero. Held components have the prescribed displacements. The near-field
    displacements ``near`` (n, 2) are excluded: the work of the remainder is returned.
    """
    elastic = scene.bodies[body]
    cloud, material = elastic.model.cloud, elastic.model.material
    moved, origin, bent = _paths(scene, body, unknowns, displacement, near, single)
    path = moved - origin
    factors = unknowns[0]
    total = inner_work(cloud, stress, origin) if bent else 0.0
    total += _on_master(scene, condensed, body, unknowns, path)
    given = _given_tractions(scene, condensed, body, unknowns)
    for name, surface in cloud.surfaces.items():
        springs = np.array(elastic.springs.get(name, NO_SPRING))
        pulled = given[name] - springs * (displacement + near)[surface.index]
        # The force on held components is the traction of the stress beneath.
        inner = traction_of(stress[surface.index], surface.normal)
        traction = np.where(elastic.restrained.get(name, FREE), inner, pulled)
        total += along_surface(surface, _around(cloud, surface) * traction, path[surface.index])
    for load in scene.surface_loads:
        if load.body == body and not load.held:
            total += factors[load.number] * _beyond_nodes(elastic, load, path)
    for force in scene.body_forces:
        if force.body == body:
            total += over_body(cloud, factors[force.number] * force.values, path)
    if scene.heated(body):
        total -= over_body(cloud, stress, scene.degrees(body, factors)[:, None] * material.expansion)
    return total


def _paths(
    scene: Scene,
    body: str,
    unknowns: Sequence[FloatArray],
    displacement: FloatArray,
    near: FloatArray,
    single: Sequence[tuple[int, int]],
) -> tuple[FloatArray, FloatArray, bool]:
    """Displacements (n, 2) with prescribed values, reference displacements (n, 2) from which forces do work,
    and whether the reference strains the body.

    A rigid reference does not change the work of balanced forces. The rigid motion of the held parts leaves
    no work to the reactions, which are known as stresses near singular corners, or not at all: for clamped
    beams the error of the work is then that of the deflection. If several surfaces are held and moved apart,
    a smooth field with their displacements is the reference, on which the internal stress does the reactions'
    work.
    """
    elastic = scene.bodies[body]
    cloud = elastic.model.cloud
    moved, nodes, surfaces = displacement.copy(), np.zeros_like(displacement), np.zeros_like(displacement)
    prescribed = _prescribed(scene, body, unknowns)
    for name, components in elastic.restrained.items():
        surface = cloud.surfaces[name]
        for component in (0, 1):
            surfaces[surface.index, component] += surface.weight * components[component]
            if elastic.held.get(name, FREE)[component]:
                moved[surface.index, component] = (prescribed[name] - near[surface.index])[:, component]
    for node, component in single:
        nodes[node, component] = 1.0
        moved[node, component] = -near[node, component]
    origin = rigid_part(cloud, moved, [nodes, surfaces])
    held = (nodes > 0.0) | (surfaces > 0.0)
    beyond = np.where(held, moved - origin, 0.0)
    bent = bool(np.abs(beyond).max() > FINE_ROUND_OFF * np.abs(moved).max())
    return moved, origin + extended(cloud, beyond, held) if bent else origin, bent


def _prescribed(scene: Scene, body: str, unknowns: Sequence[FloatArray]) -> Mapping[str, FloatArray]:
    """Displacements (b, 2) that supports, loads and platens prescribe on a body's surfaces."""
    factors, motions = unknowns[:2]
    cloud = scene.bodies[body].model.cloud
    total = {name: np.zeros((len(surface.index), 2)) for name, surface in cloud.surfaces.items()}
    for load in scene.surface_loads:
        if load.body == body and load.held:
            total[load.surface] += factors[load.number] * load.values
    for platen, motion, by in scene.motions:
        for name in platen.surfaces_of(body):
            pattern = platen.pattern(cloud.surfaces[name], cloud.points, motion)
            total[name] += by @ np.concatenate([factors, motions]) * pattern
    return total


def _given_tractions(
    scene: Scene, condensed: Condensed, body: str, unknowns: Sequence[FloatArray]
) -> Mapping[str, FloatArray]:
    """Nodal tractions (b, 2) of loads, and of contacts on slaves, on a body's surfaces."""
    factors = unknowns[0]
    surfaces = scene.bodies[body].model.cloud.surfaces
    total = {name: np.zeros((len(surface.index), 2)) for name, surface in surfaces.items()}
    for load in scene.surface_loads:
        if load.body == body and not load.held:
            total[load.surface] += factors[load.number] * load.values
    for pairing in condensed.reported:
        pressure, traction = condensed.contact_values(pairing, unknowns)
        if not pairing.nodal:
            kernel = scene.bodies[body].model.kernel
            for slave, sign in pairing.sides_of(body):
                for name, surface in surfaces.items():
                    adjacent = adjacent_traction(pairing.grid, kernel, slave, surface, pressure, traction)
                    total[name] -= sign * adjacent
                if pairing.grid.covers:
                    mean = pairing.grid.mean_traction(pressure, traction)
                    total[pairing.surface_of(slave).name] += sign * mean
        elif pairing.slave_body == body:
            given, chosen = _on_slave(pairing, pressure, traction), pairing.candidate
            position = pairing.position[chosen]
            parts = facing_parts(pairing.slave, position, pairing.normal[chosen])
            for part, numbers, on in parts:
                total[part.name][numbers] += given[position[on]]
    return total


def _on_master(
    scene: Scene, condensed: Condensed, body: str, unknowns: Sequence[FloatArray], path: FloatArray
) -> float:
    """Work of contacts on a body's master surfaces along ``path`` (n, 2): of minus the slaves' forces at the
    closest points, as for the body's pieces."""
    total = 0.0
    for pairing in condensed.reported:
        master = pairing.master
        if pairing.master_body != body or master is None or not pairing.nodal:
            continue
        pressure, traction = condensed.contact_values(pairing, unknowns)
        given, slave = _on_slave(pairing, pressure, traction), pairing.slave
        halves = Halves.of(slave, FINE)
        share = halves.share[:, None]
        length = halves.length * opposed(pairing, halves.arc)
        length *= scene.bodies[body].model.cloud.around(slave.curve.points(halves.arc))
        force = length[:, None] * (share * given[halves.own] + (1.0 - share) * given[halves.other])
        arc = master.curve.closest(slave.curve.points(halves.arc))
        around = master.curve.length if master.curve.closed else None
        moved = [np.interp(arc, master.arc_length, one, period=around) for one in path[master.index].T]
        total -= float((force * np.stack(moved, axis=1)).sum())
    return total


def _beyond_nodes(body: ElasticBody, load: SurfaceLoad, path: FloatArray) -> float:
    """Work of a load along ``path`` (n, 2) minus that of its nodal values, per unit factor: nodal values are
    inaccurate for a load that few nodes see."""
    if load.between is None:
        return 0.0
    surface = body.model.cloud.surfaces[load.surface]
    halves = Halves.of(surface, FINE)
    taken = ~np.array(body.restrained.get(load.surface, FREE))
    own, other, share = surface.index[halves.own], surface.index[halves.other], halves.share[:, None]
    moved = share * path[own] + (1.0 - share) * path[other]
    cloud = body.model.cloud
    length = halves.length * cloud.around(surface.curve.points(halves.arc))
    whole = float((length[:, None] * taken * load.between * moved).sum())
    nodal = _around(cloud, surface) * taken * load.values
    return whole - along_surface(surface, nodal, path[surface.index])


def _around(cloud: Cloud, surface: Surface) -> FloatArray:
    """Circumferences (b, 1) of a surface's nodes in bodies of revolution."""
    return cloud.around(cloud.points[surface.index])[:, None]


def _on_slave(pairing: Pairing, pressure: FloatArray, traction: FloatArray) -> FloatArray:
    """Contact tractions (b, 2) at all nodes of the slave surface."""
    chosen = pairing.candidate
    result = np.zeros((len(pairing.slave.index), 2))
    result[pairing.position[chosen]] = (
        pressure[:, None] * pairing.normal[chosen] + traction[:, None] * pairing.tangent[chosen]
    )
    return result
