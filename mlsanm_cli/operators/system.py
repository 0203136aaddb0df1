"""The interface for solving a discretised body, whatever its equations."""

from __future__ import annotations

from typing import Protocol

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.operators.refinement import FULL_TOLERANCE
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Equations:
    """A body's scaled equations: ``matrix`` (n, n) u = ``sources`` (n, c) v. ``definite``: the matrix is
    symmetric positive definite."""

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
        measure: rows of nearly incompressible materials are so large that a useless solution has one of the
        order of round-off."""

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; usually ""."""

    def inverse_normal(self, vectors: FloatArray) -> FloatArray:
        """(S^T S)^-1 times ``vectors`` (n, c), with S the scaled equations."""

    def scaled(self, sources: sparse.csc_array, strong: bool = True) -> FloatArray:
        """Right-hand sides (r, c) in the scaling of the equations, without the ``strong`` rows if false."""

    def equations(self, sources: sparse.csc_array) -> Equations:
        """The equations for right-hand sides ``sources`` (r, c), to be factorised together with others."""

    def residual_vector(self, source: FloatArray, solution: FloatArray) -> FloatArray:
        """Residual (n,) of ``solution`` (n,) for right-hand side ``source`` (r,), more accurate than with the
        matrix of :meth:`equations`."""
