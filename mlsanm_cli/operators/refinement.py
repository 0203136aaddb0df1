"""Iterative refinement of the solutions of a factorised system (Higham 2002, doi:10.1137/1.9780898718027)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlsanm_cli.arrays import FloatArray

TOLERANCE = 1e-8
"""Refinement ends when the next update is foreseen to change no solution by more, relatively.

On graded clouds round-off in the residual moves solutions by 1e-9 to 2e-8 in every update, for ever.
"""
MOST = 12
STALLED = 0.5
"""An update this large a part of the one before it brings nothing any more."""


def refine(solution: FloatArray, update: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """``solution`` (n, c) after as many updates as it takes: at least one, as the factor is inexact.

    ``update`` gives what the factor thinks is missing. Where the updates do not shrink, they end too;
    :func:`missing` tells that.
    """
    before = np.linalg.norm(solution, axis=0)
    for _ in range(MOST):
        step = update(solution)
        solution = solution + step
        change = np.linalg.norm(step, axis=0)
        small = change**2 <= TOLERANCE * before * np.linalg.norm(solution, axis=0)
        if (small | (change >= STALLED * before)).all():
            break
        before = change
    return solution


def missing(solution: FloatArray, update: Callable[[FloatArray], FloatArray]) -> float:
    """What one more update would change, relative to the ``solution`` (n, c); the worst column counts."""
    change = np.linalg.norm(update(solution), axis=0)
    size = np.linalg.norm(solution, axis=0)
    return float((change / np.where(size > 0.0, size, 1.0)).max(initial=0.0))
