"""When the refinement of the solutions of a factorised system is done, and the plain way to do it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray

FULL_TOLERANCE = 1e-11
"""Refinement ends when the expected next update changes no solution by more, relatively."""
FUNCTIONAL_TOLERANCE = 1e-8
"""The same for many solutions of which only functionals are required. On graded clouds round-off in the
residual changes solutions by 1e-9 to 2e-8 in every update."""
VERIFIED_TOLERANCE = 1e-7
"""Largest change of a solution by the last update, if it is to be used for error estimates."""
BLOCK_COLUMNS = 64
"""Solutions refined together: enough for dense products, few enough to keep them all."""
MAX_UPDATES = 15
DIRECTIONS = 6
"""Number of earlier directions that the next one is made conjugate to.

A ring of radius over thickness 100, eight nodes across, degree 4, is exact to 1e-9 after 6 steps with all of
them, after 7 with three; with one it is off by 8e-6 after 10, and by the short recurrence 0.3 % after 15.
"""
STALL_RATIO, STALL_CHANGE = 0.5, 1e-5
"""Refinement has stalled if an update is above the first part of the two before it, and below the second part
of the solution.

Larger updates continue it: where the factor has lost modes altogether, as the bending of bodies a hundred
times as long as thick, conjugate gradients find one after the other in steps of any size.
"""
TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class Progress:
    """How far several solutions have come: sizes (c,) of their ``last`` updates and of those ``before``, and
    which are ``done`` (c,).

    They are where the next update is foreseen to change them by ``tolerance`` at most, relatively, and the
    last one changed them by no more than ``limit``.
    """

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
        """At ``count`` solutions that come from elsewhere, whatever they are worth."""
        unknown = np.full(count, np.inf)
        return cls(unknown, unknown, np.zeros(count, bool), tolerance, limit)

    def after(self, update: FloatArray, solution: FloatArray) -> Progress:
        """After one more ``update`` (n, c), which led to ``solution`` (n, c)."""
        change, size = np.linalg.norm(update, axis=0), np.linalg.norm(solution, axis=0)
        # Nothing is known of what an update does before there are two.
        next_one = change * np.where(np.isinf(self.last), 1.0, change / np.maximum(self.last, TINY))
        small = (next_one <= self.tolerance * size) & (change <= self.limit * size)
        small_change = change <= STALL_CHANGE * size
        stalled = (change >= STALL_RATIO * np.maximum(self.before, self.last)) & small_change
        last = np.where(self.done, self.last, change)
        return Progress(self.last, last, self.done | small | stalled, self.tolerance, self.limit)

    @property
    def finished(self) -> bool:
        """Whether no solution gains any more."""
        return bool(self.done.all())


def refine(
    solution: FloatArray, update: Callable[[FloatArray], FloatArray], progress: Progress
) -> tuple[FloatArray, Progress]:
    """``solution`` (n, c) after as many updates as it takes: at least one, as the factor is inexact.

    ``update`` gives what the factor thinks is missing (Higham 2002, doi:10.1137/1.9780898718027). Where the
    updates do not shrink, they end too, as the size of the last one then shows.
    """
    for _ in range(MAX_UPDATES):
        step = update(solution)
        solution = solution + step
        progress = progress.after(step, solution)
        if progress.finished:
            break
    return solution, progress


def best_part(image: FloatArray, wanted: FloatArray) -> FloatArray:
    """How much (1, c) of a start with this ``image`` (r, 1) comes closest to what is ``wanted`` (r, c)."""
    return np.asarray(image.T @ wanted / max(float((image**2).sum()), TINY))


def relative(lengths: FloatArray, solutions: FloatArray) -> FloatArray:
    """``lengths`` (c,) as parts of those of the ``solutions`` (n, c), which may be zero."""
    size = np.linalg.norm(solutions, axis=0)
    return np.asarray(lengths / np.where(size > 0.0, size, 1.0))
