"""Newton corrections: of a start point at fixed load factor, and of the end of a step."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.continuation.expansion import ExpansionPoint, Metric, station
from mlsanm_cli.continuation.options import PathOptions
from mlsanm_cli.continuation.problem import FloatArray, Problem, SingularTangentError
from mlsanm_cli.errors import NumericalError

# Halvings of a damped update before it counts as failed: 2^-40 of a Newton step is no progress.
_HALVINGS = 40
# An update that would leave the admissible region goes this part of the way to its boundary, which is found
# by so many bisections.
_SHORT_OF = 0.95
_BISECTIONS = 5
# A correction with an old tangent continues while each update removes nine tenths of the residual.
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


@dataclasses.dataclass
class SolveCounts:
    """Counts of one step or correction as they grow."""

    updates: int = 0
    factorizations: int = 0
    solves: int = 0

    def add(self, other: SolveCounts) -> None:
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


@dataclass(frozen=True, eq=False)
class Point:
    """Unknowns, load factor, and the largest residual there."""

    x: FloatArray
    lam: float
    residual: float


@np.errstate(over="ignore", invalid="ignore")
def correct(problem: Problem, x: FloatArray, lam: float, options: PathOptions | None = None) -> Correction:
    """Solve R(x, lam) = 0 at fixed ``lam`` by Newton's method from an admissible ``x``, shape (size,).

    Updates are halved until the point stays admissible and the norm of the residual falls. The residual
    aimed at is ``options.goal``; when round-off forbids that, ``tolerance`` will do.

    Raises
    ------
    NumericalError
        When ``x`` is not admissible, the tangent singular, or no convergence reached.
    """
    options, effort = options or PathOptions(), SolveCounts()
    if not np.isfinite(residual_norm(problem, x, lam)):
        raise NumericalError(
            f"the start point at load factor {lam:.9g} is not admissible", "start from open gaps and no load"
        )
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
            f"{effort.updates} updates, tolerance {options.tolerance:.3g}",
            'use contact.regularization.law = "exact", or a larger contact.regularization.eta',
        )
    counts = effort.updates, effort.factorizations, effort.solves
    return Correction(found.x, found.lam, found.residual, *counts)


@dataclass(frozen=True, eq=False)
class Across:
    """What an update keeps besides the load factor's place: its product with ``normal``, (size,) and one."""

    metric: Metric
    normal: tuple[FloatArray, float]

    def along(self, dx: FloatArray, slope: FloatArray) -> float:
        """Return the multiple of (slope, 1) that puts dx back on the plane."""
        return -self.metric.product(dx, 0.0, *self.normal) / self.metric.product(slope, 1.0, *self.normal)


@np.errstate(over="ignore", invalid="ignore")
def iterate(
    problem: Problem,
    x: FloatArray,
    lam: float,
    plane: Across | None,
    options: PathOptions,
    effort: SolveCounts,
) -> Point:
    """Return the point that damped Newton updates come to from an admissible (x, lam).

    They keep the load factor, or stay on ``plane``, and end at ``options.goal``, after ``max_corrections``,
    or where no part of an update lowers the norm of the residual. Work is added to ``effort``.

    Raises
    ------
    SingularTangentError
        When a tangent cannot be factorised or its solution is not finite.
    """
    point = Point(np.array(x, dtype=np.float64), lam, residual_norm(problem, x, lam))
    for _ in range(options.max_corrections):
        if point.residual <= options.goal:
            break
        residual = problem.residual(point.x, point.lam)
        effort.factorizations += 1
        effort.solves += 1
        try:
            tangent = problem.tangent(point.x, point.lam)
            dx, along = tangent.solve(-residual), 0.0
            if plane is not None:
                effort.solves += 1
                slope = -tangent.solve(problem.load_derivative(point.x, point.lam))
                along = plane.along(dx, slope)
                dx = dx + along * slope
        except np.linalg.LinAlgError as error:
            raise SingularTangentError(f"singular tangent at load factor {point.lam:.9g}") from error
        if not np.all(np.isfinite(dx)):
            raise SingularTangentError(f"singular tangent at load factor {point.lam:.9g}")
        damped = _damped(problem, point, (dx, along), float(np.linalg.norm(residual)))
        if damped is None:
            break
        point = damped
        effort.updates += 1
    return point


@np.errstate(over="ignore", invalid="ignore")
def correct_end(
    problem: Problem,
    metric: Metric,
    start: ExpansionPoint,
    end: tuple[FloatArray, float],
    normal: tuple[FloatArray, float] | None,
    options: PathOptions,
    effort: SolveCounts,
) -> Correction | None:
    """Bring the end of a step back to the path; None when that fails.

    The correction is orthogonal to ``normal``, or keeps the load factor when ``normal`` is None. The
    factorised tangent of the step's start is tried first, a fresh one where it does not converge fast.
    Work is added to ``effort``.
    """
    point = Point(*end, residual_norm(problem, *end))
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


def _updated(
    problem: Problem,
    metric: Metric,
    at: ExpansionPoint,
    point: Point,
    normal: tuple[FloatArray, float] | None,
    effort: SolveCounts,
) -> Point:
    """Return the point after one Newton update with the tangent and slope of the station ``at``."""
    effort.solves += 1
    dx = at.tangent.solve(-problem.residual(point.x, point.lam))
    if normal is None:
        x, lam = point.x + dx, point.lam
    else:
        along = Across(metric, normal).along(dx, at.slope)
        x, lam = point.x + dx + along * at.slope, point.lam + along
    return Point(x, lam, residual_norm(problem, x, lam))


def admissible_part(
    problem: Problem, point: tuple[FloatArray, float], update: tuple[FloatArray, float]
) -> float:
    """Return 1, or how much of an update of an admissible point stays clear of the region's boundary; 0
    where next to nothing does."""

    def inside(part: float) -> bool:
        return problem.admissible(point[0] + part * update[0], point[1] + part * update[1])

    if inside(1.0):
        return 1.0
    low, high = 0.5, 1.0
    while not inside(low):
        low, high = 0.5 * low, low
        if low < 0.5**_HALVINGS:
            return 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if inside(middle) else (low, middle)
    return _SHORT_OF * low


def _damped(problem: Problem, point: Point, update: tuple[FloatArray, float], size: float) -> Point | None:
    """Return the point after the first of an update's parts, halved from the admissible one on, that lowers
    the residual's norm ``size`` enough; None where none does."""
    part = admissible_part(problem, (point.x, point.lam), update)
    while part >= 0.5**_HALVINGS:
        x, lam = point.x + part * update[0], point.lam + part * update[1]
        if problem.admissible(x, lam):
            residual = problem.residual(x, lam)
            # The Euclidean norm falls along a Newton update, the largest residual need not.
            if float(np.linalg.norm(residual)) <= (1.0 - _DECREASE * part) * size:
                return Point(x, lam, float(np.abs(residual).max(initial=0.0)))
        part *= 0.5
    return None
