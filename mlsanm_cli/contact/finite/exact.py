"""Exact contact at finite strain with Coulomb friction, by Newton's method for bodies and contacts together.
Equations (22) and (26) of docs/method.md."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray, runs_of
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.finite.contacts import Contacts, ContactSystem
from mlsanm_cli.contact.finite.iteration import Iteration, Responses
from mlsanm_cli.contact.finite.node_curve import wrapped
from mlsanm_cli.contact.finite.pair import Meeting
from mlsanm_cli.mechanics.finite.stability import STILL, SoftMotion
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

MIN_JACOBIAN = 0.05
"""Updates are shortened until det F exceeds this everywhere."""
MAX_STALLED = 3
"""Iterations without a smaller update after which an increment is abandoned, once there are twice as many."""
MAX_UPDATE = 100.0
"""Updates beyond this many typical displacements abandon an increment: a body whose contacts open by more
than it may roll at once is held by nothing."""
REUSE_BELOW, REUSE_RATE = 1e-3, 0.1
"""Derivatives of the bodies are reused after an update below REUSE_BELOW times the typical displacement, as
long as updates shrink by REUSE_RATE or better."""
INITIAL_OVERLAP = 1e-3
"""Penetration allowed to a free body that falls on something, over the typical displacement."""


@dataclass(frozen=True)
class FiniteContactState:
    """A state in contact: ``displacement`` (2N,) of all bodies in turn; at the slaves' knots of all contacts
    nominal ``pressure``, friction ``shear``, ``gap``, ``place`` and ``slip`` (c,), and ``normal`` (c, 2);
    ``traction`` (2s,) and displacements ``surface`` (2s,) at the knots of all sides in turn; the ``free``
    motions (d,). ``residual`` is the estimated next update over the typical displacement, ``soft`` the
    softest motion with contacts that neither open nor close. ``dragged`` (c,) are the slips in the whole
    increment, also before knots touch."""

    displacement: FloatArray
    pressure: FloatArray
    shear: FloatArray
    gap: FloatArray
    free: FloatArray
    sets: ContactStatus
    place: FloatArray
    slip: FloatArray
    normal: FloatArray
    traction: FloatArray
    surface: FloatArray
    residual: float = 0.0
    iterations: int = 0
    factorizations: int = 0
    solves: int = 0
    stability: float = np.inf
    soft: SoftMotion = STILL
    dragged: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def status(self) -> NDArray[np.int8]:
        """OPEN, STICK or SLIP of all knots (c,)."""
        return self.sets.status(np.arange(len(self.sets.closed)))


class ExactContact(ContactSystem):
    """Exact contact of bodies, solved at given loads."""

    def solved(
        self,
        start: FiniteContactState,
        factors: FloatArray,
        tolerance: float,
        most: int,
        before: FloatArray | None,
        closed_before: BoolArray,
    ) -> FiniteContactState | None:
        """The state at load ``factors`` (L,), searched from ``start``, with slips relative to the places
        ``before`` (c,), where knots were closed (c,). None if ``most`` iterations do not converge. Raises
        LinAlgError or NumericalError for singular derivatives."""
        u, p, q, sets, solves = start.displacement, start.pressure, start.shear, start.sets, 0
        free, given = start.free, factors
        traction, updates, spent = start.traction, [np.inf], 0
        responses: Responses | None = None
        since = before
        for count in range(1, most + 1):
            factors = np.concatenate([given, free])
            response = self.response(u, traction)
            met = self.contacts.meet(response.moved(u, traction), factors, since, closed_before)
            # After slow convergence, as of thin bodies in rotation, derivatives are not reused.
            slow = len(updates) > 2 and updates[-1] > REUSE_RATE * updates[-2]
            known = responses if updates[-1] <= REUSE_BELOW and not slow else None
            args = (self, factors, response, u, traction, p, q, sets, met)
            step = Iteration(*args, first=count == 1, known=known)
            spent += 0 if known else len(self.projectors)
            solves, responses = solves + step.solves, step.responses
            part = self._until_touch(met, step)
            while part > 1e-3:
                ahead = u + part * step.du
                volumes = (one.body.least_volume(ahead[self.bodies[k]]) for k, one in self.projectors.items())
                if min(volumes) > MIN_JACOBIAN:
                    break
                part *= 0.5
            u, p, q = u + part * step.du, p + part * step.dp, q + part * step.dq
            free = free + part * step.free
            traction = traction + part * step.traction
            # At light touch the status of nodes is decided by round-off and may be ignored.
            still = max(float(np.abs(one).max(initial=0.0)) for one in (step.dp, step.dq)) <= self.nothing
            settled = count > 1 and (still or step.sets.key == sets.key)
            sets = step.sets
            last = float(np.abs(step.du).max()) / self.length
            recent, past = updates[1 - MAX_STALLED :], updates[: 1 - MAX_STALLED]
            stalls = len(updates) > 2 * MAX_STALLED and min(*recent, last) >= min(past)
            if stalls or not part * last <= MAX_UPDATE:
                return None
            # Estimated next update, assuming the same rate of convergence.
            left = last * min(1.0, last / updates[-1]) if last else 0.0
            updates.append(last)
            if part == 1.0 and settled and left <= REUSE_BELOW and since is before and before is not None:
                # Once: what knots outside have moved by hardly depends on it.
                touched = self._touched(before, met, closed_before, sets.closed)
                if not np.array_equal(touched, before):
                    since, updates = touched, [np.inf]
                    continue
            if part == 1.0 and settled and left <= tolerance:
                break
        else:
            return None
        factors, surface = np.concatenate([given, free]), response.moved(u, traction)
        met = self.contacts.meet(surface, factors, since, closed_before)
        whole = met if since is before else self.contacts.meet(surface, factors, before, closed_before)
        p, q = np.where(sets.closed, p, 0.0), np.where(sets.closed, q, 0.0)
        return FiniteContactState(
            *(u, p, q, met.gap, free, sets, met.place, met.slip, met.normal),
            *(met.tractions(p, q), surface, left, count, spent, solves),
            stability=step.stability(met),
            soft=step.softest(u, p, q),
            dragged=whole.slip,
        )

    def _touched(self, before: FloatArray, met: Meeting, closed: BoolArray, now: BoolArray) -> FloatArray:
        """The places ``before`` (c,) from which slips count: for knots that were not ``closed`` (c,), but are
        ``now`` (c,), where they have touched. Until then they have moved as open knots next to them do."""
        found = before.copy()
        for contact, here, _ in self.contacts.each:
            if contact.friction:
                slave, after = contact.slave, now[here]
                part, beside = touching(slave.weight, closed[here], after, slave.around is not None)
                moved = wrapped(met.place[here] - before[here], contact.around)[beside]
                found[here] += np.where(met.facing[here][beside] & ~after[beside], part * moved, 0.0)
        return found

    def _until_touch(self, met: Meeting, step: Iteration) -> float:
        """Fraction of an update after which a body that nothing holds meets something."""
        if not self.contacts.free or step.sets.closed.any():
            return 1.0
        moved = self.onto @ step.du
        for driven in self.contacts.driven:
            moved[self.contacts.pushing(driven)] -= step.free[driven.number]
        falls = -(met.d_gap @ moved)
        near = met.facing & (falls > 0.0) & (met.gap > 0.0)
        ways = (met.gap[near] + INITIAL_OVERLAP * self.length) / falls[near]
        return min(1.0, float(ways.min(initial=1.0)))


def undeformed(unknowns: int, contacts: Contacts) -> FiniteContactState:
    """The undeformed state of bodies with ``unknowns`` unknowns."""
    none, zero = np.zeros(len(contacts.weight)), np.zeros(contacts.size)
    sets = ContactStatus(none > 0.0, none > 0.0, none)
    known = np.zeros(unknowns), none, none, none, np.zeros(contacts.free), sets
    return FiniteContactState(*known, none, none, np.zeros((len(none), 2)), zero, zero)


def touching(
    length: FloatArray, before: BoolArray, now: BoolArray, around: bool
) -> tuple[FloatArray, IntArray]:
    """Parts (c,) of an increment after which knots of a ``length`` (c,) touch, 0 for those that were closed
    ``before`` it (c,) as well, and the open knots (c,) next to which they enter the contact, themselves if
    there are none. The ends of contact move evenly from where they were to where they are ``now`` (c,); the
    knots of a patch in which none was closed count as closed from the start. Contacts ``around`` a body
    continue from the last knot to the first."""
    count = len(length)
    part, beside = np.zeros(count), np.arange(count)
    if not (now & ~before).any() or now.all():
        return part, beside
    order = np.roll(np.arange(count), -int(np.argmin(now)) if around else 0)
    closed, known = now[order], (before & now)[order]
    ends = np.concatenate([[0.0], np.cumsum(length[order])])
    middle = 0.5 * (ends[1:] + ends[:-1])
    for first, last in runs_of(closed).tolist():
        old = first + np.flatnonzero(known[first:last])
        if not len(old):
            continue
        low, high = int(old[0]), int(old[-1]) + 1
        sides = ((first, low, low, first, first - 1), (high, last, high, last, last))
        for begin, end, was, reached, outer in sides:
            some, open_knot = np.arange(begin, end), outer % count
            if len(some) and (around or open_knot == outer):
                part[order[some]] = (middle[some] - ends[was]) / (ends[reached] - ends[was])
                beside[order[some]] = order[open_knot]
    return part, beside


def dissipated(
    friction: FloatArray, now: FiniteContactState, found: FiniteContactState, pressure: FloatArray
) -> FloatArray:
    """Work (c,) per length that ``friction`` (c,) dissipates in an increment under ``pressure`` (c,): nodes
    slip at the limit of friction only, whatever they carried before. Those that enter or leave the contact
    count with the slip of the increment under half of the pressure that they have in it."""
    closed = found.sets.closed | now.sets.closed
    way = np.abs(np.where(found.sets.stuck, found.slip, found.dragged))
    return np.asarray(np.where(closed, friction * pressure * way, 0.0))


def slides(now: FiniteContactState, found: FiniteContactState, here: slice) -> bool:
    """Whether all closed nodes of a contact slide in one direction before and after the increment."""
    senses, least = [], COARSE_ROUND_OFF * float(found.pressure[here].max())
    for state in (now, found):
        # Nodes without pressure have no history of friction.
        closed, sense, sets = state.pressure[here] > least, state.sets.slip_sign[here], state.sets
        slips = sets.closed[here] & ~sets.stuck[here]
        senses += np.where(slips[closed], sense[closed], 0.0).tolist()
    return len(set(senses)) == 1 and senses[0] != 0.0
