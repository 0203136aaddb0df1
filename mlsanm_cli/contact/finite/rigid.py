"""A side of a body at finite strain against a rigid obstacle: gaps, normals, and what turns with them.

The unknowns are nominal pressures p_j >= 0, per length before loading, at the nodes of the slave: the
traction p n acts along the obstacle's normal n where the node is now, so that neither the slave's normal nor
its stretch is in the equations, and p_j w_j dg_j is work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.meeting import Meeting, by_component
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.obstacles import Chain, Round, Shape

DIFFERENCE_STEP = 1e-3
"""Step of differences along chains, relative to the length of a node."""


@dataclass(frozen=True)
class RigidContact:
    """The contact ``name`` of a ``slave`` with an obstacle, whose ``shape`` moves by ``motion`` (2, L) and
    turns by ``rotation`` (L,) about ``pivot`` (2,), as drawn, times the load factors, free motions among
    them; ``friction`` is Coulomb's coefficient."""

    name: str
    slave: ContactSide
    shape: Shape
    motion: FloatArray
    friction: float
    rotation: FloatArray
    pivot: FloatArray

    @property
    def sides(self) -> tuple[ContactSide, ...]:
        """The slave alone."""
        return (self.slave,)

    def start(self, factors: FloatArray) -> FloatArray:
        """Where the obstacle's normals (c, 2) are before anything is deformed."""
        count = self.motion.shape[1] - len(factors)
        return self.seen(self.slave.places, self.slave.outward, np.append(factors, np.zeros(count)))[1]

    def seen(
        self, places: FloatArray, outward: FloatArray, factors: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Distances (e,) of ``places`` (e, 2) with outward normals (e, 2) from the obstacle, and its normals
        (e, 2), at load ``factors`` (L,)."""
        turn = self.turn(factors)
        at = self._drawn(places, factors, turn)
        partner, normal = self.shape.closest(at, outward @ turn)
        return ((at - partner) * normal).sum(axis=1), normal @ turn.T

    def turn(self, factors: FloatArray) -> FloatArray:
        """The matrix (2, 2) by which the obstacle has turned."""
        angle = float(self.rotation @ factors)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def _drawn(self, places: FloatArray, factors: FloatArray, turn: FloatArray) -> FloatArray:
        """Places (e, 2) as the obstacle sees them, where it was drawn."""
        return np.asarray(self.pivot + (places - self.motion @ factors - self.pivot) @ turn)

    def apart(self, displacement: FloatArray, factors: FloatArray, _place: FloatArray) -> FloatArray:
        """Where nodes (c, 2) displaced by (c, 2) are, as the obstacle sees them."""
        return self._drawn(self.slave.places + displacement, factors, self.turn(factors))

    def meet(
        self,
        displacement: FloatArray,
        factors: FloatArray,
        before: FloatArray | None,
        _closed: BoolArray | None = None,
    ) -> Meeting:
        """The contact in a state of the slave's ``displacement`` (c, 2) and load ``factors`` (L,); slips are
        from the places (c,) ``before``, or nothing. Obstacles have no ends to be closed beyond."""
        turn = self.turn(factors)
        at, outward = self._drawn(self.slave.places + displacement, factors, turn), self.slave.outward @ turn
        partner, drawn = self.shape.closest(at, outward)
        gap, normal = ((at - partner) * drawn).sum(axis=1), drawn @ turn.T
        tangent = turned(normal)
        count = self.slave.count
        bent, place, scale = self._along(at, outward)
        slip = np.zeros(count) if before is None else self._slip(place - before)
        own = sparse.eye_array(count, format="csr")
        none = sparse.csr_array((0, count))
        along = by_component(own, tangent)
        return Meeting(
            np.ones(count, dtype=bool),
            gap,
            normal,
            tangent,
            place,
            slip,
            by_component(own, normal),
            sparse.csr_array(sparse.diags_array(scale) @ along),
            sparse.csr_array(sparse.diags_array(bent) @ along),
            none,
            lambda _: sparse.csr_array((0, 2 * count)),
        )

    def _along(self, at: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What multiplies a node's motion along the obstacle to turn its normal (c,), 1 over the distance
        from the centre and 0 above straight sides; places along the obstacle, and how they move (c,)."""
        if isinstance(self.shape, Chain):
            return self._along_chain(self.shape, at, outward)
        if not isinstance(self.shape, Round):
            normal = self.shape.closest(at[:1], outward[:1])[1]
            return np.zeros(len(at)), at @ turned(normal)[0], np.ones(len(at))
        x, y = (at - np.array(self.shape.center)).T
        away, sign = np.hypot(x, y), 1.0 if self.shape.inside else -1.0
        place = sign * self.shape.radius * np.arctan2(y, x)
        return -sign / away, place, self.shape.radius / away

    def _along_chain(
        self, shape: Chain, at: FloatArray, outward: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same of a chain by differences over a small part of the nodes' lengths, over which a corner is
        round; places are counted against the way along the chain, as its tangents go."""
        tangent = turned(shape.closest(at, outward)[1])
        step = DIFFERENCE_STEP * self.slave.weight[:, None] * tangent
        ahead, behind = (shape.closest(at + way, outward) for way in (step, -step))
        twice = 2.0 * DIFFERENCE_STEP * self.slave.weight
        bent = ((ahead[1] - behind[1]) * tangent).sum(axis=1) / twice
        moved = ((ahead[0] - behind[0]) * tangent).sum(axis=1) / twice
        return bent, -_arc(shape, 0.5 * (ahead[0] + behind[0])), moved

    def _slip(self, moved: FloatArray) -> FloatArray:
        if not isinstance(self.shape, Round):
            return moved
        around = 2.0 * np.pi * self.shape.radius
        return np.asarray(np.mod(moved + 0.5 * around, around) - 0.5 * around)


def _arc(shape: Chain, points: FloatArray) -> FloatArray:
    """Lengths (n,) along a chain up to ``points`` (n, 2) on it."""
    start, way = shape.points[:-1], np.diff(shape.points, axis=0)
    length = np.hypot(*way.T)
    away = points[:, None] - start[None]
    part = np.clip((away * way).sum(axis=2) / length**2, 0.0, 1.0)
    distance = ((away - part[:, :, None] * way) ** 2).sum(axis=2)
    side = np.argmin(distance, axis=1)
    before = np.cumsum(length) - length
    return np.asarray(before[side] + part[np.arange(len(points)), side] * length[side])
