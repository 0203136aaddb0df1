"""Weighted linear least squares by the normal equations, with iterative refinement on the rows themselves.

For rows M u = b with row weights w, and strong rows B u = L b, the solution minimises ||diag(w) (M u - b)|^2
+ |B u - L b|^2. Strong rows involve many unknowns and would fill the normal equations N of the others; so
their multipliers z = B u - L b are additional unknowns::

    N u + B^T z = M^T W b           B u - z = L b

which is quasi-definite (Vanderbei 1995, doi:10.1137/0805005) and has a factor without pivoting in any order.
A few sums of strong rows, forces and moment on the whole body, hold exactly, C u = d (Bjorck 1996,
doi:10.1137/1.9781611971484, section 5.1); they nearly hold before, and hold to round-off however accurate Y::

    Y = N^-1 C^T (C N^-1 C^T)^-1        u = N^-1 f + Y (d - C N^-1 f)

The factor alone loses half the digits. Residuals of the rows restore them (Bjorck 1987,
doi:10.1016/0024-3795(87)90101-7), by conjugate gradients (Bjorck 1996, section 7.4) with the factor as
preconditioner. For bodies a hundred times as long as thick the factor has lost bending modes and is not
even definite: each direction is made conjugate to several previous ones (Golub and Ye 1999,
doi:10.1137/S1064827597323415). Equation (4) of docs/method.md."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.kernels.normal import add_blocks, count_neighbours, group_rows, rows_of_nodes
from mlsanm_cli.operators.factors import (
    Factor,
    Fronts,
    LinearSolver,
    factor_definite,
    mirrored,
    refuse_too_many,
    structure,
)
from mlsanm_cli.operators.system import (
    DIRECTIONS,
    FULL_TOLERANCE,
    FUNCTIONAL_TOLERANCE,
    MAX_UPDATES,
    TINY,
    LinearSystem,
    Progress,
    corrected,
)
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF


@dataclass(frozen=True)
class Strong:
    """Strong ``rows`` (g, n), scaled, and their operator ``loads`` (g, r) on right-hand sides. The multiplier
    of row i belongs to place ``owner[i]`` (g,) among ``places`` (k, 2), at most four to one place, where it
    is eliminated. The ``sums`` (s, g) of rows hold exactly."""

    rows: sparse.csr_array
    loads: sparse.csr_array
    owner: IntArray
    places: FloatArray
    sums: sparse.csr_array


@dataclass(frozen=True)
class Conditions:
    """``rows`` C (s, n), ``lift`` Y (n, s), and ``stiffness`` (s, s), the inverse of C N^-1 C^T."""

    rows: sparse.csr_array
    lift: FloatArray
    stiffness: FloatArray

    def met(self, solution: FloatArray, wanted: FloatArray) -> FloatArray:
        """The ``solution`` (n, c) of the normal equations, corrected to C u = ``wanted`` (s, c)."""
        return np.asarray(solution + self.lift @ (wanted - self.rows @ solution))


def independent_sums(rows: sparse.csr_array, sums: sparse.csr_array) -> tuple[sparse.csr_array, IntArray]:
    """Constraints (t, n) that are ``sums`` (s, g) of strong ``rows`` (g, n), without those that cancel, and
    which sums they are (t,)."""
    taken = sparse.csr_array(sums @ rows)
    size = _largest(sparse.csr_array(abs(sums) @ abs(rows)))
    taken.data[np.abs(taken.data) <= FINE_ROUND_OFF * np.repeat(size, np.diff(taken.indptr))] = 0.0
    taken.eliminate_zeros()
    kept = np.flatnonzero(_largest(taken) > ROUND_OFF * size)
    return sparse.csr_array(taken[kept]), kept


def _largest(matrix: sparse.csr_array) -> FloatArray:
    """Largest modulus in every row (s,)."""
    return np.asarray(abs(matrix).max(axis=1).toarray()).ravel() if matrix.shape[0] else np.zeros(0)


@dataclass(frozen=True)
class LeastSquares(LinearSystem):
    """Factorised least-squares problem: ``rows`` (e, n) already multiplied by ``weight`` (e,), and ``strong``
    rows, whose sums are the ``conditions``. Of the r right-hand sides the first e are those of the rows. The
    ``factor`` is that of the equations for the n unknowns followed by ``multipliers``."""

    rows: sparse.csr_array
    weight: FloatArray
    strong: Strong
    factor: Factor
    conditions: Conditions
    multipliers: int = 0

    def solve(self, sources: sparse.csc_array, tolerance: float = FULL_TOLERANCE) -> FloatArray:
        scaled = self.scaled(sources)
        solution = self._refined(scaled, tolerance)[0]
        return self.conditions.met(solution, self._sums(scaled))

    def correction(self, sources: sparse.csc_array, solutions: FloatArray | None = None) -> FloatArray:
        scaled = self.scaled(sources)
        wanted = self._sums(scaled)
        if solutions is not None:
            scaled, wanted = scaled - self._apply(solutions), wanted - self.conditions.rows @ solutions
        # The response to the conditions by the factor alone as well: its error in the bending of long thin
        # bodies then affects both alike.
        return self._unrefined_conditions.met(self.inverse_normal(self._gather(scaled)), wanted)

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        weighted = sparse.csc_array(self._scaling @ sources)
        mixed = np.eye(sources.shape[1]) if mixture is None else mixture
        count, first = weighted.shape[0], self.rows.shape[0]
        rows = sparse.csr_array(sparse.vstack([observed, self.conditions.rows], format="csr"))

        def of_columns(chosen: FloatArray) -> FloatArray:
            misfit = weighted @ (mixed @ chosen)
            return np.asarray(rows @ self._refined(misfit, FUNCTIONAL_TOLERANCE)[0])

        def of_rows(chosen: FloatArray) -> FloatArray:
            misfit = np.zeros((count, chosen.shape[1]))
            images = -self._refined(misfit, FUNCTIONAL_TOLERANCE, np.asarray(rows.T @ chosen))[1]
            return np.asarray((weighted.T @ images).T @ mixed)

        gathered = sparse.csc_array(self.rows.T @ weighted[:first] + self.strong.rows.T @ weighted[first:])
        # Followed by the multipliers, which nothing observes or loads.
        size = self.rows.shape[1] + self.multipliers
        wide = sparse.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], size))
        entries = (gathered.data, gathered.indices, gathered.indptr)
        tall = sparse.csc_array(entries, shape=(size, gathered.shape[1]))
        start = self.factor.products(wide, tall)
        seen, kept = np.split(corrected(start @ mixed, of_columns, of_rows), [observed.shape[0]])
        wanted = (self.strong.sums @ weighted[first:]) @ mixed
        return np.asarray(seen + (observed @ self.conditions.lift) @ (wanted - kept))

    def _refined(
        self, misfit: FloatArray, tolerance: float, force: FloatArray | float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Solutions (n, c) of N x = ``force`` + A^T ``misfit`` (e + g, c), A all rows, and the remaining
        misfit. ``force`` (n, c) is zero for solutions of the least-squares problem."""
        solution = self.inverse_normal(force + self._gather(misfit))
        progress, misfit = Progress(solution, tolerance), misfit - self._apply(solution)
        before: deque[tuple[FloatArray, FloatArray, FloatArray]] = deque(maxlen=DIRECTIONS)
        for _ in range(MAX_UPDATES):
            gradient = force + self._gather(misfit)
            step = self.inverse_normal(gradient)
            image = self._apply(step)
            for other, seen, size in before:
                share = np.einsum("ij,ij->j", seen, image) / size
                step -= share * other
                image -= share * seen
            size = np.maximum(np.einsum("ij,ij->j", image, image), TINY)
            # Further steps for converged solutions would only add round-off.
            length = np.where(progress.done, 0.0, np.einsum("ij,ij->j", gradient, step) / size)
            solution += length * step
            misfit -= length * image
            before.append((step, image, size))
            progress.advance(length * step, solution)
            if progress.done.all():
                break
        return solution, misfit

    @cached_property
    def _unrefined_conditions(self) -> Conditions:
        """The conditions with the response by the factor alone."""
        rows = self.conditions.rows
        if not rows.shape[0]:
            return self.conditions
        answer = self.inverse_normal(rows.T.toarray())
        stiffness = np.linalg.inv(rows @ answer)
        return Conditions(rows, answer @ stiffness, stiffness)

    def _sums(self, scaled: FloatArray) -> FloatArray:
        """Values of the conditions (s, c) for scaled right-hand sides (e + g, c)."""
        return np.asarray(self.strong.sums @ scaled[self.rows.shape[0] :])

    @property
    def note(self) -> str:
        return self.factor.note

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        nothing = np.zeros((self.multipliers, *vectors.shape[1:]))
        return self.factor.solve(np.concatenate([vectors, nothing]))[: len(vectors)]

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        found = (self._scaling @ sources).toarray()
        return np.asarray(found if strong else found[: len(self.weight)])

    @cached_property
    def _scaling(self) -> sparse.csc_array:
        """Matrix (e + g, r) that scales right-hand sides and appends those of the strong rows."""
        own = sparse.diags_array(self.weight, shape=(len(self.weight), self.strong.loads.shape[1]))
        return sparse.csc_array(sparse.vstack([own, self.strong.loads], format="csc"))

    def equations(self, sources: sparse.csc_array) -> tuple[sparse.csr_array, sparse.csr_array]:
        """The normal equations of all rows, with the forces of the conditions in the right-hand sides."""
        normal = self.rows.T @ self.rows + self.strong.rows.T @ self.strong.rows
        weighted, first = sparse.csc_array(self._scaling @ sources), self.rows.shape[0]
        caused = self.rows.T @ weighted[:first] + self.strong.rows.T @ weighted[first:]
        turned, holding = self._holding
        caused = caused + turned @ sparse.csr_array((weighted.T @ holding.T).T)
        return sparse.csr_array(normal), sparse.csr_array(caused)

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Gradient (n,) of half the sum of squares, by the rows, minus the forces of the conditions."""
        scaled = np.concatenate([self.weight * source[: len(self.weight)], self.strong.loads @ source])
        turned, holding = self._holding
        return np.asarray(-self._gather(scaled - self._apply(solution)) - turned @ (holding @ scaled))

    @cached_property
    def _holding(self) -> tuple[sparse.csr_array, FloatArray]:
        """Forces of the conditions: C^T (n, s) times a matrix (s, e + g) for scaled right-hand sides."""
        holding = np.ascontiguousarray(-self._apply(self.conditions.lift).T)
        holding[:, self.rows.shape[0] :] += self.conditions.stiffness @ self.strong.sums
        return sparse.csr_array(self.conditions.rows.T), holding

    def _apply(self, solution: FloatArray) -> FloatArray:
        """Weighted and strong rows (e + g, c) applied to ``solution`` (n, c)."""
        return np.concatenate([self.rows @ solution, self.strong.rows @ solution])

    def _gather(self, scaled: FloatArray) -> FloatArray:
        """The right-hand side (n, c) of the normal equations."""
        count = self.rows.shape[0]
        return np.asarray(self.rows.T @ scaled[:count] + self.strong.rows.T @ scaled[count:])


class NormalPattern:
    """Pattern of matrices [M^T N, B^T; C, -1] in 2 x 2 blocks, for rows M and N (r, 2n) with the same
    pattern, and strong rows B and C (g, 2n) with another one. The multiplier of strong row i belongs to
    vertex 2 ``owner[i]`` (g,) or the next one; unused ones are zero. Raises NumericalError for too many
    blocks."""

    def __init__(
        self, rows: sparse.csr_array, strong: sparse.csr_array, owner: IntArray, vertices: int
    ) -> None:
        count = rows.shape[1] // 2
        own_indptr, nodes = structure(_pairs(rows))
        group, begin = np.empty(rows.shape[0], dtype=np.int32), np.zeros(rows.shape[0] + 1, dtype=np.int32)
        members = np.empty_like(nodes)
        number = group_rows(own_indptr, nodes, np.full(count, -1, dtype=np.int32), group, begin, members)
        begin, members = begin[: number + 1], members[: begin[number]].copy()
        start, end = np.zeros(count + 1, dtype=np.int32), np.zeros(count + 1, dtype=np.int64)
        of_node, entry = np.empty((2, len(members)), dtype=np.int32)
        rows_of_nodes(begin, members, start, of_node, entry)
        count_neighbours(begin, members, start, of_node, np.full(count, -1, dtype=np.int32), end)
        in_groups = np.argsort(group, kind="stable")
        first_row = np.searchsorted(group[in_groups], np.arange(number + 1))
        # Arguments of the kernel that adds up the blocks.
        self.groups = (own_indptr, in_groups, first_row, begin, members, start, of_node, entry)
        order = np.argsort(owner, kind="stable")
        place = np.empty(len(owner), dtype=np.int64)
        place[order] = np.arange(len(owner)) - np.searchsorted(owner[order], owner[order])
        line = np.repeat(4 * owner + place, np.diff(strong.indptr))
        column = strong.indices.astype(np.int64)
        pairs, block = np.unique(line // 2 * count + column // 2, return_inverse=True)
        vertex, node = np.divmod(pairs, count)
        room, below = np.bincount(node, minlength=count), np.bincount(vertex, minlength=vertices)
        # Offsets of the block rows, of which the first begin with the blocks of M^T N, and the columns of all
        # other blocks.
        indptr = np.concatenate([[0], np.cumsum(np.concatenate([np.diff(end) + room, below + 1]))])
        refuse_too_many(int(indptr[-1]))
        border = np.zeros(indptr[-1], dtype=np.int32)
        down = indptr[count + vertex] + np.arange(len(vertex)) - np.searchsorted(vertex, vertex)
        border[down] = node
        border[indptr[count + 1 :] - 1] = count + np.arange(vertices)
        by_node = np.argsort(node, kind="stable")
        up = np.empty_like(node)
        first = indptr[node[by_node] + 1] - room[node[by_node]]
        up[by_node] = first + np.arange(len(node)) - np.searchsorted(node[by_node], node[by_node])
        border[up] = count + vertex
        row, own = line % 2, column % 2
        self.indptr, self.border = indptr, border
        # Places of the coefficients of strong rows among those of the blocks.
        self.up, self.down = 4 * up[block] + 2 * own + row, 4 * down[block] + 2 * row + own

    def matrix(
        self,
        left: sparse.csr_array,
        left_strong: sparse.csr_array,
        right: sparse.csr_array,
        right_strong: sparse.csr_array,
    ) -> sparse.bsr_array:
        """The matrix of rows M = ``left`` and N = ``right``, B = ``left_strong`` and C = ``right_strong``."""
        neighbour, blocks = self.border.copy(), np.zeros((self.indptr[-1], 2, 2))
        own, other = (_pairs(one).data.reshape(-1, 2) for one in (left, right))
        count, size = left.shape[1] // 2, 2 * (len(self.indptr) - 1)
        slot = np.full(count, -1, dtype=np.int64)
        add_blocks(own, other, *self.groups, slot, self.indptr, neighbour, blocks)
        flat = blocks.reshape(-1)
        flat[self.up], flat[self.down] = left_strong.data, right_strong.data
        blocks[self.indptr[count + 1 :] - 1] = -np.eye(2)
        return sparse.bsr_array((blocks, neighbour, self.indptr.astype(np.int32)), shape=(size, size))


def _pairs(rows: sparse.csr_array) -> sparse.bsr_array:
    """The rows in 1 x 2 blocks of a node's two unknowns, without a copy if all entries come in pairs."""
    first, second = rows.indices[::2], rows.indices[1::2]
    if (rows.indptr % 2).any() or (first % 2).any() or not np.array_equal(second, first + 1):
        return sparse.bsr_array(rows, blocksize=(1, 2))
    return sparse.bsr_array((rows.data.reshape(-1, 1, 2), first // 2, rows.indptr // 2), shape=rows.shape)


Symbolic: TypeAlias = tuple[NormalPattern, Fronts, IntArray]
"""Pattern of equations bordered by strong rows, their fronts, and the numbers of transposed blocks."""


def symbolic_of(
    rows: sparse.csr_array, strong: sparse.csr_array, owner: IntArray, points: FloatArray, places: FloatArray
) -> Symbolic:
    """That of ``rows`` and ``strong`` rows like these (:class:`Strong`)."""
    vertices = np.repeat(places, 2, axis=0)
    normal = NormalPattern(rows, strong, owner, len(vertices))
    graph = normal.matrix(rows, strong, rows, strong)
    fronts = Fronts(np.concatenate([points, vertices]), graph, len(vertices))
    return normal, fronts, mirrored(graph)


def factorise(
    rows: sparse.csr_array,
    weight: FloatArray,
    points: FloatArray,
    solver: LinearSolver,
    strong: Strong,
    symbolic: Symbolic | None = None,
) -> LeastSquares:
    """Set up and factorise the equations of ``rows`` (e, n), already multiplied by ``weight`` (e,), and of
    ``strong`` ones; their ``symbolic`` part may be known."""
    # Two vertices of two multipliers each.
    vertices = np.repeat(strong.places, 2, axis=0)
    places, count = np.concatenate([points, vertices]), len(vertices)
    normal = symbolic[0] if symbolic else NormalPattern(rows, strong.rows, strong.owner, count)
    whole = normal.matrix(rows, strong.rows, rows, strong.rows)
    factor = factor_definite(whole, places, count, solver, symbolic[1] if symbolic else None)
    none = Conditions(sparse.csr_array((0, rows.shape[1])), np.zeros((rows.shape[1], 0)), np.zeros((0, 0)))
    without = LeastSquares(rows, weight, strong, factor, none, 2 * count)
    kept, numbers = independent_sums(strong.rows, strong.sums)
    if not len(numbers):
        return replace(without, strong=replace(strong, sums=strong.sums[numbers]))
    misfit = np.zeros((rows.shape[0] + len(strong.owner), len(numbers)))
    answer = without._refined(misfit, FUNCTIONAL_TOLERANCE, kept.T.toarray())[0]
    soft = np.asarray(kept @ answer)
    unit, count = soft / np.sqrt(np.outer(np.diag(soft), np.diag(soft))), len(soft)
    # Without dependent rows. Not symmetrised, so that conditions hold to round-off however accurate this is.
    while count and not np.linalg.eigvalsh(unit[:count, :count])[0] > ROUND_OFF:
        count -= 1
    stiffness = np.linalg.inv(soft[:count, :count])
    conditions = Conditions(sparse.csr_array(kept[:count]), answer[:, :count] @ stiffness, stiffness)
    sums = sparse.csr_array(strong.sums[numbers[:count]])
    return replace(without, strong=replace(strong, sums=sums), conditions=conditions)
