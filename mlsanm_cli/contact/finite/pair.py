"""Contact of a side with another one or an obstacle at finite strain: closest points, gaps and directions.

Slave nodes have their closest point on the curve through the master's deformed nodes, at a reference length
xi of the master, a material coordinate: slips are measured by it, however both bodies move. A master's nodes
receive the slave's traction projected onto their hat functions, the mass matrix being inverted to second
order, so that the forces on both sides agree to round-off, and a constant traction is reproduced. Between the
nodes of either side the integrand is quadratic, and Simpson's rule exact. Equations (23) and (24) of
docs/method.md."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.node_curve import integration, on_polyline, wrapped
from mlsanm_cli.contact.finite.sides import ContactSide, both_components, by_component
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.obstacles import Chain, Round, Shape
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE
from mlsanm_cli.operators.stencil_weights import nodal_pairs
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

NO_GAP = 1e300
"""Gap of a node that faces nothing."""


@dataclass(frozen=True)
class Meeting:
    """Kinematics at the slave's nodes (c,): ``facing`` marks those opposite to the master; ``gap``; the
    master's outward ``normal`` (c, 2); ``place``, the closest point as a reference arc length of the master;
    ``slip`` along the :attr:`tangent` relative to an earlier place.

    Derivatives by the s displacements (2s,) of the slave's nodes, then the master's: ``d_gap``, ``d_slip``,
    ``d_turn`` (c, 2s), the last one for the rotation of the normal towards the tangent. ``carried`` (2s, 2c)
    maps tractions at the slave's nodes to those of both sides, per reference length of either, and
    ``carried_moved`` (T) (2s, 2s) is the derivative for slave tractions T (c, 2)."""

    facing: BoolArray
    gap: FloatArray
    normal: FloatArray
    place: FloatArray
    slip: FloatArray
    d_gap: sparse.csr_array
    d_slip: sparse.csr_array
    d_turn: sparse.csr_array
    carried: sparse.csr_array
    carried_moved: Callable[[FloatArray], sparse.csr_array]

    @classmethod
    def together(cls, parts: Sequence[Meeting]) -> Meeting:
        """Several contacts as one, the displacements of their sides in turn."""
        every, joined = [NOWHERE, *parts], dict[str, Any]()
        for name, first in vars(NOWHERE).items():
            values = [getattr(one, name) for one in every]
            if sparse.issparse(first):
                joined[name] = diagonal(values)
            elif name != "carried_moved":
                joined[name] = np.concatenate(values)
        ends = np.cumsum([len(one.gap) for one in every])[:-1]

        def moved(traction: FloatArray) -> sparse.csr_array:
            each = zip(every, np.split(traction, ends), strict=True)
            return diagonal([one.carried_moved(own) for one, own in each])

        return cls(**joined, carried_moved=moved)

    @property
    def tangent(self) -> FloatArray:
        """The normals rotated by -90 degrees (c, 2)."""
        return turned(self.normal)

    def slave_tractions(self, pressure: FloatArray, friction: FloatArray) -> FloatArray:
        """Nominal tractions (c, 2) of the slave for its pressures and friction (c,)."""
        return np.asarray(pressure[:, None] * self.normal + friction[:, None] * self.tangent)

    def tractions(self, pressure: FloatArray, friction: FloatArray) -> FloatArray:
        """Nominal tractions (2s,) of both sides."""
        return np.asarray(self.carried @ self.slave_tractions(pressure, friction).ravel())

    def columns(self, directions: FloatArray) -> sparse.csr_array:
        """Tractions (2s, c) of both sides per unit along ``directions`` (c, 2) on the slave."""
        every = np.arange(len(directions))
        return sparse.csr_array(self.carried @ nodal_pairs(every, directions, len(every)).T)

    def turning(self, pressure: FloatArray, friction: FloatArray) -> sparse.csr_array:
        """Derivative (2s, 2s) of the tractions by the displacements."""
        across = self.columns(pressure[:, None] * self.tangent - friction[:, None] * self.normal)
        follows = self.carried_moved(self.slave_tractions(pressure, friction))
        return sparse.csr_array(across @ self.d_turn + follows)


def diagonal(blocks: Sequence[sparse.csr_array]) -> sparse.csr_array:
    """A block diagonal matrix, also of no blocks."""
    return sparse.csr_array(sparse.block_diag([NOTHING, *blocks], format="csr"))


NOTHING = sparse.csr_array((0, 0))
NOWHERE = Meeting(
    *(np.zeros(0, dtype=bool), np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0)),
    *(NOTHING, NOTHING, NOTHING, NOTHING, lambda _: NOTHING),
)
"""No contact."""


MAX_DEPTH = 3.0
"""Knots deeper inside the master than this many of its spacings are ignored."""
DIFFERENCE_STEP = 1e-3
"""Step of differences along polylines, as a fraction of a node's length."""
END_OVERHANG = 0.5
"""Closed nodes stay candidates up to this fraction of their length beyond the master's end: a node there
would leave under pressure and return without it indefinitely."""


@dataclass(frozen=True)
class BodyContact:
    """The contact ``name`` of a ``slave`` with a deformable ``master``; ``friction`` is Coulomb's
    coefficient. ``exchanged``: roles are swapped with respect to the case."""

    name: str
    slave: ContactSide
    master: ContactSide
    friction: float = 0.0
    exchanged: bool = False

    @property
    def sides(self) -> tuple[ContactSide, ...]:
        """Slave and master."""
        return self.slave, self.master

    @property
    def around(self) -> float | None:
        """Length of the master's boundary if it is closed."""
        return self.master.around

    @cached_property
    def _outward(self) -> tuple[float, float]:
        """Signs for which a tangent rotated by -90 degrees points out of the slave and of the master."""
        along = (side.curve.rows(side.arc)[1] @ side.places for side in self.sides)
        both = zip(along, self.sides, strict=True)
        slave, master = (float(np.sign((turned(one) * side.outward).sum())) for one, side in both)
        return slave, master

    def apart(self, displacement: FloatArray, _factors: FloatArray, place: FloatArray) -> FloatArray:
        """Vectors (c, 2) from places (c,) of the master to the nodes, for displacements (c + m, 2)."""
        count = self.slave.count
        nodes = self.master.places + displacement[count:]
        return np.asarray(self.slave.places + displacement[:count] - self.master.curve.rows(place)[0] @ nodes)

    def meet(
        self,
        displacement: FloatArray,
        factors: FloatArray,
        before: FloatArray | None,
        closed: BoolArray | None = None,
    ) -> Meeting:
        """The contact for ``displacement`` (c + m, 2) of the slave's nodes, then the master's; slips are
        relative to the places ``before`` (c,), zero without. Nodes that were ``closed`` (c,) remain facing up
        to END_OVERHANG the end."""
        slave, master, count = self.slave, self.master, self.slave.count
        at, nodes = slave.places + displacement[:count], master.places + displacement[count:]
        beyond = np.zeros(count) if closed is None else np.where(closed, END_OVERHANG * slave.weight, 0.0)
        place, inside = master.curve.closest(nodes, at, beyond)
        values, slopes, bends = master.curve.rows(place)
        value, first, second = (row @ nodes for row in (values, slopes, bends))
        apart, length = at - value, np.hypot(*first.T)
        along, sign = first / length[:, None], self._outward[1]
        normal = sign * turned(along)
        gap = (apart * normal).sum(axis=1)
        own = self._outward[0] * turned(slave.curve.rows(slave.arc)[1] @ at)
        faced = (own * normal).sum(axis=1) < MAX_FACING_COSINE * np.hypot(*own.T)
        spacing = np.diff(master.nodes.ends)[master.nodes.curve.interval(place)]
        deep = gap < -MAX_DEPTH * spacing * length
        facing = inside & faced & ~deep
        kept, still = sparse.diags_array(facing.astype(float)), sparse.csr_array((count, count))
        # Rows (c, s) of x - y(xi) and of y'(xi), xi fixed; the same (c, 2s) along directions (c, 2).
        difference = sparse.csr_array(sparse.hstack([sparse.eye_array(count), -values], format="csr"))
        slope = sparse.csr_array(sparse.hstack([still, slopes], format="csr"))
        apart_moved, slope_moved = partial(by_component, difference), partial(by_component, slope)
        # Rows of xi, from (x - y) . y' = 0.
        size = (first**2).sum(axis=1)
        bent = size - (apart * second).sum(axis=1)
        bent = np.where(np.abs(bent) > COARSE_ROUND_OFF * size, bent, COARSE_ROUND_OFF * size)
        d_place = kept @ (sparse.diags_array(1.0 / bent) @ (apart_moved(first) + slope_moved(apart)))

        def turned_by(direction: FloatArray) -> sparse.csr_array:
            """Rows (c, 2s) of the total derivative of y' along ``direction`` (c, 2)."""
            bending = sparse.diags_array((second * direction).sum(axis=1)) @ d_place
            return sparse.csr_array(slope_moved(direction) + bending)

        slip, d_slip = np.zeros(count), -sign * (sparse.diags_array(length) @ d_place)
        if before is not None:
            past = wrapped(place - before, master.around)
            slip = -sign * length * past
            d_slip = d_slip - sparse.diags_array(sign * past) @ turned_by(along)
        return Meeting(
            facing,
            np.where(facing, gap, NO_GAP),
            normal,
            place,
            np.where(facing, slip, 0.0),
            kept @ apart_moved(normal),
            kept @ d_slip,
            kept @ (sparse.diags_array(sign / length) @ turned_by(normal)),
            *transfer(slave, master, place, facing, d_place),
        )


def transfer(
    slave: ContactSide, master: ContactSide, place: FloatArray, facing: BoolArray, d_place: sparse.csr_array
) -> tuple[sparse.csr_array, Callable[[FloatArray], sparse.csr_array]]:
    """:attr:`Meeting.carried` and its derivative for a slave's nodes at places (c,) of the master with
    derivatives (c, 2s); only intervals next to ``facing`` (c,) nodes count."""
    ends = facing if slave.around is None else np.append(facing, facing[:1])
    chosen = np.flatnonzero(ends[:-1] | ends[1:])
    on_slave, on_master, rise, length = integration(slave.curve, place, master.curve, chosen)
    # 2 - M / w for the inverse of M / w, as the mass matrix M has the lengths w as sums of its rows.
    over, weight = sparse.diags_array(1.0 / master.weight), sparse.diags_array(length)
    spread = (2.0 * sparse.eye_array(master.count) - over @ master.mass) @ over
    onto = both_components(spread @ on_master.T @ weight @ on_slave)

    def moved(traction: FloatArray) -> sparse.csr_array:
        along = by_component(sparse.csr_array(sparse.eye_array(len(length))), on_slave @ traction).T
        rows = both_components(spread @ rise.T @ weight) @ along @ on_slave @ d_place
        return sparse.csr_array(sparse.vstack([sparse.csr_array((2 * slave.count, rows.shape[1])), -rows]))

    carried = sparse.vstack([sparse.eye_array(2 * slave.count), -onto], format="csr")
    return sparse.csr_array(carried), moved


@dataclass(frozen=True)
class RigidContact:
    """The contact ``name`` of a ``slave`` with an obstacle. Its ``shape`` translates by ``motion`` (2, L) and
    rotates by ``rotation`` (L,) about ``pivot`` (2,), given as drawn, times the load factors including free
    motions; ``friction`` is Coulomb's coefficient. Nominal pressures act along the obstacle's normal at the
    node's current position, so that neither the slave's normal nor its stretch appears in the equations, and
    pressure times length times change of gap is work."""

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
        turn, at = self.turn(factors), self._drawn(places, factors)
        partner, normal = self.shape.closest(at, outward @ turn)
        return ((at - partner) * normal).sum(axis=1), normal @ turn.T

    def turn(self, factors: FloatArray) -> FloatArray:
        """Rotation matrix (2, 2) of the obstacle."""
        angle = float(self.rotation @ factors)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def _drawn(self, places: FloatArray, factors: FloatArray) -> FloatArray:
        """Points (e, 2) in the frame of the obstacle as drawn."""
        away = places - self.motion @ factors - self.pivot
        return np.asarray(self.pivot + away @ self.turn(factors))

    def apart(self, displacement: FloatArray, factors: FloatArray, _place: FloatArray) -> FloatArray:
        """Positions of nodes (c, 2) with ``displacement`` (c, 2) in the frame of the obstacle as drawn."""
        return self._drawn(self.slave.places + displacement, factors)

    def meet(
        self,
        displacement: FloatArray,
        factors: FloatArray,
        before: FloatArray | None,
        _closed: BoolArray | None = None,
    ) -> Meeting:
        """The contact for a slave's ``displacement`` (c, 2) and load ``factors`` (L,); slips are relative to
        the places ``before`` (c,), zero without. Obstacles have no ends."""
        places, outward, count = self.slave.places + displacement, self.slave.outward, self.slave.count
        gap, normal = self.seen(places, outward, factors)
        bent, place, scale = self._along(self._drawn(places, factors), outward @ self.turn(factors))
        slip = np.zeros(count) if before is None else wrapped(place - before, self.around)
        tangent, every = turned(normal), np.arange(count)
        ways = (normal, scale[:, None] * tangent, bent[:, None] * tangent)
        gaps, slips, turns = (nodal_pairs(every, way, count) for way in ways)
        carried = sparse.csr_array(sparse.eye_array(2 * count, format="csr"))
        moved = (gaps, slips, turns, carried, lambda _: sparse.csr_array(carried.shape))
        return Meeting(every >= 0, gap, normal, place, slip, *moved)

    def _along(self, at: FloatArray, outward: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rotation (c,) of the normal per motion of a node along the obstacle (1 over the distance from the
        centre, 0 above straight sides); coordinates along the obstacle and their derivatives (c,)."""
        shape = self.shape
        if isinstance(shape, Round):
            x, y = (at - np.array(shape.center)).T
            away, sign = np.hypot(x, y), 1.0 if shape.inside else -1.0
            return -sign / away, sign * shape.radius * np.arctan2(y, x), shape.radius / away
        tangent = turned(shape.closest(at, outward)[1])
        if not isinstance(shape, Chain):
            return np.zeros(len(at)), at @ tangent[0], np.ones(len(at))
        # By differences over a small fraction of the nodes' lengths, which rounds corners; coordinates run
        # opposite to the polyline, along its tangents.
        step = DIFFERENCE_STEP * self.slave.weight[:, None] * tangent
        ahead, behind = (shape.closest(at + way, outward) for way in (step, -step))
        twice = 2.0 * DIFFERENCE_STEP * self.slave.weight
        moved = ((ahead[0] - behind[0]) * tangent).sum(axis=1) / twice
        bent = ((ahead[1] - behind[1]) * tangent).sum(axis=1) / twice
        length = np.hypot(*np.diff(shape.points, axis=0).T)
        side, part = on_polyline(0.5 * (ahead[0] + behind[0]), shape.points)
        return bent, -(np.cumsum(length)[side] - (1.0 - part) * length[side]), moved
