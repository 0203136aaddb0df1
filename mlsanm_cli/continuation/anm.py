"""The asymptotic numerical method: a path followed by power series of high order.

Every step costs one factorised tangent, N + 1 solves for the series, and a few residuals to determine its
range. The next series removes the residual that remains at its end; separate corrections are made only at
events and at the end of the path. Folds are passed: the parameter is the projection on the tangent, and the
load factor is one of the unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, Effort, correct_end, point_at, residual_norm
from mlsanm_cli.continuation.expansion import ExpansionPoint, expand
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import AnmOptions, FloatArray, SingularTangentError
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

    @cached_property
    def _validity(self) -> RangeOfValidity:
        return RangeOfValidity(self._problem, self._metric, self._lam_end, self._options)

    def _follow(self) -> Iterator[Step]:
        try:
            here = self._expansion_point(self._x, self._lam, self._effort)
        except SingularTangentError as error:
            raise Stopped(StopReason.SINGULAR_TANGENT, f"at the start: {error.message}") from error
        direction, unit = self._direction()
        while not self._stopped:
            self._check_step_count()
            series, keeps_residual = self._series(here, direction, unit)
            if keeps_residual:
                here, series = self._returned(here, series, direction, unit)
            branch = self._validity.branch(series)
            self._check_length(here, branch, unit)
            self._piece = branch
            branch, end, ahead, effort = self._reach_end(here, branch)
            if ahead is not None:
                self._piece = branch
            yield self._record(branch, end, branch.length * unit, branch.order, ahead)
            if ahead is None:
                if end.lam == self._lam_end:
                    raise Stopped(StopReason.TARGET_REACHED, f"after {self._steps} steps")
                return
            here, self._effort = ahead, effort
            direction, unit = self._next_direction(branch)

    def _direction(self) -> tuple[tuple[FloatArray, float], float]:
        """Return the direction in which the path leaves the start, and a guess of the step length."""
        direction, unit = None, 1.0
        if self._previous is not None:
            direction, unit = self._next_direction(self._previous)
        if direction is None or self._options.direction:
            sign = self._options.direction or np.sign(self._lam_end - self._lam)
            direction = np.zeros(self._problem.size), float(sign)
        return direction, unit

    def _next_direction(self, branch: Branch) -> tuple[tuple[FloatArray, float], float]:
        """Return the direction and the guess for the step that follows a piece of path."""
        direction = branch.x[1], float(branch.lam[1])
        length = max(branch.length * self._metric.norm(*direction), _SHORTEST_GUESS)
        # A power of two adds no round-off.
        return direction, float(2.0 ** np.round(np.log2(length)))

    def _series(
        self, here: ExpansionPoint, direction: tuple[FloatArray, float], unit: float
    ) -> tuple[Branch, bool]:
        self._effort["solves"] += self._options.order
        with np.errstate(over="ignore", invalid="ignore"):
            return expand(self._problem, self._metric, here, self._options.order, direction, unit)

    def _returned(
        self, here: ExpansionPoint, series: Branch, direction: tuple[FloatArray, float], unit: float
    ) -> tuple[ExpansionPoint, Branch]:
        """Return the expansion point corrected to the path, and its series; the given ones if that fails."""
        if residual_norm(self._problem, here.x, here.lam) <= self._options.goal:
            return here, series
        point = self._corrected(here, (here.x, here.lam))
        if point is None:
            return here, series
        try:
            better = self._expansion_point(point.x, point.lam, self._effort)
        except SingularTangentError:
            return here, series
        return better, self._series(better, direction, unit)[0]

    def _check_length(self, here: ExpansionPoint, branch: Branch, unit: float) -> None:
        """Raise Stopped if the valid piece of path from ``here`` is shorter than the shortest step."""
        shortest = self._options.min_length / unit
        if branch.length > shortest or branch.first_crossing(self._lam_end) is not None:
            return
        place = f"at load factor {here.lam:.9g}"
        if not self._problem.admissible(*branch.evaluate(2.0 * shortest)):
            raise Stopped(StopReason.NOT_ADMISSIBLE, f"the path leaves the admissible region {place}")
        raise Stopped(
            StopReason.STEP_TOO_SMALL, f"the series converges over less than the shortest step {place}"
        )

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
                return self._finish(here, piece.shortened(crossing))
            end = point_at(self._problem, *piece.evaluate(length))
            place = f"near load factor {end.lam:.9g}"
            if end.residual > self._options.tolerance:
                failure = Stopped(StopReason.CORRECTION_FAILED, f"the end of a step did not converge {place}")
            elif self._last is not None and self._last(end.x, end.lam):
                return piece, end, None, Effort()
            else:
                effort = Effort()
                try:
                    ahead = self._expansion_point(end.x, end.lam, effort)
                    if self._metric.norm(ahead.slope, 0.0) < _MAX_SLOPE:
                        return piece, end, ahead, effort
                except SingularTangentError:
                    pass
                self._effort.update(effort)
                failure = Stopped(StopReason.SINGULAR_TANGENT, f"the tangent is singular {place}")
            length *= _SHORTENING
        raise failure

    def _finish(self, here: ExpansionPoint, piece: Branch) -> tuple[Branch, Correction, None, Effort]:
        """Correct the end of the last step, which lies exactly at the target load factor."""
        x = piece.evaluate(piece.length)[0]
        end = self._corrected(here, (x, self._lam_end))
        # At a fold at the target the end of the series keeps the tolerance.
        return piece, end or point_at(self._problem, x, self._lam_end), None, Effort()

    def _corrected(self, here: ExpansionPoint, end: tuple[FloatArray, float]) -> Correction | None:
        return correct_end(self._problem, here, end, self._options, self._effort)
