"""Matrices for direct solvers, with 32-bit indices; the interface of their factors, and the error of one."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IndexArray
from mlsanm_cli.errors import NumericalError

Matrix: TypeAlias = "sparse.csc_array | sparse.bsr_array"
"""A symmetric matrix, in CSC or block form."""
LinearSolver: TypeAlias = Literal["auto", "superlu"]
"""Direct solver of symmetric systems: own Cholesky factorisation, or SuperLU."""


MAX_ENTRIES = np.iinfo(np.int32).max
"""Largest number of entries with 32-bit indices."""


def structure(matrix: sparse.csr_array | sparse.bsr_array) -> tuple[IndexArray, IndexArray]:
    """Row offsets and column indices of a matrix's entries or blocks. Raises NumericalError for too many."""
    refuse_too_many(int(matrix.indptr[-1]))
    indptr, indices = (part.astype(np.int32, copy=False) for part in (matrix.indptr, matrix.indices))
    return indptr, indices


def refuse_too_many(entries: int) -> None:
    """Raise NumericalError for more ``entries`` than 32-bit indices can count."""
    if entries > MAX_ENTRIES:
        raise NumericalError(
            f"the equations of a body have {entries:.3g} entries, more than the limit of {MAX_ENTRIES:.3g}",
            "make its spacing larger, or mls.degree lower",
        )


class Factor(Protocol):
    """A factorised matrix."""

    @property
    def note(self) -> str:
        """Remark on the factorisation for users; usually ""."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution for right-hand sides (n,) or (n, c)."""

    def products(self, left: sparse.csr_array, right: sparse.csc_array) -> FloatArray:
        """``left`` (g, n) times the solutions for ``right`` (n, c): (g, c)."""


def backward_error(matrix: Matrix, factor: Factor, corrections: int = 0) -> float:
    """Backward error of a factor of a symmetric ``matrix`` (n, n).

    With D its diagonal: max_i |b - A x|_i / (|b|_i + sqrt(D_i) sum_j sqrt(D_j) |x_j|), independent of the
    units of the unknowns. For the last, negative ones D_i is at least max_j A_ij^2 / D_j over the positive
    ones. The right-hand side is random with fixed seed; the solution gets ``corrections`` refinement steps.
    """
    rhs = np.random.default_rng(0).normal(size=matrix.shape[0])
    solution = factor.solve(rhs)
    for _ in range(corrections):
        solution = solution + factor.solve(rhs - matrix @ solution)
    diagonal = matrix.diagonal()
    scale = np.sqrt(np.abs(diagonal))
    first = int(np.argmax(diagonal < 0.0)) if (diagonal < 0.0).any() else len(diagonal)
    if first < len(diagonal):
        last = sparse.eye_array(len(diagonal), len(diagonal) - first, k=-first, format="csc")
        coupled = sparse.csc_array(matrix @ last)[:first]
        share = 1.0 / np.maximum(scale[:first], np.finfo(float).tiny)
        sizes = abs(sparse.diags_array(share) @ coupled).max(axis=0).toarray().ravel()
        scale[first:] = np.maximum(scale[first:], sizes)
    parts = scale * (scale @ np.abs(solution)) + np.abs(rhs)
    return float((np.abs(rhs - matrix @ solution) / parts).max())
