"""Frictionless contact, p >= 0, h >= 0, p h = 0, by an active-set method on the condensed system.

The primal-dual active set (Hintermuller, Ito and Kunisch 2002, doi:10.1137/S1052623401383558) converges in a
few iterations. If a set recurs, Murty's least-index principal pivoting takes over (Linear Complementarity,
Linear and Nonlinear Programming, 1988, chapter 4), which cannot cycle if sym(W A) is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.loose_bodies import PRESSURE_TOLERANCE, STIFFNESS_SEQUENCE, at_rest, springs
from mlsanm_cli.contact.laws.many_unknowns import (
    FINAL_TOLERANCE,
    MAX_DENSE,
    SEARCH_TOLERANCE,
    ManyClosed,
    NotConvergedError,
)
from mlsanm_cli.contact.laws.set_search import EndlessError, UnbalancedError, kkt_residual, moving
from mlsanm_cli.contact.response.compressed import compressed
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import DenseSystem, SingularSystemError

ROUND_OFF = 1e-11
NOISE_FACTOR, MAX_ITERATIVE_PASSES = 1000.0, 300
"""Tolerance over the residual of iterative solutions; and largest number of iterations with these."""
MAX_PASSES = 50
"""Largest number of iterations per node."""


@dataclass(frozen=True)
class ExactState:
    """Pressures (m,), gaps (m,), unknown motions (k,) and tractions (n,) at load ``factors`` (L,).

    ``active`` (m,) marks closed nodes, ``stuck`` (m,) those held by friction; ``solves`` counts dense
    systems; ``residual`` is the largest violation of contact conditions and balances, relative to the peak
    pressure, its elastic gap and the forces.
    """

    factors: FloatArray
    pressure: FloatArray
    gap: FloatArray
    motion: FloatArray
    traction: FloatArray
    active: BoolArray
    stuck: BoolArray
    solves: int
    residual: float

    @property
    def unknowns(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Load factors, motions, pressures and tractions as arguments of linear maps."""
        return self.factors, self.motion, self.pressure, self.traction


def solve_exact(condensed: Condensed, factors: FloatArray, start: BoolArray | None = None) -> ExactState:
    """Exact frictionless state at ``factors`` (L,), searched from the set ``start`` (m,). Raises
    NumericalError if no state balances the loads."""
    free_gap = condensed.gap.constant + condensed.gap.load @ factors
    if start is None or not start.any():
        # Overlapping nodes; if forces must be balanced, also the closest nodes of every contact.
        first = np.asarray(free_gap < 0.0)
        if len(condensed.balance.constant):
            first |= condensed.closest(free_gap)
    else:
        first = start.copy()
    try:
        solved = _searched(condensed, factors, free_gap, first, _Held(np.zeros(0), np.zeros(0)))
    except SingularSystemError:
        solved = _at_rest(condensed, factors, free_gap, first)
    if solved.active.any() and _only_moved(condensed, factors, free_gap, solved.pressure):
        solved = _apart(solved)
    gap = free_gap + condensed.gap.motion @ solved.motion + condensed.gap.pressure @ solved.pressure
    gap[solved.active] = 0.0
    nothing, p, closed = np.zeros(len(condensed.friction_nodes)), solved.pressure, solved.active
    unknowns = (factors, solved.motion, p, nothing)
    residual = kkt_residual(condensed, unknowns, closed, np.full(len(nothing), np.nan))
    stuck = np.zeros_like(closed)
    return ExactState(factors, p, gap, solved.motion, nothing, closed, stuck, solved.solves, residual)


@dataclass(frozen=True)
class _Held:
    """Springs (k,) on the motions and their rest positions (k,), empty for none."""

    springs: FloatArray
    place: FloatArray


@dataclass(frozen=True)
class _Solved:
    """Closed nodes (m,), pressures (m,), motions (k,), and the number of systems solved."""

    active: BoolArray
    pressure: FloatArray
    motion: FloatArray
    solves: int


def _at_rest(condensed: Condensed, factors: FloatArray, free_gap: FloatArray, active: BoolArray) -> _Solved:
    """The state of floating bodies at rest, searched from the set ``active`` (m,)."""
    stiff, solves = springs(condensed), 0
    place = np.zeros(len(stiff))
    for share in STIFFNESS_SEQUENCE:
        try:
            solved = _searched(condensed, factors, free_gap, active, _Held(share * stiff, place))
        except SingularSystemError:
            break
        solves += solved.solves
        pull = share * stiff * (solved.motion - place)
        active, place = solved.active, solved.motion
        if (free_gap < 0.0).any() and _only_moved(condensed, factors, free_gap, solved.pressure):
            return replace(_apart(solved), solves=solves)
        if at_rest(condensed, factors, solved.pressure, pull):
            if not solved.pressure.any():
                break
            # Pressures of the order of the residual spring forces are removed.
            pressed = solved.pressure > PRESSURE_TOLERANCE * solved.pressure.max()
            pressure = np.where(pressed, solved.pressure, 0.0)
            return _Solved(active & pressed, pressure, solved.motion, solves)
    raise UnbalancedError(
        "no contact pressure balances the loads",
        "a force-controlled platen may push its body away from the contact, or a body held by contact "
        "only may be free there; prescribe the displacement instead, or use "
        'contact.regularization.law = "hyperbolic"',
    )


def _only_moved(
    condensed: Condensed, factors: FloatArray, free_gap: FloatArray, pressure: FloatArray
) -> bool:
    """Whether surfaces in contact, drawn overlapping or displaced by others, only had to be separated:
    without a load their ``pressure`` (m,) is round-off of the gaps."""
    if (condensed.balance.constant + condensed.balance.load @ factors).any():
        return False
    return condensed.elastic_gap(pressure) <= condensed.gap_round_off


def _apart(solved: _Solved) -> _Solved:
    """The same motions without contact."""
    return replace(solved, active=np.zeros_like(solved.active), pressure=np.zeros_like(solved.pressure))


def _searched(
    condensed: Condensed, factors: FloatArray, free_gap: FloatArray, active: BoolArray, held: _Held
) -> _Solved:
    """The set that satisfies all conditions, searched from ``active`` (m,). Raises SingularSystemError if a
    set leaves bodies loose without springs."""
    gap_map, m = condensed.gap, len(condensed.weight)
    seen: set[bytes] = set()
    many = iterates = compressed(gap_map.pressure) is not None
    roughly, one_by_one = many, False
    limit = MAX_ITERATIVE_PASSES if many else MAX_PASSES * (m + 1)
    pressure = np.zeros(m)
    for count in range(1, limit + 1):
        closed = _Closed(condensed, free_gap, factors, active, held, iterates)
        for part in (SEARCH_TOLERANCE, FINAL_TOLERANCE) if roughly else (FINAL_TOLERANCE,):
            pressure, motion = closed.solve(pressure, part)
            gap = free_gap + gap_map.motion @ motion + gap_map.pressure @ pressure
            gap[active] = 0.0
            tolerance = max(ROUND_OFF, NOISE_FACTOR * part) if many else ROUND_OFF
            wrong = _violations(condensed, active, pressure, gap, moving(condensed, motion), tolerance)
            if wrong.any():
                break
        iterates = closed.iterates
        if not wrong.any():
            return _Solved(active, pressure, motion, count)
        if active.tobytes() in seen:
            # A recurring set may also be due to inexact solutions: repeat with exact ones first.
            one_by_one |= not roughly
            roughly = False
            seen.clear()
        if one_by_one:
            wrong[np.flatnonzero(wrong)[0] + 1 :] = False
        seen.add(active.tobytes())
        active = active ^ wrong
    raise EndlessError(limit)


class _Closed:
    """The equations of a set ``active`` (m,): pressures close the gaps, motions balance the forces. Those of
    a compressed compliance are solved by iterations while these converge, see ``iterates``. Raises
    SingularSystemError if bodies are loose."""

    def __init__(
        self,
        condensed: Condensed,
        free_gap: FloatArray,
        factors: FloatArray,
        active: BoolArray,
        held: _Held,
        iterates: bool,
    ) -> None:
        self._closed = closed = np.flatnonzero(active)
        balance = condensed.balance
        self._count, a, k = len(active), len(closed), len(balance.constant)
        self._gap, stiffness = -free_gap[closed], balance.motion
        self._force = -(balance.constant + balance.load @ factors)
        if len(held.springs):
            stiffness = stiffness + np.diag(held.springs)
            self._force = self._force + held.springs * held.place
        self._many, self._dense = None, None
        self._moved, self._forces = condensed.gap.motion[closed], balance.pressure[:, closed]
        self._compliance, self._stiffness = condensed.gap.pressure, stiffness
        self.iterates, own = iterates, compressed(condensed.gap.pressure)
        if own is not None and iterates and a:
            try:
                self._many = ManyClosed(own, closed, self._moved, self._forces, stiffness)
            except NotConvergedError as error:
                self._solve_directly(error)
        elif a + k:
            self._dense = self._direct()

    def _direct(self) -> DenseSystem:
        closed = self._closed
        compliance = self._compliance[np.ix_(closed, closed)]
        matrix = np.block([[compliance, self._moved], [self._forces, self._stiffness]])
        return DenseSystem(matrix, len(closed))

    def _solve_directly(self, error: NotConvergedError) -> None:
        """From here on, after an ``error`` of the iterations, raised again if there are too many nodes."""
        if len(self._closed) > MAX_DENSE:
            raise error
        self.iterates, self._many, self._dense = False, None, self._direct()

    def solve(self, near: FloatArray, part: float) -> tuple[FloatArray, FloatArray]:
        """Pressures (m,) and motions (k,) to a relative residual ``part``, starting from pressures
        ``near``."""
        pressure, closed = np.zeros(self._count), self._closed
        if self._many is not None:
            try:
                pressure[closed], motion = self._many.solve(self._gap, self._force, near[closed], part)
            except NotConvergedError as error:
                self._solve_directly(error)
            else:
                return pressure, motion
        if self._dense is None:
            return pressure, np.zeros(0)
        solution = self._dense.solve(np.concatenate([self._gap, self._force]))
        pressure[closed] = solution[: len(closed)]
        return pressure, solution[len(closed) :]


def _violations(
    condensed: Condensed,
    active: BoolArray,
    pressure: FloatArray,
    gap: FloatArray,
    least: float,
    tolerance: float,
) -> BoolArray:
    """Mask (m,) of closed nodes in tension and open nodes in overlap, beyond a relative ``tolerance``;
    ``least`` is the reference pressure where nothing is loaded."""
    typical = max(float(np.abs(pressure).max(initial=0.0)), least)
    elastic = condensed.largest_compliance * typical
    tension = active & (pressure < -tolerance * typical)
    overlap = ~active & (gap < -tolerance * elastic)
    return np.asarray(tension | overlap, dtype=bool)
