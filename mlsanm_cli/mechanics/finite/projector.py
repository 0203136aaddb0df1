"""The equations of a body at finite strain, their factorised derivative, and a stage of a path of them.

The rows J_0 of one state, the base state, define the equations of a path, J_0^T W^2 R(u) = 0 with the
derivative J_0^T W^2 J(u); W are the weights of the linear body. Those of least squares, with J(u), would be
known to first order only: iterations converge slowly, and series jump from step to step. The solution for R
at the base state measures the error of a state: the displacement that would correct it. Equation (20) of
docs/method.md."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.assembly import row_weights
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.stability import SoftMotion, rows_of_force, softest_motion
from mlsanm_cli.mechanics.finite.tangent import MeanStress, tangent_rows
from mlsanm_cli.operators import least_squares
from mlsanm_cli.operators.factors import (
    LinearSolver,
    MultifrontalFactor,
    SuperLUFactor,
    factor_general,
    factor_in_order,
)
from mlsanm_cli.operators.least_squares import Strong
from mlsanm_cli.records import dataclass

PIVOT_THRESHOLD = 1e-3
"""Diagonal entries are pivots down to this fraction of their column: others destroy the nested dissection."""
MAX_REFINEMENTS, REFINEMENT_TOLERANCE = 8, 1e-7
"""Largest number of refinements of a solution, and relative change below which the last one is sufficient:
the next one would change it by this fraction of that."""

NO_ROWS: IntArray = np.zeros(0, dtype=np.int64)


def weights_of(body: FiniteBody, left_out: IntArray = NO_ROWS) -> FloatArray:
    """Weights (r,) of the rows of the linear body, zero for rows (m,) ``left_out`` and unknown ones."""
    elastic = body.elastic
    model, pieces = elastic.model, elastic.pieces
    nodes = row_weights(model, elastic.held, elastic.held_nodes, elastic.springs, elastic.restrained)
    nodes[left_out] = 0.0
    # Pins only fix the position: they take no force from pieces.
    bearing = elastic.held_nodes[: len(elastic.held_nodes) - body.pins]
    scale = np.tile(pieces.strengths_of(model.material) / (model.material.modulus * pieces.size), 3)
    return np.concatenate([nodes, np.where(pieces.rows_known(list(bearing)), scale, 0.0)])


class Projector:
    """The rows at a ``base_state`` (2N,), a displacement, and load ``factors`` (L,) there, times ``weights``
    (r,), with their factorised least squares. The equations are for the residual minus ``rest`` (r,), which
    is 0 unless that state ``keeps`` its residual in the nodes' rows, and so is a solution. Raises
    NumericalError if singular."""

    def __init__(
        self,
        body: FiniteBody,
        weights: FloatArray,
        displacement: FloatArray,
        factors: FloatArray,
        solver: LinearSolver,
        keeps: bool = False,
    ) -> None:
        self.body, self.weights, self.base_state, self.factors = body, weights, displacement, factors
        self._solver, nodes, split = solver, body.elastic.model.cloud.points, body.node_rows
        rows, strong_rows = self._weighted_rows(displacement, factors)
        count = 3 * body.count
        loads = sparse.csr_array(sparse.diags_array(weights, format="csr")[split:])
        owner, none = np.arange(count) % body.count, sparse.csr_array((0, count))
        strong = Strong(strong_rows, loads, owner, body.elastic.pieces.middle, none)
        self.system = least_squares.factorise(
            rows, weights[:split], nodes, solver, strong, body.pattern.symbolic
        )
        self.turned, self.rest = sparse.csr_array(self.system.rows.T), np.zeros(body.elastic.rows)
        if keeps:
            self.rest[:split] = BodySeries.at(body, displacement, factors).rows(0)[:split]
        # The mean stress of an iteration.
        self._last: list[MeanStress] = []

    def _weighted_rows(
        self, displacement: FloatArray, factors: FloatArray, mean: MeanStress | None = None
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Weighted rows (r - 3k, 2N) of the nodes and (3k, 2N) of the pieces in a state."""
        rows, strong = tangent_rows(self.body, displacement, factors, mean)
        split = self.body.node_rows
        rows.data *= np.repeat(self.weights[:split], np.diff(rows.indptr))
        strong.data *= np.repeat(self.weights[split:], np.diff(strong.indptr))
        return rows, strong

    def left(self, displacement: FloatArray, factors: FloatArray) -> FloatArray:
        """Residual (r,) of the equations at ``displacement`` (2N,) and load ``factors`` (L,)."""
        return np.asarray(BodySeries.at(self.body, displacement, factors).rows(0) - self.rest)

    def displaced(self, left: FloatArray) -> FloatArray:
        """Displacement (2N,) that corresponds to a residual ``left`` (r,) of the rows, at the base state."""
        return self.system.solve(sparse.csc_array(left[:, None]))[:, 0]

    def scaled(self, left: FloatArray) -> FloatArray:
        """Weighted residual, one (r,) or several (r, c)."""
        return np.asarray((left.T * self.weights).T)

    def image(self, displacement: FloatArray) -> FloatArray:
        """The base state's weighted rows (r,) applied to a ``displacement`` (2N,)."""
        return np.concatenate([self.system.rows @ displacement, self.system.strong.rows @ displacement])

    def factorised(
        self, displacement: FloatArray, factors: FloatArray, iterating: bool = False
    ) -> Factorised:
        """The derivative of the equations at ``displacement`` (2N,) and load ``factors`` (L,); in iterations
        of Newton's method with the mean stress that the last one predicted. NumericalError if singular."""
        mean = None
        if iterating and self.body.law.nested:
            here, earlier = MeanStress(self.body, displacement, factors), self._last[:]
            self._last[:] = [here]
            mean = here.after(earlier[0]) if earlier else here
        own, own_strong = self.system.rows, self.system.strong.rows
        if np.array_equal(displacement, self.base_state):
            return Factorised(self, own, own_strong, None)
        rows, strong = self._weighted_rows(displacement, factors, mean)
        normal, fronts, transposed = self.body.pattern.symbolic
        matrix = normal.matrix(own, own_strong, rows, strong)
        if self._solver == "superlu":
            args = sparse.csc_array(matrix), fronts.unknowns, PIVOT_THRESHOLD
            return Factorised(self, rows, strong, factor_in_order(*args))
        return Factorised(self, rows, strong, factor_general(matrix, fronts, transposed))


@dataclass(frozen=True)
class Factorised:
    """The factorised derivative of a projector's equations in a state with weighted ``rows`` and ``strong``;
    at the base state ``factor`` is None, as the projector has one."""

    projector: Projector
    rows: sparse.csr_array
    strong: sparse.csr_array
    factor: MultifrontalFactor | SuperLUFactor | None

    def solve(self, scaled: FloatArray) -> FloatArray:
        """Displacement (2N,) whose rows in this state are ``scaled`` (r,) in the sense of the equations, with
        as many refinements as needed."""
        solution = self.solve_unrefined(scaled)
        for _ in range(MAX_REFINEMENTS):
            image = np.concatenate([self.rows @ solution, self.strong @ solution])
            change = self.solve_unrefined(scaled - image)
            solution = solution + change
            if not np.abs(change).max() > REFINEMENT_TOLERANCE * np.abs(solution).max():
                break
        return solution

    def solve_unrefined(self, scaled: FloatArray) -> FloatArray:
        """The same by the factor alone, for one (r,) or several (r, c)."""
        projector, count = self.projector, self.projector.body.node_rows
        gathered = np.asarray(projector.turned @ scaled[:count])
        if self.factor is None:
            gathered = gathered + self.strong.T @ scaled[count:]
            shape = (len(gathered), -1)
            return projector.system.inverse_normal(gathered.reshape(shape)).reshape(gathered.shape)
        unknowns, pieces = projector.body.unknowns, projector.body.count
        whole, number = np.zeros((unknowns + 4 * pieces, *scaled.shape[1:])), np.arange(3 * pieces)
        # Multipliers of the pieces: two vertices of two for every piece.
        multipliers = unknowns + 4 * (number % pieces) + number // pieces
        whole[:unknowns], whole[multipliers] = gathered, scaled[count:]
        return self.factor.solve(whole)[:unknowns]


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
        """The factorised derivative. Raises NumericalError if singular."""
        return FiniteTangent(self, self.projector.factorised(x, self.factors(lam)))

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
        """Minus the coefficient (2N,) of the next order, from those of lower orders. The last series is used
        with its next coefficients if it begins with the same; room for twice as many makes the work per order
        independent of their number."""
        series, *before = self.latest or (None, x, lam)
        known, both = len(before[0]), zip((x, lam), before, strict=True)
        same = all(np.array_equal(now[:known], then) for now, then in both)
        if series is None or not (known < len(x) <= series.orders and same):
            series, known = BodySeries(self.projector.body, 2 * len(x)), 0
        for order in range(known, len(x)):
            factors = self.factors(lam[0]) if not order else lam[order] * (self.end - self.start)
            series.put(order, x[order], factors)
        self.latest[:] = [series, x.copy(), lam.copy()]
        series.put(len(x), None, np.zeros(len(self.start)))
        return -self.projector.displaced(series.rows(len(x))) / self.length

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether det F > 0 everywhere."""
        return bool(np.isfinite(x).all()) and self.projector.body.least_volume(x) > 0.0


@dataclass(frozen=True)
class FiniteTangent:
    """The ``factorised`` derivative of a ``problem``."""

    problem: FiniteProblem
    factorised: Factorised

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Displacement (2N,) that changes the residual by ``rhs`` (2N,)."""
        return self.factorised.solve(self.problem.projector.image(self.problem.length * rhs))
