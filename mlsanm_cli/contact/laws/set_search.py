"""Conditions of open, sticking and slipping nodes, their residual in a state, and the primal-dual active-set
exchange of violating nodes (Hüeber, Stadler and Wohlmuth 2008, doi:10.1137/060671061)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactSolution, ContactStatus
from mlsanm_cli.contact.response.condensed import Condensed

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
