"""Exact contact at finite strain, p >= 0, h >= 0, p h = 0, with Coulomb friction, by Newton's method for
bodies and contacts together.

Every iteration factorises the bodies' derivatives and condenses them to the tractions T at the knots that may
touch: U = U_0 + z + C dT, with C by near fields where clouds do not resolve tractions. Tractions depend on
pressures and friction and rotate with the displacements, dT = B (dp, dq) + K dU, so that dT = (1 - K C)^-1
(B (dp, dq) + K z); an active set determines dp and dq.

Equation (26) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.contact.finite.meeting import Meeting
from mlsanm_cli.contact.finite.node_curve import wrapped
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.contact.finite.side_response import SideResponse
from mlsanm_cli.contact.finite.touching import touching
from mlsanm_cli.contact.finite.update import Contacts, ContactSystem, IterationResult, Responses
from mlsanm_cli.mechanics.finite.stability import STILL, SoftMotion
from mlsanm_cli.records import dataclass

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
"""Initial penetration allowed to a free body that falls on something, as a fraction of the typical
displacement."""


@dataclass(frozen=True)
class FiniteContactState:
    """A state in contact.

    ``displacement`` (2N,) of all bodies in turn; at the slaves' knots of all contacts nominal ``pressure``,
    friction ``shear``, ``gap``, ``place`` and ``slip`` (c,), ``normal`` (c, 2) and ``sets``; ``traction``
    (2s,) at the knots of all sides in turn and their displacements ``surface`` (2s,), with near
    fields; the ``free`` motions (d,). ``residual`` is the estimated next update over the typical
    displacement, ``stability`` the least resistance of a contact to pressures that oscillate from knot to
    knot, ``soft`` the softest motion with contacts that neither open nor close. ``dragged``
    (c,) are the slips in the whole increment, also before knots touch.
    """

    displacement: FloatArray
    pressure: FloatArray
    shear: FloatArray
    gap: FloatArray
    place: FloatArray
    slip: FloatArray
    normal: FloatArray
    sets: NodeSets
    traction: FloatArray
    surface: FloatArray
    free: FloatArray
    residual: float
    iterations: int
    factorizations: int
    solves: int
    stability: float = np.inf
    soft: SoftMotion = STILL
    dragged: FloatArray = field(default_factory=lambda: np.zeros(0))


class ExactContact(ContactSystem):
    """Exact contact of bodies, solved at given loads."""

    def meet(
        self, surface: FloatArray, factors: FloatArray, before: FloatArray | None, closed: BoolArray
    ) -> tuple[Meeting, ...]:
        """All contacts for displacements ``surface`` (2s,) of the sides; slips are relative to the places
        ``before`` (c,), zero without; ``closed`` (c,) is the earlier status."""
        return tuple(
            contact.meet(
                surface[there].reshape(-1, 2), factors, None if before is None else before[here], closed[here]
            )
            for contact, here, there in self.contacts.each
        )

    def _touched(
        self, before: FloatArray | None, met: Sequence[Meeting], closed: BoolArray, now: BoolArray
    ) -> FloatArray | None:
        """The places ``before`` (c,) from which slips count: for knots that were not ``closed`` (c,), but are
        ``now`` (c,), where they have touched. Until then they have moved as open knots next to them do."""
        if before is None:
            return None
        found = before.copy()
        for one, (contact, here, _) in zip(met, self.contacts.each, strict=True):
            if contact.friction:
                slave = contact.slave
                part, beside = touching(slave.weight, closed[here], now[here], slave.around is not None)
                moved = wrapped(one.place - before[here], contact.around)[beside]
                found[here] += np.where(one.facing[beside] & ~now[here][beside], part * moved, 0.0)
        return found

    def solved(
        self,
        start: FiniteContactState,
        factors: FloatArray,
        tolerance: float,
        most: int,
        before: FloatArray | None = None,
        earlier: BoolArray | None = None,
    ) -> FiniteContactState | None:
        """The state at load ``factors`` (L,), searched from ``start``, with slips relative to the places
        ``before`` (c,), where knots were closed ``earlier`` (c,), by default in ``start``. None if ``most``
        iterations do not converge. Raises LinAlgError or NumericalError for singular derivatives."""
        touching_before = start.sets.closed if earlier is None else earlier
        u, p, q, sets, solves = start.displacement, start.pressure, start.shear, start.sets, 0
        free, given = start.free, factors
        settled, traction, updates, spent = False, start.traction, [np.inf], 0
        responses: Responses | None = None
        since = before
        for count in range(1, most + 1):
            factors = np.concatenate([given, free])
            response = SideResponse.of(self.contacts.sides, self.missing, self.onto, u, traction)
            surface = response.moved(u, traction)
            met = self.meet(surface, factors, since, touching_before)
            args = (u, traction, p, q, sets, met)
            # After slow convergence, as of thin bodies in rotation, derivatives are not reused.
            slow = len(updates) > 2 and updates[-1] > REUSE_RATE * updates[-2]
            close = responses if updates[-1] <= REUSE_BELOW and not slow else None
            result = Iteration(self, factors, response, close).taken(*args, first=count == 1)
            spent += 0 if close else len(self.projectors)
            solves, responses = solves + result.solves, result.responses
            part = self._until_touch(met, result)
            while part > 1e-3 and not self._volume(u + part * result.du) > MIN_JACOBIAN:
                part *= 0.5
            u, p, q = u + part * result.du, p + part * result.dp, q + part * result.dq
            free = free + part * result.free
            traction = traction + part * result.traction
            # At light touch the status of nodes is decided by round-off and may be ignored.
            still = max(float(np.abs(one).max(initial=0.0)) for one in (result.dp, result.dq)) <= self.nothing
            settled = count > 1 and (still or result.sets.same(sets))
            sets = result.sets
            last = float(np.abs(result.du).max()) / self.length
            if not part * last <= MAX_UPDATE or _stalls(updates, last):
                return None
            # Estimated next update, assuming the same rate of convergence.
            left = last * min(1.0, last / updates[-1]) if last else 0.0
            updates.append(last)
            if part == 1.0 and settled and left <= REUSE_BELOW and since is before:
                # Once: what knots outside have moved by hardly depends on it.
                touched = self._touched(before, met, touching_before, sets.closed)
                if touched is not None and before is not None and not np.array_equal(touched, before):
                    since, updates = touched, [np.inf]
                    continue
            if part == 1.0 and settled and left <= tolerance:
                counts = (left, count, spent, solves)
                surface = response.moved(u, traction)
                met = self.meet(surface, np.concatenate([given, free]), since, touching_before)
                state = self._state(u, p, q, sets, met, surface, free, counts, result)
                if since is before:
                    return state
                whole = self.meet(surface, np.concatenate([given, free]), before, touching_before)
                return replace(state, dragged=np.concatenate([one.slip for one in whole]))
        return None

    def _until_touch(self, met: Sequence[Meeting], result: IterationResult) -> float:
        """Fraction of an update after which a body that nothing holds meets something: the full update would
        penetrate it, as hardly anything resists."""
        if not self.contacts.free or result.sets.closed.any():
            return 1.0
        least = 1.0
        for place, (one, (contact, _, there)) in enumerate(zip(met, self.contacts.each, strict=True)):
            moved = (self.onto @ result.du)[there]
            for driven in (some for some in self.contacts.driven if some.contact == place):
                moved[driven.component : 2 * contact.slave.count : 2] -= result.free[driven.number]
            falls = -(one.d_gap @ moved)
            near = one.facing & (falls > 0.0) & (one.gap > 0.0)
            ways = (one.gap[near] + INITIAL_OVERLAP * self.length) / falls[near]
            least = min(least, float(ways.min(initial=1.0)))
        return least

    def _volume(self, u: FloatArray) -> float:
        return min(one.body.least_volume(u[self.bodies[name]]) for name, one in self.projectors.items())

    def _state(
        self,
        u: FloatArray,
        p: FloatArray,
        q: FloatArray,
        sets: NodeSets,
        met: Sequence[Meeting],
        surface: FloatArray,
        free: FloatArray,
        counts: tuple[float, int, int, int],
        result: IterationResult,
    ) -> FiniteContactState:
        p, q = np.where(sets.closed, p, 0.0), np.where(sets.closed, q, 0.0)
        gap, place, slip = (
            np.concatenate([*(getattr(one, name) for one in met), np.zeros(0)])
            for name in ("gap", "place", "slip")
        )
        normal = np.concatenate([*(one.normal for one in met), np.zeros((0, 2))])
        traction = self.contacts.tractions(met, p, q)
        stable = result.stability(self, met)
        args = (u, p, q, gap, place, slip, normal, sets, traction, surface, free)
        soft = result.linearised.softest(u, p, q, sets.status)
        return FiniteContactState(*args, *counts, stable, soft, slip)


def _stalls(updates: Sequence[float], last: float) -> bool:
    """Whether the ``last`` and earlier updates have not decreased for MAX_STALLED iterations."""
    return len(updates) > 2 * MAX_STALLED and min(*updates[1 - MAX_STALLED :], last) >= min(
        updates[: 1 - MAX_STALLED]
    )


def undeformed(unknowns: int, contacts: Contacts) -> FiniteContactState:
    """The undeformed state of bodies with ``unknowns`` unknowns."""
    none, zero = np.zeros(contacts.count), np.zeros(contacts.size)
    sets = NodeSets(none.astype(np.int8), none)
    args = (sets, zero, zero, np.zeros(contacts.free), 0.0, 0, 0, 0)
    return FiniteContactState(
        np.zeros(unknowns), none, none, none, none, none, np.zeros((len(none), 2)), *args
    )
