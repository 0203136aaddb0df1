"""The equations R(x, lam) = 0 as continuation methods see them, and the options of path following. This
package contains no mechanics."""

from __future__ import annotations

from typing import ClassVar, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass

FloatArray: TypeAlias = NDArray[np.float64]


class SingularTangentError(NumericalError):
    """The tangent dR/dx cannot be factorised at the requested point."""


class Tangent(Protocol):
    """The factorised derivative dR/dx at one point."""

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Return w, shape (size,), with dR/dx w = rhs; ``rhs``, shape (size,), must not be changed."""


class Problem(Protocol):
    """A smooth system of ``size`` equations in ``size`` unknowns x and one load factor lam. The residual is
    dimensionless and of order one when an equation is grossly violated, so that one tolerance fits every
    problem. Unknowns may have any units: lengths along the path use ``x / scale``."""

    @property
    def size(self) -> int:
        """Number of unknowns and of equations."""

    @property
    def scale(self) -> FloatArray:
        """Typical magnitude of each unknown, shape (size,), all > 0; must not change along a path."""

    def residual(self, x: FloatArray, lam: float) -> FloatArray:
        """Return R(x, lam), shape (size,), dimensionless."""

    def tangent(self, x: FloatArray, lam: float) -> Tangent:
        """Return dR/dx at (x, lam), factorised. Raises NumericalError or LinAlgError."""

    def load_derivative(self, x: FloatArray, lam: float) -> FloatArray:
        """Return dR/dlam at (x, lam), shape (size,)."""

    def series_rhs(self, x: FloatArray, lam: FloatArray) -> FloatArray:
        """Return the right-hand side of order k, shape (size,), from the coefficients of orders below k.
        ``x`` has shape (k, size) and ``lam`` shape (k,), k >= 2. The result is minus the coefficient of order
        k of R(sum_j a^j x_j, sum_j a^j lam_j), with x_k and lam_k taken as zero."""

    def admissible(self, x: FloatArray, lam: float) -> bool:
        """Whether (x, lam) satisfies every constraint, for instance gaps > 0."""


MIN_LENGTH = 1e-10
"""A step shorter than this, in scaled units of the path, ends the path."""


@dataclass(frozen=True)
class PathOptions:
    """Options of every method: the ``tolerance`` is the largest residual allowed anywhere on the path
    (Newton's method: at the ends of steps)."""

    tolerance: float = 1e-8
    max_corrections: ClassVar[int] = 50
    """Largest number of Newton updates of one correction."""

    @property
    def goal(self) -> float:
        """Target for the residual of a correction; the rest is left to the series that follows."""
        return 0.01 * self.tolerance


@dataclass(frozen=True)
class AnmOptions(PathOptions):
    """Power series of ``order`` 2 to 40, of which 15 to 30 is most efficient, in the form of Padé
    approximants (``pade``) where that makes the step longer."""

    order: int = 20
    pade: bool = True


@dataclass(frozen=True)
class NewtonOptions(PathOptions):
    """Newton-Raphson iterations: every step solves at a given load factor ("load"), or on the plane normal to
    its first tangent ("arc-length"), which passes folds."""

    max_corrections: ClassVar[int] = 25
    control: Literal["load", "arc-length"] = "load"
