"""Bodies in contact at finite strain, the quantities a Newton step is computed from, and its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.finite.answers import Answer
from mlsanm_cli.contact.finite.free import DrivenObstacle, LooseMotions, Plate
from mlsanm_cli.contact.finite.meeting import Meeting
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.response.coercivity import constrained_resistance
from mlsanm_cli.mechanics.finite.projector import Factorised, Projector

AnyContact: TypeAlias = RigidContact | BodyContact
ZERO_PRESSURE = 1e-12
"""Pressures below this fraction of that of the typical displacement are zero."""


@dataclass(frozen=True)
class ContactSystem:
    """Contacts of bodies with ``projectors`` by name, whose last loads are unit tractions, x and y of every
    node of their sides, in the order of the contacts.

    ``length`` is the typical displacement; ``stiffness`` converts gaps to pressures in the initial guess. The
    motions of ``loose`` bodies, ``driven`` obstacles and ``plates`` (d,) are load factors after those of the
    case. ``answers`` are the near-field corrections of all sides.
    """

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
        """Pressures up to this are zero."""
        return ZERO_PRESSURE * self.stiffness * self.length

    @property
    def free(self) -> int:
        """Number of unknown motions (d)."""
        plates = sum(len(one.components) for one in self.plates)
        return sum(one.count for one in self.loose) + len(self.driven) + plates

    @cached_property
    def firsts(self) -> dict[str, int]:
        """Index of every body's first displacement."""
        sizes = [one.body.unknowns for one in self.projectors.values()]
        return dict(zip(self.projectors, np.cumsum([0, *sizes]).tolist(), strict=False))

    @cached_property
    def numbers(self) -> IntArray:
        """Indices (2s,) of all sides' nodal displacements among those of all bodies."""
        found = [
            self.firsts[side.body] + (2 * side.nodes[:, None] + np.arange(2)).ravel() for side in self.sides
        ]
        return np.concatenate([*found, np.zeros(0, dtype=np.int64)])

    @cached_property
    def columns(self) -> dict[str, IntArray]:
        """Indices of each body's tractions among those of all sides (2s,)."""
        found: dict[str, list[IntArray]] = {name: [] for name in self.projectors}
        first = 0
        for side in self.sides:
            found[side.body].append(first + np.arange(2 * side.count))
            first += 2 * side.count
        return {name: np.concatenate([*some, np.zeros(0, dtype=np.int64)]) for name, some in found.items()}

    @cached_property
    def friction(self) -> FloatArray:
        """Friction coefficients at the slaves' nodes (c,); zero at held ones, as at a plane of symmetry: a
        node that cannot slip has undetermined friction."""
        found = [np.where(one.slave.held, 0.0, one.friction) for one in self.contacts]
        return np.concatenate([*found, np.zeros(0)])

    @cached_property
    def sides(self) -> list[ContactSide]:
        """The sides of all contacts in turn."""
        return [side for contact in self.contacts for side in contact.sides]

    def tractions(self, met: Sequence[Meeting], pressure: FloatArray, shear: FloatArray) -> FloatArray:
        """Tractions (2s,) at the nodes of all sides for the slaves' pressures and friction (c,)."""
        parts = [
            one.tractions(pressure[here], shear[here]).ravel()
            for one, here in zip(met, self.places, strict=True)
        ]
        return np.concatenate([*parts, np.zeros(0)])

    @cached_property
    def places(self) -> list[slice]:
        """Range of every contact's slave nodes among those of all contacts."""
        ends = np.cumsum([0, *(one.slave.count for one in self.contacts)]).tolist()
        return [slice(first, last) for first, last in pairwise(ends)]


@dataclass(frozen=True)
class Done:
    """Result of an iteration: updates of displacements, pressures, friction and ``free`` motions, and
    ``sets`` of all nodes.

    ``chosen`` (k,) are the nodes that might touch, with their ``compliance`` (k, k), gaps per pressure of
    fixed direction: the resistance of the body itself, without load stiffness. Pressures with ``unbalanced``
    (d, k) forces on floating bodies are excluded from the stability. ``used`` can be reused nearby.
    """

    du: FloatArray
    dp: FloatArray
    dq: FloatArray
    free: FloatArray
    traction: FloatArray
    sets: NodeSets
    chosen: IntArray
    compliance: FloatArray
    unbalanced: FloatArray
    solves: int
    settled: bool
    used: Used

    def stability(self, pressing: ContactSystem, met: Sequence[Meeting]) -> float:
        """Least resistance of a contact with closed nodes, at closed nodes between two others, to pressures
        that oscillate from node to node; held nodes are excluded."""
        least = np.inf
        number = np.full(len(self.sets.status), -1, dtype=np.int64)
        number[self.chosen] = np.arange(len(self.chosen))
        for contact, one, here in zip(pressing.contacts, met, pressing.places, strict=True):
            own = self.sets.closed[here] & ~contact.slave.held
            inner = own[1:-1] & own[:-2] & own[2:]
            some = 1 + np.flatnonzero(inner) if inner.any() else np.flatnonzero(own)
            soft = sum(
                pressing.projectors[side.body].body.elastic.model.material.contact_compliance(
                    one.normal[some]
                )
                for side in contact.sides
            )
            place = number[here][some]
            part = self.compliance[np.ix_(place, place)]
            weight = contact.slave.weight[some]
            resistance = constrained_resistance(weight, np.diag(soft), part, self.unbalanced[:, place])
            least = min(least, resistance)
        return least


@dataclass(frozen=True)
class Used:
    """The bodies' ``factorised`` derivatives, and their ``answers`` to the ``touched`` (t,) tractions."""

    factorised: Mapping[str, Factorised]
    touched: IntArray
    answers: Mapping[str, Responses]


@dataclass(frozen=True)
class Responses:
    """Displacements of a body due to its ``own`` (k,) of the touched tractions, (2n, k), and its free
    ``moves`` (d,), (2n, d); ``pieces`` (3k, k + d) is the direct imbalance of pieces by both."""

    own: IntArray
    by_traction: FloatArray
    moves: IntArray
    by_motion: FloatArray
    pieces: sparse.csr_array


@dataclass(frozen=True)
class Imbalance:
    """Force imbalance ``now`` (d,), and its derivatives by touched tractions (d, t) and by free motions (d,
    d)."""

    now: FloatArray
    by_traction: FloatArray
    by_motion: FloatArray
