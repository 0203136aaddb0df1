"""Bodies in contact at finite strain, the quantities a Newton step is computed from, and its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.finite.free import DrivenObstacle, LooseMotions, Plate
from mlsanm_cli.contact.finite.meeting import Meeting
from mlsanm_cli.contact.finite.pair import BodyContact
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.contact.finite.sets import NodeSets
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.response.coercivity import constrained_resistance
from mlsanm_cli.mechanics.finite.projector import Factorised, Projector
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

if TYPE_CHECKING:
    from mlsanm_cli.contact.finite.linearised import Linearised

AnyContact: TypeAlias = RigidContact | BodyContact


@dataclass(frozen=True)
class Contacts:
    """The contacts of a scene, ``pairs`` of sides with knots, and its unknown motions (d,), load factors
    after those of the case: of ``loose`` bodies, ``driven`` obstacles and ``plates``."""

    pairs: tuple[AnyContact, ...] = ()
    loose: tuple[LooseMotions, ...] = ()
    driven: tuple[DrivenObstacle, ...] = ()
    plates: tuple[Plate, ...] = ()

    @property
    def free(self) -> int:
        """Number of unknown motions (d)."""
        plates = sum(len(one.components) for one in self.plates)
        return sum(one.count for one in self.loose) + len(self.driven) + plates

    def moving(self, body: str) -> IntArray:
        """The unknown motions that move a body."""
        found = [one.numbers for one in self.loose if one.body == body]
        found += [one.numbers for one in self.plates if body in one.surfaces]
        return np.concatenate([*found, np.zeros(0, dtype=np.int64)])

    @cached_property
    def each(self) -> list[tuple[AnyContact, slice, slice]]:
        """Every contact, the range of its slave's knots among those of all slaves (c,), and of the components
        of the knots of its sides among those of all sides (2s,)."""
        nodes = np.cumsum([0, *(one.slave.count for one in self.pairs)]).tolist()
        sides = np.cumsum([0, *(2 * sum(side.count for side in one.sides) for one in self.pairs)]).tolist()
        return [
            (one, slice(*here), slice(*there))
            for one, here, there in zip(self.pairs, pairwise(nodes), pairwise(sides), strict=True)
        ]

    @cached_property
    def sides(self) -> list[tuple[ContactSide, slice]]:
        """Every side, and the range of the components of its knots among those of all sides (2s,)."""
        sides = [side for contact in self.pairs for side in contact.sides]
        ends = np.cumsum([0, *(2 * side.count for side in sides)]).tolist()
        return [(side, slice(*here)) for side, here in zip(sides, pairwise(ends), strict=True)]

    @property
    def count(self) -> int:
        """Number of the knots of all slaves (c)."""
        return sum(one.slave.count for one in self.pairs)

    @property
    def size(self) -> int:
        """Number of the components of the knots of all sides (2s)."""
        return sum(2 * side.count for side, _ in self.sides)

    @cached_property
    def friction(self) -> FloatArray:
        """Friction coefficients at the slaves' knots (c,); zero at held ones, as at a plane of symmetry: a
        knot that cannot slip has undetermined friction."""
        found = [np.where(one.slave.held, 0.0, one.friction) for one in self.pairs]
        return np.concatenate([*found, np.zeros(0)])

    @cached_property
    def weight(self) -> FloatArray:
        """Lengths (c,) of the slaves' knots."""
        return np.concatenate([*(one.slave.weight for one in self.pairs), np.zeros(0)])

    def spread(self, body: str) -> sparse.csr_array:
        """Nodal tractions (t, 2s) of a body's sides by those at all sides' knots."""
        rows = [side.spread if side.body == body else side.spread[:0] for side, _ in self.sides]
        return sparse.csr_array(sparse.block_diag([sparse.csr_array((0, 0)), *rows], format="csr"))

    def tractions(self, met: Sequence[Meeting], pressure: FloatArray, shear: FloatArray) -> FloatArray:
        """Tractions (2s,) at the knots of all sides for the slaves' pressures and friction (c,)."""
        parts = [
            one.tractions(pressure[here], shear[here]).ravel()
            for one, (_, here, _) in zip(met, self.each, strict=True)
        ]
        return np.concatenate([*parts, np.zeros(0)])


@dataclass(frozen=True)
class ContactSystem:
    """``contacts`` of bodies with ``projectors`` by name, whose last loads are unit tractions, x and y of
    every node of their sides, in the order of the contacts.

    ``length`` is the typical displacement; ``stiffness`` converts gaps to pressures in the initial guess.
    ``missing`` (2s, 2s) are the sides' displacements beyond the clouds'.
    """

    projectors: Mapping[str, Projector]
    contacts: Contacts
    length: float
    stiffness: float
    missing: FloatArray

    @property
    def nothing(self) -> float:
        """Pressures up to this are zero."""
        return FINE_ROUND_OFF * self.stiffness * self.length

    @cached_property
    def bodies(self) -> dict[str, slice]:
        """Range of every body's displacements."""
        ends = np.cumsum([0, *(one.body.unknowns for one in self.projectors.values())]).tolist()
        return {name: slice(*here) for name, here in zip(self.projectors, pairwise(ends), strict=True)}

    @cached_property
    def onto(self) -> sparse.csr_array:
        """Smooth displacements (2s, 2N) of all sides' knots by those of all bodies' nodes."""
        parts = []
        for side, _ in self.contacts.sides:
            rows = side.onto.tocoo()
            line, column = rows.coords
            at = (line, self.bodies[side.body].start + side.nodes.unknowns[column])
            parts.append(sparse.csr_array((rows.data, at), shape=(rows.shape[0], self.unknowns)))
        return sparse.csr_array(sparse.vstack([sparse.csr_array((0, self.unknowns)), *parts], format="csr"))

    @property
    def unknowns(self) -> int:
        """Number 2N of displacements of all bodies."""
        return sum(one.body.unknowns for one in self.projectors.values())

    @cached_property
    def spread(self) -> dict[str, sparse.csr_array]:
        """Nodal tractions (t, 2s) of each body's sides by those at all sides' knots."""
        return {name: self.contacts.spread(name) for name in self.projectors}

    @cached_property
    def columns(self) -> dict[str, IntArray]:
        """Indices of each body's tractions among those of all sides (2s,)."""
        found = {name: [np.zeros(0, dtype=np.int64)] for name in self.projectors}
        for side, here in self.contacts.sides:
            found[side.body].append(np.arange(here.start, here.stop))
        return {name: np.concatenate(some) for name, some in found.items()}


@dataclass(frozen=True)
class Responses:
    """Derivatives of the bodies, by name, which can be reused nearby: their ``factorised`` equations, and
    their responses to the ``touched`` (t,) tractions and the d free motions. A body is moved (2n, k) by those
    in its ``columns`` (k,), tractions first; ``pieces`` (3p, k) is the direct imbalance of its pieces.
    They took a number of ``solves``."""

    factorised: Mapping[str, Factorised]
    touched: IntArray
    solves: int
    columns: Mapping[str, IntArray] = field(default_factory=dict)
    moved: Mapping[str, FloatArray] = field(default_factory=dict)
    pieces: Mapping[str, sparse.csr_array] = field(default_factory=dict)


@dataclass(frozen=True)
class IterationResult:
    """Result of an iteration: updates of displacements, pressures, friction and ``free`` motions, and
    ``sets`` of all nodes.

    ``chosen`` (k,) are the nodes that might touch, with their ``compliance`` (k, k), gaps per pressure of
    fixed direction: the resistance of the body itself, without load stiffness. Pressures with ``unbalanced``
    (d, k) forces on floating bodies are excluded from the stability. ``linearised`` are the equations
    solved.
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
    responses: Responses
    linearised: Linearised

    def stability(self, system: ContactSystem, met: Sequence[Meeting]) -> float:
        """Least resistance of a contact with closed nodes, at closed nodes between two others, to pressures
        that oscillate from node to node; held nodes are excluded."""
        least = np.inf
        number = np.full(len(self.sets.status), -1, dtype=np.int64)
        number[self.chosen] = np.arange(len(self.chosen))
        for one, (contact, here, _) in zip(met, system.contacts.each, strict=True):
            own = self.sets.closed[here] & ~contact.slave.held
            inner = own[1:-1] & own[:-2] & own[2:]
            some = 1 + np.flatnonzero(inner) if inner.any() else np.flatnonzero(own)
            soft = sum(
                system.projectors[side.body].body.elastic.model.material.contact_compliance(one.normal[some])
                for side in contact.sides
            )
            place = number[here][some]
            part = self.compliance[np.ix_(place, place)]
            weight = contact.slave.weight[some]
            resistance = constrained_resistance(weight, np.diag(soft), part, self.unbalanced[:, place])
            least = min(least, resistance)
        return least
