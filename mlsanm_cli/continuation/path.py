"""The common part of path-following methods: steps, reasons to stop.

A follower is used once::

    follower = follow(problem, x0, lam0, lam_end, options)
    for step in follower.steps():
        ...
    follower.reason, follower.x, follower.lam       # how the path ended, and its last valid point
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from functools import cached_property

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.corrector import Correction, Effort, correct, residual_norm
from mlsanm_cli.continuation.problem import (
    ExpansionPoint,
    Metric,
    PathOptions,
    Problem,
    SingularTangentError,
    Tangent,
    expansion_point,
)
from mlsanm_cli.continuation.series import Branch, root
from mlsanm_cli.records import dataclass

LIMIT_SAMPLES = 65
"""Points of a step at which the slope of the load factor is evaluated to find limit points."""


class StopReason(StrEnum):
    """Why a path ended; the values are shown to users."""

    TARGET_REACHED = "target reached"
    STEP_TOO_SMALL = "step too small"
    NOT_ADMISSIBLE = "not admissible"
    SINGULAR_TANGENT = "singular tangent"
    CORRECTION_FAILED = "correction failed"
    STOPPED_BY_CALLER = "stopped by caller"


@dataclass(frozen=True, eq=False)
class Step:
    """One finished step of a path: the ``branch`` over it, whose end may be corrected, its end ``x`` (size,),
    ``lam`` with the largest ``residual``, its ``arc_length`` along its first tangent in the scaled units of
    the path, and the ``effort`` for it, failed trials included. ``order`` is that of the power series; 0 if
    only the ends of the branch are on the path. ``tangent`` is the factorised one at the end, if the path
    goes on from there."""

    branch: Branch
    x: FloatArray
    lam: float
    residual: float
    arc_length: float
    effort: Effort
    order: int
    tangent: Tangent | None = None

    @property
    def counts(self) -> tuple[int, int, int]:
        """Updates, factorisations and solves."""
        return self.effort["updates"], self.effort["factorizations"], self.effort["solves"]

    @cached_property
    def limit_points(self) -> list[tuple[float, bool]]:
        """Limit points within a step of power series: its parameter, and whether it is a maximum."""
        if not self.order:
            return []

        def slope(a: float) -> float:
            return float(self.branch.derivative_weights(np.array([a]))[0] @ self.branch.terms[1])

        a = np.linspace(0.0, self.branch.length, LIMIT_SAMPLES)
        slopes = self.branch.derivative_weights(a) @ self.branch.terms[1]
        turns = np.flatnonzero(slopes[:-1] * slopes[1:] < 0.0)
        return [(root(slope, a[k], a[k + 1]), bool(slopes[k] > 0.0)) for k in turns]


class Stopped(Exception):
    """Ends a path, with a reason."""

    def __init__(self, reason: StopReason, message: str) -> None:
        super().__init__(message)
        self.reason, self.message = reason, message


class Follower(ABC):
    """Follows R(x, lam) = 0 from (x0, lam0) until the load factor first is ``lam_end``. Use once. The
    parameters are those of :func:`mlsanm_cli.continuation.follow`. ``reason`` and ``message`` tell how the
    path ended, or that the caller took no more steps; ``x``, ``lam`` and ``residual`` are its last point."""

    def __init__(
        self,
        problem: Problem,
        x0: FloatArray,
        lam0: float,
        lam_end: float,
        options: PathOptions,
        previous: Branch | None = None,
        levels: Sequence[float] = (),
        last: Callable[[FloatArray, float], bool] | None = None,
    ) -> None:
        self._problem, self._options, self._last = problem, options, last
        self._lam_end, self._previous, self._levels = float(lam_end), previous, levels
        self._metric, self._effort = Metric(problem.scale), Effort()
        self.x, self.lam, self.residual = np.array(x0, dtype=np.float64), float(lam0), np.inf
        self.reason, self.message = StopReason.STOPPED_BY_CALLER, "the caller took no more steps"

    @abstractmethod
    def _follow(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> Iterator[Step]:
        """Yield steps from ``here``, first ``toward`` a direction, until something raises ``Stopped``."""

    @property
    def reached(self) -> bool:
        """Whether the path reached the target load factor."""
        return self.reason is StopReason.TARGET_REACHED

    def steps(self) -> Iterator[Step]:
        """Yield the steps. Raises NumericalError if the start cannot be corrected to the path."""
        previous = self._previous
        if previous is not None:
            self.residual = residual_norm(self._problem, self.x, self.lam)
        if not self.residual <= self._options.tolerance:
            start = correct(self._problem, self.x, self.lam, self._options, self._effort)
            self.x, self.residual = start.x, start.residual
        try:
            if self.lam == self._lam_end:
                raise Stopped(StopReason.TARGET_REACHED, "the path starts at the target load factor")
            toward = np.zeros(self._problem.size), float(np.sign(self._lam_end - self.lam))
            if previous is not None:
                toward = previous.x[1], float(previous.lam[1])
            try:
                here = self._expansion_point(self.x, self.lam, self._effort)
            except SingularTangentError as error:
                raise Stopped(StopReason.SINGULAR_TANGENT, f"at the start: {error.message}") from error
            yield from self._follow(here, toward)
        except Stopped as stop:
            self.reason, self.message = stop.reason, stop.message

    def _expansion_point(self, x: FloatArray, lam: float, effort: Effort) -> ExpansionPoint:
        effort["factorizations"] += 1
        effort["solves"] += 1
        return expansion_point(self._problem, x, lam)

    def _record(
        self, branch: Branch, end: Correction, arc_length: float, order: int, ahead: ExpansionPoint | None
    ) -> Step:
        self.x, self.lam, self.residual = end.x, end.lam, end.residual
        effort, self._effort = self._effort, Effort()
        tangent = None if ahead is None else ahead.tangent
        return Step(branch, end.x, end.lam, end.residual, arc_length, effort, order, tangent)
