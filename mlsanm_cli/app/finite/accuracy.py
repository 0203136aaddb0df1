"""Estimated errors at finite strain: of the energy by residuals; of displacements, pressures and forces by
defect correction as at small strain (:mod:`mlsanm_cli.mechanics.defect`): the residual of the equations by
fits of the next degree, in the equations of the path, is minus the error of the displacements. In contact it
is one more step of Newton's method: gaps, pressures and free motions follow. Equation (29) of
docs/method.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import nearest
from mlsanm_cli.contact.finite.exact import ExactContact, FiniteContactState
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import DEGREES, next_degree
from mlsanm_cli.mechanics.energy import extended, least_thermal_energy, over_body
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.stability import Loaded
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.laws.law import determinant
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.roundoff import ROUND_OFF
from mlsanm_cli.solve.state import State

PRESSED_MISFIT = 0.1
"""Tractions are not resolved where their projection differs by more than this part of the largest one."""
PRESSED_DISTANCE = 4.0
"""Distance, in spacings, from tractions that are not resolved within which their fields are not, either."""


Missing: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Changes of a state if fits were of the next degree: of the displacements (2N,) of all bodies, the nominal
pressure (c,), and the traction (2s,) of all sides."""


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
    """Of the solution ``now`` at load ``factors`` (L + d,), with slips since the places ``before`` (c,)."""
    left, response = {}, system.response(now.displacement, now.traction)
    surface = response.moved(now.displacement, now.traction)
    upright = as_real(as_complex(now.traction.reshape(-1, 2)) / system.contacts.turned(surface)[0]).ravel()
    for name, projector in system.projectors.items():
        body, here, spread = projector.body, system.bodies[name], system.spread[name]
        better, acting = _next(body), np.concatenate([factors, spread @ now.traction])
        left[name] = BodySeries.at(better, now.displacement[here], acting).rows(0)
        # What closed forms replace is not missing: the part along the residual by fits of the next degree of
        # the linear response of the undeformed body to the tractions.
        linear, traction = undeformed[name], spread @ upright
        first = body.loads.count - len(traction)
        still, none = np.zeros(body.unknowns), np.zeros(body.loads.count)
        columns = load_columns(linear.body, still, none, slice(first, None))
        moved = -linear.factorised(still, none).solve(linear.scaled(columns @ traction))
        series = BodySeries(better, 1)
        series.put(0, still, none)
        series.put(1, moved, np.concatenate([none[:first], traction]))
        known = _rotated(better, series.rows(1), body.turn(now.displacement[here]))
        scaled = projector.scaled(known)
        along, size = scaled @ projector.scaled(left[name]), scaled @ scaled
        left[name] -= known * (np.clip(along / size, 0.0, 1.0) if size else 0.0)
    met = system.contacts.meet(surface, factors, before, now.sets.closed)
    state = (now.displacement, now.traction, now.pressure, now.shear, now.sets, met)
    step = Iteration(system, factors, response, *state, first=False, left=left)
    pressure = np.where(now.sets.closed | step.sets.closed, step.dp, 0.0)
    return step.du, pressure, step.traction


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
    return -projector.factorised(displacement, factors).solve(left), none, none


def _next(body: FiniteBody) -> FiniteBody:
    """The body with fits of the next degree."""
    model = body.elastic.model
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    settings = next_degree(model.settings, model.material)
    better = type(model).build(model.name, model.cloud, model.material, settings)
    return replace(body, elastic=replace(body.elastic, model=better), coarser=model)


def energy_errors(scene: FiniteScene, state: State) -> tuple[dict[str, FloatArray], float]:
    """Contributions (n,) of the nodes to the estimated error of the energy, by body, and the energy, the
    integral of P : (F - F^-T) / 2, which is twice the strain energy at small strain for any rotation. From
    residuals of equilibrium inside and of tractions on free sides, weighted with the spacing and the
    uniaxial-strain modulus (Babuska and Rheinboldt 1978, doi:10.1002/nme.1620121010; Ainsworth and Oden 2000,
    section 2.2): at a crushed corner, which least squares makes smooth, fits of the next degree do not reveal
    the error. Equation (27) of docs/method.md."""
    near, nodal, total = near_pressed(scene, state.side_traction), dict[str, FloatArray](), 0.0
    for name, (body, own, acting) in scene.loaded(state).items():
        elastic, model, cloud = body.elastic, body.elastic.model, body.elastic.model.cloud
        areas, modulus, count = cloud.areas, model.material.modulus, len(cloud.points)
        left = BodySeries.at(body, own, acting).rows(0)
        found = areas * cloud.spacing**2 * (left[:count] ** 2 + left[count : 2 * count] ** 2)
        for side, index, _, held in body.conditions:
            weight = cloud.surfaces[side].weight * cloud.spacing[index]
            for component in np.flatnonzero(~np.array(held)).tolist():
                np.add.at(found, index, weight * left[elastic.condition_rows(side, component)] ** 2)
        nodal[name] = np.where(near[name], 0.0, found / modulus)
        gradient, degrees, stress = body.gradient(own), body.degrees(acting), body.stress(own, acting)
        xx, xy, yx, yy = gradient + np.array([1.0, 0.0, 0.0, 1.0])[:, None]
        turned = np.stack([yy, -yx, -xy, xx]) / (1.0 + determinant(gradient))
        least = ROUND_OFF**2 * modulus * areas.sum()
        if degrees is not None:
            turned = body.law.squared_free_stretch(turned, degrees)
            least = max(least, least_thermal_energy(model, degrees))
        total += float(areas @ (stress * 0.5 * (np.stack([xx, xy, yx, yy]) - turned)).sum(axis=0) + least)
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
        ways = last @ ahead.T - first, last - first @ ahead
        works = [_missing_work(one[name], way, near[name]) for one, way in zip(both, ways, strict=True)]
        found[name] = 0.5 * sum(works)
    return found


def _missing_work(loaded: Loaded, way: FloatArray, near: BoolArray) -> float:
    """Virtual work of the stress of a body on a small displacement ``way`` (n, 2), minus that of all forces,
    per thickness. Next to forces that the cloud does not resolve, at nodes ``near`` (n,), the displacement
    continues smoothly from elsewhere; a smooth field with the ``way`` of held parts is subtracted, so that
    reactions, which are hardly known, do no work. Equation (28) of docs/method.md."""
    body, displacement, factors = loaded
    elastic, cloud, moved = body.elastic, body.elastic.model.cloud, way
    if near.any():
        moved = extended(cloud, moved, np.repeat(~near[:, None], 2, axis=1))
    held = np.zeros(moved.shape, dtype=bool)
    for name, components in elastic.held.items():
        held[cloud.surfaces[name].index] |= np.array(components)
    for node, component in elastic.held_nodes[: len(elastic.held_nodes) - body.pins]:
        held[node, component] = True
    if moved[held].any():
        moved = moved - extended(cloud, moved, held)
    found = over_body(cloud, body.stress(displacement, factors).T, body.gradient(moved.ravel()).T)
    force = BodySeries.at(body, displacement, factors).outline_forces()[1]
    found -= float((force.T * body.applied.points.seen(moved)[:, 0]).sum())
    if body.loads.force is not None:
        found -= over_body(cloud, body.loads.force @ factors, moved)
    return found


def missing_figures(scene: FiniteScene, state: State, missing: Missing) -> dict[str, Any]:
    """Estimated errors of a state for summary.json by what its fits are ``missing``: of all displacements
    (root mean square), and by contact of the pressures (L2 norm) and of the force over the largest one."""
    (moved, pressed, carried), size = missing, float(np.linalg.norm(state.displacement))
    part = float(np.linalg.norm(moved)) / size if size else None
    found: dict[str, Any] = {"displacement": part}
    if not scene.in_increments:
        return found
    both = state.side_traction, carried
    force, change = (np.hypot(*scene.contacts.forces(one).T) for one in both)
    largest, pressure, contacts = force.max(initial=0.0), dict[str, float](), dict[str, float]()
    slaves = np.cumsum([0, *(len(one.sides) for one in scene.contacts.pairs)])[:-1]
    for (contact, here, _), off in zip(scene.contacts.each, change[slaves], strict=True):
        if state.pressure[here].any():
            weight, values = contact.slave.weight, state.pressure[here]
            pressure[contact.name] = float(np.sqrt(weight @ pressed[here] ** 2 / (weight @ values**2)))
            contacts |= {contact.name: float(off / largest)} if largest else {}
    return found | {"pressure": pressure, "contacts": contacts}


def work_error(tally: Mapping[str, Any]) -> float:
    """Internal less external work of the bodies over the largest energy."""
    works = tally["missing"].values()
    return sum(map(abs, works)) / (0.5 * tally["energy"]) if tally["energy"] else 0.0
