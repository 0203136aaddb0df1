"""The interface for solving a discretised body, whatever its equations, and iterative refinement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.records import dataclass

FULL_TOLERANCE = 1e-11
"""Relative tolerance of the predicted next update."""
FUNCTIONAL_TOLERANCE = 1e-8
"""The same for many solutions of which only functionals are needed."""
VERIFIED_TOLERANCE = 1e-7
"""Limit of the last update where it serves as error estimate."""
BLOCK_COLUMNS = 64
"""Solutions refined at once: enough for dense products, few enough for memory."""
MAX_UPDATES = 15
DIRECTIONS = 6
"""Number of earlier directions that the next one is made conjugate to."""
STALL_RATIO, STALL_CHANGE = 0.5, 1e-5
"""An update larger than the first fraction of both previous ones, and smaller than the second fraction of the
solution, means stagnation."""
TINY = np.finfo(float).tiny


class LinearSystem(Protocol):
    """Factorised equations for n unknowns, with right-hand sides in the physical units of r rows."""

    def solve(self, sources: sparse.csc_array, tolerance: float = FULL_TOLERANCE) -> FloatArray:
        """Solutions (n, c) for right-hand sides ``sources`` (r, c), refined to a relative ``tolerance``."""

    def solve_with_error(
        self, sources: sparse.csc_array, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Solutions (n, c) for ``sources`` (r, c), and the relative change (c,) by the last update, an error
        estimate. Starts from a multiple of ``start`` (n, 1), if given, which saves updates if it is close."""

    def solve_unrefined(self, sources: sparse.csc_array) -> FloatArray:
        """Solutions (n, c) by the factor alone; :meth:`residual` estimates their error."""

    def step(self, source: sparse.csc_array, solution: FloatArray, more: sparse.csc_array) -> FloatArray:
        """A refinement step for a ``solution`` (n, 1) with right-hand side ``source`` (r, 1), and the
        unrefined solution for ``more`` (r, 1): (n, 2), in one pass through the factor."""

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        """Rows ``observed`` (g, n) applied to the solutions for ``sources`` (r, s), times the ``mixture`` (s,
        c) if given: (g, s) or (g, c). Much cheaper than the solutions themselves for sparse sources."""

    def residual(self, sources: sparse.csc_array, solutions: FloatArray) -> FloatArray:
        """Relative change (c,) of the ``solutions`` (n, c) by one more refinement. The residual itself is no
        measure: rows of nearly incompressible materials are too large."""

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; usually ""."""

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """(S^T S)^-1 times ``vectors`` (n, c), with S the scaled equations."""

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        """Right-hand sides (r, c) in the scaling of the equations, without the ``strong`` rows if false."""

    def equations(self, sources: sparse.csc_array) -> tuple[sparse.csr_array, sparse.csr_array]:
        """The scaled equations' matrix (n, n) and their right-hand sides (n, c) for ``sources`` (r, c)."""

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Residual (n,) of ``solution`` (n,) for ``source`` (r,), more accurate than by the matrix."""


@dataclass(frozen=True)
class Progress:
    """Progress of several solutions: sizes (c,) of their ``last`` updates and of those ``before``, and which
    are ``done`` (c,). A solution is done when the predicted next update is at most ``tolerance`` and the last
    one at most ``limit``, relatively."""

    before: FloatArray
    last: FloatArray
    done: BoolArray
    tolerance: float
    limit: float = 1.0

    @classmethod
    def of(cls, sizes: FloatArray, tolerance: float, limit: float = 1.0) -> Progress:
        """At first solutions of ``sizes`` (c,), or infinite ones at starts of unknown accuracy."""
        return cls(np.full(len(sizes), np.inf), sizes, np.zeros(len(sizes), bool), tolerance, limit)

    def after(self, update: FloatArray, solution: FloatArray) -> Progress:
        """After another ``update`` (n, c), which led to ``solution`` (n, c)."""
        change, size = np.linalg.norm(update, axis=0), np.linalg.norm(solution, axis=0)
        # The rate of convergence is unknown before the second update.
        next_one = change * np.where(np.isinf(self.last), 1.0, change / np.maximum(self.last, TINY))
        small = (next_one <= self.tolerance * size) & (change <= self.limit * size)
        small_change = change <= STALL_CHANGE * size
        stalled = (change >= STALL_RATIO * np.maximum(self.before, self.last)) & small_change
        last = np.where(self.done, self.last, change)
        return Progress(self.last, last, self.done | small | stalled, self.tolerance, self.limit)


def refine(
    solution: FloatArray, update: Callable[[FloatArray], FloatArray], progress: Progress
) -> tuple[FloatArray, Progress]:
    """``solution`` (n, c) after as many updates as needed, at least one, or until they stop shrinking.
    ``update`` is the factor's correction of the residual (Higham 2002, doi:10.1137/1.9780898718027)."""
    for _ in range(MAX_UPDATES):
        step = update(solution)
        solution = solution + step
        progress = progress.after(step, solution)
        if progress.done.all():
            break
    return solution, progress


def relative(lengths: FloatArray, solutions: FloatArray) -> FloatArray:
    """``lengths`` (c,) relative to the norms of the ``solutions`` (n, c), which may be zero."""
    size = np.linalg.norm(solutions, axis=0)
    return np.asarray(lengths / np.where(size > 0.0, size, 1.0))
