"""Exact contact at finite strain, p >= 0, h >= 0, p h = 0, with Coulomb friction, by Newton's method on
bodies and contacts together.

Every iteration factorises the bodies' derivatives and condenses them on the tractions T at the nodes that
may touch: U = U_0 + z + C dT, C with what clouds do not resolve of it. Tractions go with pressures and
friction and turn with the displacements, dT = B (dp, dq) + K dU, so that
dT = (1 - K C)^-1 (B (dp, dq) + K z); an active set finds dp and dq.

Equation (28) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.finite.answers import Answer, Closer
from mlsanm_cli.contact.finite.free import DrivenObstacle, LooseMotions, Plate
from mlsanm_cli.contact.finite.iteration import Iteration
from mlsanm_cli.contact.finite.meeting import Meeting
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.finite.update import Done, Used
from mlsanm_cli.mechanics.finite.projector import Projector

AnyContact: TypeAlias = RigidContact | BodyContact
MIN_JACOBIAN = 0.05
"""Updates are shortened until det F is above this everywhere."""
MAX_STALLED = 3
"""Iterations without a smaller update after which an increment fails; from twice as many on."""
REUSE_BELOW, REUSE_RATE = 1e-3, 0.1
"""Derivatives of the bodies before an update of at most this part of the typical displacement are good enough
behind it: the next updates shrink by about as much, or else by less than this factor."""
INITIAL_OVERLAP = 1e-3
"""Initial penetration, relative to the typical displacement, of a body that falls onto another."""
ZERO_PRESSURE = 1e-12
"""Pressures below this part of those of the typical displacement are zero."""


@dataclass(frozen=True)
class Pressed:
    """A state in contact: ``displacement`` (2N,) of all bodies in turn; at the slaves' nodes of all contacts
    nominal ``pressure`` and ``shear`` of friction (c,), ``gap``, ``place`` and ``slip`` (c,), ``normal``
    (c, 2) and what nodes do; ``traction`` (2s,) at the nodes of all sides in turn, which have moved by
    ``surface`` (2s,), where their answers differ from the clouds'; the ``free`` motions (d,). ``residual`` is
    what the next update would be over the typical displacement, ``stability`` the least resistance of a
    contact to pressures that change from node to node."""

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


@dataclass(frozen=True)
class ExactContact:
    """Contacts of bodies with ``projectors`` by name, whose last loads are unit tractions, x and y of every
    node of their sides in turn, in the order of the contacts. ``length`` is the typical displacement;
    ``stiffness`` turns gaps into pressures, to guess what touches. The motions of ``loose`` bodies and of
    ``driven`` obstacles and ``plates`` (d,) are load factors behind those of the case. ``answers`` are those
    of all sides to their own tractions."""

    projectors: Mapping[str, Projector]
    contacts: Sequence[AnyContact]
    length: float
    stiffness: float
    loose: Sequence[LooseMotions] = ()
    driven: Sequence[DrivenObstacle] = ()
    plates: Sequence[Plate] = ()
    answers: Sequence[Answer] = ()

    @property
    def nothing(self) -> float:
        """Pressures up to this are none."""
        return ZERO_PRESSURE * self.stiffness * self.length

    @property
    def free(self) -> int:
        """Number of unknown motions (d)."""
        plates = sum(len(one.components) for one in self.plates)
        return sum(one.count for one in self.loose) + len(self.driven) + plates

    @cached_property
    def firsts(self) -> dict[str, int]:
        """Where every body's displacements begin."""
        sizes = [one.body.unknowns for one in self.projectors.values()]
        return dict(zip(self.projectors, np.cumsum([0, *sizes]).tolist(), strict=False))

    @cached_property
    def numbers(self) -> IntArray:
        """Where among the displacements of all bodies those of all sides' nodes (2s,) are."""
        found = [
            self.firsts[side.body] + (2 * side.nodes[:, None] + np.arange(2)).ravel() for side in self.sides
        ]
        return np.concatenate([*found, np.zeros(0, dtype=np.int64)])

    @cached_property
    def columns(self) -> dict[str, IntArray]:
        """By body, which tractions (2s,) of all sides are its own, in their order."""
        found: dict[str, list[IntArray]] = {name: [] for name in self.projectors}
        first = 0
        for side in self.sides:
            found[side.body].append(first + np.arange(2 * side.count))
            first += 2 * side.count
        return {name: np.concatenate([*some, np.zeros(0, dtype=np.int64)]) for name, some in found.items()}

    @cached_property
    def friction(self) -> FloatArray:
        """Coulomb's coefficient at the slaves' nodes (c,); none at held ones, as at the ends of a plane of
        symmetry: what cannot slip has no friction that could be known."""
        found = [np.where(one.slave.held, 0.0, one.friction) for one in self.contacts]
        return np.concatenate([*found, np.zeros(0)])

    @cached_property
    def sides(self) -> list[ContactSide]:
        """The sides of all contacts in turn."""
        return [side for contact in self.contacts for side in contact.sides]

    def meet(
        self, surface: FloatArray, factors: FloatArray, before: FloatArray | None, closed: BoolArray
    ) -> tuple[Meeting, ...]:
        """All contacts in a state of the sides' displacements ``surface`` (2s,); slips are from the places
        (c,) ``before``, or nothing; ``closed`` (c,) were these nodes."""
        found, first, node = [], 0, 0
        moved = surface.reshape(-1, 2)
        for contact in self.contacts:
            last = first + contact.slave.count
            own = moved[node : node + sum(side.count for side in contact.sides)]
            since = None if before is None else before[first:last]
            found.append(contact.meet(own, factors, since, closed[first:last]))
            first, node = last, node + len(own)
        return tuple(found)

    def solved(
        self,
        start: Pressed,
        factors: FloatArray,
        tolerance: float,
        most: int,
        before: FloatArray | None = None,
    ) -> Pressed | None:
        """The state at load ``factors`` (L,), searched from ``start``; slips are from the places ``before``
        (c,). None where ``most`` iterations do not settle. Raises LinAlgError or NumericalError for singular
        derivatives."""
        u, p, q, sets, solves = start.displacement, start.pressure, start.shear, start.sets, 0
        free, given = start.free, factors
        settled, traction, updates, spent = False, start.traction, [np.inf], 0
        used: Used | None = None
        for count in range(1, most + 1):
            factors = np.concatenate([given, free])
            closer = Closer.of(self.sides, self.answers, u[self.numbers], traction)
            surface = closer.moved(u[self.numbers], traction)
            met = self.meet(surface, factors, before, start.sets.closed)
            args = (u, traction, p, q, sets, met)
            # Thin bodies that turn may not forgive it.
            slow = len(updates) > 2 and updates[-1] > REUSE_RATE * updates[-2]
            close = used if updates[-1] <= REUSE_BELOW and not slow else None
            done = Iteration(self, factors, before, closer, close).taken(*args, first=count == 1)
            spent += 0 if close else len(self.projectors)
            solves, used = solves + done.solves, done.used
            part = self._until_touch(met, done)
            while part > 1e-3 and not self._volume(u + part * done.du) > MIN_JACOBIAN:
                part *= 0.5
            u, p, q = u + part * done.du, p + part * done.dp, q + part * done.dq
            free = free + part * done.free
            traction = traction + part * done.traction
            # Where bodies only just touch, round-off decides what nodes do.
            still = max(float(np.abs(one).max(initial=0.0)) for one in (done.dp, done.dq)) <= self.nothing
            settled = count > 1 and done.settled and (still or done.sets.same(sets))
            sets = done.sets
            last = float(np.abs(done.du).max()) / self.length
            if not np.isfinite(last) or _stalls(updates, last):
                return None
            # What is left shrinks at least as it did.
            left = last * min(1.0, last / updates[-1]) if last else 0.0
            updates.append(last)
            if part == 1.0 and settled and left <= tolerance:
                counts = (left, count, spent, solves)
                surface = closer.moved(u[self.numbers], traction)
                met = self.meet(surface, np.concatenate([given, free]), before, start.sets.closed)
                return self._state(u, p, q, sets, met, surface, free, counts, done)
        return None

    def _until_touch(self, met: Sequence[Meeting], done: Done) -> float:
        """How much of an update moves what nothing holds yet until it meets something: the whole would carry
        it through, as hardly anything resists."""
        if not self.free or done.sets.closed.any():
            return 1.0
        least, first = 1.0, 0
        for place, (contact, one) in enumerate(zip(self.contacts, met, strict=True)):
            last = first + 2 * sum(side.count for side in contact.sides)
            moved = done.du[self.numbers[first:last]]
            first = last
            for driven in (some for some in self.driven if some.contact == place):
                moved[driven.component : 2 * contact.slave.count : 2] -= done.free[driven.number]
            falls = -(one.d_gap @ moved)
            near = one.facing & (falls > 0.0) & (one.gap > 0.0)
            ways = (one.gap[near] + INITIAL_OVERLAP * self.length) / falls[near]
            least = min(least, float(ways.min(initial=1.0)))
        return least

    def _volume(self, u: FloatArray) -> float:
        parts = [
            one.body.least_volume(u[self.firsts[name] : self.firsts[name] + one.body.unknowns])
            for name, one in self.projectors.items()
        ]
        return min(parts)

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
        done: Done,
    ) -> Pressed:
        p, q = np.where(sets.closed, p, 0.0), np.where(sets.closed, q, 0.0)
        gap, place, slip = (
            np.concatenate([*(getattr(one, name) for one in met), np.zeros(0)])
            for name in ("gap", "place", "slip")
        )
        normal = np.concatenate([*(one.normal for one in met), np.zeros((0, 2))])
        traction = self.tractions(met, p, q)
        stable = done.stability(self, met)
        args = (u, p, q, gap, place, slip, normal, sets, traction, surface, free)
        return Pressed(*args, *counts, stable)

    def tractions(self, met: Sequence[Meeting], pressure: FloatArray, shear: FloatArray) -> FloatArray:
        """Tractions (2s,) at the nodes of all sides by the slaves' pressures and friction (c,)."""
        parts = [
            one.tractions(pressure[here], shear[here]).ravel()
            for one, here in zip(met, self.places, strict=True)
        ]
        return np.concatenate([*parts, np.zeros(0)])

    @cached_property
    def places(self) -> list[slice]:
        """Where every contact's slave nodes are among those of all."""
        ends = np.cumsum([0, *(one.slave.count for one in self.contacts)]).tolist()
        return [slice(first, last) for first, last in pairwise(ends)]


def _stalls(updates: Sequence[float], last: float) -> bool:
    """Whether the updates before the ``last`` one, and it, have become no smaller for MAX_STALLED of them."""
    return len(updates) > 2 * MAX_STALLED and min(*updates[1 - MAX_STALLED :], last) >= min(
        updates[: 1 - MAX_STALLED]
    )


def unpressed(unknowns: int, contacts: Sequence[AnyContact], free: int = 0) -> Pressed:
    """The state before loading of bodies with so many ``unknowns`` and ``free`` motions."""
    count = sum(one.slave.count for one in contacts)
    sides = sum(side.count for one in contacts for side in one.sides)
    none = np.zeros(count)
    sets = NodeSets(np.zeros(count, dtype=np.int8), none)
    still = np.zeros(unknowns)
    zero = np.zeros(2 * sides)
    args = (sets, zero, zero, np.zeros(free), 0.0, 0, 0, 0)
    return Pressed(still, none, none, none, none, none, np.zeros((count, 2)), *args)
