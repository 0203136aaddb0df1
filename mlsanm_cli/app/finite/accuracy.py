"""Estimated errors at finite strain: of the energy by residuals; of displacements, pressures and forces by
fits of the next degree.

Defect correction as at small strain (:mod:`mlsanm_cli.mechanics.defect`): the residual of the equations by
fits of the next degree, in the equations of the path, is minus the error of the displacements. In contact it
is one more step of Newton's method: gaps, pressures and free motions follow.

Equation (29) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.finite.exact import ExactContact, FiniteContactState
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import DEGREES, next_degree
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.estimate import energy, missing_work, unaccounted
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.state import State

PRESSED_MISFIT = 0.1
"""Tractions are not resolved where their projection differs by more than this part of the largest one."""
PRESSED_DISTANCE = 4.0
"""Distance, in spacings, from tractions that are not resolved within which their fields are not, either."""


@dataclass(frozen=True)
class Missing:
    """Changes of a state if fits were of the next degree: of the displacements (2N,) of all bodies, the
    nominal ``pressure`` (c,), and the ``traction`` (2s,) of all sides."""

    displacement: FloatArray
    pressure: FloatArray
    traction: FloatArray


def near_pressed(scene: FiniteScene, traction: FloatArray) -> dict[str, BoolArray]:
    """Masks (n,) by body of the nodes next to tractions (2s,) of the sides that the cloud does not resolve:
    what these do there is known in closed form, and not from the cloud."""
    clouds = {name: body.elastic.model.cloud for name, body in scene.bodies.items()}
    found = {name: np.zeros(len(cloud.points), dtype=bool) for name, cloud in clouds.items()}
    for side, here in scene.contacts.sides:
        load, cloud = traction[here], clouds[side.body]
        nodal, knots = (side.spread @ load).reshape(-1, 2), load.reshape(-1, 2)
        linear = np.stack([side.nodes.at(side.arc, one) for one in nodal.T], axis=1)
        misfit = np.abs(linear - knots).max(axis=1)
        places = side.places[misfit > PRESSED_MISFIT * np.abs(load).max()]
        if len(places):
            away = nearest(cKDTree(places), cloud.points)[0]
            found[side.body] |= away <= PRESSED_DISTANCE * cloud.spacing
    return found


def missed_in_contact(
    system: ExactContact,
    undeformed: Mapping[str, Projector],
    now: FiniteContactState,
    before: FloatArray | None,
    factors: FloatArray,
) -> Missing:
    """Of the solution ``now`` at load ``factors`` (L + d,), with slips since the places ``before`` (c,).
    Raises NumericalError or LinAlgError."""
    left, response = {}, system.response(now.displacement, now.traction)
    surface = response.moved(now.displacement, now.traction)
    turns = (side.turned(surface[here].reshape(-1, 2))[0] for side, here in system.contacts.sides)
    turn = np.concatenate([np.zeros(0, dtype=complex), *turns])
    upright = as_real(as_complex(now.traction.reshape(-1, 2)) / turn).ravel()
    for name, projector in system.projectors.items():
        body, here, spread = projector.body, system.bodies[name], system.spread[name]
        better, acting = _next(body), np.concatenate([factors, spread @ now.traction])
        left[name] = BodySeries.at(better, now.displacement[here], acting).rows(0)
        # What closed forms replace is not missing: the part along the residual by fits of the next degree of
        # the linear response of the undeformed body to the tractions.
        traction, first = spread @ upright, body.loads.count - len(spread @ upright)
        still, none = np.zeros(body.unknowns), np.zeros(body.loads.count)
        linear = undeformed[name]
        columns = load_columns(linear.body, still, none, slice(first, None))
        series = BodySeries(better, 1)
        series.put(0, still, none)
        moved = -linear.factorised(still, none).solve(linear.scaled(columns @ traction))
        series.put(1, moved, np.concatenate([none[:first], traction]))
        known = _rotated(better, series.rows(1), body.turn(now.displacement[here]))
        scaled = projector.scaled(known)
        along, size = scaled @ projector.scaled(left[name]), scaled @ scaled
        left[name] -= known * (np.clip(along / size, 0.0, 1.0) if size else 0.0)
    met = system.contacts.meet(surface, factors, before, now.sets.closed)
    state = (now.displacement, now.traction, now.pressure, now.shear, now.sets, met)
    step = Iteration(system, factors, response, *state, first=False, left=left)
    pressure = np.where(now.sets.closed | step.sets.closed, step.dp, 0.0)
    return Missing(step.du, pressure, step.traction)


def _rotated(body: FiniteBody, rows: FloatArray, angle: float) -> FloatArray:
    """``rows`` (r,) of a body that has turned by an ``angle``; those of held surfaces, which do not turn and
    may be displacements across and tractions along them, stay."""
    found, nodes = rows.copy(), np.arange(len(body.elastic.model.cloud.points))
    pieces = body.node_rows + np.arange(body.count)
    both: list[tuple[IntArray, IntArray]] = [(nodes, len(nodes) + nodes), (pieces, body.count + pieces)]
    for name, *_, held in body.conditions:
        if not any(held):
            both.append((body.elastic.condition_rows(name, 0), body.elastic.condition_rows(name, 1)))
    for x, y in both:
        turned = (rows[x] + 1j * rows[y]) * np.exp(1j * angle)
        found[x], found[y] = turned.real, turned.imag
    return found


def missed_alone(projector: Projector, displacement: FloatArray, factors: FloatArray) -> Missing:
    """Of the ``displacement`` (2N,) of a body without contact. Raises NumericalError or LinAlgError."""
    left, none = BodySeries.at(_next(projector.body), displacement, factors).rows(0), np.zeros(0)
    left = projector.scaled(left)
    return Missing(-projector.factorised(displacement, factors).solve(left), none, none)


def _next(body: FiniteBody) -> FiniteBody:
    """The body with fits of the next degree."""
    model = body.elastic.model
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    settings = next_degree(model.settings, model.material)
    better = type(model).build(model.name, model.cloud, model.material, settings)
    return replace(body, elastic=replace(body.elastic, model=better), coarser=model)


def energy_errors(scene: FiniteScene, state: State) -> tuple[dict[str, FloatArray], float]:
    """Contributions (n,) of the nodes to the estimated error of the energy, by body, and the energy."""
    near, nodal, total = near_pressed(scene, state.side_traction), {}, 0.0
    for name, loaded in scene.loaded(state).items():
        nodal[name] = unaccounted(*loaded)
        total += energy(*loaded)
        nodal[name][near[name]] = 0.0
    return nodal, total


def missing_works(scene: FiniteScene, before: State, now: State) -> dict[str, float]:
    """Internal less external work from one state to another, by body. By the principle of virtual work the
    two are equal for every stress in equilibrium, whether or not it derives from a strain. Bodies without
    supports are rotated back first: rigid motions do no work."""
    found, both = {}, [scene.loaded(one) for one in (before, now)]
    near = near_pressed(scene, np.abs(before.side_traction) + np.abs(now.side_traction))
    for name, body in scene.bodies.items():
        elastic, (then, at) = body.elastic, (one[name][1] for one in both)
        turn, nodes = 0.0, elastic.model.cloud.points
        if not any(map(any, elastic.held.values())) and len(elastic.held_nodes) == body.pins:
            turn = body.turn(at) - body.turn(then)
        cos, sin = np.cos(turn), np.sin(turn)
        ahead = np.array([[cos, sin], [-sin, cos]])
        first, last = nodes + then.reshape(-1, 2), nodes + at.reshape(-1, 2)
        ways = ((last @ ahead.T - first).ravel(), (last - first @ ahead).ravel())
        works = [missing_work(*one[name], way, near[name]) for one, way in zip(both, ways, strict=True)]
        found[name] = 0.5 * sum(works)
    return found


def missing_figures(scene: FiniteScene, state: State, missing: Missing) -> dict[str, Any]:
    """Estimated errors of a state for summary.json by what its fits are ``missing``: of all displacements
    (root mean square), and by contact of the pressures (L2 norm) and of the force over the largest one."""
    size = float(np.linalg.norm(state.displacement))
    part = float(np.linalg.norm(missing.displacement)) / size if size else None
    found: dict[str, Any] = {"displacement": part}
    if not scene.in_increments:
        return found
    pressure, force = {}, {}
    for contact, here, there in scene.contacts.each:
        weight = contact.slave.weight
        both = (one[there].reshape(-1, 2)[: len(weight)] for one in (state.side_traction, missing.traction))
        if state.pressure[here].any():
            square = weight @ missing.pressure[here] ** 2 / (weight @ state.pressure[here] ** 2)
            pressure[contact.name] = float(np.sqrt(square))
            force[contact.name] = [float(np.hypot(*(weight @ one))) for one in both]
    largest = max((whole for whole, _ in force.values()), default=0.0)
    return found | {
        "pressure": pressure,
        "contacts": {name: change / largest for name, (_, change) in force.items() if largest},
    }


def energy_estimate(tally: Mapping[str, Any]) -> float:
    """Largest estimated error of the energy over the largest energy on the path."""
    return float(tally["unaccounted"] / tally["energy"]) if tally["energy"] else 0.0


def work_error(tally: Mapping[str, Any]) -> float:
    """Internal less external work of the bodies over the largest energy."""
    works = tally["missing"].values()
    return sum(map(abs, works)) / (0.5 * tally["energy"]) if tally["energy"] else 0.0
