"""Newton-Raphson: a path followed from state to state, the step adapted to the iterations it takes.

A step begins along the tangent (its first iteration) and ends where damped Newton updates converge: at a
given load factor, or on the plane across the tangent at a given distance, which passes folds. Updates keep
clear of the boundary of the admissible region and lower the norm of the residual. Between its ends a step is
a guess only: the cubic with the values and tangents of both. Whatever is wanted inside, a load factor or an
event, is therefore guessed, solved for, and guessed again from the shorter cubic that ends there.

Sources: E. Riks, An incremental approach to the solution of snapping and buckling problems, International
Journal of Solids and Structures 15 (1979) 529-551; M. A. Crisfield, A fast incremental/iterative solution
procedure that handles snap-through, Computers & Structures 13 (1981) 55-62.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.continuation.corrector import (
    Across,
    Correction,
    admissible_part,
    iterate,
    residual_norm,
)
from mlsanm_cli.continuation.expansion import ExpansionPoint
from mlsanm_cli.continuation.options import NewtonOptions
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import FloatArray, SingularTangentError
from mlsanm_cli.continuation.series import Branch

# A step that fails is tried again with half its length; one is shrunk by no more for taking many iterations.
_HALF = 0.5
# On the plane across the tangent a step may turn by an angle of at most this cosine, and its end lies no
# further from its first guess than this part of the guess's own way.
_TURN, _ASTRAY = 0.3, 1.0
# Events are looked for on a cubic whose residual midway is below this; it grows as the fourth power of the
# step, which is cut down by no more than this at once.
_FAITHFUL, _CUT = 1e-4, 0.2
# An event is settled when its place moves by less than this part of the step (the next move would be about
# the square of that), or no less than before and within the tolerance, as a load factor or scaled length:
# problems may hand out tangents that are not quite new.
_SETTLED, _SHRINKING = 1e-10, 0.5
_GUESSES = 20
# The cubic up to the last guess is also looked at beyond it, to this multiple of its length.
_BEYOND = 1.25
# So near the start, as a part of the step, the first cubic is good to round-off: no other is needed.
_NEAR = 1e-6
# After an event at some part of a step, the next step is no longer than this many such parts.
_AFTER = 2.0


class _Failed(Stopped):
    """A step did not come to its end; a shorter one may."""


@dataclass(frozen=True, eq=False)
class _Leg:
    """A step: the cubic between its ends, its end, the next station, whether an event ends it."""

    piece: Branch
    end: Correction
    ahead: ExpansionPoint
    event: bool = False


class NewtonFollower(Follower):
    """Follows a path from state to state.

    With load control the path goes straight to ``lam_end``, and on the other side of a fold that it jumps
    over; with arc-length control steps are shortened until they stay on the path.
    """

    _options: NewtonOptions
    _pace = 0.0

    @property
    def _stops(self) -> list[float]:
        return sorted({*self._levels, self._lam_end})

    @property
    def _loaded(self) -> bool:
        return self._options.control == "load"

    def _walk(self) -> Iterator[Step]:
        try:
            here = self._station(self._x, self._lam, self._effort)
        except SingularTangentError as error:
            raise Stopped(StopReason.SINGULAR_TANGENT, f"at the start: {error.message}") from error
        side = float(self._options.direction or np.sign(self._lam_end - self._lam))
        toward = np.zeros(self._problem.size), side
        if self._previous is not None and not self._options.direction:
            toward = self._previous.x[1], float(self._previous.lam[1])
        along = self._along(here, toward)
        if self._previous is None:
            way = abs((self._lam_end - self._lam) / along[1]) if along[1] else 1.0
            self._pace = self._options.first * way
        else:
            self._pace = self._previous.length
        while not self._stopped:
            self._allow()
            leg = self._advance(here, along)
            self._piece = leg.piece.shortened(self._pace)
            yield self._record(leg.piece, leg.end, leg.piece.length * self._metric.norm(*along), 0)
            if leg.event:
                raise Stopped(StopReason.EVENT, f"after {self._steps} steps")
            if leg.end.lam == self._lam_end:
                raise Stopped(StopReason.TARGET_REACHED, f"after {self._steps} steps")
            here, along = leg.ahead, self._along(leg.ahead, along)

    def _along(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> tuple[FloatArray, float]:
        """Return the tangent of the path over the step's parameter: load factor or arc length."""
        if self._loaded:
            side = float(np.sign(self._lam_end - here.lam)) or float(np.sign(toward[1]))
            return side * here.slope, side
        size = np.copysign(self._metric.norm(here.slope, 1.0), self._metric.product(here.slope, 1.0, *toward))
        return here.slope / size, float(1.0 / size)

    def _advance(self, here: ExpansionPoint, along: tuple[FloatArray, float]) -> _Leg:
        """Return the next step, as long as the pace, the levels and the equations allow."""
        length, level = self._pace, None
        if self._loaded:
            level = min((v for v in self._stops if (v - here.lam) * along[1] > 0.0), key=self._away(here))
            room = abs(level - here.lam)
            length, level = (room, level) if length >= (1.0 - _NEAR) * room else (length, None)
        shortest = self._options.min_length / self._metric.norm(*along)
        while True:
            try:
                return self._attempt(here, along, length, level)
            except _Failed as failure:
                length, level = _HALF * length, None
                self._pace = length
                if length < shortest:
                    place = f"at load factor {here.lam:.9g}"
                    raise Stopped(failure.reason, f"{failure.message}, and no shorter step {place}") from None

    def _away(self, here: ExpansionPoint) -> Callable[[float], float]:
        return lambda level: abs(level - here.lam)

    def _attempt(
        self, here: ExpansionPoint, along: tuple[FloatArray, float], length: float, level: float | None
    ) -> _Leg:
        """Return a step of ``length``, cut at the first level (arc length) or event in it. Raises _Failed."""
        straight = Branch(np.array([here.x, along[0]]), np.array([here.lam, along[1]]), length)
        before = self._effort.updates
        self._effort.updates += 1
        leg = self._solved(here, along, straight, length, level)
        ease = np.sqrt(self._options.wanted / (self._effort.updates - before))
        pace = length * float(np.clip(ease, _HALF, self._options.growth))
        self._pace = max(self._pace, pace) if ease >= 1.0 else pace
        if not self._loaded:
            leg = self._at_level(here, along, leg)
        if self._barrier is None:
            return leg
        return self._before_event(here, along, self._faithful(here, along, leg), self._barrier)

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
        part = admissible_part(self._problem, (here.x, here.lam), (x - here.x, lam - here.lam))
        x = here.x + part * (x - here.x)
        plane = None
        if not self._loaded and level is None:
            plane, lam = Across(self._metric, along), here.lam + part * (lam - here.lam)
        place = f"near load factor {lam:.9g}"
        try:
            point = iterate(self._problem, x, lam, plane, self._options, self._effort)
            if not point.residual <= self._options.tolerance:
                message = f"iterations end at a residual of {point.residual:.3g} {place}"
                raise _Failed(StopReason.CORRECTION_FAILED, message)
            ahead = self._station(point.x, point.lam, self._effort)
        except SingularTangentError:
            raise _Failed(StopReason.SINGULAR_TANGENT, f"the tangent is singular {place}") from None
        if not self._loaded and self._metric.norm(point.x - x, point.lam - lam) > _ASTRAY * a:
            raise _Failed(StopReason.CORRECTION_FAILED, f"iterations lead to another branch {place}")
        end = Correction(point.x, point.lam, point.residual, 0, 0, 0)
        return _Leg(self._cubic(here, along, ahead), end, ahead)

    def _cubic(self, here: ExpansionPoint, along: tuple[FloatArray, float], ahead: ExpansionPoint) -> Branch:
        """Return the piece of path with the values and tangents of both ends. Raises _Failed."""
        x, lam = ahead.x - here.x, ahead.lam - here.lam
        if self._loaded:
            length, turn, slope, rise = abs(lam), 1.0, along[1] * ahead.slope, along[1]
        else:
            slope, rise = self._along(ahead, along)
            length, turn = (self._metric.product(*one, *along) for one in ((x, lam), (slope, rise)))
        if not (length > 0.0 and turn >= _TURN):
            message = f"the path turns too far before load factor {ahead.lam:.9g}"
            raise _Failed(StopReason.CORRECTION_FAILED, message)
        slope, rise = slope / turn, rise / turn
        first = np.append(along[0], along[1])
        secant, last = np.append(x, lam) / length, np.append(slope, rise)
        bend = (3.0 * secant - 2.0 * first - last) / length
        twist = (first + last - 2.0 * secant) / length**2
        whole = np.array([np.append(here.x, here.lam), first, bend, twist])
        return Branch(whole[:, :-1], whole[:, -1], length)

    def _at_level(self, here: ExpansionPoint, along: tuple[FloatArray, float], leg: _Leg) -> _Leg:
        """Return the step, or a shorter one to the first level that it crosses (not the one it begins at)."""
        found = [(leg.piece.first_crossing(v), v) for v in self._stops if v != here.lam]
        crossings = [(a, v) for a, v in found if a is not None and a > 0.0]
        return self._solved(here, along, leg.piece, *min(crossings)) if crossings else leg

    def _faithful(self, here: ExpansionPoint, along: tuple[FloatArray, float], leg: _Leg) -> _Leg:
        """Return the step, or a shorter one whose cubic follows the path well enough to show its events."""
        while True:
            length = leg.piece.length
            error = residual_norm(self._problem, *leg.piece.evaluate(0.5 * length))
            if error <= _FAITHFUL:
                return leg
            part = max(_CUT, min(_HALF, (0.5 * _FAITHFUL / error) ** 0.25)) if np.isfinite(error) else _CUT
            self._pace = part * length
            if self._pace * self._metric.norm(*along) < self._options.min_length:
                raise _Failed(StopReason.STEP_TOO_SMALL, "the path bends too sharply to look for events")
            leg = self._solved(here, along, leg.piece, self._pace)

    def _before_event(
        self,
        here: ExpansionPoint,
        along: tuple[FloatArray, float],
        leg: _Leg,
        barrier: Callable[[Branch], float],
    ) -> _Leg:
        """Return the step, or a shorter one to the first event in it."""
        whole, a, before = leg.piece.length, barrier(leg.piece), np.inf
        if not a < whole:
            return leg
        for _ in range(_GUESSES):
            leg = self._at(here, along, leg, a)
            if a <= _NEAR * whole:
                break
            found = barrier(leg.piece.shortened(min(_BEYOND * leg.piece.length, whole)))
            if found == np.inf:
                return leg  # the first cubic's own doing
            move = abs(found - leg.piece.length)
            within = move <= self._options.tolerance and move > _SHRINKING * before
            if move <= _SETTLED * whole or within:
                break
            a, before = found, move
        else:
            raise _Failed(StopReason.CORRECTION_FAILED, f"no event settles near {leg.end.lam:.9g}")
        if leg.piece.length > _NEAR * whole:
            self._pace = min(self._pace, _AFTER * leg.piece.length)
        return replace(leg, event=True)

    def _at(self, here: ExpansionPoint, along: tuple[FloatArray, float], leg: _Leg, a: float) -> _Leg:
        """Return the step that ends at ``a``; next to the start it takes no solving."""
        x, lam = leg.piece.evaluate(a)
        if a > _NEAR * leg.piece.length:
            return self._solved(here, along, leg.piece, a)
        residual = float(np.abs(self._problem.residual(x, lam)).max(initial=0.0))
        return _Leg(leg.piece.shortened(a), Correction(x, lam, residual, 0, 0, 0), here)
