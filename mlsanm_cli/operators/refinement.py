"""When the refinement of the solutions of a factorised system is done, and the plain way to do it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.values import dataclass

PRECISE = 1e-11
"""Refinement ends when the next update is foreseen to change no solution by more, relatively."""
QUICK = 1e-8
"""The same for many solutions of which only functionals are wanted.

On graded clouds round-off in the residual moves solutions by 1e-9 to 2e-8 in every update, for ever.
"""
BLOCK = 64
"""Solutions refined together: enough for dense products, few enough to keep them all."""
MOST = 15
STALLED = 0.5
"""An update this large a part of the one before it brings nothing any more."""
DIRECTIONS = 8
"""Random directions along which the size of an update is looked at: it comes out 10 times too small, whatever
it is, with a probability of 1e-7."""
SEED = 0


@dataclass(frozen=True)
class Progress:
    """How far several solutions have come: sizes (c,) of their last updates, and which are ``done`` (c,)."""

    last: FloatArray
    done: BoolArray
    tolerance: float

    @classmethod
    def of(cls, solution: FloatArray, tolerance: float) -> Progress:
        """At the first ``solution`` (n, c)."""
        return cls(np.linalg.norm(solution, axis=0), np.zeros(solution.shape[1], dtype=bool), tolerance)

    def after(self, update: FloatArray, solution: FloatArray) -> Progress:
        """After one more ``update`` (n, c), which led to ``solution`` (n, c)."""
        change = np.linalg.norm(update, axis=0)
        small = change**2 <= self.tolerance * self.last * np.linalg.norm(solution, axis=0)
        stalled = change >= STALLED * self.last
        return Progress(change, self.done | small | stalled, self.tolerance)

    @property
    def finished(self) -> bool:
        """Whether no solution gains any more."""
        return bool(self.done.all())


def directions(count: int) -> FloatArray:
    """Directions (n, d) with independent normal entries for vectors of ``count`` entries, always the same.

    Products with them tell the length of a vector, see :func:`length_of` (Hutchinson 1990,
    doi:10.1080/03610919008812866, whose estimate is that of a trace).
    """
    return np.random.default_rng(SEED).normal(size=(count, DIRECTIONS))


def length_of(products: FloatArray) -> float:
    """The length of a vector by its ``products`` (d,) with :func:`directions`."""
    return float(np.sqrt(np.mean(products**2)))


def refine(solution: FloatArray, update: Callable[[FloatArray], FloatArray], tolerance: float) -> FloatArray:
    """``solution`` (n, c) after as many updates as it takes: at least one, as the factor is inexact.

    ``update`` gives what the factor thinks is missing (Higham 2002, doi:10.1137/1.9780898718027). Where the
    updates do not shrink, they end too; the next one's size tells that.
    """
    progress = Progress.of(solution, tolerance)
    for _ in range(MOST):
        step = update(solution)
        solution = solution + step
        progress = progress.after(step, solution)
        if progress.finished:
            break
    return solution
