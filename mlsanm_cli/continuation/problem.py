"""The equations R(x, lam) = 0 as continuation methods see them. This package contains no mechanics."""

from __future__ import annotations

from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.errors import NumericalError

FloatArray: TypeAlias = NDArray[np.float64]


class SingularTangentError(NumericalError):
    """The tangent dR/dx cannot be factorised at the requested point."""


class Tangent(Protocol):
    """The factorised derivative dR/dx at one point.

    A tangent may also have a method ``orders(x, lam, slope, normal, size)`` that computes the coefficients
    ``x`` (N + 1, size) and ``lam`` (N + 1,) of all orders from 2 on at once, which is faster.
    """

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return w, shape (size,), with dR/dx w = rhs; ``rhs``, shape (size,), must not be changed."""


class Problem(Protocol):
    """A smooth system of ``size`` equations in ``size`` unknowns x and one load factor lam.

    The residual is dimensionless and of order one when an equation is grossly violated, so that one
    tolerance fits every problem. Unknowns may have any units: lengths along the path use ``x / scale``.
    """

    @property
    def size(self) -> int:
        """Number of unknowns and of equations."""

    @property
    def scale(self) -> FloatArray:
        """Typical magnitude of each unknown, shape (size,), all > 0; must not change along a path."""

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Return R(x, lam), shape (size,), dimensionless."""

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        """Return dR/dx at (x, lam), factorised.

        Raises
        ------
        SingularTangentError
            When the factorisation breaks down (``numpy.linalg.LinAlgError`` is accepted as well).
        """

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Return dR/dlam at (x, lam), shape (size,)."""

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Return the right-hand side of order k, shape (size,), from the coefficients of orders below k.

        ``x`` has shape (k, size) and ``lam`` shape (k,), k >= 2. The result is minus the coefficient of
        order k of R(sum_j a^j x_j, sum_j a^j lam_j), with x_k and lam_k taken as zero.
        """

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether (x, lam) satisfies every constraint, for instance gaps > 0."""
