"""Unknown rigid motions at finite strain: of loose bodies with their pins, and of obstacles and plates under
forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case
from mlsanm_cli.contact.finite.free import DrivenObstacle, LooseMotions, Plate
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.update import AnyContact
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.loads import Loads, Turning
from mlsanm_cli.mechanics.rigid import ROTATION, free_motions, pins


def free_motions_of(
    case: Case, prepared: SceneModel
) -> tuple[tuple[LooseMotions, ...], tuple[DrivenObstacle, ...], tuple[Plate, ...]]:
    """Unknown rigid motions: of loose bodies in the order of all bodies, then obstacles, then plates."""
    found = {one.body: one for one in prepared.rigid_constraints if isinstance(one, mechanics.FloatingBody)}
    loose = []
    for name, model in prepared.models.items():
        if name in found:
            unknown = tuple(one.component for one in found[name].motions if one.prescribed is None)
            size, anchors = float(np.ptp(model.nodes, axis=0).max()), tuple(prepared.held_nodes[name])
            loose.append(LooseMotions(name, unknown, size, anchors, np.zeros((0, 0))))
    number = sum(one.count for one in loose)
    names = [pairing.name for pairing in prepared.pairings]
    driven: list[DrivenObstacle] = []
    for constraint in prepared.rigid_constraints:
        if isinstance(constraint, mechanics.Obstacle):
            for one in constraint.motions:
                if one.prescribed is None:
                    place = names.index(constraint.contact)
                    driven.append(DrivenObstacle(place, one.component, number + len(driven), one.force))
    plates = tuple(_plates(case, prepared, number + len(driven)))
    return tuple(loose), tuple(driven), plates


def _plates(case: Case, prepared: SceneModel, number: int) -> list[Plate]:
    """All plates; ``number`` is the index of their first unknown motion."""
    loads, found = len(case.moved), list[Plate]()
    platens = [one for one in prepared.rigid_constraints if isinstance(one, mechanics.Platen)]
    count = loads + number + sum(one.prescribed is None for platen in platens for one in platen.motions)
    for platen in platens:
        unknown = [one for one in platen.motions if one.prescribed is None]
        surfaces = {body: platen.surfaces_of(body) for body in platen.bodies}
        size = max(float(np.ptp(prepared.models[body].nodes, axis=0).max()) for body in surfaces)
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


def pins_of(
    prepared: SceneModel, name: str, loose: Sequence[LooseMotions]
) -> tuple[list[tuple[int, int]], FloatArray]:
    """Pins (node, component) of a loose body, and their displacement per free motion."""
    own = next((one for one in loose if one.body == name), None)
    if own is None:
        return [], np.zeros((0, 0))
    cloud = prepared.models[name].cloud
    springs = prepared.acting.springs[name]
    free = free_motions(cloud, prepared.held[name], prepared.held_nodes[name], springs)
    # Inside: on a side in contact a pin would have no field in closed form.
    outer = np.concatenate([surface.index for surface in cloud.surfaces.values()])
    inner = np.setdiff1d(np.arange(len(cloud.points)), outer)
    pinned = [(int(inner[node]), component) for node, component in pins(cloud.points[inner], free)]
    places = [2 * node + component for node, component in pinned]
    patterns = free.patterns(cloud.points)[places]
    scale = np.array([own.size if one == ROTATION else 1.0 for one in free.components])
    known = [free.components.index(component) for component in own.components]
    return pinned, (patterns / scale)[:, known]


def driving(contact: AnyContact, number: int, driven: Sequence[DrivenObstacle], loads: int) -> AnyContact:
    """The contact with the free motions of its obstacle."""
    if isinstance(contact, BodyContact):
        return contact
    motion = contact.motion.copy()
    for one in driven:
        if one.contact == number:
            motion[one.component, loads + one.number] = 1.0
    return replace(contact, motion=motion)
