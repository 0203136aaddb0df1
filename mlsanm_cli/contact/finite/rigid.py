"""A side of a body at finite strain against a rigid obstacle: gaps, normals, and their derivatives. Nominal
pressures act along the obstacle's normal at the node's current position, so that neither the slave's normal
nor its stretch appears in the equations, and pressure times length times change of gap is work."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.node_curve import on_polyline, wrapped
from mlsanm_cli.contact.finite.pair import Meeting
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.obstacles import Chain, Round, Shape
from mlsanm_cli.operators.stencil_weights import nodal_pairs
from mlsanm_cli.records import dataclass

DIFFERENCE_STEP = 1e-3
"""Step of differences along polylines, as a fraction of a node's length."""


@dataclass(frozen=True)
class RigidContact:
    """The contact ``name`` of a ``slave`` with an obstacle. Its ``shape`` translates by ``motion`` (2, L) and
    rotates by ``rotation`` (L,) about ``pivot`` (2,), given as drawn, times the load factors including free
    motions; ``friction`` is Coulomb's coefficient."""

    name: str
    slave: ContactSide
    shape: Shape
    motion: FloatArray
    friction: float
    rotation: FloatArray
    pivot: FloatArray
    exchanged: ClassVar[bool] = False

    @property
    def sides(self) -> tuple[ContactSide, ...]:
        """The slave alone."""
        return (self.slave,)

    @property
    def around(self) -> float | None:
        """Length of the obstacle's boundary if it is closed."""
        return 2.0 * np.pi * self.shape.radius if isinstance(self.shape, Round) else None

    def seen(
        self, places: FloatArray, outward: FloatArray, factors: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Distances (e,) of ``places`` with ``outward`` normals from the obstacle, and its normals (e, 2)."""
        turn = self.turn(factors)
        at = self._drawn(places, factors, turn)
        partner, normal = self.shape.closest(at, outward @ turn)
        return ((at - partner) * normal).sum(axis=1), normal @ turn.T

    def turn(self, factors: FloatArray) -> FloatArray:
        """Rotation matrix (2, 2) of the obstacle."""
        angle = float(self.rotation @ factors)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def _drawn(self, places: FloatArray, factors: FloatArray, turn: FloatArray) -> FloatArray:
        """Points (e, 2) in the frame of the obstacle as drawn."""
        return np.asarray(self.pivot + (places - self.motion @ factors - self.pivot) @ turn)

    def apart(self, displacement: FloatArray, factors: FloatArray, _place: FloatArray) -> FloatArray:
        """Positions of nodes (c, 2) with ``displacement`` (c, 2) in the frame of the obstacle as drawn."""
        return self._drawn(self.slave.places + displacement, factors, self.turn(factors))

    def meet(
        self,
        displacement: FloatArray,
        factors: FloatArray,
        before: FloatArray | None,
        _closed: BoolArray | None = None,
    ) -> Meeting:
        """The contact for a slave's ``displacement`` (c, 2) and load ``factors`` (L,); slips are relative to
        the places ``before`` (c,), zero without. Obstacles have no ends."""
        turn = self.turn(factors)
        at, outward = self._drawn(self.slave.places + displacement, factors, turn), self.slave.outward @ turn
        partner, drawn = self.shape.closest(at, outward)
        gap, normal = ((at - partner) * drawn).sum(axis=1), drawn @ turn.T
        count = self.slave.count
        bent, place, scale = self._along(at, outward)
        slip = np.zeros(count) if before is None else wrapped(place - before, self.around)
        every, none = np.arange(count), sparse.csr_array((2 * count, 2 * count))
        across, slipping, turning = (
            nodal_pairs(every, way, count)
            for way in (normal, scale[:, None] * turned(normal), bent[:, None] * turned(normal))
        )
        carried = sparse.csr_array(sparse.eye_array(2 * count, format="csr"))
        rows = (across, slipping, turning, carried, lambda _: none)
        return Meeting(np.ones(count, dtype=bool), gap, normal, place, slip, *rows)

    def _along(self, at: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rotation (c,) of the normal per motion of a node along the obstacle (1 over the distance from the
        centre, 0 above straight sides); coordinates along the obstacle and their derivatives (c,)."""
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
        """The same for a polyline by differences over a small fraction of the nodes' lengths, which rounds
        corners; coordinates run opposite to the polyline, along its tangents."""
        tangent = turned(shape.closest(at, outward)[1])
        step = DIFFERENCE_STEP * self.slave.weight[:, None] * tangent
        ahead, behind = (shape.closest(at + way, outward) for way in (step, -step))
        twice = 2.0 * DIFFERENCE_STEP * self.slave.weight
        bent = ((ahead[1] - behind[1]) * tangent).sum(axis=1) / twice
        moved = ((ahead[0] - behind[0]) * tangent).sum(axis=1) / twice
        length = np.hypot(*np.diff(shape.points, axis=0).T)
        side, part = on_polyline(0.5 * (ahead[0] + behind[0]), shape.points)
        return bent, -(np.cumsum(length)[side] - (1.0 - part) * length[side]), moved
