"""Newton-Raphson: a path followed from state to state, with a step length adapted to the iteration count.

A step starts along the tangent and ends where damped Newton updates converge: at a given load factor, or on
the plane normal to the tangent at a given distance, which passes folds (E. Riks, International Journal of
Solids and Structures 15 (1979) 529-551; M. A. Crisfield, Computers & Structures 13 (1981) 55-62). Between its
ends a step is the cubic with the values and tangents of both: a load factor inside is located on it and
solved for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation.corrector import Correction, admissible_part, iterate
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import MIN_LENGTH, ExpansionPoint, NewtonOptions, SingularTangentError
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

# With arc-length control the direction may turn by an angle of at least this cosine within a step.
_MIN_COSINE = 0.3


# The first step is this part of the straight way to the target; steps grow by at most this factor if they
# take fewer iterations than wanted.
_FIRST, _GROWTH, _WANTED = 0.1, 2.0, 6


class _Failed(Stopped):
    """A step did not converge; a shorter one may."""


_Leg: TypeAlias = tuple[Branch, Correction, ExpansionPoint]
"""A step: the cubic between its ends, its end, the next expansion point."""


class NewtonFollower(Follower):
    """Follows a path from state to state. With load control it may jump over a fold to another branch; with
    arc-length control steps are shortened until they stay on the path."""

    _options: NewtonOptions
    _step_length = 0.0

    @property
    def _load_control(self) -> bool:
        return self._options.control == "load"

    def _follow(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> Iterator[Step]:
        along = self._along(here, toward)
        way = abs((self._lam_end - self.lam) / along[1]) if along[1] else 1.0
        self._step_length = _FIRST * way if self._previous is None else self._previous.length
        while True:
            piece, end, ahead = self._advance(here, along)
            yield self._record(piece, end, piece.length * self._metric.norm(*along), 0, ahead)
            if end.lam == self._lam_end:
                raise Stopped(StopReason.TARGET_REACHED, f"at load factor {end.lam:.9g}")
            here, along = ahead, self._along(ahead, along)

    def _along(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> tuple[FloatArray, float]:
        """Return the tangent of the path by the step's parameter: load factor or arc length."""
        if self._load_control:
            side = float(np.sign(self._lam_end - here.lam)) or float(np.sign(toward[1]))
            return side * here.slope, side
        size = np.copysign(self._metric.norm(here.slope, 1.0), self._metric.product(here.slope, 1.0, *toward))
        return here.slope / size, float(1.0 / size)

    def _advance(self, here: ExpansionPoint, along: tuple[FloatArray, float]) -> _Leg:
        """Return the next step, as long as the step length, the levels and convergence allow."""
        length, level, targets = self._step_length, None, sorted({*self._levels, self._lam_end})
        if self._load_control:
            ways = {v: abs(v - here.lam) for v in targets if (v - here.lam) * along[1] > 0.0}
            level = min(ways, key=ways.__getitem__)
            room = ways[level]
            length, level = (room, level) if length >= (1.0 - COARSE_ROUND_OFF) * room else (length, None)
        shortest, effort = MIN_LENGTH / self._metric.norm(*along), self._effort
        while True:
            straight = Branch(np.array([here.x, along[0]]), np.array([here.lam, along[1]]), length)
            before = effort["updates"]
            effort["updates"] += 1
            try:
                leg = self._solved(here, along, straight, length, level)
                ease = np.sqrt(_WANTED / (effort["updates"] - before))
                pace = length * float(np.clip(ease, 0.5, _GROWTH))
                self._step_length = max(self._step_length, pace) if ease >= 1.0 else pace
                if self._load_control:
                    return leg
                # A shorter step to the first level that is crossed after its start.
                found = [(leg[0].first_crossing(v), v) for v in targets if v != here.lam]
                crossings = [(a, v) for a, v in found if a is not None and a > 0.0]
                return self._solved(here, along, leg[0], *min(crossings)) if crossings else leg
            except _Failed as failure:
                length, level = 0.5 * length, None
                self._step_length = length
                if length < shortest:
                    place = f"at load factor {here.lam:.9g}"
                    raise Stopped(failure.reason, f"{failure.message}, and no shorter step {place}") from None

    def _solved(
        self,
        here: ExpansionPoint,
        along: tuple[FloatArray, float],
        guess: Branch,
        a: float,
        level: float | None = None,
    ) -> _Leg:
        """Return the step that ends at ``level``, else at the parameter ``a`` of ``guess``."""
        x, lam = guess.evaluate(a)
        lam = lam if level is None else level
        part = admissible_part(self._problem, here.x, here.lam, x - here.x, lam - here.lam)
        x, product, load_update = here.x + part * (x - here.x), self._metric.product, None

        def in_normal_plane(dx: FloatArray, slope: FloatArray) -> float:
            return -product(dx, 0.0, *along) / product(slope, 1.0, *along)

        if not self._load_control and level is None:
            load_update, lam = in_normal_plane, here.lam + part * (lam - here.lam)
        place = f"near load factor {lam:.9g}"
        try:
            point = iterate(self._problem, x, lam, load_update, self._options, self._effort)
            if not point.residual <= self._options.tolerance:
                message = f"iterations end at a residual of {point.residual:.3g} {place}"
                raise _Failed(StopReason.CORRECTION_FAILED, message)
            ahead = self._expansion_point(point.x, point.lam, self._effort)
        except SingularTangentError:
            raise _Failed(StopReason.SINGULAR_TANGENT, f"the tangent is singular {place}") from None
        if not self._load_control and self._metric.norm(point.x - x, point.lam - lam) > a:
            raise _Failed(StopReason.CORRECTION_FAILED, f"iterations lead to another branch {place}")
        return self._cubic(here, along, ahead), point, ahead

    def _cubic(self, here: ExpansionPoint, along: tuple[FloatArray, float], ahead: ExpansionPoint) -> Branch:
        """Return the cubic with the values and tangents of both ends. Raises _Failed."""
        x, lam = ahead.x - here.x, ahead.lam - here.lam
        if self._load_control:
            length, turn, slope, rise = abs(lam), 1.0, along[1] * ahead.slope, along[1]
        else:
            slope, rise = self._along(ahead, along)
            length, turn = (self._metric.product(*one, *along) for one in ((x, lam), (slope, rise)))
        if not (length > 0.0 and turn >= _MIN_COSINE):
            message = f"the path turns too far before load factor {ahead.lam:.9g}"
            raise _Failed(StopReason.CORRECTION_FAILED, message)
        slope, rise = slope / turn, rise / turn
        first = np.append(along[0], along[1])
        secant, last = np.append(x, lam) / length, np.append(slope, rise)
        bend = (3.0 * secant - 2.0 * first - last) / length
        twist = (first + last - 2.0 * secant) / length**2
        whole = np.array([np.append(here.x, here.lam), first, bend, twist])
        return Branch(whole[:, :-1], whole[:, -1], length)
