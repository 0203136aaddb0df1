"""Unilateral contact with Coulomb friction: states, and finite increments between them. Equation (14) of
docs/method.md."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.complementary_path import admissible_sets
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.limit_load import supporting
from mlsanm_cli.contact.laws.set_search import AdmissibleChanges, kkt_residual
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.roundoff import ROUND_OFF


@dataclass(frozen=True, eq=False)
class CoulombState:
    """One state of the history: load ``factors`` (L,), ``values``, ``sets``, the slips (n,) at which nodes
    stick, and the energy ``work`` (n,) dissipated by friction so far, per length of surface. Factors of the
    equations of states after it are updates of those of its ``system``, if known."""

    factors: FloatArray
    values: ContactSolution
    sets: ContactStatus
    stick_reference: FloatArray
    work: FloatArray
    system: SetSystem | None = None

    def moved(
        self,
        factors: FloatArray,
        values: ContactSolution,
        sets: ContactStatus,
        stick_reference: FloatArray,
        system: SetSystem,
        jumps: bool = False,
    ) -> CoulombState:
        """The next state, with tractions and slips linear in between, or with friction as at its end if it
        ``jumps``."""
        traction = values.traction if jumps else 0.5 * (self.values.traction + values.traction)
        slipped = np.where(sets.slip_sign != 0.0, values.slip - self.values.slip, 0.0)
        return CoulombState(factors, values, sets, stick_reference, self.work - traction * slipped, system)


def unloaded(condensed: Condensed, factors: FloatArray) -> CoulombState:
    """The state before the first load, without pressure and slip; initial overlaps are resolved by the first
    increment."""
    m, n = len(condensed.weight), len(condensed.friction_nodes)
    values = ContactSolution(
        np.zeros(m),
        np.zeros(n),
        np.zeros(len(condensed.balance.constant)),
        condensed.gap.constant + condensed.gap.load @ factors,
        np.zeros(n),
    )
    sets = ContactStatus(np.zeros(m, dtype=bool), np.zeros(n, dtype=bool), np.zeros(n))
    return CoulombState(factors, values, sets, np.zeros(n), np.zeros(n))


def acts(condensed: Condensed, change: FloatArray) -> bool:
    """Whether a change of the load factors (L,) affects contacts or motions."""
    return any((part.load @ change).any() for part in (condensed.gap, condensed.slip, condensed.balance))


def increment(
    condensed: Condensed,
    state: CoulombState,
    factors: FloatArray,
    slipping: bool = True,
    guess: ContactStatus | None = None,
    pivots: int | None = None,
) -> tuple[CoulombState, int]:
    """The state after one finite increment to ``factors`` (L,), with return mapping for friction, and the
    number of systems solved.

    The search starts from ``guess``, if given. Without ``slipping`` all closed nodes stick. Raises
    NoStateError, also after so many ``pivots``, if given.
    """
    before, nodes = state.values.slip, condensed.friction_nodes
    closed = state.sets.closed | (state.values.gap <= ROUND_OFF * condensed.weight)
    force = condensed.balance.constant + condensed.balance.load @ factors
    if len(force) and not state.sets.closed.any():
        closed = _resting(condensed, state, closed, factors, force)
    stuck = closed[nodes] & (state.sets.slip_sign == 0.0)
    slip_sign = np.where(closed[nodes], state.sets.slip_sign, 0.0)
    both = np.ones(len(condensed.weight), dtype=bool)
    watch = AdmissibleChanges(both, both, np.full(len(before), slipping), np.zeros(len(before)), force)

    known = state.system

    def solve(sets: ContactStatus) -> tuple[SetSystem, ContactSolution, FloatArray]:
        nonlocal known
        known = SetSystem(condensed, sets, known, force)
        values = known.state(factors, before, state.values.motion)
        return known, values, values.slip - before

    first = ContactStatus(closed, stuck, slip_sign) if guess is None else guess
    sets, system, values, count = admissible_sets(condensed, first, watch, solve, pivots=pivots)
    stick_reference = np.where(sets.stuck, before, values.slip)
    return state.moved(factors, values, sets, stick_reference, system, jumps=True), count


def _resting(
    condensed: Condensed, state: CoulombState, closed: BoolArray, factors: FloatArray, force: FloatArray
) -> BoolArray:
    """Closed nodes (m,) that hold floating bodies under a ``force`` (k,) on their motions: ``closed`` ones,
    more on which they rest like rigid bodies, or the closest ones of all contacts."""
    for number in range(2):
        try:
            SetSystem(
                condensed, replace(state.sets, closed=closed).resting(condensed.friction_nodes), None, force
            )
        except SingularSystemError:
            gap = condensed.gap.constant + condensed.gap.load @ factors
            rigid = supporting(condensed, gap, force) if not number else None
            closed = closed | (condensed.closest(state.values.gap) if rigid is None else rigid)
    return closed


def residual(condensed: Condensed, state: CoulombState) -> float:
    """Largest violation of contact conditions, friction and balances, see :func:`kkt_residual`."""
    v, sets = state.values, state.sets
    unknowns = (state.factors, v.motion, v.pressure, v.traction)
    return kkt_residual(condensed, unknowns, sets.closed, np.where(sets.stuck, state.stick_reference, np.nan))
