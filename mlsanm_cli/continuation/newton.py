"""Newton-Raphson: a path followed from state to state, with a step length adapted to the iteration count.

A step starts along the tangent (its first iteration) and ends where damped Newton updates converge: at a
given load factor, or on the plane normal to the tangent at a given distance, which passes folds. Updates stay
in the admissible region and lower the norm of the residual. Between its ends a step is interpolated: by the
cubic with the values and tangents of both. A load factor inside is therefore located on the cubic and
solved for.

Sources: E. Riks, An incremental approach to the solution of snapping and buckling problems, International
Journal of Solids and Structures 15 (1979) 529-551; M. A. Crisfield, A fast incremental/iterative solution
procedure that handles snap-through, Computers & Structures 13 (1981) 55-62.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, admissible_part, iterate
from mlsanm_cli.continuation.expansion import ExpansionPoint
from mlsanm_cli.continuation.path import Follower, Step, Stopped, StopReason
from mlsanm_cli.continuation.problem import FloatArray, NewtonOptions, SingularTangentError
from mlsanm_cli.continuation.series import Branch
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

# With arc-length control the direction may turn by an angle of at least this cosine within a step.
_MIN_COSINE = 0.3


class _Failed(Stopped):
    """A step did not converge; a shorter one may."""


@dataclass(frozen=True, eq=False)
class _Step:
    """A step: the cubic between its ends, its end, the next expansion point."""

    piece: Branch
    end: Correction
    ahead: ExpansionPoint


class NewtonFollower(Follower):
    """Follows a path from state to state. With load control the load factor goes straight to ``lam_end`` and
    may jump over a fold to another branch; with arc-length control steps are shortened until they stay on the
    path."""

    _options: NewtonOptions
    _step_length = 0.0

    @property
    def _targets(self) -> list[float]:
        return sorted({*self._levels, self._lam_end})

    @property
    def _load_control(self) -> bool:
        return self._options.control == "load"

    def _follow(self) -> Iterator[Step]:
        try:
            here = self._expansion_point(self._x, self._lam, self._effort)
        except SingularTangentError as error:
            raise Stopped(StopReason.SINGULAR_TANGENT, f"at the start: {error.message}") from error
        side = float(self._options.direction or np.sign(self._lam_end - self._lam))
        toward = np.zeros(self._problem.size), side
        if self._previous is not None and not self._options.direction:
            toward = self._previous.x[1], float(self._previous.lam[1])
        along = self._along(here, toward)
        if self._previous is None:
            way = abs((self._lam_end - self._lam) / along[1]) if along[1] else 1.0
            self._step_length = self._options.first * way
        else:
            self._step_length = self._previous.length
        while not self._stopped:
            self._check_step_count()
            leg = self._advance(here, along)
            self._piece = leg.piece.shortened(self._step_length)
            arc_length = leg.piece.length * self._metric.norm(*along)
            yield self._record(leg.piece, leg.end, arc_length, 0, leg.ahead)
            if leg.end.lam == self._lam_end:
                raise Stopped(StopReason.TARGET_REACHED, f"after {self._steps} steps")
            here, along = leg.ahead, self._along(leg.ahead, along)

    def _along(self, here: ExpansionPoint, toward: tuple[FloatArray, float]) -> tuple[FloatArray, float]:
        """Return the tangent of the path by the step's parameter: load factor or arc length."""
        if self._load_control:
            side = float(np.sign(self._lam_end - here.lam)) or float(np.sign(toward[1]))
            return side * here.slope, side
        size = np.copysign(self._metric.norm(here.slope, 1.0), self._metric.product(here.slope, 1.0, *toward))
        return here.slope / size, float(1.0 / size)

    def _advance(self, here: ExpansionPoint, along: tuple[FloatArray, float]) -> _Step:
        """Return the next step, as long as the step length, the levels and convergence allow."""
        length, level = self._step_length, None
        if self._load_control:
            ways = {v: abs(v - here.lam) for v in self._targets if (v - here.lam) * along[1] > 0.0}
            level = min(ways, key=ways.__getitem__)
            room = ways[level]
            length, level = (room, level) if length >= (1.0 - COARSE_ROUND_OFF) * room else (length, None)
        shortest = self._options.min_length / self._metric.norm(*along)
        while True:
            try:
                return self._attempt(here, along, length, level)
            except _Failed as failure:
                length, level = 0.5 * length, None
                self._step_length = length
                if length < shortest:
                    place = f"at load factor {here.lam:.9g}"
                    raise Stopped(failure.reason, f"{failure.message}, and no shorter step {place}") from None

    def _attempt(
        self, here: ExpansionPoint, along: tuple[FloatArray, float], length: float, level: float | None
    ) -> _Step:
        """Return a step of ``length``, cut at the first level in it (arc length). Raises _Failed."""
        straight = Branch(np.array([here.x, along[0]]), np.array([here.lam, along[1]]), length)
        before = self._effort["updates"]
        self._effort["updates"] += 1
        leg = self._solved(here, along, straight, length, level)
        ease = np.sqrt(self._options.wanted / (self._effort["updates"] - before))
        pace = length * float(np.clip(ease, 0.5, self._options.growth))
        self._step_length = max(self._step_length, pace) if ease >= 1.0 else pace
        return leg if self._load_control else self._at_level(here, along, leg)

    def _solved(
        self,
        here: ExpansionPoint,
        along: tuple[FloatArray, float],
        guess: Branch,
        a: float,
        level: float | None = None,
    ) -> _Step:
        """Return the step that ends at ``level``, else at the parameter ``a`` of ``guess``."""
        x, lam = guess.evaluate(a)
        lam = lam if level is None else level
        part = admissible_part(self._problem, (here.x, here.lam), (x - here.x, lam - here.lam))
        x = here.x + part * (x - here.x)
        product = self._metric.product

        def in_normal_plane(dx: FloatArray, slope: FloatArray) -> float:
            return -product(dx, 0.0, *along) / product(slope, 1.0, *along)

        load_update = None
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
        return _Step(self._cubic(here, along, ahead), point, ahead)

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

    def _at_level(self, here: ExpansionPoint, along: tuple[FloatArray, float], leg: _Step) -> _Step:
        """Return the step, or a shorter one to the first level that it crosses after its start."""
        found = [(leg.piece.first_crossing(v), v) for v in self._targets if v != here.lam]
        crossings = [(a, v) for a, v in found if a is not None and a > 0.0]
        return self._solved(here, along, leg.piece, *min(crossings)) if crossings else leg
