"""The contacts of a scene at finite strain, and its unknown rigid motions, load factors after those of the
case. A floating body is pinned at as many nodes as it has free motions; the factors move the pins, in
directions that rotate with the body, and the resultant force and moment on it, about held nodes, must vanish.
An obstacle's factors move it, and contact tractions balance its force; a plate's factors move the sides
bonded to it, whose stress balances its force and its moment about its hinge."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.contact.finite.pair import BodyContact, Meeting, RigidContact, diagonal
from mlsanm_cli.contact.finite.side_response import SideResponse
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.body_series import BodySeries
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import held_force
from mlsanm_cli.mechanics.near_field import ComplexArray
from mlsanm_cli.mechanics.rigid import ROTATION
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF

AnyContact: TypeAlias = RigidContact | BodyContact
NO_UNKNOWNS: IntArray = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class LooseMotions:
    """The free ``components`` (d) of a ``body``: 0 (x), 1 (y), 2 (rotation times its ``size``), unknowns
    ``numbers`` (d,). ``anchors`` are the (node, component) pairs held by supports, ``pins`` (p) those that
    hold the body, ``moves`` (p, d) their displacements per free motion."""

    body: str
    components: tuple[int, ...]
    numbers: IntArray
    size: float
    anchors: tuple[tuple[int, int], ...]
    pins: tuple[tuple[int, int], ...]
    moves: FloatArray

    def sums(
        self, body: FiniteBody, series: BodySeries, displacement: FloatArray
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (d, 3k) that sum the imbalance of pieces, and their change (d, 2N) by lever arms."""
        pieces, count = body.elastic.pieces, body.count
        middle = series.middle[0]
        center = middle.mean(axis=1)
        # A node held in x reacts along x only: its moment vanishes about points on that line alone.
        for node, component in self.anchors:
            other = 1 - component
            center[other] = body.elastic.model.cloud.points[node, other] + displacement[2 * node + other]
        arm = (middle - center[:, None]) / self.size
        none, ones = np.zeros(count), np.ones(count)
        turned = [-arm[1], arm[0], pieces.size / self.size * ones]
        every = [np.concatenate(row) for row in ([ones, none, none], [none, ones, none], turned)]
        rows = sparse.csr_array(np.array([every[component] for component in self.components]))
        imbalance = series.rows(0)[-3 * count :].reshape(3, count)[:2] / self.size
        moving = np.zeros((len(self.components), len(displacement)))
        if ROTATION in self.components:
            own, pull = moving[self.components.index(ROTATION)], imbalance @ body.centers
            own[::2], own[1::2] = pull[1], -pull[0]
            for node, component in self.anchors:
                sign = 1.0 if component == 0 else -1.0
                own[2 * node + 1 - component] += sign * imbalance[component].sum()
        return rows, sparse.csr_array(moving)


@dataclass(frozen=True)
class DrivenObstacle:
    """Unknown motion ``number``, a ``component``, of a ``contact``'s obstacle under a ``force`` (L,)."""

    contact: int
    component: int
    number: int
    force: FloatArray


@dataclass(frozen=True)
class Plate:
    """A rigid plate ``name``, moved by ``loads``, bonded to ``surfaces`` of bodies, with its hinge at
    ``center`` (2,) as drawn. Its unknown ``components``, as of floating bodies, are unknowns ``numbers``
    (k,). It is under a ``force`` and moment (3, L) per load factor; ``motion`` (3, L + d) is its displacement
    and rotation per load factor and free motion."""

    name: str
    surfaces: Mapping[str, tuple[str, ...]]
    loads: tuple[int, ...]
    center: FloatArray
    size: float
    components: tuple[int, ...]
    numbers: IntArray
    force: FloatArray
    motion: FloatArray

    def pulled(
        self, name: str, body: FiniteBody, displacement: FloatArray, factors: FloatArray
    ) -> tuple[FloatArray, sparse.csr_array]:
        """Force and moment about the hinge (3,) on a body from its stress, and the derivative (3, 2N)."""
        hinge = self.center + self.motion[:2] @ factors[: self.motion.shape[1]]
        return held_force(body, displacement, factors, self.surfaces[name], hinge)

    def unknown(self, values: FloatArray) -> FloatArray:
        """The entries of ``values`` (3, ...) for its unknowns (k, ...), moments over the plate's size."""
        scale = np.where(np.array(self.components) == ROTATION, 1.0 / self.size, 1.0)
        return np.asarray((values[list(self.components)].T * scale).T)


def ranges(counts: Iterable[int]) -> list[slice]:
    """Consecutive ranges with these ``counts``."""
    return [slice(*ends) for ends in pairwise(np.cumsum([0, *counts]).tolist())]


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
        return sum(len(one.components) for one in self.loose) + len(self.driven) + plates

    def moving(self, body: str) -> IntArray:
        """The unknown motions that move a body."""
        found = [one.numbers for one in self.loose if one.body == body]
        found += [one.numbers for one in self.plates if body in one.surfaces]
        return np.concatenate([*found, NO_UNKNOWNS])

    @cached_property
    def each(self) -> list[tuple[AnyContact, slice, slice]]:
        """Contacts, ranges of their knots (c,) and of the components (2s,) at those of their sides."""
        knots = ranges(one.slave.count for one in self.pairs)
        components = ranges(2 * sum(side.count for side in one.sides) for one in self.pairs)
        return list(zip(self.pairs, knots, components, strict=True))

    @cached_property
    def sides(self) -> list[tuple[ContactSide, slice]]:
        """Every side, and the range of the components of its knots among those of all sides (2s,)."""
        sides = [side for contact in self.pairs for side in contact.sides]
        return list(zip(sides, ranges(2 * side.count for side in sides), strict=True))

    @property
    def size(self) -> int:
        """Number of the components of the knots of all sides (2s)."""
        return sum(2 * side.count for side, _ in self.sides)

    @cached_property
    def friction(self) -> FloatArray:
        """Coefficients at the knots (c,); zero at held ones, whose friction would be undetermined."""
        found = [np.where(one.slave.held, 0.0, one.friction) for one in self.pairs]
        return np.concatenate([*found, np.zeros(0)])

    @cached_property
    def weight(self) -> FloatArray:
        """Lengths (c,) of the slaves' knots."""
        return np.concatenate([*(one.slave.weight for one in self.pairs), np.zeros(0)])

    def pushing(self, driven: DrivenObstacle) -> IntArray:
        """The tractions of all sides that act on an obstacle along its motion."""
        contact, _, there = self.each[driven.contact]
        first = there.start + driven.component
        return np.arange(first, first + 2 * contact.slave.count, 2)

    def spread(self, body: str) -> sparse.csr_array:
        """Nodal tractions (t, 2s) of a body's sides by those at all sides' knots."""
        return diagonal([side.spread if side.body == body else side.spread[:0] for side, _ in self.sides])

    def meet(
        self,
        surface: FloatArray,
        factors: FloatArray,
        before: FloatArray | None = None,
        closed: BoolArray | None = None,
    ) -> Meeting:
        """All contacts for displacements ``surface`` (2s,) of the sides; slips are relative to the places
        ``before`` (c,), zero without; ``closed`` (c,) is the earlier status."""
        found = []
        for contact, here, there in self.each:
            since = None if before is None else before[here]
            kept = None if closed is None else closed[here]
            found.append(contact.meet(surface[there].reshape(-1, 2), factors, since, kept))
        return Meeting.together(found)

    def forces(self, traction: FloatArray) -> FloatArray:
        """Forces (n, 2) on the sides of all contacts in turn by their ``traction`` (2s,)."""
        forces = [side.weight @ traction[here].reshape(-1, 2) for side, here in self.sides]
        return np.array(forces).reshape(-1, 2)

    def turned(self, surface: FloatArray) -> tuple[ComplexArray, sparse.csr_array]:
        """Rotations (s,) of sides displaced by ``surface`` (2s,), and rows (s, 2s) of the angles."""
        turns = [side.deformed(surface[here]) for side, here in self.sides]
        turn = np.concatenate([np.zeros(0, dtype=np.complex128), *(one for one, _ in turns)])
        return np.asarray(turn / np.abs(turn)), diagonal([rows for _, rows in turns])

    @cached_property
    def adjacent(self) -> sparse.csr_array:
        """The knots (c, c) next to each knot and itself, on the slaves."""
        return diagonal([one.slave.mass for one in self.pairs])


@dataclass(frozen=True)
class ContactSystem:
    """``contacts`` of bodies with ``projectors`` by name, whose last loads are unit tractions, x and y of
    every node of their sides, in the order of the contacts. ``length`` is the typical displacement,
    ``stiffness`` converts gaps to pressures in the initial guess, and ``missing`` (2s, 2s) are the sides'
    displacements beyond the clouds'."""

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
        sizes = ranges(one.body.unknowns for one in self.projectors.values())
        return dict(zip(self.projectors, sizes, strict=True))

    @property
    def unknowns(self) -> int:
        """Number 2N of displacements of all bodies."""
        return sum(one.body.unknowns for one in self.projectors.values())

    @cached_property
    def onto(self) -> sparse.csr_array:
        """Smooth displacements (2s, 2N) of all sides' knots by those of all bodies' nodes."""
        sides = [side for side, _ in self.contacts.sides]
        nodes = [self.bodies[side.body].start + side.nodes.unknowns for side in sides]
        columns, rows = np.concatenate([*nodes, NO_UNKNOWNS]), diagonal([side.onto for side in sides])
        entries = rows.data, columns[rows.indices], rows.indptr
        return sparse.csr_array(entries, shape=(rows.shape[0], self.unknowns))

    @cached_property
    def spread(self) -> dict[str, sparse.csr_array]:
        """Nodal tractions (t, 2s) of each body's sides by those at all sides' knots."""
        return {name: self.contacts.spread(name) for name in self.projectors}

    def response(self, displacement: FloatArray, traction: FloatArray) -> SideResponse:
        """The response of the sides at ``displacement`` (2N,), with their ``traction`` (2s,)."""
        angles = self.contacts.turned(self.onto @ displacement)
        return SideResponse(self.missing, self.onto, *angles, traction)
