"""Estimated errors of displacements and pressures of a state at finite strain.

Defect correction as at small strain (:mod:`mlsanm_cli.mechanics.defect`): the residual of the equations by
fits of the next degree, in the equations of the path, is minus the error of the displacements. In contact it
is one more step of Newton's method: gaps, pressures and free motions follow.

Equation (29) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.finite.exact import ExactContact, FiniteContactState
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import DEGREES, next_degree
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.mechanics.springs import FREE
from mlsanm_cli.records import dataclass

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


def near_pressed(
    bodies: Mapping[str, FiniteBody], sides: Sequence[tuple[ContactSide, slice]], traction: FloatArray
) -> dict[str, BoolArray]:
    """Masks (n,) by body of the nodes next to tractions (2s,) of the sides that the cloud does not resolve:
    what these do there is known in closed form, and not from the cloud."""
    clouds = {name: body.elastic.model.cloud for name, body in bodies.items()}
    found = {name: np.zeros(len(cloud.points), dtype=bool) for name, cloud in clouds.items()}
    for side, here in sides:
        load, cloud = traction[here], clouds[side.body]
        misfit = np.abs(side.hats @ (side.spread @ load) - load).reshape(-1, 2).max(axis=1)
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
    sides, left = system.contacts.sides, {}
    response = system.response(now.displacement, now.traction)
    surface = response.moved(now.displacement, now.traction)
    turns = (side.turned(surface[here].reshape(-1, 2))[0] for side, here in sides)
    turn = np.concatenate([np.zeros(0, dtype=complex), *turns])
    upright = as_real(as_complex(now.traction.reshape(-1, 2)) / turn).ravel()
    bodies = {name: projector.body for name, projector in system.projectors.items()}
    for name, body in bodies.items():
        better, here, spread = _next(body), system.bodies[name], system.spread[name]
        acting = np.concatenate([factors, spread @ now.traction])
        left[name] = BodySeries.at(better, now.displacement[here], acting).rows(0)
        # What closed forms replace is not missing: the part along the residual of the linear response.
        known = _of_tractions(undeformed[name], better, spread @ upright)
        known = _rotated(better, known, body.turn(now.displacement[here]))
        scaled = system.projectors[name].scaled(known)
        along, size = scaled @ system.projectors[name].scaled(left[name]), scaled @ scaled
        left[name] -= known * (np.clip(along / size, 0.0, 1.0) if size else 0.0)
    met = system.meet(surface, factors, before, now.sets.closed)
    state = (now.displacement, now.traction, now.pressure, now.shear, now.sets, met)
    step = Iteration(system, factors, response, *state, first=False, left=left)
    pressure = np.where(now.sets.closed | step.sets.closed, step.dp, 0.0)
    return Missing(step.du, pressure, step.traction)


def _of_tractions(projector: Projector, better: FiniteBody, traction: FloatArray) -> FloatArray:
    """Residual (r,) by fits of the next degree of the linear response of an undeformed body to the
    ``traction`` (t,) of its sides."""
    count, still = projector.body.loads.count, np.zeros(projector.body.unknowns)
    none = np.zeros(count)
    acting = np.concatenate([none[: count - len(traction)], traction])
    columns = load_columns(projector.body, still, none, slice(count - len(traction), None))
    factorised = projector.factorised(still, none)
    series = BodySeries(better, 1)
    series.put(0, still, none)
    series.put(1, -factorised.solve(projector.scaled(columns @ traction)), acting)
    return series.rows(1)


def _rotated(body: FiniteBody, rows: FloatArray, angle: float) -> FloatArray:
    """``rows`` (r,) of a body that has turned by an ``angle``; those of held surfaces, which do not turn and
    may be displacements across and tractions along them, stay."""
    found, count = rows.copy(), len(body.elastic.model.cloud.points)
    both: list[tuple[IntArray, IntArray]] = [(np.arange(count), count + np.arange(count))]
    for name, *_ in body.conditions:
        if not any(body.elastic.held.get(name, FREE)):
            both.append((body.elastic.condition_rows(name, 0), body.elastic.condition_rows(name, 1)))
    first = body.elastic.rows - 3 * body.count
    both.append((first + np.arange(body.count), first + body.count + np.arange(body.count)))
    for x, y in both:
        turned = (rows[x] + 1j * rows[y]) * np.exp(1j * angle)
        found[x], found[y] = turned.real, turned.imag
    return found


def missed_alone(projector: Projector, displacement: FloatArray, factors: FloatArray) -> Missing:
    """Of the ``displacement`` (2N,) of a body without contact at load ``factors`` (L,). Raises NumericalError
    or LinAlgError."""
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
