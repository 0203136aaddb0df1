"""The asymptotic numerical method: a path followed by power series of high order.

Every step costs one factorised tangent and N + 1 solves. The next series removes the residual at its end;
separate corrections are made only at events and at the end of the path. Folds are passed: the parameter is
the projection on the tangent. The classical range of a series, a = (eps |X_1| / |X_N|)^(1/(N-1)) (B.
Cochelin, Computers & Structures 53 (1994) 1181-1192), is shortened or extended until the residual at its
end lies just below the tolerance: an evaluation is cheap compared with a factorisation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.corrector import Correction, Effort, correct_end, point_at, residual_norm
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import (
    MIN_LENGTH,
    AnmOptions,
    ExpansionPoint,
    SingularTangentError,
    expand,
)
from mlsanm_cli.continuation.series import Branch, denominator, nearest_pole

# A step whose end cannot be used is shortened by this factor, at most so many times.
_STEP_SHORTENING = 0.7
_MAX_SHORTENINGS = 8
# Beyond this slope |dx/dlam| a fold is so near that the series loses digits: expand at another point.
_MAX_SLOPE = 1e7
# Shortest step from which the length of the next one is guessed.
_SHORTEST_GUESS = 1e-6
# A length is accepted if the residual there lies between the first and the last of these parts of the
# tolerance (it grows as the power N + 1 of the length), or if its bounds differ by less than this ratio.
_ENOUGH, _AIM, _LIMIT = 0.4, 0.7, 0.9
_BOUND_RATIO = 1.03
_MAX_TRIALS = 30
_SHRINK, _GROW = 0.3, 1.5
# The first guess is at most this multiple of the way of a straight path to lam_end.
_STRAIGHT = 4.0
# Parts of a range at which the residual is checked, besides its end.
_INSIDE = (0.25, 0.5, 0.75, 0.9)
# A Padé approximant, which has poles, is used only if it extends the step by this factor.
_MIN_GAIN, _CLEAR_GAIN = 1.02, 1.15
# First guess of the range of a Padé approximant over that of its power series.
_PADE_EXTENSION = 1.4
# A step covers at most this part of the way to the nearest pole.
_POLE_MARGIN = 0.9
# A step ends where cancellation between the terms of a Padé approximant leaves this much round-off (part of
# the tolerance): many adjacent poles, as along a branch cut, have terms of 1e7.
_MAX_ROUND_OFF, _SHORTENING = 0.02, 0.95


class AnmFollower(Follower):
    """Follows a path by power series."""

    _options: AnmOptions

    def _follow(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> Iterator[Step]:
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
            branch = self._valid(series)
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
        """Determine the end of a step, shortened while no tangent can be factorised there: the piece of path,
        its end, the next expansion point (None at the target, and where the caller leaves) and its counts."""
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
            length *= _STEP_SHORTENING
        raise failure

    def _error(self, branch: Branch, a: float) -> float:
        """Return the largest residual at ``a``; inf if the point is not admissible or not finite."""
        x, lam = branch.evaluate(a)
        return residual_norm(self._problem, x, lam) if np.isfinite(lam) else np.inf

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def _valid(self, series: Branch) -> Branch:
        """Return the longest valid piece of path of a ``series``, at most to ``lam_end``; of length 0 if
        none."""
        guess = self._first_guess(series)
        rational = self._rational(series, guess) if self._options.pade and guess > 0.0 else None
        if rational is not None and rational.length > _CLEAR_GAIN * guess:
            return rational
        taylor = series.shortened(self._range(series, guess, np.inf))
        if rational is not None and rational.length > _MIN_GAIN * taylor.length:
            return rational
        return taylor

    def _first_guess(self, series: Branch) -> float:
        """Return the classical range of a power series."""
        weight = np.sqrt(self._metric.weight)
        first, last = (max(np.abs(weight * series.x[k]).max(), abs(series.lam[k])) for k in (1, -1))
        order = series.lam.size - 1
        if not np.isfinite(last):
            return 0.0
        along = (self._lam_end - series.lam[0]) / series.lam[1] if series.lam[1] != 0.0 else 0.0
        if last > 0.0 and order > 1:
            # The series of an almost straight path has an unbounded range, over which the crossing of lam_end
            # could not be found to round-off.
            most = max(_STRAIGHT * along, _STRAIGHT * self._shortest(series))
            most = most if along > 0.0 else np.inf
            return float(min((self._options.tolerance * first / last) ** (1.0 / (order - 1)), most))
        return float(along) if along > 0.0 else 1.0

    def _rational(self, series: Branch, guess: float) -> Branch | None:
        """Return the longest valid Padé approximant, None if there is none."""
        scaled = np.column_stack([np.sqrt(self._metric.weight) * series.x, series.lam])
        lower = denominator(scaled, guess)
        if lower is None:
            return None
        rational = Branch(series.x, series.lam, 0.0, lower)
        reach = self._longest(rational, _PADE_EXTENSION * guess, np.inf)
        if reach == 0.0:
            return None
        # Up to this length the approximant evaluates with little round-off; without limit if up to its reach.
        quiet, limit = reach, _MAX_ROUND_OFF * self._options.tolerance
        for _ in range(_MAX_TRIALS):
            if rational.round_off(quiet, self._problem.scale) <= limit:
                break
            quiet *= _SHORTENING
        else:
            quiet = 0.0
        pole = nearest_pole(lower, reach / _POLE_MARGIN)
        ceiling = min(_POLE_MARGIN * pole, quiet if quiet < reach else np.inf)
        return rational.shortened(self._range(rational, min(reach, ceiling), ceiling))

    def _range(self, branch: Branch, guess: float, ceiling: float) -> float:
        """Return the end of a range <= ``ceiling`` that is valid inside as well; 0 if there is none."""
        limit = _LIMIT * self._options.tolerance
        length = self._longest(branch, guess, ceiling)
        for _ in range(_MAX_TRIALS):
            bad = next((f for f in _INSIDE if self._error(branch, f * length) > limit), None)
            if bad is None or length == 0.0:
                return length
            length = self._longest(branch, 0.9 * bad * length, bad * length)
        return 0.0

    def _shortest(self, series: Branch) -> float:
        """Return the parameter of the shortest step."""
        return MIN_LENGTH / self._metric.norm(series.x[1], float(series.lam[1]))

    def _longest(self, branch: Branch, guess: float, ceiling: float) -> float:
        """Return about the largest a <= ``ceiling`` whose residual is within the tolerance, or 0."""
        tolerance, side = self._options.tolerance, np.sign(self._lam_end - branch.lam[0])
        limit = _LIMIT * tolerance  # between the checked points the residual may be a little larger
        low, high, a = 0.0, np.inf, min(guess, ceiling)
        power, before = float(branch.order + 1), (0.0, 0.0)
        shortest = self._shortest(branch)
        for _ in range(_MAX_TRIALS):
            if a <= shortest:
                break
            if side * (branch.load_factor(a) - self._lam_end) > 0.0:
                crossing = branch.shortened(a).first_crossing(self._lam_end)
                # The last step of a path may be as short as it happens to be.
                a = ceiling = a if crossing is None else crossing
            error = self._error(branch, a)
            if error <= limit:
                low = a
                if error >= _ENOUGH * tolerance or a >= ceiling:
                    break
            else:
                high = a
            if high <= _BOUND_RATIO * low:
                break
            # The residual grows from linearly, by round-off of the first coefficients, to its full power.
            if 0.0 < before[1] < np.inf and 0.0 < error < np.inf and a != before[0]:
                growth = np.log(error / before[1]) / np.log(a / before[0])
                power = float(np.clip(growth, 1.0, power))
            before = (a, error)
            a = min(_next(a, error / tolerance, power, low, high), ceiling)
        return low


def _next(a: float, ratio: float, power: float, low: float, high: float) -> float:
    """Return the next length after ``a``; its residual, ``ratio`` tolerances, grows as ``a**power``."""
    if 0.0 < ratio < np.inf:
        trial = a * float(np.clip((_AIM / ratio) ** (1.0 / power), _SHRINK, _GROW))
    else:
        trial = a * (_GROW if ratio == 0.0 else _SHRINK)
    if low < trial < high:
        return max(trial, float(np.sqrt(low * a)))
    return float(np.sqrt(low * high)) if low > 0.0 else _SHRINK * high
