"""Convergence criteria of iterative refinement for a factorised system, and the basic iteration."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.records import dataclass

FULL_TOLERANCE = 1e-11
"""Relative tolerance of the predicted next update."""
FUNCTIONAL_TOLERANCE = 1e-8
"""The same for many solutions of which only functionals are needed: on graded clouds round-off in the
residual changes solutions by up to 2e-8 in every update."""
VERIFIED_TOLERANCE = 1e-7
"""Limit of the last update where it serves as error estimate."""
BLOCK_COLUMNS = 64
"""Solutions refined at once: enough for dense products, few enough for memory."""
MAX_UPDATES = 15
DIRECTIONS = 6
"""Number of earlier directions that the next one is made conjugate to: in thin rings the short recurrence
fails."""
STALL_RATIO, STALL_CHANGE = 0.5, 1e-5
"""An update larger than the first fraction of both previous ones, and smaller than the second fraction of the
solution, means stagnation. Larger ones find bending modes of thin bodies that the factor has lost."""
TINY = np.finfo(float).tiny


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
    def of(cls, solution: FloatArray, tolerance: float, limit: float = 1.0) -> Progress:
        """At the first ``solution`` (n, c)."""
        size, count = np.linalg.norm(solution, axis=0), solution.shape[1]
        return cls(np.full(count, np.inf), size, np.zeros(count, bool), tolerance, limit)

    @classmethod
    def begun(cls, count: int, tolerance: float, limit: float = 1.0) -> Progress:
        """At ``count`` starting values of unknown accuracy."""
        unknown = np.full(count, np.inf)
        return cls(unknown, unknown, np.zeros(count, bool), tolerance, limit)

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

    @property
    def finished(self) -> bool:
        """Whether all solutions are done."""
        return bool(self.done.all())


def refine(
    solution: FloatArray, update: Callable[[FloatArray], FloatArray], progress: Progress
) -> tuple[FloatArray, Progress]:
    """``solution`` (n, c) after as many updates as needed, at least one, as the factor is inexact. ``update``
    computes the factor's correction of the residual (Higham 2002, doi:10.1137/1.9780898718027). The iteration
    also ends where updates stop shrinking; the size of the last one shows that."""
    for _ in range(MAX_UPDATES):
        step = update(solution)
        solution = solution + step
        progress = progress.after(step, solution)
        if progress.finished:
            break
    return solution, progress


def best_part(image: FloatArray, wanted: FloatArray) -> FloatArray:
    """Factors (1, c) of a start with the given ``image`` (r, 1) that are optimal for ``wanted`` (r, c)."""
    return np.asarray(image.T @ wanted / max(float((image**2).sum()), TINY))


def relative(lengths: FloatArray, solutions: FloatArray) -> FloatArray:
    """``lengths`` (c,) relative to the norms of the ``solutions`` (n, c), which may be zero."""
    size = np.linalg.norm(solutions, axis=0)
    return np.asarray(lengths / np.where(size > 0.0, size, 1.0))
