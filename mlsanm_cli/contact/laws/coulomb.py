"""Unilateral contact with Coulomb friction: states, and finite increments between them. Equation (13) of
docs/method.md."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.complementary_path import admissible_sets
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus, SetSystem
from mlsanm_cli.contact.laws.set_search import AdmissibleChanges, FloatingError, kkt_residual, moving
from mlsanm_cli.contact.response.condensed import EQUAL_GAP, Condensed

PRESSURE_TOLERANCE = 1e-10
"""Pressures below this fraction of those that correspond to the rigid motions are zero."""


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
) -> tuple[CoulombState, int]:
    """The state after one finite increment to ``factors`` (L,), with return mapping for friction, and the
    number of systems solved.

    The search starts from ``guess``, if given. Without ``slipping`` all closed nodes stick. Raises
    NoStateError; with ``slipping`` FloatingError if surfaces that were apart would touch without pressure.
    """
    before = state.values.slip
    closed = state.sets.closed | (state.values.gap <= EQUAL_GAP * condensed.weight)
    floating = len(condensed.balance.constant) > 0 and not state.sets.closed.any()
    if floating:
        closed |= condensed.closest(state.values.gap)
    stuck = closed[condensed.friction_nodes] & (state.sets.slip_sign == 0.0)
    slip_sign = np.where(closed[condensed.friction_nodes], state.sets.slip_sign, 0.0)
    both = np.ones(len(condensed.weight), dtype=bool)
    watch = AdmissibleChanges(both, both, np.full(len(before), slipping), np.zeros(len(before)))

    known = state.system

    def solve(sets: ContactStatus) -> tuple[SetSystem, ContactSolution, FloatArray]:
        nonlocal known
        known = SetSystem(condensed, sets, known)
        values = known.state(factors, before)
        return known, values, values.slip - before

    first = ContactStatus(closed, stuck, slip_sign) if guess is None else guess
    sets, system, values, count = admissible_sets(condensed, first, watch, solve)
    pressed = values.pressure.max() > PRESSURE_TOLERANCE * moving(condensed, values.motion)
    if floating and slipping and not pressed and acts(condensed, factors - state.factors):
        raise FloatingError
    stick_reference = np.where(sets.stuck, before, values.slip)
    return state.moved(factors, values, sets, stick_reference, system, jumps=True), count


def residual(condensed: Condensed, state: CoulombState) -> float:
    """Largest violation of contact conditions, friction and balances, see :func:`kkt_residual`."""
    v, sets = state.values, state.sets
    unknowns = (state.factors, v.motion, v.pressure, v.traction)
    return kkt_residual(condensed, unknowns, sets.closed, np.where(sets.stuck, state.stick_reference, np.nan))
