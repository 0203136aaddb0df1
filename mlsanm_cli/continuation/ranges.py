"""The range of validity of a piece of path, determined by the residual itself: the classical range of a power
series, a = (eps |X_1| / |X_N|)^(1/(N-1)) (B. Cochelin, Computers & Structures 53 (1994) 1181-1192), is
shortened or extended until the residual at its end lies just below the tolerance. An evaluation is cheap
compared with a factorisation."""

from __future__ import annotations

import numpy as np

from mlsanm_cli.continuation.corrector import residual_norm
from mlsanm_cli.continuation.expansion import Metric
from mlsanm_cli.continuation.problem import MIN_LENGTH, AnmOptions, Problem
from mlsanm_cli.continuation.series import Branch, denominator, nearest_pole

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


class RangeOfValidity:
    """Determines ranges of validity on a path of ``problem`` to the load factor ``lam_end``."""

    def __init__(self, problem: Problem, metric: Metric, lam_end: float, options: AnmOptions) -> None:
        self.problem, self.metric, self.lam_end, self.options = problem, metric, lam_end, options

    def error(self, branch: Branch, a: float) -> float:
        """Return the largest residual at ``a``; inf if the point is not admissible or not finite."""
        x, lam = branch.evaluate(a)
        return residual_norm(self.problem, x, lam) if np.isfinite(lam) else np.inf

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")
    def branch(self, series: Branch) -> Branch:
        """Return the longest valid piece of path of a ``series``; its length is 0 if there is none. The piece
        ends at the latest where it first reaches ``lam_end``."""
        guess = self.first_guess(series)
        rational = self._rational(series, guess) if self.options.pade and guess > 0.0 else None
        if rational is not None and rational.length > _CLEAR_GAIN * guess:
            return rational
        taylor = series.shortened(self._range(series, guess, np.inf))
        if rational is not None and rational.length > _MIN_GAIN * taylor.length:
            return rational
        return taylor

    def first_guess(self, series: Branch) -> float:
        """Return the classical range of a power series."""
        weight = np.sqrt(self.metric.weight)
        first, last = (max(np.abs(weight * series.x[k]).max(), abs(series.lam[k])) for k in (1, -1))
        order = series.lam.size - 1
        if not np.isfinite(last):
            return 0.0
        along = (self.lam_end - series.lam[0]) / series.lam[1] if series.lam[1] != 0.0 else 0.0
        if last > 0.0 and order > 1:
            # The series of an almost straight path has an unbounded range, over which the crossing of lam_end
            # could not be found to round-off.
            most = max(_STRAIGHT * along, _STRAIGHT * self._shortest(series))
            most = most if along > 0.0 else np.inf
            return float(min((self.options.tolerance * first / last) ** (1.0 / (order - 1)), most))
        return float(along) if along > 0.0 else 1.0

    def _rational(self, series: Branch, guess: float) -> Branch | None:
        """Return the longest valid Padé approximant, None if there is none."""
        scaled = np.column_stack([np.sqrt(self.metric.weight) * series.x, series.lam])
        lower = denominator(scaled, guess)
        if lower is None:
            return None
        rational = Branch(series.x, series.lam, 0.0, lower)
        reach = self._longest(rational, _PADE_EXTENSION * guess, np.inf)
        if reach == 0.0:
            return None
        # Up to this length the approximant evaluates with little round-off; without limit if up to its reach.
        quiet, limit = reach, _MAX_ROUND_OFF * self.options.tolerance
        for _ in range(_MAX_TRIALS):
            if rational.round_off(quiet, self.problem.scale) <= limit:
                break
            quiet *= _SHORTENING
        else:
            quiet = 0.0
        pole = nearest_pole(lower, reach / _POLE_MARGIN)
        ceiling = min(_POLE_MARGIN * pole, quiet if quiet < reach else np.inf)
        return rational.shortened(self._range(rational, min(reach, ceiling), ceiling))

    def _range(self, branch: Branch, guess: float, ceiling: float) -> float:
        """Return the end of a range <= ``ceiling`` that is valid inside as well; 0 if there is none."""
        limit = _LIMIT * self.options.tolerance
        length = self._longest(branch, guess, ceiling)
        for _ in range(_MAX_TRIALS):
            bad = next((f for f in _INSIDE if self.error(branch, f * length) > limit), None)
            if bad is None or length == 0.0:
                return length
            length = self._longest(branch, 0.9 * bad * length, bad * length)
        return 0.0

    def _shortest(self, series: Branch) -> float:
        """Return the parameter of the shortest step."""
        return MIN_LENGTH / self.metric.norm(series.x[1], float(series.lam[1]))

    def _longest(self, branch: Branch, guess: float, ceiling: float) -> float:
        """Return about the largest a <= ``ceiling`` whose residual is within the tolerance, or 0."""
        tolerance, side = self.options.tolerance, np.sign(self.lam_end - branch.lam[0])
        limit = _LIMIT * tolerance  # between the checked points the residual may be a little larger
        low, high, a = 0.0, np.inf, min(guess, ceiling)
        power, before = float(branch.order + 1), (0.0, 0.0)
        shortest = self._shortest(branch)
        for _ in range(_MAX_TRIALS):
            if a <= shortest:
                break
            if side * (branch.load_factor(a) - self.lam_end) > 0.0:
                crossing = branch.shortened(a).first_crossing(self.lam_end)
                # The last step of a path may be as short as it happens to be.
                a = ceiling = a if crossing is None else crossing
            error = self.error(branch, a)
            if error <= limit:
                low = a
                if error >= _ENOUGH * tolerance or a >= ceiling:
                    break
            else:
                high = a
            if high <= _BOUND_RATIO * low:
                break
            power, before = _growth(before, (a, error), power), (a, error)
            a = min(_next(a, error / tolerance, power, low, high), ceiling)
        return low


def _growth(before: tuple[float, float], after: tuple[float, float], power: float) -> float:
    """Return the power of the length as which the residual grows between two trials (length, residual): from
    1 (round-off of the first coefficients) to ``power``, which is kept where it cannot be measured."""
    (a, error), (b, other) = before, after
    if not (0.0 < error < np.inf and 0.0 < other < np.inf) or a == b:
        return power
    return float(np.clip(np.log(other / error) / np.log(b / a), 1.0, power))


def _next(a: float, ratio: float, power: float, low: float, high: float) -> float:
    """Return the next length to try after ``a``, whose residual is ``ratio`` times the tolerance and grows as
    ``a**power``."""
    if 0.0 < ratio < np.inf:
        trial = a * float(np.clip((_AIM / ratio) ** (1.0 / power), _SHRINK, _GROW))
    else:
        trial = a * (_GROW if ratio == 0.0 else _SHRINK)
    if low < trial < high:
        return max(trial, float(np.sqrt(low * a)))
    return float(np.sqrt(low * high)) if low > 0.0 else _SHRINK * high
