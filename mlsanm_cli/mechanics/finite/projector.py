"""The equations of a body at finite strain, and their factorised derivative.

Least squares of nonlinear rows R would ask for J(u)^T W^2 R(u) = 0, whose own derivative is not at hand:
Gauss-Newton iterations converge slowly, and series jump from step to step. So the rows J_0 of one state, the
station, make the equations of a path, a smooth square system::

    J_0^T W^2 R(u) = 0        derivative  J_0^T W^2 J(u)

W weighs the rows as in the linear body and its pieces as strongly as there. Right at the station that is the
linear least-squares problem, and what it makes of R is the measure of how far a state is from a solution: the
displacement that would mend it.

Equation (17) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.mechanics.assembly import row_weights
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.tangent import derivative_pieces, derivative_rows
from mlsanm_cli.operators import least_squares
from mlsanm_cli.operators.least_squares import LeastSquares, Strong
from mlsanm_cli.operators.linear.interface import DirectSolver, Factor
from mlsanm_cli.operators.linear.superlu import elimination_order, factor_unsymmetric

PIVOT_THRESHOLD = 1e-3
"""Diagonal entries down to this part of the largest of their column are pivots. Block under a cylinder, 0.3 R
deep, 487 nodes: with 0.1 the factorisation takes 2.2 times as long and solutions twice, at the same accuracy,
as other pivots undo the nested dissection."""
MAX_REFINEMENTS, REFINEMENT_TOLERANCE = 8, 1e-7
"""Largest number of refinements of a solution, and relative change by the last one: the next would change it
by this part of that. A bar on springs of 1e-5 of its modulus takes four."""

NO_ROWS: IntArray = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class Weights:
    """Weights (r - 3k,) of the nodes' rows and scales (3k,) of the pieces', 0 where they say nothing."""

    nodes: FloatArray
    pieces: FloatArray

    @classmethod
    def of(cls, body: FiniteBody, left_out: IntArray = NO_ROWS) -> Weights:
        """As the linear body has them, but for rows (m,) ``left_out``."""
        elastic = body.elastic
        model, pieces = elastic.model, elastic.pieces
        nodes = row_weights(model, elastic.held, elastic.held_nodes, body.table, elastic.gripped)
        nodes[left_out] = 0.0
        # Pins only say where a body is: they take no force from its pieces.
        bearing = elastic.held_nodes[: len(elastic.held_nodes) - body.pins]
        known: BoolArray = pieces.rows_known(list(bearing))
        scale = np.tile(pieces.strength / (model.material.modulus * pieces.size), 3)
        return cls(nodes, np.where(known, scale, 0.0))


@dataclass(frozen=True)
class Projector:
    """The rows of a ``station`` (2N,), a displacement, as they are weighted, with their factorised
    least-squares problem; ``places`` (k, 2) are the means of the pieces' nodes. Equations are of what rows
    are left with beyond the ``rest`` (r,), which is 0 but where the station is to solve them itself."""

    body: FiniteBody
    weights: Weights
    station: FloatArray
    system: LeastSquares
    places: FloatArray
    rest: FloatArray

    @classmethod
    def at(
        cls,
        body: FiniteBody,
        weights: Weights,
        displacement: FloatArray,
        factors: FloatArray,
        solver: DirectSolver,
        keeps: bool = False,
    ) -> Projector:
        """Those of a state of ``displacement`` (2N,) and load ``factors`` (L,), which solves them itself if
        it ``keeps`` what its nodes' rows are left with; NumericalError for a singular one."""
        nodes, pieces = body.elastic.model.nodes, body.elastic.pieces
        rows, strong_rows = weighted_rows(body, weights, displacement, factors)
        count = 3 * pieces.count
        first = sparse.csr_array((count, body.elastic.rows - count))
        loads = sparse.hstack([first, sparse.diags_array(weights.pieces)], format="csr")
        places = np.zeros((pieces.count, 2))
        np.add.at(places, pieces.labels, nodes)
        places /= np.bincount(pieces.labels, minlength=pieces.count)[:, None]
        owner = np.arange(count) % pieces.count
        none = sparse.csr_array((0, count))
        strong = Strong(strong_rows, sparse.csr_array(loads), owner, places, none)
        system = least_squares.factorise(rows, weights.nodes, nodes, solver, strong)
        rest = np.zeros(body.elastic.rows)
        if keeps:
            series = BodySeries(body, 0)
            series.put(0, displacement, factors)
            rest[:-count] = series.rows(0)[:-count]
        return cls(body, weights, displacement, system, places, rest)

    def displaced(self, left: FloatArray) -> FloatArray:
        """The displacement (2N,) that what is ``left`` (r,) of the rows stands for, at the station."""
        return self.system.solve(sparse.csc_array(left[:, None]))[:, 0]

    def scaled(self, left: FloatArray) -> FloatArray:
        """What is ``left`` (r,) of the rows as they are weighted."""
        return np.asarray(left * np.concatenate([self.weights.nodes, self.weights.pieces]))

    def image(self, displacement: FloatArray) -> FloatArray:
        """The station's weighted rows (r,) of a ``displacement`` (2N,)."""
        return np.concatenate([self.system.rows @ displacement, self.system.strong.rows @ displacement])

    @cached_property
    def _turned(self) -> sparse.csr_array:
        return sparse.csr_array(self.system.rows.T)

    def gathered(self, scaled: FloatArray) -> FloatArray:
        """The equations' right-hand side (2N,) by weighted rows (r,), those of the pieces left out."""
        return np.asarray(self._turned @ scaled[: len(self.weights.nodes)])

    def scaled_columns(self, left: sparse.csr_array) -> FloatArray:
        """The same of several (r, c), as an array."""
        scale = np.concatenate([self.weights.nodes, self.weights.pieces])
        return np.asarray((sparse.diags_array(scale) @ left).toarray())

    def factorised(
        self, displacement: FloatArray, factors: FloatArray, turning: sparse.csr_array | None = None
    ) -> Factorised:
        """The derivative of the equations in a state of ``displacement`` (2N,) and load ``factors`` (L,), the
        rows ``turning`` (r, 2N) of other loads that turn added; NumericalError where it is singular."""
        if np.array_equal(displacement, self.station) and (turning is None or not turning.nnz):
            return Factorised(self, self.system.rows, self.system.strong.rows, None)
        rows, strong = weighted_rows(self.body, self.weights, displacement, factors)
        if turning is not None:
            scale = np.concatenate([self.weights.nodes, self.weights.pieces])
            more = sparse.csr_array(sparse.diags_array(scale) @ turning)
            rows = sparse.csr_array(rows + more[: rows.shape[0]])
            strong = sparse.csr_array(strong + more[rows.shape[0] :])
        normal = sparse.csr_array(self._turned @ rows)
        place = self._multipliers
        up = sparse.csr_array(self.system.strong.rows.T) @ place.T
        down = place @ strong
        matrix = sparse.block_array([[normal, up], [down, -sparse.eye_array(place.shape[0])]], format="csc")
        factor = factor_unsymmetric(sparse.csc_array(matrix), self._order(matrix), PIVOT_THRESHOLD)
        return Factorised(self, rows, strong, factor)

    @cached_property
    def _multipliers(self) -> sparse.csr_array:
        """Where the pieces' rows have their multipliers (4k, 3k): two vertices of two for every piece."""
        count = self.body.count
        number = np.arange(3 * count)
        line = 4 * (number % count) + number // count
        return sparse.csr_array((np.ones(3 * count), (line, number)), shape=(4 * count, 3 * count))

    def _order(self, matrix: sparse.csc_array) -> IntArray:
        points = np.concatenate([self.body.elastic.model.nodes, np.repeat(self.places, 2, axis=0)])
        return elimination_order(sparse.csc_array(matrix), points)


@dataclass(frozen=True)
class Factorised:
    """The factorised derivative of a projector's equations in a state, whose weighted rows are ``rows`` and
    ``strong``; at the station it is the projector's own, and there is no other ``factor``."""

    projector: Projector
    rows: sparse.csr_array
    strong: sparse.csr_array
    factor: Factor | None

    def solve(self, scaled: FloatArray) -> FloatArray:
        """The displacement (2N,) whose rows in this state are the ``scaled`` (r,), as far as the equations
        see, refined on the rows themselves: once, or as often as soft springs of a stiff body ask for."""
        solution = self.solve_unrefined(scaled)
        for _ in range(MAX_REFINEMENTS):
            change = self.solve_unrefined(scaled - self.image(solution))
            solution = solution + change
            if not np.abs(change).max() > REFINEMENT_TOLERANCE * np.abs(solution).max():
                break
        return solution

    def image(self, displacement: FloatArray) -> FloatArray:
        """The weighted rows (r,) of a ``displacement`` (2N,) in this state."""
        return np.concatenate([self.rows @ displacement, self.strong @ displacement])

    def solve_unrefined(self, scaled: FloatArray) -> FloatArray:
        """The same by the factor alone, of one (r,) or several (r, c)."""
        projector = self.projector
        count = len(projector.weights.nodes)
        if self.factor is None:
            gathered = projector.gathered(scaled) + self.strong.T @ scaled[count:]
            shape = (len(gathered), -1)
            return projector.system.inverse_normal(gathered.reshape(shape)).reshape(gathered.shape)
        below = projector._multipliers @ scaled[count:]
        whole = self.factor.solve(np.concatenate([projector.gathered(scaled), below]))
        return whole[: self.rows.shape[1]]


def weighted_rows(
    body: FiniteBody, weights: Weights, displacement: FloatArray, factors: FloatArray
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Rows (r - 3k, 2N) of the nodes and (3k, 2N) of the pieces in a state, weighted."""
    rows = derivative_rows(body, displacement, factors)
    rows.data *= np.repeat(weights.nodes, np.diff(rows.indptr))
    strong = derivative_pieces(body, displacement, factors)
    strong.data *= np.repeat(weights.pieces, np.diff(strong.indptr))
    return rows, strong
