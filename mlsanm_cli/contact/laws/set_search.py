"""The search for sets of open, sticking and slipping nodes that obey all rules.

Nodes that break their own rule are exchanged (Hüeber, Stadler and Wohlmuth 2008, doi:10.1137/060671061), many
at once at first, one by one should a set come back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactState, ContactStatus
from mlsanm_cli.contact.laws.sliding import slides_freely
from mlsanm_cli.contact.response.condensed import Condensed
from mlsanm_cli.contact.response.dense import SingularSystemError
from mlsanm_cli.errors import NumericalError

ROUND_OFF = 1e-10
ALL, WORST, ONE = range(3)
"""Which of the nodes that break a rule are exchanged at once: the more of them, the sooner the search ends,
or comes to sets that free what friction holds, or to some it has had."""


@dataclass(frozen=True, eq=False)
class AdmissibleChanges:
    """Which rules count: closed nodes that may open (m,), open ones that may close (m,), sticking and closing
    ones that may slip (n,) and to which ``side`` (n,): 1, -1, or 0 for both."""

    opening: BoolArray
    closing: BoolArray
    slipping: BoolArray
    side: FloatArray


class UnbalancedError(NumericalError):
    """No contact pressure balances the loads."""


class NoStateError(NumericalError):
    """No sets of open, sticking and slipping nodes obey all rules; ``sliding`` where nothing
    holds a platen along its contacts."""

    def __init__(self, sliding: bool) -> None:
        super().__init__(
            "no contact state balances the loads",
            "a force-controlled platen may push its body away from the contact, or nothing resists its "
            "direction; prescribe that direction's displacement instead",
        )
        self.sliding = sliding


class EndlessError(NoStateError):
    """The search came to no end, as it may where the compliance does not resist all pressures."""

    def __init__(self, passes: int) -> None:
        NumericalError.__init__(
            self,
            f"the active set found no contact state in {passes} passes",
            "the clouds may be too coarse where the surfaces touch, or differ between the two; at high "
            "friction there may also be no continuous path",
        )
        self.sliding = False


class FloatingError(NoStateError):
    """Nothing touched before, and still nothing is pressed: free motions could be any."""

    def __init__(self) -> None:
        NumericalError.__init__(
            self,
            "the position of a body held by contact only is undetermined: no contact is loaded yet",
            "move it by a force instead of a displacement, or draw the surfaces touching",
        )
        self.sliding = False


System = TypeVar("System")


def primal_dual_active_set(
    condensed: Condensed,
    first: ContactStatus,
    watch: AdmissibleChanges,
    solve: Callable[[ContactStatus], tuple[System, ContactState, FloatArray]],
    passes: int | None = None,
) -> tuple[ContactStatus, System, ContactState, int]:
    """Sets that obey every watched rule, their system and values, and how many systems it took.

    ``solve`` gives the system of some sets, the values that the rules are about, and the slips (n,) whose
    signs must be against friction; SingularSystemError where there are none. Raises NoStateError, also after
    so many ``passes``.
    """
    sets, seen, care = first, set[bytes](), ALL
    others: Iterator[ContactStatus] | None = None
    limit = passes or 60 + 12 * len(first.closed)
    for count in range(1, limit + 1):
        try:
            system, values, slipped = solve(sets)
        except SingularSystemError:
            if care == ONE:
                others = _divided(condensed, sets) if others is None else others
                another = next(others, None)
                if another is None:
                    raise NoStateError(sliding=slides_freely(condensed, sets)) from None
                sets = first = another
                care = ALL
                seen.clear()
                continue
            # Too many exchanges at once have freed what friction holds.
            sets, care = first, care + 1
            seen.clear()
            continue
        better, wrong = _exchange(condensed, sets, watch, values, slipped)
        if not wrong.any():
            return sets, system, values, count
        if sets.key in seen and care < ONE:
            care += 1
            seen.clear()
        elif sets.key in seen:
            node = int(np.flatnonzero(wrong)[0])
            untried = (one for one in _otherwise(condensed, sets, node) if one.key not in seen)
            another = next(untried, None)
            if another is not None:
                sets = another
                continue
        seen.add(sets.key)
        if care == ALL:
            sets = better
        elif care == WORST:
            off = np.where(wrong, _violation(condensed, sets, values, slipped), 0.0)
            sets = _only(condensed, sets, better, off >= 0.5 * off.max())
        else:
            sets = _only(condensed, sets, better, np.arange(len(wrong)) == np.flatnonzero(wrong)[0])
    raise EndlessError(limit)


def _otherwise(condensed: Condensed, sets: ContactStatus, node: int) -> Iterator[ContactStatus]:
    """The same sets with one closed node that rests, or slips either way: one that opens where it slips as it
    asks for, and closes where it is open, may do the others."""
    for own in np.flatnonzero(condensed.friction_nodes == node):
        for rests, sign in ((True, 0.0), (False, 1.0), (False, -1.0)):
            closed, stuck, slip_sign = sets.closed.copy(), sets.stuck.copy(), sets.slip_sign.copy()
            closed[node], stuck[own], slip_sign[own] = True, rests, sign
            yield ContactStatus(closed, stuck, slip_sign)


def _divided(condensed: Condensed, sets: ContactStatus) -> Iterator[ContactStatus]:
    """The same sets with one node that sticks, where those that slip one way and those that slip the other
    meet: a body that both hold rests there, and when its last sticking node gives way another one comes to
    rest."""
    if sets.stuck.any():
        return
    for own in condensed.tangential.values():
        slip_sign = sets.slip_sign[own]
        slides = np.flatnonzero(slip_sign)
        change = np.flatnonzero(slip_sign[slides[1:]] != slip_sign[slides[:-1]])
        for node in own.start + slides[np.unique(np.concatenate([change, change + 1]))]:
            stuck, turned = sets.stuck.copy(), sets.slip_sign.copy()
            stuck[node], turned[node] = True, 0.0
            yield ContactStatus(sets.closed, stuck, turned)


def _exchange(
    condensed: Condensed,
    sets: ContactStatus,
    watch: AdmissibleChanges,
    values: ContactState,
    slipped: FloatArray,
) -> tuple[ContactStatus, BoolArray]:
    """The sets with every node that breaks its rule exchanged, and which nodes (m,) these are.

    A node that closes, or slips with friction, is judged by the pressure and traction that its own compliance
    asks for to undo its overlap and its slip.
    """
    nodes = condensed.friction_nodes
    own = np.diagonal(condensed.whole)
    own_normal, own_tangential = own[: len(sets.closed)], own[len(sets.closed) :][: len(sets.stuck)]
    p, t = values.pressure, values.traction
    largest = max(np.abs(p).max(initial=0.0), np.abs(t).max(initial=0.0))
    force = ROUND_OFF * max(largest, moving(condensed, values.motion))
    opening = sets.closed & watch.opening & (p < -force)
    closing = ~sets.closed & watch.closing & (values.gap < -ROUND_OFF * np.abs(values.gap).max(initial=0.0))
    closed = (sets.closed & ~opening) | closing
    asked = np.where(sets.stuck, t, t - slipped / own_tangential)
    limit = condensed.friction * np.where(closing, p - values.gap / own_normal, p)[nodes]
    side = np.where(watch.side == 0.0, np.sign(asked), watch.side)
    over = side * asked - limit
    still = closed[nodes] & sets.closed[nodes]
    slips = still & sets.stuck & watch.slipping & (over > force)
    with_friction = sets.slip_sign * slipped > ROUND_OFF * np.abs(slipped).max(initial=0.0)
    turns = still & with_friction & ((over <= 0.0) | (side == sets.slip_sign))
    reverses = still & with_friction & ~turns
    slides = closing[nodes] & watch.slipping & (over > 0.0)
    holds = closing[nodes] & ~slides
    stuck = (sets.stuck & still & ~slips) | turns | holds
    slip_sign = np.where(
        slips | reverses | slides, side, np.where(turns | ~closed[nodes] | holds, 0.0, sets.slip_sign)
    )
    wrong = opening | closing
    wrong[nodes] |= slips | turns | reverses
    return ContactStatus(closed, stuck, slip_sign), wrong


def _violation(
    condensed: Condensed, sets: ContactStatus, values: ContactState, slipped: FloatArray
) -> FloatArray:
    """By how much places (m,) may break their rules, as pressures."""
    nodes, m = condensed.friction_nodes, len(sets.closed)
    own = np.diagonal(condensed.whole)
    p, t = values.pressure, values.traction
    off = np.where(sets.closed, np.maximum(-p, 0.0), np.maximum(-values.gap / own[:m], 0.0))
    beyond = np.maximum(np.abs(t) - condensed.friction * np.maximum(p[nodes], 0.0), 0.0)
    against = np.abs(slipped / own[m : m + len(nodes)])
    off[nodes] += np.where(sets.stuck, beyond, np.where(sets.closed[nodes], against, 0.0))
    return off


def moving(condensed: Condensed, motion: FloatArray) -> float:
    """A pressure that would move the surfaces as far as a ``motion`` (k,) of platens and bodies."""
    moved = float(np.abs(condensed.gap.motion @ motion).max(initial=0.0))
    return moved / condensed.largest_compliance if moved else 0.0


def _only(
    condensed: Condensed, sets: ContactStatus, better: ContactStatus, chosen: BoolArray
) -> ContactStatus:
    """The exchange of the ``chosen`` nodes (m,) alone."""
    own = chosen[condensed.friction_nodes]
    closed = np.where(chosen, better.closed, sets.closed)
    stuck, slip_sign = (
        np.where(own, better.stuck, sets.stuck),
        np.where(own, better.slip_sign, sets.slip_sign),
    )
    return ContactStatus(closed, stuck, slip_sign)
