"""Which slave nodes face which place of the master: virtual nodes, normals, initial gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.joined import normals_towards
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.obstacles import Shape

MAX_FACING_COSINE = -0.2
"""Surfaces face each other if the product of their outward normals is below this."""
SLACK = 1e-6
ROUND_OFF = 1e-13


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
            on = on[(part.normal[own[on]] * normal[on]).sum(axis=1) < MAX_FACING_COSINE]
        yield part, own[on], on


def opposed(pairing: Pairing, s: FloatArray) -> BoolArray:
    """Whether places (e,) along a slave of several parts face the master there; those of a single surface
    do."""
    slave, master = pairing.slave.curve, pairing.master
    if not pairing.slave.parts or master is None:
        return np.ones(len(s), dtype=bool)
    there = master.curve.closest(slave.points(s))
    return np.asarray((slave.normals(s) * master.curve.normals(there)).sum(axis=1) < MAX_FACING_COSINE)


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
    facing = (slave.normal * normal).sum(axis=1) < MAX_FACING_COSINE
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
