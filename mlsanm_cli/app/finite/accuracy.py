"""Estimated errors of displacements and pressures of a state at finite strain.

Defect correction as at small strain (:mod:`mlsanm_cli.mechanics.defect`): the residual of the equations by
fits of the next degree, in the equations of the path, is minus the error of the displacements. In contact it
is one more step of Newton's method: gaps, pressures and free motions follow.

Equation (18) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.finite.answers import Closer
from mlsanm_cli.contact.finite.exact import ExactContact, Pressed
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.defect import DEGREES, next_degree
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Projector


@dataclass(frozen=True)
class Missing:
    """Changes of a state if fits were of the next degree: of the displacements (2N,) of all bodies, the
    nominal ``pressure`` (c,), and the ``traction`` (2s,) of all sides."""

    displacement: FloatArray
    pressure: FloatArray
    traction: FloatArray


def missed_in_contact(
    pressing: ExactContact, now: Pressed, before: FloatArray | None, factors: FloatArray
) -> Missing:
    """Of the solution ``now`` at load ``factors`` (L + d,), with slips since the places ``before`` (c,).
    Raises NumericalError or LinAlgError."""
    moved = now.displacement[pressing.numbers]
    closer = Closer.of(pressing.sides, pressing.answers, moved, now.traction)
    met = pressing.meet(closer.moved(moved, now.traction), factors, before, now.sets.closed)
    measured = {name: _next(one.body) for name, one in pressing.projectors.items()}
    step = Iteration(pressing, factors, before, closer, measured=measured)
    state = (now.displacement, now.traction, now.pressure, now.shear, now.sets, met)
    done = step.taken(*state, first=False)
    pressure = np.where(now.sets.closed | done.sets.closed, done.dp, 0.0)
    return Missing(done.du, pressure, done.traction)


def missed_alone(projector: Projector, displacement: FloatArray, factors: FloatArray) -> Missing:
    """Of the ``displacement`` (2N,) of a body without contact at load ``factors`` (L,). Raises NumericalError
    or LinAlgError."""
    series, none = BodySeries(_next(projector.body), 0), np.zeros(0)
    series.put(0, displacement, factors)
    change = -projector.factorised(displacement, factors).solve(projector.scaled(series.rows(0)))
    return Missing(change, none, none)


def _next(body: FiniteBody) -> FiniteBody:
    """The body with fits of the next degree."""
    model = body.elastic.model
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    settings = next_degree(model.settings, model.material)
    better = type(model).build(model.name, model.cloud, model.material, settings)
    return replace(body, elastic=replace(body.elastic, model=better))
