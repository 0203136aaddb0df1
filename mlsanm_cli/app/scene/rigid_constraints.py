"""Rigid constraints of a case: platens, obstacles, and bodies held by contact only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.case import Case, ObstacleMotion, Platen
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.rigid import ROTATION, RigidBodyModes, free_motions
from mlsanm_cli.mechanics.springs import Springs
from mlsanm_cli.roundoff import ROUND_OFF

HeldSurfaces = Mapping[str, Mapping[str, tuple[bool, bool]]]
HeldNodes = Mapping[str, tuple[tuple[int, int], ...]]


def rigid_constraints(
    case: Case,
    boundaries: Boundaries,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
    restraints: HeldSurfaces,
    springs: Mapping[str, Springs],
) -> list[mechanics.RigidConstraint]:
    """All rigid constraints, with ``held[body][surface]`` and ``held_nodes[body]`` as in `SceneModel`.
    ``restraints`` are the surfaces held by supports or stiff springs. Raises CaseError for floating bodies
    in a scheme that does not support them."""
    return [
        *_platens(case, boundaries, clouds, restraints, held_nodes),
        *_obstacles(case),
        *_floating(boundaries, clouds, held, held_nodes, springs),
    ]


def components(nodes: tuple[tuple[int, int], ...]) -> tuple[bool, bool]:
    """Whether single nodes are fixed in x, and in y."""
    return any(c == 0 for _, c in nodes), any(c == 1 for _, c in nodes)


def _platens(
    case: Case,
    boundaries: Boundaries,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
) -> Iterator[mechanics.RigidConstraint]:
    """Platens, one per boundary or list of boundaries of platen loads."""
    platens = {number: load for number, load in enumerate(case.load) if isinstance(load, Platen)}
    for label in dict.fromkeys(load.label for load in platens.values()):
        loads = [(number, load) for number, load in platens.items() if load.label == label]
        first = loads[0][1]
        parts = [(place.body, boundaries.names(place)) for place in first.places]
        motions = []
        for component, controls in _controls(loads).items():
            elsewhere = any(
                components(held_nodes[body])[component]
                or any(sides[component] for name, sides in held[body].items() if name not in names)
                for body, names in parts
            )
            motions.append(_motion(len(case.moved), component, controls, alone=not elsewhere))
        if first.turning != "fixed":
            alone = all(set(held[body]) == set(names) and not held_nodes[body] for body, names in parts)
            turns = {
                number: ("force", load.moment or 0.0)
                if not isinstance(load.rotation, float)
                else ("displacement", load.rotation)
                for number, load in loads
            }
            motions.append(_motion(len(case.moved), ROTATION, turns, alone))
        numbers = tuple(number for number, _ in loads)
        at = first.hinge or _middle(clouds, parts)
        bodies = tuple(dict.fromkeys(body for body, _ in parts))
        sides = tuple((body, name) for body, names in parts for name in names)
        yield mechanics.RigidConstraint(label, bodies, at, tuple(motions), numbers, sides)


def _middle(clouds: Mapping[str, Cloud], parts: Sequence[tuple[str, tuple[str, ...]]]) -> tuple[float, float]:
    """The centroid of surfaces of bodies."""
    surfaces = [(clouds[body], clouds[body].surfaces[name]) for body, names in parts for name in names]
    weight = np.concatenate([one.weight for _, one in surfaces])
    x, y = weight @ np.concatenate([cloud.points[one.index] for cloud, one in surfaces]) / weight.sum()
    return float(x), float(y)


def _obstacles(case: Case) -> Iterator[mechanics.RigidConstraint]:
    """Obstacles with a prescribed motion."""
    moved = {number: load for number, load in enumerate(case.load) if isinstance(load, ObstacleMotion)}
    for contact in dict.fromkeys(load.obstacle for load in moved.values()):
        loads = [(number, load) for number, load in moved.items() if load.obstacle == contact]
        motions = tuple(
            _motion(len(case.moved), component, controls, alone=True)
            for component, controls in _controls(loads).items()
        )
        if motions:
            numbers = tuple(number for number, _ in loads)
            yield mechanics.RigidConstraint(contact, (), (0.0, 0.0), motions, numbers)


def _floating(
    boundaries: Boundaries,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
    springs: Mapping[str, Springs],
) -> Iterator[mechanics.RigidConstraint]:
    """Bodies whose supports leave rigid motions. Raises CaseError if they have no contact, or if the law of
    the contacts does not support them."""
    case = boundaries.case
    touching = {place.body for sides in boundaries.sides.values() for place in sides}
    for body in case.body:
        cloud = clouds[body.name]
        free = free_motions(cloud, held[body.name], held_nodes[body.name], springs[body.name])
        if not free.components:
            continue
        if body.name not in touching:
            what, needs = _described(free, float(np.ptp(cloud.points, axis=0).max()))
            message = f"can move freely: nothing resists {what}"
            hint = f"add a [[support]], a displacement or a platen: {needs}"
            raise CaseError((CaseProblem(f"body.{body.name}", message, hint=hint),))
        if case.is_regularized:
            message = f"body {body.name} is held by contact only, which needs the exact contact law"
            hint = 'use "exact", or fix the body with a [[support]]'
            raise CaseError((CaseProblem("contact.regularization.law", message, hint=hint),))
        still = np.zeros(len(case.moved))
        motions = tuple(mechanics.RigidMotion(component, None, still) for component in free.components)
        yield mechanics.RigidConstraint(body.name, (body.name,), free.center, motions)


def _described(free: RigidBodyModes, size: float) -> tuple[str, str]:
    """Free motions of a body of a ``size`` in words, and supports that would resist them."""
    x, y = (place if abs(place) > ROUND_OFF * size else 0.0 for place in free.center)
    about = f" about ({x:.6g}, {y:.6g})" if free.components == (ROTATION,) else ""
    words = {
        0: ("translation in x", "fix ux"),
        1: ("translation in y", "fix uy"),
        ROTATION: (f"rotation{about}", "fix a second point or a whole boundary"),
    }
    what, needs = zip(*(words[component] for component in free.components), strict=True)
    return " and ".join(what), ", ".join(needs)


def _controls(
    loads: Sequence[tuple[int, Platen | ObstacleMotion]],
) -> dict[int, dict[int, tuple[str, float]]]:
    """For each controlled component, the kind and value of each load."""
    return {
        component: {number: load.control[axis] for number, load in loads if axis in load.control}
        for component, axis in enumerate("xy")
        if any(axis in load.control for _, load in loads)
    }


def _motion(
    loads: int, component: int, controls: Mapping[int, tuple[str, float]], alone: bool
) -> mechanics.RigidMotion:
    """One component of a platen or obstacle; forces, or displacements, of several loads add up."""
    values = np.zeros(loads)
    for number, (_, value) in controls.items():
        values[number] = value
    if any(kind == "displacement" for kind, _ in controls.values()):
        return mechanics.RigidMotion(component, values, np.zeros(loads), alone)
    return mechanics.RigidMotion(component, None, values, alone)
