"""Newton corrections: of a start point at fixed load factor, and of the end of a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.continuation.expansion import Metric, Station, station
from mlsanm_cli.continuation.options import AnmOptions
from mlsanm_cli.continuation.problem import FloatArray, Problem, SingularTangentError
from mlsanm_cli.errors import NumericalError

# Halvings of a damped update before it counts as failed: 2^-40 of a Newton step is no progress.
_HALVINGS = 40
# A correction with an old tangent goes on while each update removes nine tenths of the residual.
_CHORD_RATE = 0.1
_CHORD_UPDATES = 3
# Smallest relative fall of the residual's norm that a damped update must bring, per unit of its fraction.
_DECREASE = 1e-4
# An end of step that round-off keeps above its goal may use this part of the tolerance; the rest is left
# to the next series.
_HEADROOM = 0.3


@dataclass(frozen=True, eq=False)
class Correction:
    """A corrected point, its largest residual, and what it took."""

    x: FloatArray
    lam: float
    residual: float
    updates: int
    factorizations: int
    solves: int


@dataclass
class Effort:
    """Counts of one step or correction as they grow."""

    updates: int = 0
    factorizations: int = 0
    solves: int = 0

    def add(self, other: Effort) -> None:
        """Add the counts of ``other`` to these."""
        self.updates += other.updates
        self.factorizations += other.factorizations
        self.solves += other.solves


def residual_norm(problem: Problem, x: FloatArray, lam: float) -> float:
    """Return the largest residual at an admissible point; inf where it is not admissible or not finite."""
    if not problem.admissible(x, lam):
        return np.inf
    value = float(np.abs(problem.residual(x, lam)).max(initial=0.0))
    return value if value == value else np.inf


@np.errstate(over="ignore", invalid="ignore")
def correct(problem: Problem, x: FloatArray, lam: float, options: AnmOptions | None = None) -> Correction:
    """Solve R(x, lam) = 0 at fixed ``lam`` by Newton's method from an admissible ``x``, shape (size,).

    Updates are halved until the point stays admissible and the norm of the residual falls. The residual
    aimed at is ``options.goal``; when round-off forbids that, ``tolerance`` will do.

    Raises
    ------
    NumericalError
        When ``x`` is not admissible, the tangent singular, or no convergence reached.
    """
    options = options or AnmOptions()
    point = np.array(x, dtype=np.float64)
    largest = residual_norm(problem, point, lam)
    if not np.isfinite(largest):
        raise NumericalError(
            f"the start point at load factor {lam:.9g} is not admissible", "start from open gaps and no load"
        )
    effort = Effort()
    while largest > options.goal and effort.updates < options.max_corrections:
        residual = problem.residual(point, lam)
        try:
            effort.factorizations += 1
            effort.solves += 1
            update = problem.tangent(point, lam).solve(-residual)
            if not np.all(np.isfinite(update)):
                raise SingularTangentError("the update is not finite")
        except (SingularTangentError, np.linalg.LinAlgError) as error:
            raise NumericalError(
                f"singular tangent at load factor {lam:.9g} while correcting a point",
                "check that every body is held, by supports or by contact",
            ) from error
        damped = _damped(problem, point, lam, update, residual)
        if damped is None:
            break
        point, largest = damped
        effort.updates += 1
    if largest > options.tolerance:
        raise NumericalError(
            f"no solution found at load factor {lam:.9g}: residual {largest:.3g} after {effort.updates} "
            f"updates, tolerance {options.tolerance:.3g}",
            "start from a smaller load or a larger contact.regularization.eta",
        )
    return Correction(point, lam, largest, effort.updates, effort.factorizations, effort.solves)


@np.errstate(over="ignore", invalid="ignore")
def correct_end(
    problem: Problem,
    metric: Metric,
    start: Station,
    end: tuple[FloatArray, float],
    normal: tuple[FloatArray, float] | None,
    options: AnmOptions,
    effort: Effort,
) -> Correction | None:
    """Bring the end of a step back to the path; None when that fails.

    The correction is orthogonal to ``normal``, or keeps the load factor when ``normal`` is None. The
    factorised tangent of the step's start is tried first, a fresh one where it does not converge fast.
    Work is added to ``effort``.
    """
    point = _Point(*end, residual_norm(problem, *end))
    updates = effort.updates
    for _ in range(_CHORD_UPDATES):
        if point.residual <= options.goal:
            break
        better = _updated(problem, metric, start, point, normal, effort)
        if not better.residual <= _CHORD_RATE * point.residual:
            break
        point = better
        effort.updates += 1
    for _ in range(options.max_corrections):
        if point.residual <= options.goal:
            break
        try:
            effort.factorizations += 1
            effort.solves += 1
            fresh = station(problem, point.x, point.lam)
        except SingularTangentError:
            return None
        better = _updated(problem, metric, fresh, point, normal, effort)
        if not better.residual < point.residual:
            break
        point = better
        effort.updates += 1
    if point.residual > max(options.goal, _HEADROOM * options.tolerance):
        return None
    return Correction(point.x, point.lam, point.residual, effort.updates - updates, 0, 0)


@dataclass(frozen=True, eq=False)
class _Point:
    x: FloatArray
    lam: float
    residual: float


def _updated(
    problem: Problem,
    metric: Metric,
    at: Station,
    point: _Point,
    normal: tuple[FloatArray, float] | None,
    effort: Effort,
) -> _Point:
    """Return the point after one Newton update with the tangent and slope of the station ``at``."""
    effort.solves += 1
    dx = at.tangent.solve(-problem.residual(point.x, point.lam))
    if normal is None:
        x, lam = point.x + dx, point.lam
    else:
        along = -metric.product(dx, 0.0, *normal) / metric.product(at.slope, 1.0, *normal)
        x, lam = point.x + dx + along * at.slope, point.lam + along
    return _Point(x, lam, residual_norm(problem, x, lam))


def _damped(
    problem: Problem, x: FloatArray, lam: float, update: FloatArray, residual: FloatArray
) -> tuple[FloatArray, float] | None:
    """Return the first of x + update, x + update/2, ... that is admissible and lowers the residual."""
    size = float(np.linalg.norm(residual))
    fraction = 1.0
    for _ in range(_HALVINGS):
        trial = x + fraction * update
        largest = residual_norm(problem, trial, lam)
        if np.isfinite(largest):
            # The Euclidean norm falls along a Newton update, the largest residual need not.
            reduced = float(np.linalg.norm(problem.residual(trial, lam)))
            if reduced <= (1.0 - _DECREASE * fraction) * size:
                return trial, largest
        fraction *= 0.5
    return None
