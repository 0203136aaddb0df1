"""Work of all forces on a body: final forces times final displacements. For a linear body this is twice the
strain energy, whatever the contact history."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.energy import along_surface, extended, inner_work, over_body, rigid_part
from mlsanm_cli.mechanics.scene import Scene
from mlsanm_cli.mechanics.supports import FREE, NO_SPRING
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
    elastic, factors = scene.bodies[body], unknowns[0]
    cloud, material = elastic.model.cloud, elastic.model.material
    # Tractions and displacements are those of the equations, without what heating adds there.
    drivers = condensed.drive(unknowns)
    drivers[[heating.number for heating in scene.heated(body)]] = 0.0
    given = condensed.sources[body] @ drivers
    moved, origin, bent = _paths(elastic, given, displacement, near, single)
    path = moved - origin
    total = inner_work(cloud, stress, origin) if bent else 0.0
    for name, surface in cloud.surfaces.items():
        springs = np.array(elastic.springs.get(name, NO_SPRING))
        applied = np.stack([given[elastic.condition_rows(name, component)] for component in (0, 1)], axis=1)
        pulled = applied - springs * displacement[surface.index]
        # The force on held components is the traction of the stress beneath.
        inner = traction_of(stress[surface.index], surface.normal)
        traction = np.where(elastic.restrained.get(name, FREE), inner, pulled)
        around = cloud.around(cloud.points[surface.index])[:, None]
        total += along_surface(surface, around * traction, path[surface.index])
    for load in scene.surface_loads:
        if load.body == body and not load.held and load.between is not None:
            # Nodal values are inaccurate for a load that few nodes see: add what they miss.
            surface = cloud.surfaces[load.surface]
            halves, taken = Halves.of(surface, FINE), ~np.array(elastic.restrained.get(load.surface, FREE))
            own, other = surface.index[halves.own], surface.index[halves.other]
            there = halves.share[:, None] * path[own] + (1.0 - halves.share[:, None]) * path[other]
            length = halves.length * cloud.around(surface.curve.points(halves.arc))
            whole = float((length[:, None] * taken * load.between * there).sum())
            nodal = cloud.around(cloud.points[surface.index])[:, None] * taken * load.values
            total += factors[load.number] * (whole - along_surface(surface, nodal, path[surface.index]))
    for force in scene.body_forces:
        if force.body == body:
            total += over_body(cloud, factors[force.number] * force.values, path)
    if scene.heated(body):
        total -= over_body(cloud, stress, scene.degrees(body, factors)[:, None] * material.expansion)
    return total


def _paths(
    elastic: ElasticBody,
    given: FloatArray,
    displacement: FloatArray,
    near: FloatArray,
    single: Sequence[tuple[int, int]],
) -> tuple[FloatArray, FloatArray, bool]:
    """Displacements (n, 2), with those ``given`` (r,), displacements (n, 2) from which forces do work,
    and whether the reference strains the body.

    A rigid reference does not change the work of balanced forces. The rigid motion of the held parts leaves
    no work to the reactions, which are known as stresses near singular corners, or not at all: for clamped
    beams the error of the work is then that of the deflection. If several surfaces are held and moved apart,
    a smooth field with their displacements is the reference, on which the internal stress does the reactions'
    work.
    """
    cloud = elastic.model.cloud
    moved, nodes, surfaces = displacement.copy(), np.zeros_like(displacement), np.zeros_like(displacement)
    for name, components in elastic.restrained.items():
        surface = cloud.surfaces[name]
        for component in (0, 1):
            surfaces[surface.index, component] += surface.weight * components[component]
            if elastic.held.get(name, FREE)[component]:
                moved[surface.index, component] = given[elastic.condition_rows(name, component)]
    for node, component in single:
        nodes[node, component] = 1.0
        moved[node, component] = -near[node, component]
    origin = rigid_part(cloud, moved, [nodes, surfaces])
    held = (nodes > 0.0) | (surfaces > 0.0)
    beyond = np.where(held, moved - origin, 0.0)
    bent = bool(np.abs(beyond).max() > FINE_ROUND_OFF * np.abs(moved).max())
    return moved, origin + extended(cloud, beyond, held) if bent else origin, bent
