"""A stage of a body's path at finite strain, for the continuation methods."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Factorised, Projector
from mlsanm_cli.mechanics.finite.stability import SoftMotion, rows_of_force, softest_motion
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class FiniteProblem:
    """R(u, lam) = 0 for the nodal displacement u (2N,), with load factors from ``start`` to ``end`` (L,). The
    residual is the displacement that would correct the state at the projector's base state, over ``length``,
    the typical displacement."""

    projector: Projector
    start: FloatArray
    end: FloatArray
    length: float
    latest: list[Any] = field(init=False, default_factory=list, compare=False)
    """The latest series, with its coefficients."""

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.projector.body.unknowns

    @property
    def scale(self) -> FloatArray:
        """Typical displacement (2N,)."""
        return np.full(self.size, self.length)

    def factors(self, lam: float) -> FloatArray:
        """Load factors (L,) at path parameter ``lam``."""
        return np.asarray((1.0 - lam) * self.start + lam * self.end)

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Correcting displacement (2N,) over the typical displacement; nan where det F <= 0."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            left = self.projector.left(x, self.factors(lam))
        if not np.isfinite(left).all():
            return np.full(self.size, np.nan)
        return self.projector.displaced(left) / self.length

    def tangent(self, x: FloatArray, lam: float) -> FiniteTangent:
        """The factorised derivative; raises LinAlgError if singular."""
        try:
            factorised = self.projector.factorised(x, self.factors(lam))
        except NumericalError as error:
            raise np.linalg.LinAlgError(error.message) from error
        return FiniteTangent(self, factorised)

    def softest(self, x: FloatArray, lam: float, tangent: object = None) -> SoftMotion:
        """The softest motion in the state ``x`` (2N,), by its ``tangent`` if that is known."""
        tangent = tangent or self.tangent(x, lam)
        assert isinstance(tangent, FiniteTangent)
        projector, factorised = self.projector, tangent.factorised

        def displaced(force: FloatArray) -> FloatArray:
            return -factorised.solve_unrefined(projector.scaled(rows_of_force(projector.body, force)))

        return softest_motion(displaced, [(projector.body, x, self.factors(lam))])

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """dR/dlam (2N,)."""
        series = BodySeries(self.projector.body, 1)
        series.put(0, x, self.factors(lam))
        series.put(1, None, self.end - self.start)
        return self.projector.displaced(series.rows(1)) / self.length

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Minus the coefficient (2N,) of the next order, from those of lower orders."""
        series = self._series(x, lam)
        series.put(len(x), None, np.zeros(len(self.start)))
        return -self.projector.displaced(series.rows(len(x))) / self.length

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether det F > 0 everywhere."""
        return bool(np.isfinite(x).all()) and self.projector.body.least_volume(x) > 0.0

    def _series(self, x: FloatArray, lam: FloatArray) -> BodySeries:
        """The series of the body with coefficients ``x`` and ``lam`` and room for another one: the last one
        with its next coefficients if it begins with the same. Room for twice as many makes the work per
        order independent of their number."""
        series, known = None, 0
        if self.latest:
            series, *before = self.latest
            known = len(before[0])
            same = known < len(x) <= series.orders and all(
                np.array_equal(now[:known], then) for now, then in zip((x, lam), before, strict=True)
            )
            if not same:
                series = None
        if series is None:
            series, known = BodySeries(self.projector.body, 2 * len(x)), 0
        for order in range(known, len(x)):
            factors = self.factors(lam[0]) if not order else lam[order] * (self.end - self.start)
            series.put(order, x[order], factors)
        self.latest[:] = [series, x.copy(), lam.copy()]
        return series


class FiniteTangent:
    """The ``factorised`` derivative of a ``problem``."""

    def __init__(self, problem: FiniteProblem, factorised: Factorised) -> None:
        self._problem, self.factorised = problem, factorised

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Displacement (2N,) that changes the residual by ``rhs`` (2N,)."""
        return self.factorised.solve(self._problem.projector.image(self._problem.length * rhs))
