"""What moves rigidly in a case: platens, obstacles, and bodies that only contacts can hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mlsanm_cli.app.surfaces import surfaces_at
from mlsanm_cli.case import Case, ObstacleMotion, Platen
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.rigid import ROTATION, free_motions
from mlsanm_cli.mechanics.springs import Springs

AXES = {"x": 0, "y": 1}

HeldSurfaces = Mapping[str, Mapping[str, tuple[bool, bool]]]
HeldNodes = Mapping[str, tuple[tuple[int, int], ...]]


def movers(
    case: Case,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
    grips: HeldSurfaces,
    springs: Mapping[str, Springs],
) -> list[mechanics.Mover]:
    """All of them, with ``held[body][surface]`` and ``held_nodes[body]`` as in a prepared scene.

    ``grips`` are the surfaces held by supports or stiff springs. Raises CaseError for loose bodies in a
    scheme that cannot take them.
    """
    return [
        *_platens(case, clouds, grips, held_nodes),
        *_obstacles(case),
        *_loose(case, clouds, held, held_nodes, springs),
    ]


def components(nodes: tuple[tuple[int, int], ...]) -> tuple[bool, bool]:
    """Whether single nodes hold x, and whether they hold y."""
    return any(c == 0 for _, c in nodes), any(c == 1 for _, c in nodes)


def _platens(
    case: Case,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
) -> Iterator[mechanics.Platen]:
    """Platens, one per boundary that platen loads move."""
    groups: dict[str, list[tuple[int, Platen]]] = {}
    for number, load in enumerate(case.load):
        if isinstance(load, Platen):
            groups.setdefault(load.place.label, []).append((number, load))
    for label, loads in groups.items():
        place = loads[0][1].place
        body, names = place.body, surfaces_at(case, place)
        surfaces = [clouds[body].surfaces[name] for name in names]
        points = np.concatenate([clouds[body].points[surface.index] for surface in surfaces])
        weight = np.concatenate([surface.weight for surface in surfaces])
        center = (weight[:, None] * points).sum(axis=0) / weight.sum()
        motions = []
        for component, controls in _controls(loads).items():
            elsewhere = components(held_nodes[body])[component] or any(
                sides[component] for name, sides in held[body].items() if name not in names
            )
            motions.append(_motion(len(case.moved), component, controls, alone=not elsewhere))
        if loads[0][1].rotation == "free":
            alone = set(held[body]) == set(names) and not held_nodes[body]
            motions.append(mechanics.RigidMotion(ROTATION, None, np.zeros(len(case.moved)), alone))
        at = (float(center[0]), float(center[1]))
        numbers = tuple(number for number, _ in loads)
        yield mechanics.Platen(body, names, at, tuple(motions), numbers, label)


def _obstacles(case: Case) -> Iterator[mechanics.Obstacle]:
    """Obstacles that loads move."""
    groups: dict[str, list[tuple[int, ObstacleMotion]]] = {}
    for number, load in enumerate(case.load):
        if isinstance(load, ObstacleMotion):
            groups.setdefault(load.obstacle, []).append((number, load))
    for contact, loads in groups.items():
        motions = tuple(
            _motion(len(case.moved), component, controls, alone=True)
            for component, controls in _controls(loads).items()
        )
        yield mechanics.Obstacle(contact, (0.0, 0.0), motions, tuple(number for number, _ in loads))


def _loose(
    case: Case,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
    springs: Mapping[str, Springs],
) -> Iterator[mechanics.LooseBody]:
    """Bodies that conditions leave free to move. Raises CaseError where the scheme cannot take that."""
    for body in case.body:
        free = free_motions(clouds[body.name], held[body.name], held_nodes[body.name], springs[body.name])
        if not free.components:
            continue
        if case.solver.formulation == "monolithic":
            message = f"body {body.name} is held by contact alone, which only the condensed formulation knows"
            hint = 'use "condensed", or hold the body with a [[support]]'
            raise CaseError((CaseProblem("solver.formulation", message, hint=hint),))
        if case.mls.scheme != "least-squares":
            message = f"body {body.name} is held by contact alone, which needs the scheme least-squares"
            hint = 'use "least-squares", or hold the body with a [[support]]'
            raise CaseError((CaseProblem("mls.scheme", message, hint=hint),))
        still = np.zeros(len(case.moved))
        motions = tuple(mechanics.RigidMotion(component, None, still) for component in free.components)
        yield mechanics.LooseBody(body.name, free.center, motions)


def _controls(
    loads: Sequence[tuple[int, Platen | ObstacleMotion]],
) -> dict[int, dict[int, tuple[str, float]]]:
    """For each component that is moved, how and how far each load moves it."""
    found: dict[int, dict[int, tuple[str, float]]] = {}
    for axis, component in AXES.items():
        found[component] = {number: load.control[axis] for number, load in loads if axis in load.control}
    return {component: controls for component, controls in found.items() if controls}


def _motion(
    loads: int, component: int, controls: Mapping[int, tuple[str, float]], alone: bool
) -> mechanics.RigidMotion:
    """One direction of a platen or obstacle; several loads' forces, or several loads' displacements, add."""
    values = np.zeros(loads)
    for number, (_, value) in controls.items():
        values[number] = value
    if any(kind == "displacement" for kind, _ in controls.values()):
        return mechanics.RigidMotion(component, values, np.zeros(loads), alone)
    return mechanics.RigidMotion(component, None, values, alone)
