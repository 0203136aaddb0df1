"""The asymptotic numerical method: a path followed by power series of high order.

Every step costs one factorised tangent, N + 1 solves for the series, and a few residuals to determine its
range. The next series removes the residual that remains at its end; separate corrections are made only at
events and at the end of the path. Folds are passed: the parameter is the projection on the tangent, and the
load factor is one of the unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, Effort, correct_end, point_at, residual_norm
from mlsanm_cli.continuation.expansion import ExpansionPoint, expand
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import MIN_LENGTH, AnmOptions, FloatArray, SingularTangentError
from mlsanm_cli.continuation.ranges import RangeOfValidity
from mlsanm_cli.continuation.series import Branch

# A step whose end cannot be used is shortened by this factor, at most so many times.
_SHORTENING = 0.7
_MAX_SHORTENINGS = 8
# Beyond this slope |dx/dlam| a fold is so near that the series loses digits: expand at another point.
_MAX_SLOPE = 1e7
# Shortest step from which the length of the next one is guessed.
_SHORTEST_GUESS = 1e-6


class AnmFollower(Follower):
    """Follows a path by power series."""

    _options: AnmOptions

    def _follow(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> Iterator[Step]:
        validity = RangeOfValidity(self._problem, self._metric, self._lam_end, self._options)
        unit = 1.0 if self._previous is None else self._unit(self._previous)
        while True:
            series, keeps_residual = self._series(here, toward, unit)
            if keeps_residual and residual_norm(self._problem, here.x, here.lam) > self._options.goal:
                # Corrected to the path, unless that fails.
                point = correct_end(self._problem, here, here.x, here.lam, self._options, self._effort)
                with suppress(SingularTangentError):
                    if point is not None:
                        here = self._expansion_point(point.x, point.lam, self._effort)
                        series = self._series(here, toward, unit)[0]
            branch = validity.branch(series)
            shortest = MIN_LENGTH / unit
            if branch.length <= shortest and branch.first_crossing(self._lam_end) is None:
                place = f"at load factor {here.lam:.9g}"
                if not self._problem.admissible(*branch.evaluate(2.0 * shortest)):
                    message = f"the path leaves the admissible region {place}"
                    raise Stopped(StopReason.NOT_ADMISSIBLE, message)
                message = f"the series converges over less than the shortest step {place}"
                raise Stopped(StopReason.STEP_TOO_SMALL, message)
            branch, end, ahead, effort = self._reach_end(here, branch)
            yield self._record(branch, end, branch.length * unit, branch.order, ahead)
            if ahead is None:
                if end.lam == self._lam_end:
                    raise Stopped(StopReason.TARGET_REACHED, f"at load factor {end.lam:.9g}")
                return
            here, self._effort = ahead, effort
            toward, unit = (branch.x[1], float(branch.lam[1])), self._unit(branch)

    def _unit(self, branch: Branch) -> float:
        """Return the guess of the length of the step that follows a piece of path."""
        length = max(branch.length * self._metric.norm(branch.x[1], float(branch.lam[1])), _SHORTEST_GUESS)
        # A power of two adds no round-off.
        return float(2.0 ** np.round(np.log2(length)))

    def _series(
        self, here: ExpansionPoint, toward: tuple[FloatArray, float], unit: float
    ) -> tuple[Branch, bool]:
        self._effort["solves"] += self._options.order
        with np.errstate(over="ignore", invalid="ignore"):
            return expand(self._problem, self._metric, here, self._options.order, toward, unit)

    def _reach_end(
        self, here: ExpansionPoint, branch: Branch
    ) -> tuple[Branch, Correction, ExpansionPoint | None, Effort]:
        """Determine the end of a step and factorise there; the step is shortened while that fails. Returns
        the piece of path, its end, the next expansion point (None at the target, and where the caller leaves
        the path) and its counts."""
        length, failure = branch.length, Stopped(StopReason.SINGULAR_TANGENT, "")
        for _ in range(_MAX_SHORTENINGS):
            piece = branch.shortened(length)
            crossing = piece.first_crossing(self._lam_end)
            if crossing is not None:
                # The last step ends exactly at the target; at a fold there the series keeps the tolerance.
                piece = piece.shortened(crossing)
                ahead = piece.evaluate(crossing)[0], self._lam_end
                last = correct_end(self._problem, here, *ahead, self._options, self._effort)
                return piece, last or point_at(self._problem, *ahead), None, Effort()
            end = point_at(self._problem, *piece.evaluate(length))
            place = f"near load factor {end.lam:.9g}"
            if end.residual > self._options.tolerance:
                failure = Stopped(StopReason.CORRECTION_FAILED, f"the end of a step did not converge {place}")
            elif self._last is not None and self._last(end.x, end.lam):
                return piece, end, None, Effort()
            else:
                effort = Effort()
                with suppress(SingularTangentError):
                    point = self._expansion_point(end.x, end.lam, effort)
                    if self._metric.norm(point.slope, 0.0) < _MAX_SLOPE:
                        return piece, end, point, effort
                self._effort.update(effort)
                failure = Stopped(StopReason.SINGULAR_TANGENT, f"the tangent is singular {place}")
            length *= _SHORTENING
        raise failure
