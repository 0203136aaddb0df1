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
STALL_RATIO = 0.5
"""An update this large a part of both before it brings nothing any more.

Not of one: where the factor has lost a mode altogether, as the bending of bodies a hundred times as long as
thick, conjugate gradients find it in one large step, and are there in the next.
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
        stalled = change >= STALL_RATIO * np.maximum(self.before, self.last)
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
