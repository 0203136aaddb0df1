"""The asymptotic numerical method: a path followed by power series of high order.

Every step costs one factorised tangent and N + 1 solves for the series, and a few residuals to find out how
far it is good. What residual is left at its end the next series leads back to zero; a correction of its own
comes only on request, and at the end of the path. Folds are passed: the parameter is the projection on the
tangent and the load factor is an unknown like the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, SolveCounts, correct_end, residual_norm
from mlsanm_cli.continuation.expansion import ExpansionPoint, Series, expand
from mlsanm_cli.continuation.options import AnmOptions
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import FloatArray, SingularTangentError
from mlsanm_cli.continuation.ranges import RangeOfValidity
from mlsanm_cli.continuation.series import Branch

# An end of step that cannot be used is tried again at this part of the length, so often at most.
_RETREAT = 0.7
_RETREATS = 8
# Beyond this slope |dx/dlam| a fold is so near that the series loses digits: expand somewhere else.
_STEEP = 1e7
# Above this part of the path's direction the load factor is kept by corrections, so that pieces join there.
_LEVEL = 1e-3
# The direction at the end of a step is taken between this part of its length and the end.
_BEFORE = 0.98
# Shortest step that the size of the next one is guessed from.
_SHORT = 1e-6


class AnmFollower(Follower):
    """Follows a path by power series."""

    _options: AnmOptions

    @cached_property
    def _gauge(self) -> RangeOfValidity:
        return RangeOfValidity(self._problem, self._metric, self._lam_end, self._options)

    def _walk(self) -> Iterator[Step]:
        try:
            here = self._station(self._x, self._lam, self._effort)
        except SingularTangentError as error:
            raise Stopped(StopReason.SINGULAR_TANGENT, f"at the start: {error.message}") from error
        direction, unit = self._direction()
        while not self._stopped:
            self._allow()
            series = self._series(here, direction, unit)
            if series.beside:
                here, series = self._returned(here, series, direction)
            cut = self._soon(series)
            branch = cut or self._gauge.branch(series)
            if not cut:
                self._judge(here, series, branch)
                self._piece = branch
            limit = branch.length if self._barrier is None or cut else self._barrier(branch)
            if cut or limit < branch.length:
                piece = branch.shortened(limit)
                yield self._step(piece, self._cut(here, piece), unit)
                raise Stopped(StopReason.EVENT, f"after {self._steps} steps")
            branch, end, ahead, effort = self._arrive(here, branch)
            if ahead is not None:
                self._piece = branch
            yield self._step(branch, end, unit)
            if ahead is None:
                raise Stopped(StopReason.TARGET_REACHED, f"after {self._steps} steps")
            here, self._effort = ahead, effort
            direction, unit = self._onward(branch)

    def _direction(self) -> tuple[tuple[FloatArray, float], float]:
        """Return the direction in which to leave the start point, and a guess of the step's length."""
        direction, unit = None, 1.0
        if self._previous is not None:
            direction, unit = self._onward(self._previous)
        if direction is None or self._options.direction:
            sign = self._options.direction or np.sign(self._lam_end - self._lam)
            direction = np.zeros(self._problem.size), float(sign)
        return direction, unit

    def _onward(self, branch: Branch) -> tuple[tuple[FloatArray, float], float]:
        """Return the same for the step that follows a piece of path."""
        direction = branch.x[1], float(branch.lam[1])
        return direction, _power_of_two(branch.length * self._metric.norm(*direction))

    def _series(self, here: ExpansionPoint, direction: tuple[FloatArray, float], unit: float) -> Series:
        with np.errstate(over="ignore", invalid="ignore"):
            series = expand(self._problem, self._metric, here, self._options.order, direction, unit)
        self._effort.solves += self._options.order
        return series

    def _soon(self, series: Series) -> Branch | None:
        """Return the piece of path up to an event if the power series is good that far, else None."""
        if self._barrier is None:
            return None
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            piece = Branch(series.x, series.lam, self._gauge.first_guess(series))
            crossing = piece.first_crossing(self._lam_end)
            piece = piece if crossing is None else piece.shortened(crossing)
            self._piece = piece
            limit = self._barrier(piece) if 0.0 < piece.length < np.inf else np.inf
            good = limit < piece.length and self._gauge.good(piece, limit)
        return piece.shortened(limit) if good else None

    def _returned(
        self, here: ExpansionPoint, series: Series, direction: tuple[FloatArray, float]
    ) -> tuple[ExpansionPoint, Series]:
        """Return the station on the path itself and its series; those given where there is none."""
        if residual_norm(self._problem, here.x, here.lam) <= self._options.goal:
            return here, series
        point = self._corrected(here, (here.x, here.lam), None)
        if point is None:
            return here, series
        try:
            better = self._station(point.x, point.lam, self._effort)
        except SingularTangentError:
            return here, series
        return better, self._series(better, direction, series.unit)

    def _judge(self, here: ExpansionPoint, series: Series, branch: Branch) -> None:
        """Stop where the longest good piece of path that begins at ``here`` is none."""
        shortest = self._options.min_length / series.unit
        if branch.length > shortest or branch.first_crossing(self._lam_end) is not None:
            return
        place = f"at load factor {here.lam:.9g}"
        if not self._problem.admissible(*branch.evaluate(2.0 * shortest)):
            raise Stopped(StopReason.NOT_ADMISSIBLE, f"the path leaves the admissible region {place}")
        raise Stopped(
            StopReason.STEP_TOO_SMALL, f"the series converges over less than the shortest step {place}"
        )

    def _arrive(
        self, here: ExpansionPoint, branch: Branch
    ) -> tuple[Branch, Correction, ExpansionPoint | None, SolveCounts]:
        """Settle the end of a step and factorise there; the step is shortened while that fails.

        Returns the step's piece of path, its end, the next station (None at the target) and its effort.
        """
        length, failure = branch.length, Stopped(StopReason.CORRECTION_FAILED, "")
        for _ in range(_RETREATS):
            piece = branch.shortened(length)
            crossing = piece.first_crossing(self._lam_end)
            if crossing is not None:
                return self._finish(here, piece.shortened(crossing))
            end = self._end(here, piece)
            place = f"near load factor {piece.load_factor(length):.9g}"
            if end is None:
                failure = Stopped(StopReason.CORRECTION_FAILED, f"the end of a step did not converge {place}")
            else:
                effort = SolveCounts()
                try:
                    ahead = self._station(end.x, end.lam, effort)
                    if self._metric.norm(ahead.slope, 0.0) < _STEEP:
                        return piece, end, ahead, effort
                except SingularTangentError:
                    pass
                self._effort.add(effort)
                failure = Stopped(StopReason.SINGULAR_TANGENT, f"the tangent is singular {place}")
            length *= _RETREAT
        raise failure

    def _cut(self, here: ExpansionPoint, piece: Branch) -> Correction:
        """Return the end, corrected, of a piece that ends at the barrier: what follows has another series,
        whose length this one's residual would not suit."""
        x, lam = piece.evaluate(piece.length)
        end = self._corrected(here, (x, lam), None)
        if end is None:
            raise Stopped(StopReason.CORRECTION_FAILED, f"no state at the event near load factor {lam:.9g}")
        return end

    def _finish(self, here: ExpansionPoint, piece: Branch) -> tuple[Branch, Correction, None, SolveCounts]:
        """Correct the end of the last step, which lies exactly at the load factor asked for."""
        x = piece.evaluate(piece.length)[0]
        end = self._corrected(here, (x, self._lam_end), None)
        if end is None:  # a fold at the very target: the series' own end keeps the tolerance
            end = Correction(x, self._lam_end, residual_norm(self._problem, x, self._lam_end), 0, 0, 0)
        return piece, end, None, SolveCounts()

    def _end(self, here: ExpansionPoint, piece: Branch) -> Correction | None:
        """Return the end of a step, corrected if its residual has drifted; None when that fails."""
        x, lam = piece.evaluate(piece.length)
        residual = residual_norm(self._problem, x, lam)
        if residual <= self._options.drift * self._options.tolerance:
            return Correction(x, lam, residual, 0, 0, 0)
        return self._corrected(here, (x, lam), self._normal(piece))

    def _corrected(
        self, here: ExpansionPoint, end: tuple[FloatArray, float], normal: tuple[FloatArray, float] | None
    ) -> Correction | None:
        return correct_end(self._problem, self._metric, here, end, normal, self._options, self._effort)

    def _normal(self, piece: Branch) -> tuple[FloatArray, float] | None:
        """Return the direction a correction of the end must not take: None stands for the load factor's."""
        x, lam = piece.evaluate(piece.length)
        x_before, lam_before = piece.evaluate(_BEFORE * piece.length)
        rise = abs(lam - lam_before)
        if rise > _LEVEL * self._metric.norm(x - x_before, lam - lam_before):
            return None
        return piece.x[1], float(piece.lam[1])

    def _step(self, branch: Branch, end: Correction, unit: float) -> Step:
        return self._record(branch, end, branch.length * unit, branch.order)


def _power_of_two(length: float) -> float:
    """Return the power of two nearest to ``length``, a moderate one even after a very short last step."""
    return float(2.0 ** np.round(np.log2(max(length, _SHORT))))
