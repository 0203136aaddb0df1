"""Loads and springs of a case at the nodes of given clouds; the rigid constraints: platens, obstacles, and
bodies held by contact only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import accumulate

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.load_profiles import (
    AmountField,
    amounts_at,
    amounts_of,
    profiles,
    table_of,
    values_along,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import (
    BodyForce,
    Case,
    Centrifugal,
    Displacement,
    ExpressionError,
    ObstacleMotion,
    Platen,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.mechanics import scene as mechanics
from mlsanm_cli.mechanics.eigenstress import Heating
from mlsanm_cli.mechanics.rigid import ROTATION, RigidBodyModes, free_motions
from mlsanm_cli.mechanics.springs import Springs
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

SAMPLES_PER_POINT = 32
"""Samples for each quadrature point if tractions are discontinuous between nodes."""
HeldSurfaces = Mapping[str, Mapping[str, tuple[bool, bool]]]
HeldNodes = Mapping[str, tuple[tuple[int, int], ...]]


@dataclass(frozen=True)
class Acting:
    """Loads at factor 1, without those on platens, and ``springs[body][surface]``, traction per
    displacement."""

    surface_loads: tuple[mechanics.SurfaceLoad, ...]
    body_forces: tuple[mechanics.BodyForce, ...]
    heatings: tuple[Heating, ...]
    springs: Mapping[str, Mapping[str, tuple[float, float]]]


def temperature_of(load: Temperature) -> AmountField:
    """The temperature change of a load."""
    return AmountField(f"load.{load.name}.temperature", load.temperature)


def acting(boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> Acting:
    """Evaluates all loads. Raises CaseError for expressions without a value at a node, and for tables that do
    not cover their boundary."""
    case, problems = boundaries.case, list[CaseProblem]()
    surface_loads, body_forces = list[mechanics.SurfaceLoad](), list[mechanics.BodyForce]()
    heatings = list[Heating]()
    for number, load in enumerate(case.load):
        try:
            match load:
                case Traction() | Pressure() | Displacement():
                    surface_loads += _on_boundary(number, load, boundaries, clouds[load.owner])
                case BodyForce() | Centrifugal():
                    values = amounts_at(load.body_force, clouds[load.body].points)
                    body_forces.append(mechanics.BodyForce(number, load.body, values))
                case Temperature():
                    field = temperature_of(load)
                    heatings.append(Heating(number, load.body, field, field.at(clouds[load.body].points)))
        except ExpressionError as error:
            problems.append(CaseProblem(f"load.{load.name}.{load.kind}", str(error)))
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(tuple(problems))
    springs: dict[str, dict[str, tuple[float, float]]] = {body.name: {} for body in case.body}
    for support in case.support:
        if support.place is not None and support.spring is not None:
            own = springs[support.place.body]
            for surface in boundaries.names[support.place]:
                x, y = own.get(surface, (0.0, 0.0))
                own[surface] = (x + support.spring[0], y + support.spring[1])
    return Acting(tuple(surface_loads), tuple(body_forces), tuple(heatings), springs)


def _on_boundary(
    number: int, load: Traction | Pressure | Displacement, boundaries: Boundaries, cloud: Cloud
) -> Iterator[mechanics.SurfaceLoad]:
    """A load at the nodes of its surfaces, 0 in free directions, and tractions at the FINE quadrature points;
    if they are discontinuous between nodes of a file, means over the length of each point."""
    amounts, table, held = amounts_of(load), table_of(load), isinstance(load, Displacement)
    surfaces = [cloud.surfaces[name] for name in boundaries.names[load.place]]
    *starts, length = accumulate((surface.curve.length for surface in surfaces), initial=0.0)
    if table and (
        table[0][0] > COARSE_ROUND_OFF * length or table[-1][0] < (1.0 - COARSE_ROUND_OFF) * length
    ):
        message = f"goes from {table[0][0]:.6g} to {table[-1][0]:.6g}, the boundary from 0 to {length:.9g}"
        raise CaseError((CaseProblem(f"load.{load.name}.table", message),))
    nodal = any(body.has_nodes for body in boundaries.case.body if body.name == load.owner)
    outline = boundaries.drawn[load.owner]
    averaged = nodal and not held and any(jumps for _, _, jumps in profiles(outline, load))
    for surface, start in zip(surfaces, starts, strict=True):
        curve, between = surface.curve, None

        def at(arc: FloatArray, points: FloatArray, curve: Curve = curve, start: float = start) -> FloatArray:
            values = values_along(amounts, table, arc + start, points)
            return -values * curve.normals(arc) if isinstance(load, Pressure) else values

        values = at(surface.arc_length, cloud.points[surface.index])
        if not held:
            if not curve.closed:
                # Tractions may be discontinuous at the end of a surface.
                just = np.array([ROUND_OFF, 1.0 - ROUND_OFF]) * curve.length
                values[[0, -1]] = at(just, curve.points(just))
            halves = Halves.of(surface, FINE)
            between = at(halves.arc, curve.points(halves.arc))
            if averaged:
                order = np.argsort(halves.arc)
                step = halves.length[order]
                share = (np.arange(SAMPLES_PER_POINT) + 0.5) / SAMPLES_PER_POINT
                arc = ((np.cumsum(step) - step)[:, None] + share * step[:, None]).ravel()
                sampled = at(arc, curve.points(arc))
                between[order] = sampled.reshape(-1, SAMPLES_PER_POINT, 2).mean(axis=1)
        yield mechanics.SurfaceLoad(number, load.owner, surface.name, values, held, between)


def rigid_constraints(
    boundaries: Boundaries,
    clouds: Mapping[str, Cloud],
    held: HeldSurfaces,
    held_nodes: HeldNodes,
    restraints: HeldSurfaces,
    springs: Mapping[str, Springs],
) -> list[mechanics.RigidConstraint]:
    """All rigid constraints, with ``held[body][surface]`` and ``held_nodes[body]`` as in `SceneModel`.
    ``restraints`` are the surfaces held by supports or stiff springs. Raises CaseError for bodies that can
    move without a contact, or whose contact law does not support floating bodies."""
    case = boundaries.case
    moved: dict[str, list[tuple[int, ObstacleMotion]]] = {}
    for number, load in enumerate(case.load):
        if isinstance(load, ObstacleMotion):
            moved.setdefault(load.obstacle, []).append((number, load))
    found = list(_platens(boundaries, clouds, restraints, held_nodes))
    for contact, loads in moved.items():
        controls = {k: c for k, axis in enumerate("xy") if (c := _controls(loads, axis))}
        motions = tuple(_motion(case, component, control, True) for component, control in controls.items())
        numbers = tuple(number for number, _ in loads)
        found += [mechanics.RigidConstraint(contact, (), (0.0, 0.0), motions, numbers)] if motions else []
    touching = {place.body for sides in boundaries.sides.values() for place, _ in sides}
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
        found.append(mechanics.RigidConstraint(body.name, (body.name,), free.center, motions))
    return found


def _platens(
    boundaries: Boundaries, clouds: Mapping[str, Cloud], held: HeldSurfaces, held_nodes: HeldNodes
) -> Iterator[mechanics.RigidConstraint]:
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
            if controls:
                elsewhere = any(
                    any(c == component for _, c in held_nodes[body])
                    or any(fixed[component] for name, fixed in held[body].items() if name not in names)
                    for body, names in parts
                )
                motions.append(_motion(case, component, controls, alone=not elsewhere))
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
        yield mechanics.RigidConstraint(label, bodies, center, tuple(motions), numbers, sides)


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
    loads: list[tuple[int, Platen]] | list[tuple[int, ObstacleMotion]], axis: str
) -> dict[int, tuple[str, float]]:
    """Kind and value of each load that controls an axis, by number."""
    return {number: load.control[axis] for number, load in loads if axis in load.control}


def _motion(
    case: Case, component: int, controls: Mapping[int, tuple[str, float]], alone: bool
) -> mechanics.RigidMotion:
    """One component of a platen or obstacle; forces, or displacements, of several loads add up."""
    values, still = np.zeros(len(case.moved)), np.zeros(len(case.moved))
    for number, (_, value) in controls.items():
        values[number] = value
    if any(kind == "displacement" for kind, _ in controls.values()):
        return mechanics.RigidMotion(component, values, still, alone)
    return mechanics.RigidMotion(component, None, values, alone)
