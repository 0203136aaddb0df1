"""Equations of a mirror-symmetric body for symmetric loads: half of its unknowns, half of its rows."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray, IntArray
from mlsanm_cli.cloud.mirror import Mirror
from mlsanm_cli.operators.refinement import PRECISE, relative
from mlsanm_cli.operators.rows import nodal_pairs
from mlsanm_cli.operators.stencils import Stencils
from mlsanm_cli.operators.system import Equations, LinearSystem
from mlsanm_cli.values import dataclass


def reflected(stencils: Stencils, mirror: Mirror) -> Stencils:
    """Stencils of all nodes (n) from those of the mirror's own nodes (h).

    On the mirror they become their own images, by the mean of both: of two nodes equally far one may have
    been taken alone.
    """
    times = np.where(mirror.side == 0, 2, 1)
    whole = stencils.take(np.repeat(mirror.place, times))
    first = np.concatenate([[0], np.cumsum(times)])
    imaged = np.repeat(mirror.side < 0, times)
    imaged[first[1:][mirror.side == 0] - 1] = True
    length = np.diff(whole.indptr)
    beyond = np.repeat(imaged, length)
    # In place, kind by kind, as the weights are many.
    share = np.repeat(np.repeat(1.0 / times, times), length)
    for kind, sign in enumerate(mirror.derivative_signs(whole.weights.shape[1])):
        whole.weights[:, kind] *= np.where(beyond, sign, 1.0) * share
    indices = np.where(beyond, mirror.image[whole.indices], whole.indices)
    return replace(whole, indptr=whole.indptr[first], indices=indices)


def reflected_numbers(numbers: IndexArray, mirror: Mirror) -> IndexArray:
    """Numbers (n, k) of nodes that belong to all nodes from those (h, k) that belong to the own ones."""
    whole, beyond = numbers[mirror.place], mirror.side < 0
    whole[beyond] = mirror.image[whole[beyond]]
    return whole


@dataclass(frozen=True)
class Fold:
    """How symmetric displacements of n nodes follow from those of the ``own`` ones (h,) on one side of the
    mirror, and which rows (r) then say the same.

    Component by component, node ``place`` (2n,) times ``sign`` (2n,) is what a displacement is, 0 for what is
    across the mirror on it. Of the rows, ``kept`` (e,) stand for themselves and their ``image`` (e,), which
    says the same times ``row_sign`` (e,); one that is its own image counts half. ``still`` (s,) are unknowns
    across the mirror on it, which further rows hold at zero.

    Behind the rows, right-hand sides have those of strong ones. Of these ``strong`` (g,) are kept for
    themselves and their ``strong_image`` (g,), times ``strong_sign`` (g,), of ``strong_rows_total`` (k).
    The mirror is ``along`` x (0) or y (1).
    """

    own: IntArray
    place: IntArray
    sign: FloatArray
    kept: IntArray
    image: IntArray
    row_sign: FloatArray
    rows: int
    still: IntArray
    strong_rows_total: int
    strong: IntArray
    strong_image: IntArray
    strong_sign: FloatArray
    along: int

    @property
    def unknowns(self) -> int:
        """How many are left (2h)."""
        return 2 * len(self.own)

    def kept_within(self, first: int, count: int) -> IntArray:
        """Which of ``count`` rows from ``first`` on are kept, by their places in that range."""
        start, end = np.searchsorted(self.kept, (first, first + count))
        return np.asarray(self.kept[start:end] - first)

    def columns(self, rows: sparse.csr_array) -> sparse.csr_array:
        """What ``rows`` (g, 2n) make of symmetric displacements: rows (g, 2h), unknowns twice in some."""
        data = rows.data * self.sign[rows.indices]
        indices = self.place.astype(rows.indices.dtype)[rows.indices]
        return sparse.csr_array((data, indices, rows.indptr), shape=(rows.shape[0], self.unknowns))

    def halved(self, kept: sparse.csr_array) -> sparse.csr_array:
        """The ``kept`` rows (e, 2n) in the unknowns that are left, and those that hold some still:
        (e + s, 2h)."""
        # In pairs of a node's unknowns, as all rows are.
        factors = np.zeros((len(self.still), 2))
        factors[np.arange(len(self.still)), self.still % 2] = 1.0
        held = nodal_pairs(self.still // 2, factors, len(self.own))
        return sparse.csr_array(sparse.vstack([self.columns(kept), held], format="csr"))

    def weights(self, weight: FloatArray, hold: FloatArray) -> FloatArray:
        """Weights (e + s,) of the rows from those of all rows (r,), and those (n,) that would ``hold`` a
        node. A row that is its own image counts half of two."""
        share = np.where(self.kept == self.image, np.sqrt(0.5), 1.0)
        return np.concatenate([share * weight[self.kept], hold[self.own[self.still // 2]]])

    def strong_rows(
        self, rows: sparse.csr_array, loads: sparse.csr_array
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Of all strong ``rows`` (k, 2n) and ``loads`` (k, r + k) those (g, 2h) that are kept, and what the
        right-hand sides (e + s + g) of :meth:`sources` do there. One that is its own image counts half."""
        share = sparse.diags_array(self.strong_share)
        count, nothing = len(self.kept), sparse.csr_array((len(self.strong), len(self.still)))
        entries = (self.row_sign, (self.image, np.arange(count)))
        other = self.kept != self.image
        whole = sparse.csr_array((other * entries[0], entries[1]), shape=(self.rows, count))
        whole = whole + sparse.csr_array((np.ones(count), (self.kept, np.arange(count))), shape=whole.shape)
        own, piece = loads[self.strong][:, : self.rows], loads[self.strong][:, self.rows :]
        parts = [own @ whole, nothing, piece[:, self.strong]]
        return (
            sparse.csr_array(share @ self.columns(sparse.csr_array(rows[self.strong]))),
            sparse.csr_array(share @ sparse.hstack(parts)),
        )

    @property
    def strong_share(self) -> FloatArray:
        """What the strong rows (g,) are multiplied by: the root of how often they count."""
        share: FloatArray = np.where(self.strong == self.strong_image, np.sqrt(0.5), 1.0)
        return share

    def strong_sums(self, sums: sparse.csr_array) -> sparse.csr_array:
        """What ``sums`` (s, k) of all strong rows are of those that are kept (s, g), before they are
        multiplied."""
        other = sparse.diags_array(np.where(self.strong == self.strong_image, 0.0, self.strong_sign))
        return sparse.csr_array(sums[:, self.strong] + sums[:, self.strong_image] @ other)

    @cached_property
    def _halving(self) -> sparse.csr_array:
        """What makes the symmetric part of right-hand sides (r + k), by those kept (e + s + g, r + k)."""
        own = _means(self.kept, self.image, self.row_sign, self.rows)
        still = sparse.csr_array((len(self.still), self.rows))
        strong = _means(self.strong, self.strong_image, self.strong_sign, self.strong_rows_total)
        return sparse.csr_array(sparse.block_diag([sparse.vstack([own, still]), strong], format="csr"))

    def sources(self, sources: sparse.csc_array) -> sparse.csc_array:
        """The symmetric part of right-hand sides (r + k, c), by those kept (e + s + g, c)."""
        return sparse.csc_array(self._halving @ sources)

    def lost(self, sources: sparse.csc_array) -> FloatArray:
        """What of right-hand sides (r, c) is not symmetric (c,), relatively."""
        dense = sources[: self.rows].toarray()
        even = np.zeros(dense.shape)
        folded = self.sources(sources)[: len(self.kept)].toarray()
        even[self.image] = self.row_sign[:, None] * folded
        even[self.kept] = folded
        return relative(np.asarray(np.linalg.norm(dense - even, axis=0)), dense)

    def spread(self, solutions: FloatArray) -> FloatArray:
        """Displacements (2n, c) of all nodes from those (2h, c) of the own ones."""
        spread: FloatArray = self.sign[:, None] * solutions[self.place]
        return spread

    def gathered(self, vectors: FloatArray) -> FloatArray:
        """The transpose of :meth:`spread`, of ``vectors`` (2n, c)."""
        gathered = np.zeros((self.unknowns, vectors.shape[1]))
        np.add.at(gathered, self.place, self.sign[:, None] * vectors)
        return gathered

    def taken(self, displacements: FloatArray) -> FloatArray:
        """Those of the own nodes (2h, c) of symmetric ``displacements`` (2n, c)."""
        taken = np.zeros((self.unknowns, displacements.shape[1]))
        own = self.sign > 0.0
        taken[self.place[own]] = displacements[own]
        return taken


@dataclass(frozen=True)
class Folded:
    """The ``system`` of a body's half, as one of the whole body whose loads are symmetric.

    Of unit loads it answers to the symmetric part. Sums of squares are half of the whole body's.
    """

    system: LinearSystem
    fold: Fold

    def solve(self, sources: sparse.csc_array, tolerance: float = PRECISE) -> FloatArray:
        """Solutions (n, c) for the symmetric part of ``sources`` (r, c)."""
        return self.fold.spread(self.system.solve(self.fold.sources(sources), tolerance))

    def solve_with_error(
        self, sources: sparse.csc_array, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Solutions (n, c) for ``sources`` (r, c), and what the last update changed of each, or what of the
        sources was not symmetric: (c,)."""
        begun = None if start is None else self.fold.taken(start)
        solutions, worth = self.system.solve_with_error(self.fold.sources(sources), begun)
        return self.fold.spread(solutions), np.maximum(worth, self.fold.lost(sources))

    def solve_unrefined(self, sources: sparse.csc_array) -> FloatArray:
        """Solutions (n, c) by the factor alone, for the symmetric part of ``sources`` (r, c)."""
        return self.fold.spread(self.system.solve_unrefined(self.fold.sources(sources)))

    def step(self, source: sparse.csc_array, solution: FloatArray, more: sparse.csc_array) -> FloatArray:
        """A step of refinement of a ``solution`` (n, 1), and solutions for ``more`` (r, 1), (n, 2)."""
        fold = self.fold
        return fold.spread(self.system.step(fold.sources(source), fold.taken(solution), fold.sources(more)))

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        """What the rows ``observed`` (g, n) make of the solutions for the symmetric part of ``sources``
        (r, s), times the ``mixture`` (s, c) if there is one."""
        return self.system.functionals(self.fold.columns(observed), self.fold.sources(sources), mixture)

    def residual(self, sources: sparse.csc_array, solutions: FloatArray) -> FloatArray:
        """What one more refinement would change of each of the ``solutions`` (n, c), or what of the
        ``sources`` (r, c) is not symmetric: (c,)."""
        worth = self.system.residual(self.fold.sources(sources), self.fold.taken(solutions))
        return np.maximum(worth, self.fold.lost(sources))

    @property
    def note(self) -> str:
        """What users should know of how the equations were factorised, usually nothing."""
        return self.system.note

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """The inverse of the whole body's normal equations times the symmetric part of ``vectors`` (n, c)."""
        return 0.5 * self.fold.spread(self.system.inverse_normal(self.fold.gathered(vectors)))

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        """Right-hand sides (r, c) as the half's equations are scaled, as large as the whole body's."""
        scaled: FloatArray = np.sqrt(2.0) * self.system.scaled(self.fold.sources(sources), strong)
        return scaled

    def equations(self, sources: sparse.csc_array) -> Equations:
        """No system of several bodies has been made of halves: TypeError."""
        raise TypeError("equations of all bodies together need whole ones")

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """As :meth:`equations`: TypeError."""
        raise TypeError("equations of all bodies together need whole ones")


def _means(kept: IntArray, image: IntArray, sign: FloatArray, total: int) -> sparse.csr_array:
    """What makes the means (e, total) of the ``kept`` ones (e,) of right-hand sides and ``sign`` (e,) times
    their ``image`` (e,)."""
    at = np.tile(np.arange(len(kept)), 2)
    factors = 0.5 * np.concatenate([np.ones(len(kept)), sign])
    return sparse.csr_array((factors, (at, np.append(kept, image))), shape=(len(kept), total))
