"""Estimated errors of displacements and pressures of a state at finite strain.

Defect correction as at small strain (:mod:`mlsanm_cli.mechanics.defect`): the residual of the equations by
fits of the next degree, in the equations of the path, is minus the error of the displacements. In contact it
is one more step of Newton's method: gaps, pressures and free motions follow.

Equation (18) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping
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
    """Change of the displacements (2N,) of all bodies and of the nominal pressures (c,) and ``normal`` ones
    of a state if fits were of the next degree."""

    displacement: FloatArray
    pressure: FloatArray

    def figures(
        self, displacement: FloatArray, pressed: Pressed | None, contacts: Mapping[str, FloatArray]
    ) -> dict[str, object]:
        """For summary.json: of a ``displacement`` (2N,), and of the pressures of ``contacts`` by the lengths
        (c,) of their nodes in turn."""
        size = float(np.linalg.norm(displacement))
        found: dict[str, object] = {
            "displacement": float(np.linalg.norm(self.displacement)) / size if size else None
        }
        pressure, first = {}, 0
        for name, weight in contacts.items():
            here, first = slice(first, first + len(weight)), first + len(weight)
            if pressed is not None and pressed.pressure[here].any():
                change, whole = (
                    np.sqrt(weight @ one[here] ** 2) for one in (self.pressure, pressed.pressure)
                )
                pressure[name] = float(change / whole)
        return found | ({"pressure": pressure} if pressure else {})


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
    return Missing(done.du, np.where(now.sets.closed | done.sets.closed, done.dp, 0.0))


def missed_alone(projector: Projector, displacement: FloatArray, factors: FloatArray) -> Missing:
    """Of the ``displacement`` (2N,) of a body without contact at load ``factors`` (L,). Raises NumericalError
    or LinAlgError."""
    series = BodySeries(_next(projector.body), 0)
    series.put(0, displacement, factors)
    left = projector.scaled(series.rows(0))
    return Missing(-projector.factorised(displacement, factors).solve(left), np.zeros(0))


def _next(body: FiniteBody) -> FiniteBody:
    """The body with fits of the next degree."""
    model = body.elastic.model
    if model.settings.degree not in DEGREES:
        raise NumericalError(f"no error estimate is known for degree {model.settings.degree}")
    settings = next_degree(model.settings)
    better = type(model).build(model.name, model.cloud, model.material, settings)
    return replace(body, elastic=replace(body.elastic, model=better))
