"""What all followers of a path have in common: start point, counts, outcome."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, Effort, correct, residual_norm
from mlsanm_cli.continuation.expansion import ExpansionPoint, Metric, station
from mlsanm_cli.continuation.options import PathOptions
from mlsanm_cli.continuation.path import Outcome, Step, StopReason
from mlsanm_cli.continuation.problem import FloatArray, Problem
from mlsanm_cli.continuation.series import Branch


class Stopped(Exception):
    """The path ends here, for a reason."""

    def __init__(self, reason: StopReason, message: str) -> None:
        super().__init__(message)
        self.reason, self.message = reason, message


@dataclass(frozen=True, eq=False)
class PathRequest:
    """What a follower is asked for; the fields are parameters of :func:`mlsanm_cli.continuation.follow`."""

    x0: FloatArray
    lam0: float
    lam_end: float
    previous: Branch | None
    barrier: Callable[[Branch], float] | None
    levels: Sequence[float]


class PathFollower(ABC):
    """Follows R(x, lam) = 0 from (x0, lam0) until the load factor first is ``lam_end``. Use once."""

    def __init__(self, problem: Problem, route: PathRequest, options: PathOptions) -> None:
        self._problem, self._limits, self._barrier = problem, options, route.barrier
        self._lam_end, self._previous = float(route.lam_end), route.previous
        self._metric = Metric(problem.scale)
        self._x, self._lam, self._residual = np.array(route.x0, dtype=np.float64), float(route.lam0), np.inf
        if self._x.shape != (problem.size,):
            raise ValueError(f"the start point has shape {self._x.shape}, the problem size {problem.size}")
        self._steps, self._done, self._effort = 0, Effort(), Effort()
        self._piece: Branch | None = None
        self._reason, self._message = StopReason.STOPPED_BY_CALLER, "the caller took no more steps"
        self._started = self._stopped = False

    @abstractmethod
    def _walk(self) -> Iterator[Step]:
        """Go from step to step until something raises ``Stopped``."""

    @property
    def outcome(self) -> Outcome:
        """How the path ended, or, while steps are still to come, where it stands (stopped by the caller)."""
        return Outcome(
            reason=self._reason,
            message=self._message,
            x=self._x,
            lam=self._lam,
            residual=self._residual,
            steps=self._steps,
            iterations=self._done.updates + self._effort.updates,
            factorizations=self._done.factorizations + self._effort.factorizations,
            solves=self._done.solves + self._effort.solves,
            piece=self._piece,
        )

    def stop(self) -> None:
        """End the path after the step handed out last."""
        self._stopped = True

    def steps(self) -> Iterator[Step]:
        """Yield the steps as they are finished.

        Raises
        ------
        NumericalError
            When the start point does not satisfy the equations and cannot be corrected. Every other
            failure ends the path, with its reason in :attr:`outcome`.
        RuntimeError
            When called a second time.
        """
        if self._started:
            raise RuntimeError("a follower goes along its path once; make a new one")
        self._started = True
        self._start()
        try:
            if self._lam == self._lam_end:
                raise Stopped(StopReason.TARGET_REACHED, "the path starts at the load factor asked for")
            yield from self._walk()
        except Stopped as stop:
            self._reason, self._message = stop.reason, stop.message

    def _start(self) -> None:
        if self._previous is not None:
            self._residual = residual_norm(self._problem, self._x, self._lam)
            if self._residual <= self._limits.tolerance:
                return  # the end of a step, which its successor starts from as it is
        start = correct(self._problem, self._x, self._lam, self._limits)
        self._x, self._residual = start.x, start.residual
        self._effort.add(Effort(start.updates, start.factorizations, start.solves))

    def _allow(self) -> None:
        """Raise ``Stopped`` when there may be no further step."""
        if self._steps == self._limits.max_steps:
            raise Stopped(StopReason.MAX_STEPS, f"{self._steps} steps end at load factor {self._lam:.9g}")

    def _station(self, x: FloatArray, lam: float, effort: Effort) -> ExpansionPoint:
        effort.factorizations += 1
        effort.solves += 1
        return station(self._problem, x, lam)

    def _record(self, branch: Branch, end: Correction, arc_length: float, order: int) -> Step:
        self._steps += 1
        self._x, self._lam, self._residual = end.x, end.lam, end.residual
        effort, self._effort = self._effort, Effort()
        self._done.add(effort)
        return Step(
            index=self._steps,
            branch=branch,
            x=end.x,
            lam=end.lam,
            residual=end.residual,
            arc_length=arc_length,
            iterations=effort.updates,
            factorizations=effort.factorizations,
            solves=effort.solves,
            order=order,
        )
