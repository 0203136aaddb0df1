"""Verification of factors of positive definite matrices, with SuperLU as fallback."""

from __future__ import annotations

from dataclasses import replace

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear.interface import Factor, Matrix, backward_error
from mlsanm_cli.operators.linear.superlu import elimination_order, factor_in_order

MAX_BACKWARD_ERROR = 1e-11
"""Accepted backward error of a factor; round-off is expected."""
MAX_UNCORRECTED_ERROR, MAX_CORRECTED_ERROR = 1e-9, 1e-13
"""Or: accepted backward error if one correction, as all solutions get, reduces it to MAX_CORRECTED_ERROR.
Equations of nearly incompressible bodies lose digits in any factor without pivoting (1e-11 and more), which a
correction restores (1e-17 to 4e-14)."""


def verified_or_superlu(factor: Factor | None, matrix: Matrix, points: FloatArray) -> Factor:
    """The ``factor`` of a ``matrix`` (2n, 2n) if accurate, else SuperLU's, with a note.

    Raises NumericalError if that is inaccurate too.
    """
    if factor is not None and _accurate(matrix, factor):
        return factor
    plain = sparse.csc_array(matrix)
    other = factor_in_order(plain, elimination_order(plain, points))
    if not _accurate(matrix, other):
        raise NumericalError(
            "the elastic system of a body is singular to working precision",
            "a body may be able to move freely, or its cloud may be too coarse for mls.degree",
        )
    return replace(
        other,
        note="the equations are not positive definite to working precision; SuperLU factorised them",
    )


def _accurate(matrix: Matrix, factor: Factor) -> bool:
    """Whether a factor is accurate, with the corrections that solutions get."""
    error = backward_error(matrix, factor)
    if error <= MAX_BACKWARD_ERROR:
        return True
    return (
        error <= MAX_UNCORRECTED_ERROR
        and backward_error(matrix, factor, corrections=1) <= MAX_CORRECTED_ERROR
    )
