"""The equations of a body at finite strain, and their factorised derivative.

Nonlinear least squares for rows R would solve J(u)^T W^2 R(u) = 0, whose own derivative is not available:
Gauss-Newton iterations converge slowly, and series jump from step to step. Therefore the rows J_0 of one
state, the base state, define the equations of a path, a smooth square system::

    J_0^T W^2 R(u) = 0        derivative  J_0^T W^2 J(u)

W are the weights of the linear body, with pieces as strong as there. At the base state this is the linear
least-squares problem, whose solution for R measures the error of a state: the displacement that would correct
it.

Equation (20) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import field
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.assembly import row_weights
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.tangent import MeanStress, tangent_rows
from mlsanm_cli.operators import least_squares
from mlsanm_cli.operators.least_squares import LeastSquares, Strong
from mlsanm_cli.operators.linear.interface import LinearSolver
from mlsanm_cli.operators.linear.multifrontal import MultifrontalFactor, factor_general
from mlsanm_cli.operators.linear.superlu import SuperLUFactor, factor_in_order
from mlsanm_cli.records import dataclass

PIVOT_THRESHOLD = 1e-3
"""A diagonal entry is accepted as pivot down to this fraction of the largest in its column: other pivots
destroy the nested dissection."""
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


@dataclass(frozen=True)
class Projector:
    """The rows at a ``base_state`` (2N,), a displacement, and load ``factors`` (L,) there, times ``weights``
    (r,), with their factorised least squares. The equations are for the residual minus ``rest`` (r,), which
    is 0 unless the base state is to be a solution itself. ``last`` is the mean stress of an iteration."""

    body: FiniteBody
    weights: FloatArray
    base_state: FloatArray
    factors: FloatArray
    system: LeastSquares
    rest: FloatArray
    solver: LinearSolver
    last: list[MeanStress] = field(default_factory=list, compare=False)

    @classmethod
    def at(
        cls,
        body: FiniteBody,
        weights: FloatArray,
        displacement: FloatArray,
        factors: FloatArray,
        solver: LinearSolver,
        keeps: bool = False,
    ) -> Projector:
        """The projector at ``displacement`` (2N,) and load ``factors`` (L,); with ``keeps`` that state solves
        the nodes' rows by definition. Raises NumericalError if singular."""
        nodes, split = body.elastic.model.cloud.points, body.node_rows
        rows, strong_rows = weighted_rows(body, weights, displacement, factors)
        count = 3 * body.count
        loads = sparse.csr_array(sparse.diags_array(weights, format="csr")[split:])
        owner, none = np.arange(count) % body.count, sparse.csr_array((0, count))
        strong = Strong(strong_rows, loads, owner, body.elastic.pieces.middle, none)
        system = least_squares.factorise(rows, weights[:split], nodes, solver, strong, body.pattern.symbolic)
        rest = np.zeros(body.elastic.rows)
        if keeps:
            rest[:split] = BodySeries.at(body, displacement, factors).rows(0)[:split]
        return cls(body, weights, displacement, factors, system, rest, solver)

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

    @cached_property
    def _turned(self) -> sparse.csr_array:
        return sparse.csr_array(self.system.rows.T)

    def gathered(self, scaled: FloatArray) -> FloatArray:
        """Right-hand side (2N,) of the equations for weighted rows (r,), without those of the pieces."""
        return np.asarray(self._turned @ scaled[: self.body.node_rows])

    def factorised(
        self, displacement: FloatArray, factors: FloatArray, iterating: bool = False
    ) -> Factorised:
        """The derivative of the equations at ``displacement`` (2N,) and load ``factors`` (L,); in iterations
        of Newton's method with the mean stress that the last one predicted. Raises NumericalError if
        singular."""
        mean = None
        if iterating and self.body.law.nested:
            here, earlier = MeanStress(self.body, displacement, factors), self.last[:]
            self.last[:] = [here]
            mean = here.after(earlier[0]) if earlier else here
        own, own_strong = self.system.rows, self.system.strong.rows
        if np.array_equal(displacement, self.base_state):
            return Factorised(self, own, own_strong, None)
        rows, strong = weighted_rows(self.body, self.weights, displacement, factors, mean)
        symbolic = self.body.pattern.symbolic
        matrix = symbolic.normal.matrix(own, own_strong, rows, strong)
        if self.solver == "superlu":
            order = symbolic.fronts.unknowns
            return Factorised(
                self, rows, strong, factor_in_order(sparse.csc_array(matrix), order, PIVOT_THRESHOLD)
            )
        return Factorised(self, rows, strong, factor_general(matrix, symbolic.fronts, symbolic.transposed))


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
            change = self.solve_unrefined(scaled - self.image(solution))
            solution = solution + change
            if not np.abs(change).max() > REFINEMENT_TOLERANCE * np.abs(solution).max():
                break
        return solution

    def image(self, displacement: FloatArray) -> FloatArray:
        """The weighted rows (r,) of this state applied to a ``displacement`` (2N,)."""
        return np.concatenate([self.rows @ displacement, self.strong @ displacement])

    def solve_unrefined(self, scaled: FloatArray) -> FloatArray:
        """The same by the factor alone, for one (r,) or several (r, c)."""
        projector = self.projector
        count = projector.body.node_rows
        if self.factor is None:
            gathered = projector.gathered(scaled) + self.strong.T @ scaled[count:]
            shape = (len(gathered), -1)
            return projector.system.inverse_normal(gathered.reshape(shape)).reshape(gathered.shape)
        unknowns = projector.body.unknowns
        whole = np.zeros((unknowns + 4 * projector.body.count, *scaled.shape[1:]))
        # Multipliers (3k,) of the pieces: two vertices of two for every piece.
        number, pieces = np.arange(3 * projector.body.count), projector.body.count
        multipliers = unknowns + 4 * (number % pieces) + number // pieces
        whole[:unknowns], whole[multipliers] = projector.gathered(scaled), scaled[count:]
        return self.factor.solve(whole)[:unknowns]


def weighted_rows(
    body: FiniteBody,
    weights: FloatArray,
    displacement: FloatArray,
    factors: FloatArray,
    mean: MeanStress | None = None,
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Weighted rows (r - 3k, 2N) of the nodes and (3k, 2N) of the pieces in a state."""
    rows, strong = tangent_rows(body, displacement, factors, mean)
    rows.data *= np.repeat(weights[: body.node_rows], np.diff(rows.indptr))
    strong.data *= np.repeat(weights[body.node_rows :], np.diff(strong.indptr))
    return rows, strong
