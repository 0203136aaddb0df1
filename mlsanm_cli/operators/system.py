"""The interface for solving a discretised body, whatever its equations, and iterative solutions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.roundoff import ROUND_OFF

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
        """Change (n, c) of ``solutions`` by one pass through the factor; without, the factor's solutions."""

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
    change = np.linalg.norm(system.correction(sources, solutions), axis=0)
    return np.asarray(change / np.where(size > 0.0, size, 1.0))


class Progress:
    """Progress of several solutions: which are ``done`` (c,), as the predicted next update is at most
    ``tolerance``, relatively, or updates stagnate."""

    def __init__(self, first: FloatArray, tolerance: float) -> None:
        """At ``first`` solutions (n, c)."""
        self._last, self._tolerance = np.linalg.norm(first, axis=0), tolerance
        self._before, self.done = np.full(len(self._last), np.inf), np.zeros(len(self._last), dtype=bool)

    def advance(self, update: FloatArray, solution: FloatArray) -> None:
        """Take note of another ``update`` (n, c), which led to ``solution`` (n, c)."""
        change, size = np.linalg.norm(update, axis=0), np.linalg.norm(solution, axis=0)
        small = change * (change / np.maximum(self._last, TINY)) <= self._tolerance * size
        slow = change >= STALL_RATIO * np.maximum(self._before, self._last)
        self._before, self._last = self._last, np.where(self.done, self._last, change)
        self.done = self.done | small | (slow & (change <= STALL_CHANGE * size))


RANK, CHECK_COLUMNS = 8, 4
"""Initial numbers of random columns, and of those for the error estimate."""
NOISE_RATIO = 5.0
"""Accepted error outside the basis over that inside."""

Apply: TypeAlias = Callable[[FloatArray], FloatArray]


def corrected(start: FloatArray, of_columns: Apply, of_rows: Apply) -> FloatArray:
    """The matrix A (g, c) approximated by ``start``; ``of_columns`` computes A V (g, s), ``of_rows`` U^T A
    (s, c) accurately. An ill-conditioned factor is inaccurate in a few smooth modes: the error has low rank,
    found from its action on random columns (Halko, Martinsson and Tropp 2011, doi:10.1137/090771806)."""
    column = np.linalg.norm(start, axis=0)
    column[column == 0.0] = 1.0
    row = np.linalg.norm(start / column, axis=1)[:, None]
    row[row == 0.0] = 1.0
    rng = np.random.default_rng(0)
    rank, tried, found = RANK, np.zeros((start.shape[1], 0)), np.zeros((start.shape[0], 0))
    while 2 * (rank + CHECK_COLUMNS) < min(start.shape):
        more = rng.normal(size=(len(tried), rank + CHECK_COLUMNS - tried.shape[1])) / column[:, None]
        tried, found = np.hstack([tried, more]), np.hstack([found, of_columns(more) / row])
        basis = np.linalg.qr((found - start @ tried / row)[:, :rank])[0]
        result = start + row * (basis @ (of_rows(basis / row) - (basis / row).T @ start))
        left = (found - result @ tried / row)[:, rank:]
        within = basis.T @ left
        noise = max(ROUND_OFF * np.linalg.norm(found[:, rank:]), NOISE_RATIO * np.linalg.norm(within))
        if np.linalg.norm(left - basis @ within) <= noise:
            return np.asarray(result)
        rank *= 2
    unit = np.eye(start.shape[1])
    firsts = range(0, len(unit), BLOCK_COLUMNS)
    blocks = [of_columns(unit[:, first : first + BLOCK_COLUMNS]) for first in firsts]
    return np.concatenate([start[:, :0], *blocks], axis=1)


BASIS = 300
"""Largest number of vectors kept; no restarts, which stall."""


def gmres(product: Apply, rhs: FloatArray, tolerance: float) -> tuple[FloatArray, int]:
    """An approximate solution (n,) for ``rhs`` (n,) whose residual is ``tolerance`` times as large, or the
    best in BASIS vectors; and the number of products (Saad and Schultz 1986, doi:10.1137/0907058)."""
    size = float(np.linalg.norm(rhs))
    if size == 0.0:
        return np.zeros_like(rhs), 0
    vectors, count = [rhs / size], min(BASIS, len(rhs))
    matrix = np.zeros((count + 1, count))
    rotations = np.zeros((count, 2))
    left = np.zeros(count + 1)
    left[0] = size
    for k in range(count):
        new = product(vectors[k])
        # Twice, against loss of orthogonality.
        for _ in (0, 1):
            for row, vector in enumerate(vectors):
                share = float(vector @ new)
                matrix[row, k] += share
                new = new - share * vector
        length = float(np.linalg.norm(new))
        matrix[k + 1, k] = length
        column = matrix[:, k]
        for row in range(k):
            c, s = rotations[row]
            above, below = column[row], column[row + 1]
            column[row], column[row + 1] = c * above + s * below, c * below - s * above
        radius = float(np.hypot(column[k], length))
        rotations[k] = c, s = column[k] / radius, length / radius
        column[k], column[k + 1] = radius, 0.0
        left[k], left[k + 1] = c * left[k], -s * left[k]
        if abs(left[k + 1]) <= tolerance * size or length <= np.finfo(float).eps * radius:
            break
        vectors.append(new / length)
    used = k + 1
    shares = np.linalg.solve(np.triu(matrix[:used, :used]), left[:used])
    return np.asarray(np.stack(vectors[:used], axis=1) @ shares), used
