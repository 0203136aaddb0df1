"""The interface for solving a discretised body, whatever its equations, and iterative refinement."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.records import dataclass

FULL_TOLERANCE = 1e-11
"""Relative tolerance of the predicted next update."""
FUNCTIONAL_TOLERANCE = 1e-8
"""The same for many solutions of which only functionals are needed."""
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

    def correction(self, sources: sparse.csc_array, solutions: FloatArray | None = None) -> FloatArray:
        """Change (n, c) of ``solutions`` (n, c) for ``sources`` (r, c) by one pass through the factor; from
        none, the solutions by the factor alone."""

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        """Rows ``observed`` (g, n) applied to the solutions for ``sources`` (r, s), times the ``mixture`` (s,
        c) if given: (g, s) or (g, c). Much cheaper than the solutions themselves for sparse sources."""

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; usually ""."""

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """(S^T S)^-1 times ``vectors`` (n, c), with S the scaled equations."""

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        """Right-hand sides (r, c) in the scaling of the equations, without the ``strong`` rows if false."""


def residual_of(system: LinearSystem, sources: sparse.csc_array, solutions: FloatArray) -> FloatArray:
    """Relative change (c,) of the ``solutions`` (n, c) by one more refinement. The residual itself is no
    measure: rows of nearly incompressible materials are too large."""
    size = np.linalg.norm(solutions, axis=0)
    return np.asarray(
        np.linalg.norm(system.correction(sources, solutions), axis=0) / np.where(size > 0.0, size, 1.0)
    )


@dataclass(frozen=True)
class Progress:
    """Progress of several solutions: sizes (c,) of their ``last`` updates and of those ``before``, and which
    are ``done`` (c,): the predicted next update is at most ``tolerance``, relatively."""

    before: FloatArray
    last: FloatArray
    done: BoolArray
    tolerance: float

    @classmethod
    def of(cls, first: FloatArray, tolerance: float) -> Progress:
        """At ``first`` solutions (n, c)."""
        sizes = np.linalg.norm(first, axis=0)
        return cls(np.full(len(sizes), np.inf), sizes, np.zeros(len(sizes), bool), tolerance)

    def after(self, update: FloatArray, solution: FloatArray) -> Progress:
        """After another ``update`` (n, c), which led to ``solution`` (n, c)."""
        change, size = np.linalg.norm(update, axis=0), np.linalg.norm(solution, axis=0)
        small = change * (change / np.maximum(self.last, TINY)) <= self.tolerance * size
        small_change = change <= STALL_CHANGE * size
        stalled = (change >= STALL_RATIO * np.maximum(self.before, self.last)) & small_change
        last = np.where(self.done, self.last, change)
        return Progress(self.last, last, self.done | small | stalled, self.tolerance)
