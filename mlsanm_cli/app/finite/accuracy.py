"""Estimated errors of displacements and pressures of a state at finite strain.

Defect correction as at small strain (:mod:`mlsanm_cli.mechanics.defect`): the residual of the equations by
fits of the next degree, in the equations of the path, is minus the error of the displacements. In contact it
is one more step of Newton's method: gaps, pressures and free motions follow.

Equation (29) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.exact import ExactContact, FiniteContactState
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.contact.finite.side_response import SideResponse
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import DEGREES, next_degree
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.near_field import as_complex, as_real
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Missing:
    """Changes of a state if fits were of the next degree: of the displacements (2N,) of all bodies, the
    nominal ``pressure`` (c,), and the ``traction`` (2s,) of all sides."""

    displacement: FloatArray
    pressure: FloatArray
    traction: FloatArray


def missed_in_contact(
    system: ExactContact,
    undeformed: Mapping[str, Projector],
    now: FiniteContactState,
    before: FloatArray | None,
    factors: FloatArray,
) -> Missing:
    """Of the solution ``now`` at load ``factors`` (L + d,), with slips since the places ``before`` (c,).
    Raises NumericalError or LinAlgError."""
    moved, left, known = now.displacement[system.numbers], {}, np.zeros(len(system.numbers))
    sides = system.contacts.sides
    response = SideResponse.of(sides, system.corrections, moved, now.traction)
    surface = response.moved(moved, now.traction)
    turns = (side.turned(surface[here].reshape(-1, 2))[0] for side, here in sides)
    turn = np.concatenate([np.zeros(0, dtype=complex), *turns])
    upright = as_real(as_complex(now.traction.reshape(-1, 2)) / turn).ravel()
    for name, projector in system.projectors.items():
        better, own = _next(projector.body), system.columns[name]
        here = system.bodies[name]
        acting = np.concatenate([factors, now.traction[own]])
        left[name] = BodySeries.at(better, now.displacement[here], acting).rows(0)
        change = _of_tractions(undeformed[name], better, upright[own])
        known[own] = change[system.numbers[own] - here.start]
    # What fields in closed form replace is not missing.
    for (_, here), (_, missing) in zip(sides, system.corrections, strict=True):
        known[here] *= missing.any()
    known = as_real(as_complex(known.reshape(-1, 2)) * turn).ravel()
    met = system.meet(surface - response.smooth @ known, factors, before, now.sets.closed)
    step = Iteration(system, factors, response, left=left)
    state = (now.displacement, now.traction, now.pressure, now.shear, now.sets, met)
    result = step.taken(*state, first=False)
    pressure = np.where(now.sets.closed | result.sets.closed, result.dp, 0.0)
    return Missing(result.du, pressure, result.traction)


def _of_tractions(projector: Projector, better: FiniteBody, traction: FloatArray) -> FloatArray:
    """What fits miss of the response (2N,) of an undeformed body to the ``traction`` (t,) of its sides."""
    count, still = projector.body.loads.count, np.zeros(projector.body.unknowns)
    none = np.zeros(count)
    acting = np.concatenate([none[: count - len(traction)], traction])
    columns = load_columns(projector.body, still, none, slice(count - len(traction), None))
    factorised = projector.factorised(still, none)
    series = BodySeries(better, 1)
    series.put(0, still, none)
    series.put(1, -factorised.solve(projector.scaled(columns @ traction)), acting)
    return -factorised.solve(projector.scaled(series.rows(1)))


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
