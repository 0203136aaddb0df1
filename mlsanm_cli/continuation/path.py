"""The common part of path-following methods: steps, reasons to stop, outcome.

A follower is used once::

    follower = follow(problem, x0, lam0, lam_end, options)
    for step in follower.steps():
        ...                        # follower.stop() ends the path after this step
    follower.outcome               # reason, last point, totals
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, Effort, correct, residual_norm
from mlsanm_cli.continuation.expansion import ExpansionPoint, Metric, expansion_point
from mlsanm_cli.continuation.problem import FloatArray, PathOptions, Problem, Tangent
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.records import dataclass


class StopReason(StrEnum):
    """Why a path ended; the values are shown to users."""

    TARGET_REACHED = "target reached"
    MAX_STEPS = "max steps"
    STEP_TOO_SMALL = "step too small"
    NOT_ADMISSIBLE = "not admissible"
    SINGULAR_TANGENT = "singular tangent"
    CORRECTION_FAILED = "correction failed"
    STOPPED_BY_CALLER = "stopped by caller"


@dataclass(frozen=True, eq=False)
class Step:
    """One finished step of a path.

    Attributes
    ----------
    index : 1 for the first step
    branch : the path over the step; ``branch.evaluate(branch.length)`` is the end before a correction
    x, lam : end of the step and start of the next: unknowns, shape (size,), and load factor
    residual : largest residual at the end
    arc_length : length of the step along its first tangent, in the scaled units of the path
    iterations : Newton updates; for power series those at the end of the step
    factorizations, solves : tangents factorised and systems solved for this step, failed trials included
    order : order of the power series; 0 if ``branch`` is no series and only its ends are on the path
    tangent : the factorised tangent at the end, if the path goes on from there
    """

    index: int
    branch: Branch
    x: FloatArray
    lam: float
    residual: float
    arc_length: float
    iterations: int
    factorizations: int
    solves: int
    order: int
    tangent: Tangent | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a path ended: the reason with a ``message``, the last valid point, totals of the whole path.
    ``piece`` is the last step: the ``previous`` of a path that continues."""

    reason: StopReason
    message: str
    x: FloatArray
    lam: float
    residual: float
    steps: int
    iterations: int
    factorizations: int
    solves: int
    piece: Branch | None

    @property
    def reached(self) -> bool:
        """Whether the path reached the target load factor."""
        return self.reason is StopReason.TARGET_REACHED


class Stopped(Exception):
    """Ends a path, with a reason."""

    def __init__(self, reason: StopReason, message: str) -> None:
        super().__init__(message)
        self.reason, self.message = reason, message


class Follower(ABC):
    """Follows R(x, lam) = 0 from (x0, lam0) until the load factor first is ``lam_end``. Use once. The
    parameters are those of :func:`mlsanm_cli.continuation.follow`."""

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
        self._problem, self._options = problem, options
        self._last = last
        self._lam_end, self._previous, self._levels = float(lam_end), previous, levels
        self._metric = Metric(problem.scale)
        self._x, self._lam, self._residual = np.array(x0, dtype=np.float64), float(lam0), np.inf
        self._steps, self._done, self._effort = 0, Effort(), Effort()
        self._piece: Branch | None = None
        self._reason, self._message = StopReason.STOPPED_BY_CALLER, "the caller took no more steps"
        self._stopped = False

    @abstractmethod
    def _follow(self) -> Iterator[Step]:
        """Yield steps until something raises ``Stopped``."""

    @property
    def outcome(self) -> Outcome:
        """How the path ended or, while it is being followed, its current state (stopped by the caller)."""
        return Outcome(
            reason=self._reason,
            message=self._message,
            x=self._x,
            lam=self._lam,
            residual=self._residual,
            steps=self._steps,
            iterations=self._done["updates"] + self._effort["updates"],
            factorizations=self._done["factorizations"] + self._effort["factorizations"],
            solves=self._done["solves"] + self._effort["solves"],
            piece=self._piece,
        )

    def stop(self) -> None:
        """End the path after the last step yielded."""
        self._stopped = True

    def steps(self) -> Iterator[Step]:
        """Yield the steps as they are finished. Raises NumericalError if the start point does not satisfy the
        equations and cannot be corrected; any other failure ends the path, with its reason in
        :attr:`outcome`."""
        self._start()
        try:
            if self._lam == self._lam_end:
                raise Stopped(StopReason.TARGET_REACHED, "the path starts at the target load factor")
            yield from self._follow()
        except Stopped as stop:
            self._reason, self._message = stop.reason, stop.message

    def _start(self) -> None:
        if self._previous is not None:
            self._residual = residual_norm(self._problem, self._x, self._lam)
            if self._residual <= self._options.tolerance:
                return
        start = correct(self._problem, self._x, self._lam, self._options)
        self._x, self._residual = start.x, start.residual
        self._effort.update(updates=start.updates, factorizations=start.factorizations, solves=start.solves)

    def _check_step_count(self) -> None:
        """Raise ``Stopped`` at the largest number of steps."""
        if self._steps == self._options.max_steps:
            raise Stopped(StopReason.MAX_STEPS, f"{self._steps} steps end at load factor {self._lam:.9g}")

    def _expansion_point(self, x: FloatArray, lam: float, effort: Effort) -> ExpansionPoint:
        effort["factorizations"] += 1
        effort["solves"] += 1
        return expansion_point(self._problem, x, lam)

    def _record(
        self, branch: Branch, end: Correction, arc_length: float, order: int, ahead: ExpansionPoint | None
    ) -> Step:
        self._steps += 1
        self._x, self._lam, self._residual = end.x, end.lam, end.residual
        effort, self._effort = self._effort, Effort()
        self._done.update(effort)
        return Step(
            index=self._steps,
            branch=branch,
            x=end.x,
            lam=end.lam,
            residual=end.residual,
            arc_length=arc_length,
            iterations=effort["updates"],
            factorizations=effort["factorizations"],
            solves=effort["solves"],
            order=order,
            tangent=None if ahead is None else ahead.tangent,
        )
