"""What happens where a method for positive definite matrices does not give a factor that solves."""

from __future__ import annotations

from dataclasses import replace

import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.operators.linear.interface import Factor, Matrix, backward_error
from mlsanm_cli.operators.linear.superlu import elimination_order, factor_in_order

MAX_BACKWARD_ERROR = 1e-11
"""Largest backward error of an accepted factor; expected is round-off."""
CORRECTABLE, CORRECTED_ERROR = 1e-9, 1e-14
"""Or a backward error that one correction, which all solutions get, reduces to the second value: equations of
nearly incompressible bodies lose digits in any factor without pivoting, 1e-11 and more, and a correction
recovers them (1e-17)."""


def verified_or_superlu(factor: Factor | None, matrix: Matrix, points: FloatArray) -> Factor:
    """The ``factor`` of a ``matrix`` (2n, 2n) if there is one and it solves, else SuperLU's, with a note.

    Raises NumericalError where that does not solve either.
    """
    if factor is not None and _sound(matrix, factor):
        return factor
    plain = sparse.csc_array(matrix)
    other = factor_in_order(plain, elimination_order(plain, points))
    if not _sound(matrix, other):
        raise NumericalError(
            "the elastic system of a body is singular to working precision",
            "a body may be able to move freely, or its cloud may be too coarse for mls.degree",
        )
    return replace(
        other,
        note="the equations are not positive definite to working precision; SuperLU factorised them",
    )


def _sound(matrix: Matrix, factor: Factor) -> bool:
    """Whether a factor solves, with the corrections that solutions get."""
    error = backward_error(matrix, factor)
    if error <= MAX_BACKWARD_ERROR:
        return True
    return error <= CORRECTABLE and backward_error(matrix, factor, corrections=1) <= CORRECTED_ERROR
