"""Conditions of open, sticking and slipping nodes, their residual in a state, and the primal-dual active-set
exchange of violating nodes (Hüeber, Stadler and Wohlmuth 2008, doi:10.1137/060671061)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

ROUND_OFF = 1e-10


@dataclass(frozen=True, eq=False)
class AdmissibleChanges:
    """The conditions to be enforced: closed nodes that may open (m,), open ones that may close (m,), sticking
    and closing ones that may slip (n,), and towards which ``side`` (n,): 1, -1, or 0 for both. Given the
    ``force`` (k,) on motions, those that it does not drive are held where closed nodes do not resist them."""

    opening: BoolArray
    closing: BoolArray
    slipping: BoolArray
    side: FloatArray
    force: FloatArray | None = None


class UnbalancedError(NumericalError):
    """No contact pressure balances the loads."""


class UnresistedError(UnbalancedError):
    """The first loads drive bodies that no contacts hold, wherever they touch."""


class NoStateError(NumericalError):
    """No contact status satisfies all conditions; ``sliding`` if nothing holds a platen along its
    contacts."""

    def __init__(self, sliding: bool) -> None:
        super().__init__(
            "no contact state balances the loads",
            "bodies may slide or roll apart: raise friction, or fix them; a force-controlled platen may push "
            "its body away from the contact, or nothing resists its direction: prescribe that direction's "
            "displacement instead",
        )
        self.sliding = sliding


class EndlessError(NoStateError):
    """The search did not end, as may happen where the compliance is not positive definite."""

    def __init__(self, passes: int) -> None:
        NumericalError.__init__(
            self,
            f"the active set found no contact state in {passes} passes",
            "the clouds along the contact may be too coarse or too different; at high friction there may "
            "also be no continuous path",
        )
        self.sliding = False


def exchange(
    condensed: Condensed,
    sets: ContactStatus,
    watch: AdmissibleChanges,
    values: ContactSolution,
    slipped: FloatArray,
) -> tuple[ContactStatus, BoolArray]:
    """Exchange all nodes that violate a condition; returns the new sets and a mask (m,) of these nodes. A
    node that closes, or slips in the direction of friction, is assigned by the pressure and traction that
    would undo its overlap and slip through its own compliance."""
    nodes = condensed.friction_nodes
    own_normal, own_tangential = condensed.own
    p, t = values.pressure, values.traction
    largest = max(np.abs(p).max(initial=0.0), np.abs(t).max(initial=0.0))
    force = ROUND_OFF * max(largest, moving(condensed, values.motion))
    opening = sets.closed & watch.opening & (p < -force)
    closing = ~sets.closed & watch.closing & (values.gap < -ROUND_OFF * np.abs(values.gap).max(initial=0.0))
    closed = (sets.closed & ~opening) | closing
    asked = np.where(sets.stuck, t, t - slipped / own_tangential)
    pressed = np.where(closing, p - values.gap / own_normal, p) if closing.any() else p
    limit = condensed.friction * pressed[nodes]
    side = np.where(watch.side == 0.0, np.sign(asked), watch.side)
    over = side * asked - limit
    still = closed[nodes] & sets.closed[nodes]
    slips = still & sets.stuck & watch.slipping & (over > force)
    with_friction = sets.slip_sign * slipped > ROUND_OFF * np.abs(slipped).max(initial=0.0)
    turns = still & with_friction & ((over <= 0.0) | (side == sets.slip_sign))
    reverses = still & with_friction & ~turns
    wrong = opening | closing
    wrong[nodes] |= slips | turns | reverses
    if not wrong.any():
        return sets, wrong
    slides = closing[nodes] & watch.slipping & (over > 0.0)
    holds = closing[nodes] & ~slides
    stuck = (sets.stuck & still & ~slips) | turns | holds
    slip_sign = np.where(
        slips | reverses | slides, side, np.where(turns | ~closed[nodes] | holds, 0.0, sets.slip_sign)
    )
    return ContactStatus(closed, stuck, slip_sign), wrong


def moving(condensed: Condensed, motion: FloatArray) -> float:
    """Pressure that would displace the surfaces as far as ``motion`` (k,) does."""
    moved = float(np.abs(condensed.gap.motion @ motion).max(initial=0.0))
    return moved / condensed.largest_compliance if moved else 0.0


def kkt_residual(
    condensed: Condensed,
    unknowns: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    closed: BoolArray,
    held: FloatArray,
) -> float:
    """Largest residual of contact conditions, friction and balances, relative to peak pressure, elastic gap
    and forces. ``unknowns`` are load factors, motions, pressures and tractions, ``closed`` (m,) the closed
    nodes, ``held`` (n,) the stick references, nan for nodes that do not stick."""
    factors, motion, pressure, traction = unknowns
    gap_map, balance = condensed.gap, condensed.balance
    moved = float(np.abs(gap_map.motion @ motion).max(initial=0.0))
    largest_compliance = condensed.largest_compliance
    least = COARSE_ROUND_OFF * moved / largest_compliance if largest_compliance > 0.0 else 0.0
    typical = max(float(np.abs(pressure).max(initial=0.0)), least) or 1.0
    m, n = len(pressure), len(traction)
    elastic = max(condensed.elastic_gap(pressure), least * largest_compliance) or 1.0
    free = [one.constant + one.load @ factors for one in (gap_map, condensed.slip, balance)]
    caused = condensed.blocks @ np.concatenate([pressure, traction, motion])
    gap, slip, imbalance = (free[0] + caused[:m], free[1] + caused[m : m + n], free[2] + caused[m + n :])
    overlap = np.where(closed, np.abs(gap), -gap)
    limit = condensed.friction * pressure[condensed.friction_nodes]
    size = np.maximum(np.abs(pressure), least)
    force = np.abs(balance.load @ factors) + np.abs(balance.pressure) @ size
    force += np.abs(balance.traction) @ (condensed.friction * size[condensed.friction_nodes])
    stuck = np.isfinite(held)
    # Gaps are known to round-off, and pressures to what it causes.
    length = condensed.gap_round_off
    round_off = length / largest_compliance if largest_compliance > 0.0 else 0.0
    parts = (
        (overlap.max(initial=0.0) - length) / elastic,
        (-pressure.min(initial=0.0) - round_off) / typical,
        (np.abs(slip[stuck] - held[stuck]).max(initial=0.0) - length) / elastic,
        ((np.abs(traction) - limit).max(initial=0.0) - round_off) / typical,
        0.0,
        (np.abs(imbalance) / np.maximum(force, np.finfo(float).tiny)).max(initial=0.0),
    )
    return float(max(parts))
