"""Which slave nodes face which place of the master: virtual nodes, normals, initial gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import normals_towards
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid, turned
from mlsanm_cli.contact.geometry.obstacles import Shape

OPPOSED = -0.2
"""Surfaces face each other where their outward normals' product is below this."""

WINDOW = 2.0
"""Half-width of the window over which pressures are carried to the master, in spacings."""
SLACK = 1e-6
ROUND_OFF = 1e-13
NEWTON = 5
"""Steps to a place on the slave; each squares the error, which begins as a part of the gap."""
WINDOW_SHARPNESS = 4.0
"""Squared residuals in the window are weighted by exp(-2 WINDOW_SHARPNESS r^2)."""


@dataclass(frozen=True)
class Pairing:
    """The places of one contact on the slave that have a partner on the master (w of them).

    ``position`` (w,) numbers them among the slave surface's nodes, -1 for places between nodes;
    ``points`` (w, 2) where they lie, ``arc`` (w,) their arc lengths along the slave, increasing over the
    candidates, continuing past the start of a closed surface, ``weight`` (w,) the length of slave surface
    they stand for. ``partner`` (w, 2) are the virtual nodes on the master, ``normal`` (w, 2) the master's
    outward normals there, ``gap`` (w,) the initial gaps, ``candidate`` (w,) marks the places that can touch;
    the others are only watched. ``friction`` is Coulomb's coefficient, inf of bonded surfaces,
    ``interference`` what the gaps lose when the load of this contact's name is at 1, ``closed_by`` what they
    have lost to surfaces drawn touching. A contact with a rigid obstacle has neither ``master_body`` nor
    ``master``; its virtual nodes lie on the obstacle. With ``grid`` the candidates are the places of a
    contact grid, and gaps and normals means over its functions. ``exchanged`` is set where the case has
    slave and master the other way round.
    """

    name: str
    slave_body: str
    slave: Surface
    master_body: str | None
    master: Surface | None
    position: IntArray
    points: FloatArray
    arc: FloatArray
    weight: FloatArray
    partner: FloatArray
    normal: FloatArray
    gap: FloatArray
    spacing: FloatArray
    candidate: BoolArray
    friction: float = 0.0
    interference: float = 0.0
    closed_by: float = 0.0
    grid: ContactGrid | None = None
    exchanged: bool = False

    @property
    def bodies(self) -> tuple[str, ...]:
        """The elastic bodies: slave and, if there is one, master."""
        return (self.slave_body,) if self.master_body is None else (self.slave_body, self.master_body)

    @property
    def bonded(self) -> bool:
        """Whether the surfaces are one: as with friction without limit, and they do not part."""
        return self.friction == np.inf

    @property
    def sides(self) -> tuple[tuple[str, bool, float], ...]:
        """Of each of :attr:`bodies` its name, whether it is the slave, and the sign of forces and motions."""
        return tuple(zip(self.bodies, (True, False), (1.0, -1.0), strict=False))

    def surface_of(self, slave: bool) -> Surface:
        """The surface of the slave, or of the master of a contact that has one."""
        found = self.slave if slave else self.master
        assert found is not None, "an obstacle has no nodes"
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """The boundaries of :attr:`bodies`, as the case names them."""
        slave = f"{self.slave_body}.{self.slave.name}"
        return (slave,) if self.master is None else (slave, f"{self.master_body}.{self.master.name}")

    @property
    def tangent(self) -> FloatArray:
        """The normals turned by -90 degrees (w, 2): slip and friction of the slave are counted along them."""
        return turned(self.normal)

    @property
    def node(self) -> IntArray:
        """Node numbers (w,) in the slave body."""
        return self.slave.index[self.position]

    @property
    def all_around(self) -> bool:
        """Whether the candidates are all nodes of a closed surface, with neighbours across its seam."""
        count = int(self.candidate.sum())
        return self.grid is None and self.slave.curve.closed and count == len(self.slave.index)

    def with_reach(self, reach: float) -> Pairing:
        """The same pairs with the nodes of initial gap up to ``reach`` as candidates."""
        return replace(self, candidate=self.gap <= reach)

    def first_reach(self) -> float:
        """A reach to begin with: the widest gap where the slave's spacing is within 1.5 of the finest."""
        fine = self.spacing <= 1.5 * self.spacing.min()
        return float(max(self.gap[fine].max(), self.gap.min()))


def facing_parts(
    slave: Surface, position: IntArray, normal: FloatArray
) -> Iterator[tuple[Surface, IntArray, IntArray]]:
    """The body's own surfaces that a slave is made of; the numbers (k,) of those of its nodes at ``position``
    (m,) that lie there and face the master's ``normal`` (m, 2); and which (k,) of the m these are.

    At a corner between two of them a node lies on both, and may face the master with one only.
    """
    for part, place in slave.members:
        numbers = np.full(len(slave.index), -1, dtype=np.int64)
        numbers[place] = np.arange(len(place))
        own = numbers[position]
        on = np.flatnonzero(own >= 0)
        if slave.parts:
            on = on[(part.normal[own[on]] * normal[on]).sum(axis=1) < OPPOSED]
        yield part, own[on], on


def opposed(pairing: Pairing, s: FloatArray) -> BoolArray:
    """Whether places (e,) along a slave of several parts face the master there; those of a single surface
    do."""
    slave, master = pairing.slave.curve, pairing.master
    if not pairing.slave.parts or master is None:
        return np.ones(len(s), dtype=bool)
    there = master.curve.closest(slave.points(s))
    return np.asarray((slave.normals(s) * master.curve.normals(there)).sum(axis=1) < OPPOSED)


def _weights(slave: Surface, position: IntArray, normal: FloatArray) -> FloatArray:
    """The lengths (m,) of a slave's surface that nodes at ``position`` (m,) stand for, where it faces the
    master."""
    weight = np.zeros(len(position))
    for part, own, on in facing_parts(slave, position, normal):
        weight[on] += part.weight[own]
    return weight


def on_grid(pairing: Pairing, grid: ContactGrid) -> Pairing:
    """The contact of nodes ``pairing`` with pressures on a contact grid; its nodes beyond are watched."""
    hats, facing = grid.hats, grid.facing
    place = grid.around(facing.locate(pairing.points))
    slack = SLACK * (grid.last - grid.first)
    beyond = (place < grid.first - slack) | (place > grid.last + slack)
    points, partner, _ = facing.opposite(hats.place)
    gap = grid.gap - pairing.closed_by
    count = len(hats.place)

    def joined(own: FloatArray, others: FloatArray) -> FloatArray:
        return np.concatenate([own, others[beyond]])

    return replace(
        pairing,
        position=np.concatenate([np.full(count, -1), pairing.position[beyond]]),
        points=joined(points, pairing.points),
        arc=joined(hats.place, place),
        weight=joined(hats.weight, pairing.weight),
        partner=joined(partner, pairing.partner),
        normal=joined(hats.at_places(grid.directions[0]), pairing.normal),
        gap=joined(gap, pairing.gap),
        spacing=joined(hats.weight, pairing.spacing),
        candidate=np.arange(count + int(beyond.sum())) < count,
        grid=grid,
    )


def pair_surfaces(
    name: str,
    slave_body: str,
    slave_cloud: Cloud,
    slave: Surface,
    master_body: str,
    master_cloud: Cloud,
    master: Surface,
    friction: float = 0.0,
) -> Pairing:
    """Closest points on the master's exact curve for every slave node that faces it.

    A node whose closest point is an end of the master, seen at an angle, has no partner.
    """
    s = master.curve.closest(slave_cloud.points[slave.index])
    partner, normal = master.curve.points(s), normals_towards(master.curve, s, slave.normal)
    return _paired(name, slave_body, slave_cloud, slave, (master_body, master), partner, normal, friction)


def pair_obstacle(
    name: str, slave_body: str, slave_cloud: Cloud, slave: Surface, obstacle: Shape, friction: float = 0.0
) -> Pairing:
    """The same with a rigid obstacle for master."""
    partner, normal = obstacle.closest(slave_cloud.points[slave.index], slave.normal)
    return _paired(name, slave_body, slave_cloud, slave, (None, None), partner, normal, friction)


def _paired(
    name: str,
    slave_body: str,
    slave_cloud: Cloud,
    slave: Surface,
    master: tuple[str, Surface] | tuple[None, None],
    partner: FloatArray,
    normal: FloatArray,
    friction: float,
) -> Pairing:
    """Pairs of the slave nodes with those of their closest points (b, 2) that they face."""
    points = slave_cloud.points[slave.index]
    away = points - partner
    tangential = np.abs(away[:, 0] * normal[:, 1] - away[:, 1] * normal[:, 0])
    spacing = slave_cloud.spacing[slave.index]
    facing = (slave.normal * normal).sum(axis=1) < OPPOSED
    gap = (away * normal).sum(axis=1)
    # Surfaces drawn in one place neither overlap nor gape by the last bits of their coordinates.
    gap[np.abs(gap) <= ROUND_OFF * np.abs(points).max()] = 0.0
    position = _along(slave, np.flatnonzero(facing & (tangential < 1e-6 * spacing)), gap)
    arc = slave.arc_length[position]
    return Pairing(
        name=name,
        slave_body=slave_body,
        slave=slave,
        master_body=master[0],
        master=master[1],
        position=position,
        points=points[position],
        arc=arc + slave.curve.length * (arc < arc[:1]),
        weight=_weights(slave, position, normal[position]),
        partner=partner[position],
        normal=normal[position],
        gap=gap[position],
        spacing=spacing[position],
        candidate=np.ones(len(position), dtype=bool),
        friction=friction,
    )


def _along(slave: Surface, position: IntArray, gap: FloatArray) -> IntArray:
    """Positions in order along the slave.

    On a closed one they begin behind the widest stretch left out; if none is, as with a pin in a hole, where
    the ``gap`` (b,) is widest.
    """
    if not slave.curve.closed or not len(position):
        return position
    if len(position) == len(slave.index):
        return np.roll(position, -int(np.argmax(gap)))
    s = slave.arc_length[position]
    left_out = np.diff(np.append(s, s[0] + slave.curve.length))
    return np.roll(position, -(int(np.argmax(left_out)) + 1))


def spacing_ratio(pairing: Pairing, clouds: Mapping[str, Cloud]) -> float:
    """Largest ratio, either way, of facing spacings over the candidates; 1 on an obstacle, which has none."""
    chosen, master = pairing.candidate, pairing.master
    if master is None or pairing.master_body is None or not chosen.any():
        return 1.0
    master_cloud = clouds[pairing.master_body]
    arc = master.curve.closest(pairing.partner[chosen])
    around = master.curve.length if master.curve.closed else None
    h = np.interp(arc, master.arc_length, master_cloud.spacing[master.index], period=around)
    ratio = pairing.spacing[chosen] / h
    return float(np.maximum(ratio, 1.0 / ratio).max())


def transfer(pairing: Pairing, master_cloud: Cloud) -> sparse.csr_array:
    """Pressure at the master's surface nodes (b, m) from the candidates' pressures (m,).

    One-dimensional moving least squares of degree 1 along the slave surface, times the slave's length per
    length of the master: a constant pressure is reproduced where surfaces touch. Nodes outside the
    candidates' range receive none. The window is as wide as the coarser of the two spacings asks for: a
    coarse master that only sampled a fine slave's pressures would take an oscillation from node to node for
    a smooth load, and the compliance would lose its positivity.

    A pressure is transferred to the very place where its node's gap is measured, and by the slave's length
    there, so that forces and work are the same on both sides up to the fit. Taken from the closest point of
    the slave instead, a pressure is displaced and stretched by a part of the order of the square of contact
    width over radius, whatever the spacings: on clouds fine enough the compliance then loses its positivity.
    """
    master = pairing.master
    assert master is not None, "an obstacle has no nodes"
    arc, _, spacing = _unrolled(pairing)
    s, offset, stretch = feet(pairing, master, master.arc_length)
    slack = 1e-6 * float(pairing.spacing.min())
    facing = (slave_normals(pairing, s) * master.normal).sum(axis=1) < OPPOSED
    if pairing.slave.curve.closed:
        s = np.where(s < pairing.arc[0] - slack, s + pairing.slave.curve.length, s)
    rows = np.flatnonzero(facing & (s >= arc[0] - slack) & (s <= arc[-1] + slack) & (offset <= slack))
    own = np.interp(s[rows], arc, spacing)
    # The slack keeps nodes at the window's very edge inside, whatever round-off and the unit of length say.
    reach = (1.0 + SLACK) * WINDOW * np.maximum(own, master_cloud.spacing[master.index[rows]])
    fit = candidates_fit(pairing, s[rows], reach).tocoo()
    inner, columns = fit.coords
    carried = fit.data * stretch[rows[inner]]
    return sparse.csr_array((carried, (rows[inner], columns)), shape=(len(s), fit.shape[1]))


def feet(pairing: Pairing, master: Surface, arc: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where on the slave the places at ``arc`` (b,) along the master have their pressures from: arc lengths
    (b,), how far each misses its place (b,), and the slave's length per length of the master (b,).

    There the closest point of the master is the place, found by Newton's method from the place's own closest
    point.
    """
    slave, points = pairing.slave.curve, master.curve.points(arc)
    s = slave.closest(points)
    normal = normals_towards(master.curve, arc, slave.normals(s))
    curvature = master.curve.curvature(arc)
    for _ in range(NEWTON):
        off = master.curve.closest(slave.points(s)) - arc
        if master.curve.closed:
            off -= master.curve.length * np.round(off / master.curve.length)
        cosine = -(slave_normals(pairing, s) * normal).sum(axis=1)
        gap = ((slave.points(s) - points) * normal).sum(axis=1)
        # Where surfaces do not face each other nothing is carried over, whatever their stretch.
        stretch = (1.0 + curvature * gap) / np.maximum(cosine, -OPPOSED)
        # The two curves run past each other, each with its material on the left.
        moved = s + stretch * off
        s = np.mod(moved, slave.length) if slave.closed else np.clip(moved, 0.0, slave.length)
    return s, np.abs(off), stretch


def slave_normals(pairing: Pairing, s: FloatArray) -> FloatArray:
    """Normals (b, 2) of the slave at arc lengths ``s`` (b,); where candidates end at a corner, those of the
    side that they are on."""
    curve = pairing.slave.curve
    if pairing.slave.parts and pairing.candidate.any():
        first, last = pairing.arc[pairing.candidate][[0, -1]]
        small = SLACK * float(pairing.spacing.min())
        s = np.where(np.abs(s - first) <= small, first + small, s)
        s = np.where(np.abs(s - last) <= small, last - small, s)
    return curve.normals(np.mod(s, curve.length) if curve.closed else s)


def candidates_fit(pairing: Pairing, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """Values at arc lengths ``s`` (r,) of local linear fits to those of the candidates (m,): weights (r, m).

    ``reach`` (r,) are the windows' half-widths. All around a closed surface they run on across the seam.
    """
    arc, weight, _ = _unrolled(pairing)
    fit = surface_fit(arc, weight, s, reach).tocoo()
    rows, columns = fit.coords
    count = int(pairing.candidate.sum())
    return sparse.csr_array((fit.data, (rows, columns % count)), shape=(len(s), count))


def _unrolled(pairing: Pairing) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc lengths, surface lengths and spacings (m,) of the candidates; where they go all around, those of
    the turns before and after too (3m,), so that windows run on across the seam."""
    chosen = pairing.candidate
    arc, weight, spacing = pairing.arc[chosen], pairing.weight[chosen], pairing.spacing[chosen]
    if not pairing.all_around:
        return arc, weight, spacing
    turns = pairing.slave.curve.length * np.arange(-1, 2)
    return (turns[:, None] + arc).ravel(), np.tile(weight, 3), np.tile(spacing, 3)


def surface_fit(arc: FloatArray, weight: FloatArray, s: FloatArray, reach: FloatArray) -> sparse.csr_array:
    """Values at arc lengths ``s`` (r,) of local linear fits to nodal values (m,) at ``arc``: weights (r, m).

    ``weight`` (m,) are the nodes' surface lengths, ``reach`` (r,) the windows' half-widths. Linear functions
    are reproduced.
    """
    first, last = _window(arc, s, reach)
    count = last - first
    start = np.cumsum(count) - count
    columns = np.repeat(first - start, count) + np.arange(count.sum())
    offset = (arc[columns] - np.repeat(s, count)) / np.repeat(reach, count)
    # Between candidates far apart even the nearest ones lie outside the window: their weights would underflow
    # to 0 / 0. Only the ratios of weights count.
    nearest = np.minimum.reduceat(offset**2, start) if len(start) else np.zeros(0)
    shift = np.repeat(np.where(nearest > 1.0, nearest, 0.0), count)
    share = np.exp(-2.0 * WINDOW_SHARPNESS * (offset**2 - shift)) * weight[columns]
    s0, s1, s2 = (np.repeat(np.add.reduceat(share * offset**k, start), count) for k in range(3))
    # A window with a single node can only carry its constant.
    slope = s0 * s2 - s1**2 > 1e-12 * s0**2
    share = np.where(slope, share * (s2 - s1 * offset) / np.where(slope, s0 * s2 - s1**2, 1.0), share / s0)
    rows = np.repeat(np.arange(len(s)), count)
    return sparse.csr_array((share, (rows, columns)), shape=(len(s), len(arc)))


def _window(arc: FloatArray, s: FloatArray, reach: FloatArray) -> tuple[IntArray, IntArray]:
    """Ranges [first, last) of ``arc`` (m,) within ``reach`` (r,) of ``s`` (r,), at least the two nearest."""
    nearest = np.clip(np.searchsorted(arc, s), 1, max(len(arc) - 1, 1))
    first = np.minimum(np.searchsorted(arc, s - reach), nearest - 1)
    last = np.maximum(np.searchsorted(arc, s + reach, side="right"), np.minimum(nearest + 1, len(arc)))
    return first, last
