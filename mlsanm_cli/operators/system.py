"""The interface every discretised body is solved through, however its equations are chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.refinement import FULL_TOLERANCE


@dataclass(frozen=True)
class Equations:
    """A body's equations as they are scaled, written out: ``matrix`` (n, n) u = ``sources`` (n, c) v.

    ``definite`` says whether the matrix is symmetric positive definite.
    """

    matrix: sparse.csr_array
    sources: sparse.csr_array
    definite: bool


class LinearSystem(Protocol):
    """Factorised equations for n unknowns, with right-hand sides in the physical units of r rows."""

    def solve(self, sources: sparse.csc_array, tolerance: float = FULL_TOLERANCE) -> FloatArray:
        """Solutions (n, c) for right-hand sides ``sources`` (r, c), refined to a relative ``tolerance``."""

    def solve_with_error(
        self, sources: sparse.csc_array, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Solutions (n, c) for ``sources`` (r, c), and what the last update changed of each (c,), relatively:
        what solving once more was worth. From a multiple of a ``start`` (n, 1) they take fewer updates, if
        there is one near them."""

    def solve_unrefined(self, sources: sparse.csc_array) -> FloatArray:
        """Solutions (n, c) by the factor alone; :meth:`residual` estimates their error."""

    def step(self, source: sparse.csc_array, solution: FloatArray, more: sparse.csc_array) -> FloatArray:
        """What a step of refinement adds to a ``solution`` (n, 1) for the right-hand side ``source`` (r, 1),
        and solutions for another one, ``more`` (r, 1), by the factor alone: (n, 2), in one pass through the
        factor."""

    def functionals(
        self, observed: sparse.csr_array, sources: sparse.csc_array, mixture: FloatArray | None = None
    ) -> FloatArray:
        """What the rows ``observed`` (g, n) make of the solutions for ``sources`` (r, s), as a matrix (g, s),
        or for them times the ``mixture`` (s, c): (g, c).

        Much less work than the solutions themselves, if the sources have few entries.
        """

    def residual(self, sources: sparse.csc_array, solutions: FloatArray) -> FloatArray:
        """What one more refinement would change of each of the ``solutions`` (n, c), relatively: (c,).

        The residual itself means little: nearly incompressible materials have rows so large that a useless
        solution leaves one at round-off.
        """

    @property
    def note(self) -> str:
        """What users should know of how the equations were factorised, usually nothing."""

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """(S^T S)^-1 times ``vectors`` (n, c), S the equations as they are scaled."""

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        """Right-hand sides (r, c) as the equations are scaled, on request without the ``strong`` ones."""

    def equations(self, sources: sparse.csc_array) -> Equations:
        """The equations for right-hand sides ``sources`` (r, c), to be factorised together with others."""

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """What ``solution`` (n,) has too much in each equation (n,) for a right-hand side ``source`` (r,),
        to more digits than the matrix of :meth:`equations` would give."""
