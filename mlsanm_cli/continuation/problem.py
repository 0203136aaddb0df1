"""The equations R(x, lam) = 0 as continuation methods see them, the options of path following, and the power
series of a path at one of its points. This package contains no mechanics.

With y = x/scale and the product <(x, lam), (z, mu)> = mean(y_x y_z) + lam mu (a mean, so that the load factor
keeps its weight whatever the number of unknowns), the parameter of the path is a = <X - X_0, T> / unit^2, T
being tangent to it at X_0 with |T| = unit: regular at folds. A start point has a small residual R_0; its
series follows R(X(a)) = (1 - a) R_0, which returns to the path over about the length of the step. ``unit`` is
near that length, which keeps high orders from overflowing, and a power of two, which adds no round-off.
B. Cochelin, Computers & Structures 53 (1994) 1181-1192. Equation (16) of docs/method.md."""

from __future__ import annotations

from typing import ClassVar, Literal, Protocol

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass


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


class Metric:
    """The scaled product of points of the path."""

    def __init__(self, scale: FloatArray) -> None:
        self.weight: FloatArray = 1.0 / (scale.size * scale * scale)

    def product(self, x: FloatArray, lam: float, z: FloatArray, mu: float) -> float:
        """Return <(x, lam), (z, mu)>."""
        return float((self.weight * x) @ z) + lam * mu

    def norm(self, x: FloatArray, lam: float) -> float:
        """Return |(x, lam)|; inf when it overflows."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.sqrt(self.product(x, lam, x, lam)))


@dataclass(frozen=True, eq=False)
class ExpansionPoint:
    """A point of the path with its factorised tangent and the slope dx/dlam there, shape (size,)."""

    x: FloatArray
    lam: float
    tangent: Tangent
    slope: FloatArray


def expansion_point(problem: Problem, x: FloatArray, lam: float) -> ExpansionPoint:
    """Return a point of the path with its tangent and slope. Raises SingularTangentError."""
    try:
        tangent = problem.tangent(x, lam)
        slope = -tangent.solve(problem.load_derivative(x, lam))
    except (np.linalg.LinAlgError, NumericalError) as error:
        raise SingularTangentError(f"singular tangent at load factor {lam:.9g}") from error
    if not np.all(np.isfinite(slope)):
        raise SingularTangentError(f"singular tangent at load factor {lam:.9g}")
    return ExpansionPoint(x, lam, tangent, slope)


MAX_RETURN = 0.1
"""A series returns to the path by at most this part of its unit, and otherwise keeps the residual of its
start: along a motion with very little stiffness, round-off in the residual would move it far, or back along
the path."""


def expand(
    problem: Problem,
    metric: Metric,
    start: ExpansionPoint,
    order: int,
    direction: tuple[FloatArray, float],
    unit: float,
) -> tuple[Branch, bool]:
    """Return the series of the path at ``start``, as a piece of no length, and whether it keeps the residual
    of its start. The tangent has a positive product with ``direction`` and the length ``unit``, a guess of
    the length of the step. Coefficients may overflow."""
    x = np.empty((order + 1, start.x.size))
    lam = np.empty(order + 1)
    slope = start.slope
    size = metric.norm(slope, 1.0)
    rise = float(np.copysign(unit / size, metric.product(slope, 1.0, *direction)))
    normal = metric.weight * (rise * slope)
    # <v, T_x> + T_lam, the denominator of every lam_k
    denominator = rise * size * size
    solve = start.tangent.solve
    x[0], lam[0] = start.x, start.lam
    free = solve(-problem.residual(start.x, start.lam))
    keeps_residual = metric.norm(free, 0.0) > MAX_RETURN * unit
    if keeps_residual:
        free[:] = 0.0
    lam[1] = rise - float(normal @ free) / denominator
    x[1] = free + lam[1] * slope
    for k in range(2, order + 1):
        free = solve(problem.series_rhs(x[:k], lam[:k]))
        lam[k] = -float(normal @ free) / denominator
        np.multiply(slope, lam[k], out=x[k])
        x[k] += free
    return Branch(x, lam, 0.0), keeps_residual
