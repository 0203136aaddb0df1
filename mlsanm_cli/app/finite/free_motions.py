"""Unknown rigid motions at finite strain: of loose bodies with their pins, and of obstacles and plates under
forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.case import Case
from mlsanm_cli.contact.finite.contacts import Contacts, DrivenObstacle, LooseMotions, Plate
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.loads import Loads, Turning
from mlsanm_cli.mechanics.rigid import ROTATION, free_motions, pins


def unknown_motions(case: Case, prepared: SceneModel) -> Contacts:
    """Unknown rigid motions: of loose bodies in the order of all bodies, then obstacles, then plates."""
    found = {one.name: one for one in prepared.restrained.rigid_constraints if one.floats}
    loose, number = list[LooseMotions](), 0
    for name in prepared.models:
        if name in found:
            unknown = tuple(one.component for one in found[name].motions if one.prescribed is None)
            loose.append(_pinned(prepared, name, unknown, number))
            number += len(unknown)
    names = [pairing.name for pairing in prepared.pairings]
    driven: list[DrivenObstacle] = []
    for constraint in prepared.restrained.rigid_constraints:
        if not constraint.bodies:
            for one in constraint.motions:
                if one.prescribed is None:
                    place = names.index(constraint.name)
                    driven.append(DrivenObstacle(place, one.component, number, one.force))
                    number += 1
    return Contacts((), tuple(loose), tuple(driven), tuple(_plates(case, prepared, number)))


def _pinned(prepared: SceneModel, name: str, unknown: tuple[int, ...], number: int) -> LooseMotions:
    """A loose body with ``unknown`` motions from ``number`` on, and its pins."""
    cloud, anchors = prepared.models[name].cloud, tuple(prepared.held_nodes[name])
    free = free_motions(cloud, prepared.held[name], anchors, prepared.acting.springs[name])
    # Inside: on a side in contact a pin would have no field in closed form.
    outer = np.concatenate([surface.index for surface in cloud.surfaces.values()])
    inner = np.setdiff1d(np.arange(len(cloud.points)), outer)
    pinned = tuple((int(inner[node]), component) for node, component in pins(cloud.points[inner], free))
    places = [2 * node + component for node, component in pinned]
    size = float(np.ptp(prepared.models[name].cloud.points, axis=0).max())
    scale = np.array([size if one == ROTATION else 1.0 for one in free.components])
    known = [free.components.index(component) for component in unknown]
    moves = (free.patterns(cloud.points)[places] / scale)[:, known]
    return LooseMotions(name, unknown, number, size, anchors, pinned, moves)


def _plates(case: Case, prepared: SceneModel, number: int) -> list[Plate]:
    """All plates; ``number`` is the index of their first unknown motion."""
    loads, found = len(case.moved), list[Plate]()
    platens = [one for one in prepared.restrained.rigid_constraints if one.held]
    count = loads + number + sum(one.prescribed is None for platen in platens for one in platen.motions)
    for platen in platens:
        unknown = [one for one in platen.motions if one.prescribed is None]
        surfaces = {body: platen.surfaces_of(body) for body in platen.bodies}
        size = max(float(np.ptp(prepared.models[body].cloud.points, axis=0).max()) for body in surfaces)
        components = tuple(one.component for one in unknown)
        force = np.array([one.force for one in unknown]).reshape(len(unknown), loads)
        motion = np.zeros((3, count))
        for one in platen.motions:
            if one.prescribed is not None:
                motion[one.component, :loads] = one.prescribed
                continue
            motion[one.component, loads + number] = 1.0 / size if one.component == ROTATION else 1.0
            number += 1
        place = (np.array(platen.center), size, components, number - len(unknown))
        found.append(Plate(platen.name, surfaces, platen.loads, *place, force, motion))
    return found


def plated(name: str, body: ElasticBody, plates: Sequence[Plate], loads: Loads) -> Loads:
    """The ``loads`` of a body, with the motions of its ``plates``."""
    turning = []
    for plate in (one for one in plates if name in one.surfaces):
        for surface in plate.surfaces[name]:
            arms = body.model.cloud.points[body.model.cloud.surfaces[surface].index] - plate.center
            for component in np.flatnonzero(body.held[surface]).tolist():
                rows = body.condition_rows(surface, component)
                loads.sources[rows] += plate.motion[component]
                if plate.motion[2].any():
                    turning.append(Turning(plate.motion[2], component, rows, arms))
    return replace(loads, turning=turning)
