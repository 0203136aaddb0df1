"""A parameter of the equations lowered at a fixed load factor, each solution begun at the one before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, Effort, Point, iterate
from mlsanm_cli.continuation.options import PathOptions
from mlsanm_cli.continuation.problem import FloatArray, Problem, SingularTangentError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.values import dataclass

# The way to a value that cannot be reached at once is halved (geometrically) so often at most.
_HALVINGS = 6


@dataclass(frozen=True, eq=False)
class Family:
    """Problems that differ by one positive parameter.

    Attributes
    ----------
    problem : the problem of a value
    carried : an admissible guess (size,) for the second value's problem from the solution x of the first's
    """

    problem: Callable[[float], Problem]
    carried: Callable[[FloatArray, float, float], FloatArray]


def solve_at(
    family: Family, values: Sequence[float], x: FloatArray, lam: float, options: PathOptions | None = None
) -> Iterator[Correction]:
    """Yield the solutions of a family at the load factor ``lam``, one per value, in the order given.

    The first begins at ``x``, shape (size,), admissible, each other at what ``family.carried`` makes of the
    one before. Where that does not converge, values in between are solved for too. Counts are those since the
    solution before, failed trials included.

    Raises
    ------
    NumericalError
        When a value's solution is not found, even from near by.
    """
    options, effort = options or PathOptions(), Effort()
    before: float | None = None
    for value in values:
        if before is None:
            found = _solved(family.problem(value), x, lam, options, effort)
        else:
            found = _toward(family, (before, value), x, lam, options, effort, _HALVINGS)
        if found is None:
            raise NumericalError(
                f"no solution found at load factor {lam:.9g} for the parameter {value:g}",
                "begin at a larger value, or at a smaller load",
            )
        yield Correction(found.x, lam, found.residual, effort.updates, effort.factorizations, effort.solves)
        x, before, effort = found.x, value, Effort()


def _toward(
    family: Family,
    values: tuple[float, float],
    x: FloatArray,
    lam: float,
    options: PathOptions,
    effort: Effort,
    halvings: int,
) -> Point | None:
    """Return the solution of the second value from that, x, of the first; None when it is not found."""
    before, value = values
    found = _solved(family.problem(value), family.carried(x, before, value), lam, options, effort)
    if found is not None or not halvings:
        return found
    middle = float(np.sqrt(before * value))
    half = _toward(family, (before, middle), x, lam, options, effort, halvings - 1)
    return half and _toward(family, (middle, value), half.x, lam, options, effort, halvings - 1)


def _solved(
    problem: Problem, x: FloatArray, lam: float, options: PathOptions, effort: Effort
) -> Point | None:
    try:
        point = iterate(problem, x, lam, None, options, effort)
    except SingularTangentError:
        return None
    return point if point.residual <= options.tolerance else None
