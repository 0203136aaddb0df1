"""From a validated case and its clouds to the mechanical scene: pairs, held components, platens, systems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.app.loads import Acting, acting
from mlsanm_cli.app.materials import materials
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Displacement, Platen, split_boundary
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.pairing import Pairing, pair_surfaces
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.body import BodyModel, assemble
from mlsanm_cli.mechanics.probes import Probe
from mlsanm_cli.mechanics.springs import gripped, stiffest_soft
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.operators.settings import MlsSettings

AXES = {"x": 0, "y": 1}

TILT = 0.2
"""A contact resists a direction where its normals' root mean square component along it is above this.

Below, the resistance comes from the surface's slight curvature alone: too little to tell the true motion from
the discretisation's asymmetry.
"""


@dataclass(frozen=True)
class Prepared:
    """A scene without its factorised systems: what can be said before anything is solved.

    ``held[body][surface]`` are the held components, ``held_nodes[body]`` the (node, component) pairs held one
    by one, ``acting`` the loads' values, ``probes`` the points to observe, ``notes`` what a person should
    know.
    """

    models: Mapping[str, BodyModel]
    pairings: tuple[Pairing, ...]
    held: Mapping[str, Mapping[str, tuple[bool, bool]]]
    held_nodes: Mapping[str, tuple[tuple[int, int], ...]]
    platens: tuple[mechanics.Platen, ...]
    acting: Acting
    probes: tuple[Probe, ...]
    notes: tuple[str, ...]


def mls_settings(case: Case) -> MlsSettings:
    """The operators' settings."""
    neighbors = case.mls.neighbors
    return MlsSettings(case.mls.degree, neighbors if isinstance(neighbors, int) else None, case.mls.scheme)


def prepare(case: Case, clouds: Mapping[str, Cloud]) -> Prepared:
    """Stencils, pairs and conditions.

    Raises CaseError for contacts without facing nodes, for platens whose force nothing resists, for loads
    without a value at some node, and for probes outside their body.
    """
    stiffness = materials(case)
    loads = acting(case, clouds)
    settings = mls_settings(case)
    held = {body.name: _held_surfaces(case, body.name) for body in case.body}
    models = {
        body.name: BodyModel.build(
            body.name,
            clouds[body.name],
            stiffness[body.material],
            settings,
            clamped=[name for name, components in held[body.name].items() if all(components)],
        )
        for body in case.body
    }
    pairings = tuple(pair(case, clouds))
    held_nodes = {body.name: _held_nodes(case, body.name, clouds[body.name]) for body in case.body}
    grips = {
        name: gripped(held[name], loads.springs[name], stiffest_soft(model.cloud, model.material))
        for name, model in models.items()
    }
    platens, notes = _platens(case, clouds, pairings, grips, held_nodes, loads)
    return Prepared(models, pairings, held, held_nodes, platens, loads, _probes(case, clouds), notes)


def factorise(case: Case, prepared: Prepared, solver: DirectSolver) -> mechanics.Scene:
    """Assemble and factorise every body's system."""
    bodies = {
        name: assemble(
            model, prepared.held[name], prepared.held_nodes[name], solver, prepared.acting.springs[name]
        )
        for name, model in prepared.models.items()
    }
    supports = {s.boundary: split_boundary(s.boundary) for s in case.support if s.boundary is not None}
    return mechanics.Scene(
        bodies=bodies,
        loads=tuple(load.name for load in case.load),
        surface_loads=prepared.acting.surface_loads,
        platens=prepared.platens,
        supports=supports,
        held_nodes={name: _components(nodes) for name, nodes in prepared.held_nodes.items()},
        body_forces=prepared.acting.body_forces,
        heatings=prepared.acting.heatings,
        probes=prepared.probes,
    )


def pair(case: Case, clouds: Mapping[str, Cloud]) -> list[Pairing]:
    """Slave nodes and virtual nodes of every contact, the reach applied where the case gives one."""
    pairings, problems = [], []
    for contact in case.contact:
        slave_body, slave = split_boundary(contact.slave)
        master_body, master = split_boundary(contact.master)
        pairing = pair_surfaces(
            contact.name,
            slave_body,
            clouds[slave_body],
            clouds[slave_body].surfaces[slave],
            master_body,
            clouds[master_body],
            clouds[master_body].surfaces[master],
            contact.friction,
        )
        key = f"contact.{contact.name}"
        if not len(pairing.position):
            problems.append(CaseProblem(key, f"no node of {contact.slave} faces {contact.master}"))
            continue
        reach = contact.reach if isinstance(contact.reach, float) else pairing.first_reach()
        pairing = pairing.with_reach(reach)
        if not pairing.candidate.any():
            problems.append(
                CaseProblem(
                    f"{key}.reach",
                    f"no initial gap is below {reach:g}; the smallest is {pairing.gap.min():g}",
                )
            )
        pairings.append(pairing)
    if problems:
        raise CaseError(tuple(problems))
    return pairings


def refuse_overlap(pairings: tuple[Pairing, ...]) -> None:
    """Raise CaseError for surfaces that overlap as drawn by more than the node spacing."""
    problems = []
    for pairing in pairings:
        deepest = int(np.argmin(pairing.gap + pairing.spacing))
        if pairing.gap[deepest] < -pairing.spacing[deepest]:
            x, y = pairing.partner[deepest]
            problems.append(
                CaseProblem(
                    f"contact.{pairing.name}",
                    f"the surfaces overlap by {-pairing.gap[deepest]:g} near ({x:g}, {y:g}), "
                    f"more than the node spacing",
                    hint="move one body so that the surfaces at most touch",
                )
            )
    if problems:
        raise CaseError(tuple(problems))


def stiffness_ratio(pairing: Pairing, models: Mapping[str, BodyModel]) -> float:
    """How many times stiffer the slave is than the master."""
    slave, master = (
        models[body].material.softness(pairing.normal).mean()
        for body in (pairing.slave_body, pairing.master_body)
    )
    return float(master / slave)


def _held_surfaces(case: Case, body: str) -> dict[str, tuple[bool, bool]]:
    held: dict[str, tuple[bool, bool]] = {}

    def hold(boundary: str, x: bool, y: bool) -> None:
        owner, surface = split_boundary(boundary)
        if owner == body and (x or y):
            before = held.get(surface, (False, False))
            held[surface] = (before[0] or x, before[1] or y)

    for support in case.support:
        if support.boundary is not None:
            hold(support.boundary, support.ux is not None, support.uy is not None)
    for load in case.load:
        if isinstance(load, Displacement):
            x, y = load.components
            hold(load.boundary, x is not None, y is not None)
        elif isinstance(load, Platen):
            hold(load.boundary, "x" in load.control, "y" in load.control)
    return held


def _held_nodes(case: Case, body: str, cloud: Cloud) -> tuple[tuple[int, int], ...]:
    pairs = []
    for support in case.support:
        if support.body == body and support.near is not None:
            node = int(np.argmin(((cloud.points - np.array(support.near)) ** 2).sum(axis=1)))
            pairs += [(node, c) for c, value in enumerate((support.ux, support.uy)) if value is not None]
    return tuple(pairs)


def _probes(case: Case, clouds: Mapping[str, Cloud]) -> tuple[Probe, ...]:
    probes, problems = [], []
    for probe in case.probe:
        point = np.array([probe.point])
        if not clouds[probe.body].holds(point)[0]:
            x, y = probe.point
            message = f'({x:g}, {y:g}) lies outside body "{probe.body}"'
            problems.append(CaseProblem(f"probe.{probe.name}.point", message, hint="as it is before loading"))
        probes.append(Probe(probe.name, probe.body, point))
    if problems:
        raise CaseError(tuple(problems))
    return tuple(probes)


def _components(nodes: tuple[tuple[int, int], ...]) -> tuple[bool, bool]:
    return any(c == 0 for _, c in nodes), any(c == 1 for _, c in nodes)


def _platens(
    case: Case,
    clouds: Mapping[str, Cloud],
    pairings: tuple[Pairing, ...],
    held: Mapping[str, Mapping[str, tuple[bool, bool]]],
    held_nodes: Mapping[str, tuple[tuple[int, int], ...]],
    loads: Acting,
) -> tuple[tuple[mechanics.Platen, ...], tuple[str, ...]]:
    """Platens, one per boundary that platen loads move."""
    groups: dict[str, list[tuple[int, Platen]]] = {}
    for number, load in enumerate(case.load):
        if isinstance(load, Platen):
            groups.setdefault(load.boundary, []).append((number, load))
    platens, notes, problems = [], [], []
    for boundary, moving in groups.items():
        body, surface_name = split_boundary(boundary)
        surface = clouds[body].surfaces[surface_name]
        points = clouds[body].points[surface.index]
        center = (surface.weight[:, None] * points).sum(axis=0) / surface.weight.sum()
        motions = []
        for axis, component in AXES.items():
            controls = {number: load.control[axis] for number, load in moving if axis in load.control}
            if not controls:
                continue
            elsewhere = _components(held_nodes[body])[component] or any(
                sides[component] for name, sides in held[body].items() if name != surface_name
            )
            motion = _motion(len(case.load), component, controls, alone=not elsewhere)
            sprung = any(spring[component] for spring in loads.springs[body].values())
            resisted = elsewhere or sprung or _resisted(pairings, body, component)
            if motion.prescribed is None and not resisted:
                if np.any(motion.force):
                    pushing = next(load.name for number, load in moving if motion.force[number])
                    problems.append(
                        CaseProblem(
                            f"load.{pushing}",
                            f"nothing resists its force in {axis}: no support holds the body, and the "
                            f"contact's normals hardly tilt that way",
                            hint=f"prescribe u{axis} there instead, or hold the body in {axis}",
                        )
                    )
                notes.append(
                    f"platen on {boundary}: u{axis} is held at 0, for no force is applied in {axis} "
                    f"and nothing resists it"
                )
                motion = mechanics.PlatenMotion(
                    component, np.zeros(len(case.load)), motion.force, motion.alone
                )
            motions.append(motion)
        if moving[0][1].rotation == "free":
            alone = len(held[body]) == 1 and not held_nodes[body]
            zero = np.zeros(len(case.load))
            motions.append(mechanics.PlatenMotion(mechanics.ROTATION, None, zero, alone))
        at = (float(center[0]), float(center[1]))
        platens.append(
            mechanics.Platen(body, surface_name, at, tuple(motions), tuple(number for number, _ in moving))
        )
    if problems:
        raise CaseError(tuple(problems))
    return tuple(platens), tuple(notes)


def _motion(
    loads: int, component: int, controls: Mapping[int, tuple[str, float]], alone: bool
) -> mechanics.PlatenMotion:
    """One direction of a platen; several loads' forces, or several loads' displacements, add."""
    values = np.zeros(loads)
    for number, (_, value) in controls.items():
        values[number] = value
    if any(kind == "displacement" for kind, _ in controls.values()):
        return mechanics.PlatenMotion(component, values, np.zeros(loads), alone)
    return mechanics.PlatenMotion(component, None, values, alone)


def _resisted(pairings: tuple[Pairing, ...], body: str, component: int) -> bool:
    """Whether the body's contacts push back when it moves along an axis."""
    for pairing in pairings:
        if body in (pairing.slave_body, pairing.master_body):
            if pairing.friction:
                return True
            weight: FloatArray = pairing.weight[pairing.candidate]
            tilt = (weight * pairing.normal[pairing.candidate, component] ** 2).sum() / weight.sum()
            if tilt > TILT**2:
                return True
    return False
