"""Contact of two deformable sides at finite strain: closest points, gaps and directions for any motion.

Slave nodes have their closest point on the curve through the master's deformed nodes, at a reference length
xi of the master, a material coordinate: slips are measured by it, however both bodies move. A master's nodes
receive the slave's traction projected onto their hat functions, the mass matrix being inverted to second
order, so that the forces on both sides agree to round-off, and a constant traction is reproduced. Between the
nodes of either side the integrand is quadratic, and Simpson's rule exact. Equations (23) and (24) of
docs/method.md."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.finite.node_curve import integration, wrapped
from mlsanm_cli.contact.finite.sides import ContactSide, by_component
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.pairing import MAX_FACING_COSINE
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

NO_GAP = 1e300
"""Gap of a node that faces nothing."""


@dataclass(frozen=True)
class Meeting:
    """Kinematics at the slave's nodes (c,): ``facing`` marks those opposite to the master; ``gap``; the
    master's outward ``normal`` (c, 2) and the ``tangent`` (c, 2), the normal rotated by -90 degrees;
    ``place``, the closest point as a reference arc length of the master; ``slip`` along the tangent relative
    to an earlier place.

    Derivatives by the s displacements (2s,) of the slave's nodes, then the master's: ``d_gap``, ``d_slip``,
    ``d_turn`` (c, 2s), the last one for the rotation of the normal towards the tangent. ``carried`` (m, c)
    maps tractions at the slave's nodes to the master's m nodes, per reference length of either, and
    ``carried_moved`` (T) (2m, 2s) is the derivative for slave tractions T (c, 2)."""

    facing: BoolArray
    gap: FloatArray
    normal: FloatArray
    tangent: FloatArray
    place: FloatArray
    slip: FloatArray
    d_gap: sparse.csr_array
    d_slip: sparse.csr_array
    d_turn: sparse.csr_array
    carried: sparse.csr_array
    carried_moved: Callable[[FloatArray], sparse.csr_array]

    def tractions(self, pressure: FloatArray, friction: FloatArray) -> FloatArray:
        """Nominal tractions (s, 2) of both sides for the slave's pressures and friction (c,)."""
        on_slave = pressure[:, None] * self.normal + friction[:, None] * self.tangent
        return np.concatenate([on_slave, -(self.carried @ on_slave)])

    def columns(self, directions: FloatArray) -> sparse.csr_array:
        """Tractions (2s, c) of both sides per unit along ``directions`` (c, 2) on the slave."""
        count, (line, column) = len(directions), self.carried.tocoo().coords
        x, y = (-self.carried.data * along[column] for along in directions.T)
        nodes = np.arange(count)
        rows = np.concatenate([2 * nodes, 2 * nodes + 1, 2 * (count + line), 2 * (count + line) + 1])
        columns = np.concatenate([nodes, nodes, column, column])
        entries = (np.concatenate([*directions.T, x, y]), (rows, columns))
        return sparse.csr_array(entries, shape=(2 * (count + self.carried.shape[0]), count))

    def turning(self, pressure: FloatArray, friction: FloatArray) -> sparse.csr_array:
        """Derivative (2s, 2s) of the tractions by the displacements."""
        across = pressure[:, None] * self.tangent - friction[:, None] * self.normal
        found = self.columns(across) @ self.d_turn
        if self.carried.shape[0]:
            moved = self.carried_moved(self.tractions(pressure, friction)[: len(pressure)])
            none = sparse.csr_array((found.shape[0] - moved.shape[0], found.shape[1]))
            found = found - sparse.vstack([none, moved], format="csr")
        return sparse.csr_array(found)


MAX_DEPTH = 3.0
"""Knots deeper inside the master than this many of its spacings are ignored."""
END_OVERHANG = 0.5
"""Closed nodes stay candidates until they are farther than this fraction of their length beyond the master's
end: otherwise a node there would leave under pressure and return without it indefinitely, with half its
length covered."""


@dataclass(frozen=True)
class BodyContact:
    """The contact ``name`` of a ``slave`` with a deformable ``master``; ``friction`` is Coulomb's
    coefficient. ``exchanged``: roles are swapped with respect to the case, on whose slave forces and
    directions are reported."""

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
        found = []
        for side, curve in ((self.slave, self.slave.curve), (self.master, self.master.curve)):
            along = curve.rows(side.arc)[1] @ side.places
            found.append(float(np.sign((turned(along) * side.outward).sum())))
        return found[0], found[1]

    def start(self, factors: FloatArray) -> FloatArray:
        """The master's normals (c, 2) in the undeformed state."""
        return self.meet(np.zeros((self.slave.count + self.master.count, 2)), factors, None).normal

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
        deep = gap < -MAX_DEPTH * master.spacing(place) * length
        facing = inside & faced & ~deep
        kept, still = _times(facing.astype(float)), sparse.csr_array((count, 2 * count))

        def apart_moved(direction: FloatArray) -> sparse.csr_array:
            """Rows (c, 2s) of x - y(xi), xi fixed, along ``direction`` (c, 2)."""
            on_slave = by_component(sparse.eye_array(count, format="csr"), direction)
            on_master = by_component(values, direction)
            return sparse.csr_array(sparse.hstack([on_slave, -on_master], format="csr"))

        def slope_moved(direction: FloatArray) -> sparse.csr_array:
            """Rows (c, 2s) of y'(xi), xi fixed, along ``direction`` (c, 2)."""
            both = [still, by_component(slopes, direction)]
            return sparse.csr_array(sparse.hstack(both, format="csr"))

        # Rows of xi, from (x - y) . y' = 0.
        size = (first**2).sum(axis=1)
        bent = size - (apart * second).sum(axis=1)
        bent = np.where(np.abs(bent) > COARSE_ROUND_OFF * size, bent, COARSE_ROUND_OFF * size)
        d_place = kept @ (_times(1.0 / bent) @ (apart_moved(first) + slope_moved(apart)))

        def turned_by(direction: FloatArray) -> sparse.csr_array:
            """Rows (c, 2s) of the total derivative of y' along ``direction`` (c, 2)."""
            bending = _times((second * direction).sum(axis=1)) @ d_place
            return sparse.csr_array(slope_moved(direction) + bending)

        slip, d_slip = np.zeros(count), -sign * (_times(length) @ d_place)
        if before is not None:
            past = wrapped(place - before, master.around)
            slip = -sign * length * past
            d_slip = d_slip - _times(sign * past) @ turned_by(along)
        return Meeting(
            facing,
            np.where(facing, gap, NO_GAP),
            normal,
            turned(normal),
            place,
            np.where(facing, slip, 0.0),
            kept @ apart_moved(normal),
            kept @ d_slip,
            kept @ (_times(sign / length) @ turned_by(normal)),
            *transfer(slave, master, place, facing, d_place),
        )


def _times(factors: FloatArray) -> sparse.csr_array:
    """Multiplies rows (c, ...) by ``factors`` (c,)."""
    return sparse.csr_array(sparse.diags_array(factors, format="csr"))


def transfer(
    slave: ContactSide, master: ContactSide, place: FloatArray, facing: BoolArray, d_place: sparse.csr_array
) -> tuple[sparse.csr_array, Callable[[FloatArray], sparse.csr_array]]:
    """Matrix (m, c) from tractions at the slave's nodes, at places (c,) of the master with derivatives (c,
    s), to those at the master's, and the derivative (2m, s) of what it makes of tractions (c, 2); only
    intervals next to ``facing`` (c,) nodes count."""
    ends = facing if slave.around is None else np.append(facing, facing[:1])
    chosen = np.flatnonzero(ends[:-1] | ends[1:])
    on_slave, on_master, rise, length = integration(slave.curve, place, master.curve, chosen)
    # 2 - M / w for the inverse of M / w, as the mass matrix M has the lengths w as sums of its rows.
    over = sparse.diags_array(1.0 / master.weight)
    spread = (2.0 * sparse.eye_array(master.count) - over @ master.mass) @ over
    over_length = sparse.diags_array(length)

    def moved(traction: FloatArray) -> sparse.csr_array:
        onto = spread @ rise.T @ over_length
        parts = [onto @ sparse.diags_array(on_slave @ one) @ on_slave @ d_place for one in traction.T]
        both = sparse.vstack(parts, format="csr")
        return sparse.csr_array(both[np.arange(2 * master.count).reshape(2, -1).T.ravel()])

    return sparse.csr_array(spread @ on_master.T @ over_length @ on_slave), moved
