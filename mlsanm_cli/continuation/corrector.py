"""Newton corrections of a start point at fixed load factor, and of the end of a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.problem import ExpansionPoint, PathOptions, Problem, SingularTangentError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.records import dataclass

# An update halved more often has failed: 2^-40 of a Newton step is no progress.
_MAX_HALVINGS = 40
# An update that would leave the admissible region covers this part of the way to its boundary, which is
# found by so many bisections.
_BOUNDARY_MARGIN = 0.95
_BISECTIONS = 5
# Chord updates (with an old tangent) continue while each removes nine tenths of the residual.
_CHORD_RATE = 0.1
_CHORD_UPDATES = 3
# Least relative decrease of the residual's norm by a damped update, per unit of its fraction (Armijo).
_SUFFICIENT_DECREASE = 1e-4
# The end of a step that round-off keeps above its goal may have this part of the tolerance as residual; the
# rest is left to the next series.
_END_SHARE = 0.3


Effort: TypeAlias = Counter[str]
"""Running counts of steps and corrections: updates, factorizations, solves."""


@dataclass(frozen=True, eq=False)
class Correction:
    """A corrected point and its largest residual."""

    x: FloatArray
    lam: float
    residual: float


def residual_norm(problem: Problem, x: FloatArray, lam: float) -> float:
    """Return the largest residual at a point; inf if that is not finite or the point not admissible."""
    if not problem.admissible(x, lam):
        return np.inf
    value = float(np.abs(problem.residual(x, lam)).max(initial=0.0))
    return value if value == value else np.inf


def point_at(problem: Problem, x: FloatArray, lam: float) -> Correction:
    """Return a point with its largest residual."""
    return Correction(x, lam, residual_norm(problem, x, lam))


@np.errstate(over="ignore", invalid="ignore")
def correct(
    problem: Problem,
    x: FloatArray,
    lam: float,
    options: PathOptions | None = None,
    effort: Effort | None = None,
) -> Correction:
    """Solve R(x, lam) = 0 at fixed ``lam`` by Newton's method from an admissible ``x`` (size,), to
    ``options.goal`` or, if round-off prevents that, ``tolerance``. Counts are added to ``effort``. Raises
    NumericalError if ``x`` is not admissible, the tangent singular, or the iteration does not converge."""
    options, effort = options or PathOptions(), Effort() if effort is None else effort
    if not np.isfinite(residual_norm(problem, x, lam)):
        raise NumericalError(
            f"the start point at load factor {lam:.9g} is not admissible", "start from open gaps and no load"
        )
    before = effort["updates"]
    try:
        found = iterate(problem, x, lam, None, options, effort)
    except SingularTangentError as error:
        raise NumericalError(
            f"singular tangent at load factor {lam:.9g} while correcting a point",
            "check that every body is held, by supports or by contact",
        ) from error
    if found.residual > options.tolerance:
        raise NumericalError(
            f"no solution found at load factor {lam:.9g}: residual {found.residual:.3g} after "
            f"{effort['updates'] - before} updates, tolerance {options.tolerance:.3g}",
            'use contact.regularization.law = "exact", or a larger contact.regularization.eta',
        )
    return found


@np.errstate(over="ignore", invalid="ignore")
def iterate(
    problem: Problem,
    x: FloatArray,
    lam: float,
    load_update: Callable[[FloatArray, FloatArray], float] | None,
    options: PathOptions,
    effort: Effort,
) -> Correction:
    """Return the point reached by damped Newton updates from an admissible (x, lam): at fixed load factor, or
    by the ``load_update`` for the update there and the slope dx/dlam. They end at ``options.goal``, after
    ``max_corrections``, or when none lowers the norm of the residual. Raises SingularTangentError."""
    point = point_at(problem, np.array(x, dtype=np.float64), lam)
    for _ in range(options.max_corrections):
        if point.residual <= options.goal:
            break
        residual = problem.residual(point.x, point.lam)
        effort["factorizations"] += 1
        effort["solves"] += 1
        try:
            tangent = problem.tangent(point.x, point.lam)
            dx, along = tangent.solve(-residual), 0.0
            if load_update is not None:
                effort["solves"] += 1
                slope = -tangent.solve(problem.load_derivative(point.x, point.lam))
                along = load_update(dx, slope)
                dx = dx + along * slope
        except (np.linalg.LinAlgError, NumericalError) as error:
            raise SingularTangentError(f"singular tangent at load factor {point.lam:.9g}") from error
        if not np.all(np.isfinite(dx)):
            raise SingularTangentError(f"singular tangent at load factor {point.lam:.9g}")
        # The Euclidean norm decreases along a Newton update, the largest residual need not.
        size, part = float(np.linalg.norm(residual)), admissible_part(problem, point.x, point.lam, dx, along)
        while part >= 0.5**_MAX_HALVINGS:
            ahead, lam = point.x + part * dx, point.lam + part * along
            if problem.admissible(ahead, lam):
                residual = problem.residual(ahead, lam)
                if float(np.linalg.norm(residual)) <= (1.0 - _SUFFICIENT_DECREASE * part) * size:
                    break
            part *= 0.5
        else:
            break
        point = Correction(ahead, lam, float(np.abs(residual).max(initial=0.0)))
        effort["updates"] += 1
    return point


@np.errstate(over="ignore", invalid="ignore")
def correct_end(
    problem: Problem, start: ExpansionPoint, x: FloatArray, lam: float, options: PathOptions, effort: Effort
) -> Correction | None:
    """Correct the end of a step to the path, at its load factor; None when that fails. The factorised tangent
    of the step's start is used, and a new one if that converges slowly. Counts are added to ``effort``."""
    point = point_at(problem, x, lam)
    for _ in range(_CHORD_UPDATES):
        if point.residual <= options.goal:
            return point
        effort["solves"] += 1
        step = start.tangent.solve(-problem.residual(point.x, point.lam))
        better = point_at(problem, point.x + step, point.lam)
        if not better.residual <= _CHORD_RATE * point.residual:
            break
        point = better
        effort["updates"] += 1
    try:
        point = iterate(problem, point.x, point.lam, None, options, effort)
    except SingularTangentError:
        return None
    return point if point.residual <= max(options.goal, _END_SHARE * options.tolerance) else None


def admissible_part(problem: Problem, x: FloatArray, lam: float, dx: FloatArray, dlam: float) -> float:
    """Return the part of an update in the admissible region: 1, a margin before its boundary, or 0."""

    def inside(part: float) -> bool:
        return problem.admissible(x + part * dx, lam + part * dlam)

    if inside(1.0):
        return 1.0
    low, high = 0.5, 1.0
    while not inside(low):
        low, high = 0.5 * low, low
        if low < 0.5**_MAX_HALVINGS:
            return 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if inside(middle) else (low, middle)
    return _BOUNDARY_MARGIN * low
