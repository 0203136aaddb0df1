"""The rigid constraints of a case: platens, obstacles, and bodies held by contact only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.case import Case, ObstacleMotion, Platen
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics.rigid import ROTATION, free_motions
from mlsanm_cli.mechanics.scene import RigidConstraint, RigidMotion
from mlsanm_cli.mechanics.supports import Springs
from mlsanm_cli.roundoff import ROUND_OFF

HeldSurfaces = Mapping[str, Mapping[str, tuple[bool, bool]]]
HeldNodes = Mapping[str, tuple[tuple[int, int], ...]]


def rigid_constraints(
    boundaries: Boundaries,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
    restraints: HeldSurfaces,
    springs: Mapping[str, Springs],
) -> Iterator[RigidConstraint]:
    """All rigid constraints, with ``held[body][surface]`` and ``held_nodes[body]`` as in `SceneModel`.
    ``restraints`` are the surfaces held by supports or stiff springs. Raises CaseError for bodies that can
    move without a contact, or whose contact law does not support floating bodies."""
    case = boundaries.case
    yield from _platens(boundaries, clouds, restraints, held_nodes)
    for contact in dict.fromkeys(load.obstacle for load in case.load if isinstance(load, ObstacleMotion)):
        loads = [
            (number, load)
            for number, load in enumerate(case.load)
            if isinstance(load, ObstacleMotion) and load.obstacle == contact
        ]
        controls = [(component, _controls(loads, axis)) for component, axis in enumerate("xy")]
        motions = tuple(_motion(case, component, known) for component, known in controls if known)
        if motions:
            yield RigidConstraint(contact, (), (0.0, 0.0), motions, tuple(number for number, _ in loads))
    touching = {place.body for sides in boundaries.sides.values() for place, _ in sides}
    for body in case.body:
        cloud = clouds[body.name]
        free = free_motions(cloud, held[body.name], held_nodes[body.name], springs[body.name])
        if not free.components:
            continue
        if body.name not in touching:
            size = float(np.ptp(cloud.points, axis=0).max())
            x, y = (place if abs(place) > ROUND_OFF * size else 0.0 for place in free.center)
            about = f" about ({x:.6g}, {y:.6g})" if free.components == (ROTATION,) else ""
            words = {
                0: ("translation in x", "fix ux"),
                1: ("translation in y", "fix uy"),
                ROTATION: (f"rotation{about}", "fix a second point or a whole boundary"),
            }
            what, needs = zip(*(words[component] for component in free.components), strict=True)
            message = f"can move freely: nothing resists {' and '.join(what)}"
            hint = f"add a [[support]], a displacement or a platen: {', '.join(needs)}"
            raise CaseError((CaseProblem(f"body.{body.name}", message, hint=hint),))
        if case.is_regularized:
            message = f"body {body.name} is held by contact only, which needs the exact contact law"
            hint = 'use "exact", or fix the body with a [[support]]'
            raise CaseError((CaseProblem("contact.regularization.law", message, hint=hint),))
        unknown = np.zeros(len(case.moved))
        motions = tuple(RigidMotion(component, None, unknown) for component in free.components)
        yield RigidConstraint(body.name, (body.name,), free.center, motions)


def _platens(
    boundaries: Boundaries, clouds: Mapping[str, Cloud], held: HeldSurfaces, held_nodes: HeldNodes
) -> Iterator[RigidConstraint]:
    """Platens, one per boundary or list of boundaries of platen loads."""
    case = boundaries.case
    platens = {number: load for number, load in enumerate(case.load) if isinstance(load, Platen)}
    for label in dict.fromkeys(load.label for load in platens.values()):
        loads = [(number, load) for number, load in platens.items() if load.label == label]
        first = loads[0][1]
        parts = [(place.body, boundaries.names[place]) for place in first.places]
        sides = tuple((body, name) for body, names in parts for name in names)
        motions = []
        for component, axis in enumerate("xy"):
            controls = _controls(loads, axis)
            elsewhere = any(
                any(c == component for _, c in held_nodes[body])
                or any(fixed[component] for name, fixed in held[body].items() if name not in names)
                for body, names in parts
            )
            motions += [_motion(case, component, controls, not elsewhere)] if controls else []
        if first.turning != "fixed":
            alone = all(set(held[body]) == set(names) and not held_nodes[body] for body, names in parts)
            turns = {
                number: ("displacement", load.rotation)
                if isinstance(load.rotation, float)
                else ("force", load.moment or 0.0)
                for number, load in loads
            }
            motions.append(_motion(case, ROTATION, turns, alone))
        center = first.hinge
        if not center:
            surfaces = [(clouds[body].points, clouds[body].surfaces[name]) for body, name in sides]
            weight = np.concatenate([surface.weight for _, surface in surfaces])
            places = np.concatenate([points[surface.index] for points, surface in surfaces])
            x, y = (weight @ places / weight.sum()).tolist()
            center = x, y
        bodies, numbers = tuple(dict.fromkeys(body for body, _ in parts)), tuple(n for n, _ in loads)
        yield RigidConstraint(label, bodies, center, tuple(motions), numbers, sides)


def _controls(
    loads: Sequence[tuple[int, Platen | ObstacleMotion]], axis: str
) -> dict[int, tuple[str, float]]:
    """Kind and value of each load that controls an axis, by number."""
    return {number: load.control[axis] for number, load in loads if axis in load.control}


def _motion(
    case: Case, component: int, controls: Mapping[int, tuple[str, float]], alone: bool = True
) -> RigidMotion:
    """One component of a platen, obstacle or body; forces, or displacements, of several loads add up."""
    values, still = np.zeros(len(case.moved)), np.zeros(len(case.moved))
    for number, (_, value) in controls.items():
        values[number] = value
    moved = any(kind == "displacement" for kind, _ in controls.values())
    return RigidMotion(component, values if moved else None, still if moved else values, alone)
