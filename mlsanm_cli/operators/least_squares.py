"""Weighted linear least squares through the normal equations, with steps on the rows themselves.

For rows M u = b with row weights w, the solution minimises |diag(w) (M u - b)|^2 + |Q (M u - b)|^2, where the
rows of Q, few and dense, are weighted sums of the rows. The Cholesky factor of the first part's normal
equations is corrected for the second (Woodbury's formula: Golub and Van Loan, Matrix Computations, section
2.1). It alone loses half the digits. Residuals of the rows, not of the normal equations, give them back
(Bjorck 1987, doi:10.1016/0024-3795(87)90101-7), here as conjugate gradients (Bjorck 1996,
doi:10.1137/1.9781611971484, section 7.4) with the factor for preconditioner: the first step is the corrected
semi-normal step, and bodies that are almost incompressible get there in a few more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.compliance import corrected
from mlsanm_cli.operators.linear.interface import DirectSolver, Factor
from mlsanm_cli.operators.normal import normal_equations
from mlsanm_cli.operators.refinement import (
    CHECKED,
    MOST,
    PRECISE,
    QUICK,
    TINY,
    Progress,
    best_part,
    relative,
)
from mlsanm_cli.operators.system import Equations
from mlsanm_cli.parts import dpotrf, dpotrs
from mlsanm_cli.values import dataclass

STRONGEST = 1e5
"""How much more the sums count than the rows they are made of, at most: a beam of 8 x 1 wants 1e4."""
DIGITS = 0.01
"""Part of a sum's own value that round-off may cost."""


@dataclass(frozen=True)
class LeastSquares:
    """Factorised least-squares problem: ``rows`` (r, n) already multiplied by ``weight`` (r,).

    ``sums`` (k, r) are those of the rows in their physical units, ``images`` (k, n) what they make of them.
    """

    rows: sparse.csr_array
    weight: FloatArray
    sums: FloatArray
    images: FloatArray
    factor: Factor

    def solve(self, sources: sparse.csc_array, tolerance: float = PRECISE) -> FloatArray:
        """Solutions (n, c) for right-hand sides ``sources`` (r, c) given in the rows' physical units."""
        return self._refined(np.zeros((self.rows.shape[1], 1)), self.scaled(sources), tolerance)[0]

    def checked(
        self, sources: sparse.csc_array, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Solutions (n, c) for ``sources`` (r, c), from a multiple of a ``start`` (n, 1) if one near them is
        known, and what the last update changed of each, relatively: (c,)."""
        force, lack = np.zeros((self.rows.shape[1], 1)), self.scaled(sources)
        if start is None:
            solution = self.factor.solve(self._gather(lack))
            lack = lack - self._apply(solution)
            progress = Progress.of(solution, PRECISE, CHECKED)
        else:
            image = self._apply(start)
            part = best_part(image, lack)
            solution, lack = start @ part, lack - image @ part
            progress = Progress.begun(sources.shape[1], PRECISE, CHECKED)
        solution, _, progress = self._further(force, lack, solution, progress)
        return solution, relative(progress.last, solution)

    def roughly(self, sources: sparse.csc_array) -> FloatArray:
        """Solutions (n, c) by the factor alone, for right-hand sides ``sources`` (r, c)."""
        return self.factor.solve(self._gather(self.scaled(sources)))

    def step(self, source: sparse.csc_array, solution: FloatArray, more: sparse.csc_array) -> FloatArray:
        """A step of refinement of a ``solution`` (n, 1) for ``source`` (r, 1), and solutions for ``more``
        (r, 1) by the factor alone: by the rows alone, and with the sums, (n, 3)."""
        gradient = self._gather(self.scaled(source) - self._apply(solution))
        weighted, summed = self._weighted(more)
        rhs = np.hstack([gradient, (self.rows.T @ weighted).toarray()])
        if not isinstance(self.factor, UpdatedFactor):
            return self.factor.solve(rhs)[:, [0, 1, 1]]
        first = self.factor.factor.solve(rhs)
        lacking = np.hstack([np.zeros_like(summed), summed])
        return np.hstack([first[:, 1:], self.factor.joined(first, lacking)])[:, [1, 0, 2]]

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        """What the rows ``observed`` (g, n) make of the solutions for ``sources`` (r, s): (g, s), or for them
        times the ``mixture`` (s, c): (g, c)."""
        weighted, summed = self._weighted(sources)
        mixed = np.eye(sources.shape[1]) if mixture is None else mixture

        def of_columns(chosen: FloatArray) -> FloatArray:
            lack = np.concatenate([weighted @ (mixed @ chosen), summed @ (mixed @ chosen)])
            return np.asarray(observed @ self._refined(np.zeros((self.rows.shape[1], 1)), lack, QUICK)[0])

        def of_rows(chosen: FloatArray) -> FloatArray:
            lack = np.zeros((len(self.sums) + self.rows.shape[0], chosen.shape[1]))
            images = -self._refined(np.asarray(observed.T @ chosen), lack, QUICK)[1]
            count = self.rows.shape[0]
            return np.asarray((weighted.T @ images[:count] + summed.T @ images[count:]).T @ mixed)

        start = self.factor.products(observed, sparse.csc_array(self.rows.T @ weighted))
        if isinstance(self.factor, UpdatedFactor):
            start += self.factor.image_products(observed, summed)
        return corrected(start @ mixed, of_columns, of_rows)

    def _refined(
        self, force: FloatArray, lack: FloatArray, tolerance: float
    ) -> tuple[FloatArray, FloatArray]:
        """Solutions (n, c) of N x = ``force`` + what ``lack`` (r + k, c) of the rows gathers to, and the lack
        that is left.

        ``force`` (n, c) or (n, 1) is zero for solutions of the least-squares problem.
        """
        solution = self.factor.solve(force + self._gather(lack))
        progress = Progress.of(solution, tolerance)
        return self._further(force, lack - self._apply(solution), solution, progress)[:2]

    def _further(
        self, force: FloatArray, lack: FloatArray, solution: FloatArray, progress: Progress
    ) -> tuple[FloatArray, FloatArray, Progress]:
        """The ``solution`` (n, c), which ``lack`` is left of, refined until there is no more progress."""
        step, before = np.zeros_like(solution), np.ones(solution.shape[1])
        for _ in range(MOST):
            gradient = force + self._gather(lack)
            wanted = self.factor.solve(gradient)
            now = (gradient * wanted).sum(axis=0)
            step = wanted + now / before * step
            image = self._apply(step)
            # More steps than needed would only add round-off.
            length = np.where(progress.done, 0.0, now / np.maximum((image**2).sum(axis=0), TINY))
            solution += length * step
            lack -= length * image
            before = np.where(now > 0.0, now, np.inf)
            progress = progress.after(length * step, solution)
            if progress.finished:
                break
        return solution, lack, progress

    def residual(self, sources: sparse.csc_array, solutions: FloatArray) -> FloatArray:
        """What one more corrected semi-normal step would change of each of the ``solutions`` (n, c),
        relatively: (c,)."""
        gradient = self._gather(self.scaled(sources) - self._apply(solutions))
        return relative(np.linalg.norm(self.factor.solve(gradient), axis=0), solutions)

    @property
    def note(self) -> str:
        """What users should know of how the equations were factorised, usually nothing."""
        return self.factor.note

    @property
    def plain(self) -> LeastSquares:
        """The same problem without its sums."""
        if not isinstance(self.factor, UpdatedFactor):
            return self
        return replace(self, sums=self.sums[:0], images=self.images[:0], factor=self.factor.factor)

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """The inverse of the normal equations times ``vectors`` (n, c)."""
        return self.factor.solve(vectors)

    def scaled(self, sources: sparse.csc_array) -> FloatArray:
        """Right-hand sides (r, c) multiplied by the weights, and below them their sums (k, c)."""
        weighted, summed = self._weighted(sources)
        return np.concatenate([weighted.toarray(), summed])

    def _weighted(self, sources: sparse.csc_array) -> tuple[sparse.csc_array, FloatArray]:
        """Right-hand sides (r, c) multiplied by the weights, and their sums (k, c)."""
        return _scaled_rows(sources, self.weight), np.asarray(self.sums @ sources)

    def equations(self, sources: sparse.csc_array) -> Equations:
        """The normal equations, bordered by the sums of rows."""
        normal = sparse.csr_array(normal_equations(self.rows))
        weighted = sparse.csr_array(self.rows.T @ _scaled_rows(sources, self.weight))
        return Equations(normal, weighted, self.images, np.asarray(self.sums @ sources), definite=True)

    def excess(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """The gradient (n,) of half the sum of squares, formed from the rows' own residuals."""
        lack = np.concatenate([self.weight * source, self.sums @ source]) - self._apply(solution)
        return -self._gather(lack)

    def _apply(self, solution: FloatArray) -> FloatArray:
        """Weighted rows and sums (r + k, c) of ``solution`` (n, c)."""
        return np.concatenate([self.rows @ solution, self.images @ solution])

    def _gather(self, scaled: FloatArray) -> FloatArray:
        """The right-hand side (n, c) of the normal equations."""
        count = self.rows.shape[0]
        return np.asarray(self.rows.T @ scaled[:count] + self.images.T @ scaled[count:])


@dataclass(frozen=True)
class UpdatedFactor:
    """Factor of N + B^T B from one of N: ``images`` B (k, n), ``solved`` N^-1 B^T (n, k), ``small`` the
    Cholesky factor of 1 + B N^-1 B^T."""

    factor: Factor
    images: FloatArray
    solved: FloatArray
    small: FloatArray

    @property
    def note(self) -> str:
        """That of the factor without the update."""
        return self.factor.note

    def solve(self, rhs: FloatArray, transposed: bool = False) -> FloatArray:
        """Solution for (n,) or (n, c) right-hand sides."""
        return self._updated(self.factor.solve(rhs, transposed))

    def joined(self, first: FloatArray, rhs: FloatArray) -> FloatArray:
        """Solution (n, c) with B^T ``rhs`` (k, c) on the right-hand side too, from the ``first`` one, which
        knows neither that nor the update."""
        return self._updated(first + self.solved @ rhs)

    def _updated(self, first: FloatArray) -> FloatArray:
        return np.asarray(first - self.solved @ dpotrs(self.small, self.images @ first)[0])

    def image_products(self, left: sparse.csr_array, rhs: FloatArray) -> FloatArray:
        """``left`` (g, n) times the solutions for B^T ``rhs`` (k, c)."""
        return np.asarray(left @ self.solved @ dpotrs(self.small, rhs)[0])

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c)."""
        first = self.factor.products(left, right)
        return first - self.image_products(left, np.asarray(right.T @ self.solved).T)


def _scaled_rows(columns: sparse.csc_array, weight: FloatArray) -> sparse.csc_array:
    """``columns`` (r, c), every row multiplied by its ``weight`` (r,)."""
    data = columns.data * weight[columns.indices]
    return sparse.csc_array((data, columns.indices, columns.indptr), shape=columns.shape)


def _strength(small: FloatArray) -> float:
    """Factor on the sums, ``small`` (k, k) being B N^-1 B^T without it.

    Its largest eigenvalue says how much more a sum counts than the rows it is made of; its lack of symmetry
    how many digits the factor has for that.
    """
    largest = float(np.linalg.eigvalsh(0.5 * (small + small.T))[-1])
    round_off = float(np.abs(small - small.T).max()) / largest
    return float(np.sqrt(min(STRONGEST, DIGITS / max(round_off, TINY)) / largest))


def factorise(
    rows: sparse.csr_array,
    weight: FloatArray,
    points: FloatArray,
    solver: DirectSolver,
    sums: FloatArray | None = None,
    images: FloatArray | None = None,
) -> LeastSquares:
    """Set up and factorise the normal equations of ``rows`` (r, n), which their ``weight`` (r,) multiplies
    already, and of ``sums`` (k, r) of them in their physical units, if any, which are scaled here.

    ``images`` (k, n) are the sums in the unknowns, where they are not simply those of the rows.
    """
    factor: Factor = solver.factor_definite(normal_equations(rows), points)
    if sums is None:
        sums = np.zeros((0, rows.shape[0]))
    if images is None:
        images = np.asarray((rows.T @ (sums / weight).T).T)
    if len(sums):
        solved = factor.solve(np.ascontiguousarray(images.T))
        small = images @ solved
        strength = _strength(small)
        sums, images, solved = strength * sums, strength * images, strength * solved
        symmetric = 0.5 * strength**2 * (small + small.T)
        together, info = dpotrf(np.eye(len(sums)) + symmetric)
        if info != 0:
            raise NumericalError(
                "a body is held so softly that its equations are singular to the last digits",
                "hold it by supports, or by springs stiffer against the body",
            )
        factor = UpdatedFactor(factor, images, solved, together)
    return LeastSquares(rows, weight, sums, images, factor)
