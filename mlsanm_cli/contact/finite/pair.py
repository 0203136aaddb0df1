"""Contact of two deformable sides at finite strain: closest points, gaps and directions for any motion.

Slave nodes x have their closest point on the curve y(xi) through the master's deformed nodes where (x - y) .
y' = 0; n is the master's current normal there, h = (x - y) . n the gap. xi is a reference length of the
master, hence a material coordinate: slips are measured by it, however both bodies move.

Equation (26) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.meeting import NO_GAP, Meeting, by_component
from mlsanm_cli.contact.finite.sides import ContactSide
from mlsanm_cli.contact.finite.transfer import Transfer
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE

MAX_DEPTH = 3.0
"""Nodes deeper inside the master than this many of its spacings are ignored."""
END_OVERHANG = 0.5
"""Closed nodes stay candidates until they are farther than this fraction of their length beyond the master's
end: otherwise a node there would leave under pressure and return without it indefinitely, with half its
length covered."""


@dataclass(frozen=True)
class BodyContact:
    """The contact ``name`` of a ``slave`` with a deformable ``master``; ``friction`` is Coulomb's
    coefficient.

    ``exchanged``: roles are swapped with respect to the case, on whose slave forces and directions are
    reported.
    """

    name: str
    slave: ContactSide
    master: ContactSide
    friction: float = 0.0
    exchanged: bool = False

    @property
    def sides(self) -> tuple[ContactSide, ...]:
        """Slave and master."""
        return self.slave, self.master

    @cached_property
    def _outward(self) -> tuple[float, float]:
        """Signs (1 or -1) for which a tangent rotated by -90 degrees points out of the slave and of the
        master."""
        found = []
        for side, curve in ((self.slave, self.slave.curve), (self.master, self.master.curve)):
            along = curve.rows(side.arc)[1] @ side.places
            found.append(float(np.sign((turned(along) * side.outward).sum())))
        return found[0], found[1]

    def start(self, factors: FloatArray) -> FloatArray:
        """The master's normals (c, 2) in the undeformed state."""
        return self.meet(np.zeros((self.slave.count + self.master.count, 2)), factors, None).normal

    def apart(self, displacement: FloatArray, _factors: FloatArray, place: FloatArray) -> FloatArray:
        """Vectors (c, 2) from places (c,) of the master to the nodes, for displacements (c + m, 2) of both
        sides."""
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
        rows = master.curve.rows(place)
        value, first, second = (row @ nodes for row in rows)
        apart, length = at - value, np.hypot(*first.T)
        along, sign = first / length[:, None], self._outward[1]
        normal = sign * turned(along)
        gap = (apart * normal).sum(axis=1)
        own = self._outward[0] * turned(slave.curve.rows(slave.arc)[1] @ at)
        faced = (own * normal).sum(axis=1) < MAX_FACING_COSINE * np.hypot(*own.T)
        deep = gap < -MAX_DEPTH * self._spacing(place) * length
        facing = inside & faced & ~deep
        moves = _Moves(rows, along, normal, apart, first, second)
        d_place = moves.kept(moves.place, facing)
        bend = moves.turned_by(normal, d_place)
        slip, d_slip = np.zeros(count), -sign * (sparse.diags_array(length) @ d_place)
        if before is not None:
            past = self._since(place, before)
            slip = -sign * length * past
            d_slip = d_slip - sparse.diags_array(sign * past) @ moves.turned_by(along, d_place)
        transfer = Transfer.of(slave, master, master.curve, place, facing)
        return Meeting(
            facing,
            np.where(facing, gap, NO_GAP),
            normal,
            turned(normal),
            place,
            np.where(facing, slip, 0.0),
            moves.kept(moves.apart(normal), facing),
            moves.kept(sparse.csr_array(d_slip), facing),
            moves.kept(sparse.csr_array(sparse.diags_array(sign / length) @ bend), facing),
            transfer.carried,
            lambda traction: transfer.carried_moved(traction, d_place),
        )

    def _spacing(self, place: FloatArray) -> FloatArray:
        low = self.master.curve.interval(place)
        return np.asarray(self.master.curve.knots[low + 1] - self.master.curve.knots[low])

    def _since(self, place: FloatArray, before: FloatArray) -> FloatArray:
        around = self.master.around
        if around is None:
            return place - before
        return np.asarray(np.mod(place - before + 0.5 * around, around) - 0.5 * around)


@dataclass(frozen=True)
class _Moves:
    """Derivatives of places and directions: ``rows`` of the curve's value and derivatives, unit tangents and
    normals (c, 2), vectors ``between`` the sides (c, 2), ``first`` and ``second`` derivative of the curve (c,
    2)."""

    rows: tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]
    along: FloatArray
    normal: FloatArray
    between: FloatArray
    first: FloatArray
    second: FloatArray

    def apart(self, direction: FloatArray) -> sparse.csr_array:
        """Rows (c, 2s) of x - y(xi), xi fixed, along ``direction`` (c, 2)."""
        own = by_component(sparse.eye_array(len(direction), format="csr"), direction)
        return sparse.csr_array(sparse.hstack([own, -by_component(self.rows[0], direction)], format="csr"))

    def slope(self, direction: FloatArray) -> sparse.csr_array:
        """Rows (c, 2s) of y'(xi), xi fixed, along ``direction`` (c, 2)."""
        none = sparse.csr_array((len(direction), 2 * len(direction)))
        return sparse.csr_array(sparse.hstack([none, by_component(self.rows[1], direction)], format="csr"))

    @cached_property
    def place(self) -> sparse.csr_array:
        """Rows (c, 2s) of xi, from (x - y) . y' = 0."""
        bent = (self.first**2).sum(axis=1) - (self.between * self.second).sum(axis=1)
        tiny = 1e-6 * (self.first**2).sum(axis=1)
        bent = np.where(np.abs(bent) > tiny, bent, tiny)
        moved = self.apart(self.first) + self.slope(self.between)
        return sparse.csr_array(sparse.diags_array(1.0 / bent) @ moved)

    def turned_by(self, direction: FloatArray, d_place: sparse.csr_array) -> sparse.csr_array:
        """Rows (c, 2s) of the total derivative of y' along ``direction`` (c, 2)."""
        along = sparse.diags_array((self.second * direction).sum(axis=1)) @ d_place
        return sparse.csr_array(self.slope(direction) + along)

    def kept(self, rows: sparse.csr_array, chosen: BoolArray) -> sparse.csr_array:
        """The ``rows`` (c, 2s) of the ``chosen`` (c,), zero for others."""
        return sparse.csr_array(sparse.diags_array(chosen.astype(float)) @ rows)
