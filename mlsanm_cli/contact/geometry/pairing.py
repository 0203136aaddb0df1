"""Pairing of slave nodes with points of the master: closest points, normals, initial gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.cloud.surface import Surface, normals_towards
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.facing import turned
from mlsanm_cli.contact.geometry.obstacles import Shape
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF

MAX_FACING_COSINE = -0.2
"""Surfaces face each other where the product of their outward normals is below this."""


@dataclass(frozen=True)
class Pairing:
    """The w points of one contact on the slave with a partner on the master.

    ``position`` (w,) are indices among the slave surface's nodes, -1 for points between nodes; ``points`` (w,
    2) their coordinates, ``arc`` (w,) arc lengths along the slave, increasing over the candidates and
    continuing past the start of a closed surface, ``weight`` (w,) surface lengths, ``around`` (w,) the
    circumferences of bodies of revolution there, else 1. ``partner``  (w, 2) are the closest points of the
    master, ``normal`` (w, 2) its outward normals there, ``gap`` (w,) initial gaps. ``candidate`` (w,) marks
    the m points that can touch; the others are monitored. ``friction`` is Coulomb's coefficient, inf for
    bonded surfaces. ``interference`` reduces the gaps when the load of the contact's name is 1, ``closed_by``
    is their reduction to surfaces drawn touching. A rigid obstacle has neither ``master_body`` nor
    ``master``. With a ``contact_grid`` the candidates are its nodes, and gaps and normals averages over its
    hats. ``exchanged``: slave and master are swapped with respect to the case.
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
    around: FloatArray
    candidate: BoolArray
    friction: float = 0.0
    interference: float = 0.0
    closed_by: float = 0.0
    contact_grid: ContactGrid | None = None
    exchanged: bool = False

    @property
    def count(self) -> int:
        """Number m of candidates."""
        return int(self.candidate.sum())

    @property
    def nodal(self) -> bool:
        """Whether the candidates are nodes of the slave, without near field."""
        return self.contact_grid is None

    @property
    def grid(self) -> ContactGrid:
        """The contact grid, of a contact that is not :attr:`nodal`."""
        assert self.contact_grid is not None, f"contact {self.name} has nodal pressures"
        return self.contact_grid

    @property
    def bodies(self) -> tuple[str, ...]:
        """The elastic bodies: slave and, if any, master."""
        return (self.slave_body,) if self.master_body is None else (self.slave_body, self.master_body)

    @property
    def revolved(self) -> bool:
        """Whether its bodies are those of revolution."""
        return bool((self.around != 1.0).any())

    @property
    def areas(self) -> FloatArray:
        """Areas (w,) on which the pressures act, of the full turn or per unit thickness."""
        return self.weight * self.around

    @property
    def bonded(self) -> bool:
        """Whether the surfaces are bonded: no slip and no separation."""
        return self.friction == np.inf

    @property
    def sides(self) -> tuple[tuple[str, bool, float], ...]:
        """For each of :attr:`bodies` name, whether it is the slave, and sign of forces and motions."""
        return tuple(zip(self.bodies, (True, False), (1.0, -1.0), strict=False))

    def sides_of(self, body: str) -> list[tuple[bool, float]]:
        """Of those of ``body``: whether it is the slave, and the sign."""
        return [(slave, sign) for name, slave, sign in self.sides if name == body]

    def surface_of(self, slave: bool) -> Surface:
        """The surface of the slave, or of the master if it is an elastic body."""
        found = self.slave if slave else self.master
        assert found is not None, "an obstacle has no nodes"
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """Boundaries of :attr:`bodies` as the case names them."""
        slave = f"{self.slave_body}.{self.slave.name}"
        return (slave,) if self.master is None else (slave, f"{self.master_body}.{self.master.name}")

    @property
    def tangent(self) -> FloatArray:
        """Normals rotated by -90 degrees (w, 2): positive direction of slip and friction on the slave."""
        return turned(self.normal)

    @property
    def node(self) -> IntArray:
        """Node numbers (w,) in the slave body."""
        return self.slave.index[self.position]

    @property
    def all_around(self) -> bool:
        """Whether the candidates are all nodes of a closed surface."""
        return self.nodal and self.slave.curve.closed and self.count == len(self.slave.index)

    def first_reach(self) -> float:
        """First guess of the reach: the largest gap where the slave's spacing is within 1.5 of the finest."""
        fine = self.spacing <= 1.5 * self.spacing.min()
        return float(max(self.gap[fine].max(), self.gap.min()))


def facing_parts(
    slave: Surface, position: IntArray, normal: FloatArray
) -> Iterator[tuple[Surface, IntArray, IntArray]]:
    """The body's own surfaces of a slave, each with the indices (k,) of its nodes among those at ``position``
    (m,) that face the master's ``normal`` (m, 2), and among the m; a corner may lie on two."""
    for part, place in slave.members:
        numbers = np.full(len(slave.index), -1, dtype=np.int64)
        numbers[place] = np.arange(len(place))
        own = numbers[position]
        on = np.flatnonzero(own >= 0)
        if slave.parts:
            on = on[(part.normal[own[on]] * normal[on]).sum(axis=1) < MAX_FACING_COSINE]
        yield part, own[on], on


def opposed(pairing: Pairing, s: FloatArray) -> BoolArray:
    """Mask (e,) of coordinates along a slave of several parts that face the master; all true for one part."""
    slave, master = pairing.slave.curve, pairing.master
    if not pairing.slave.parts or master is None:
        return np.ones(len(s), dtype=bool)
    there = master.curve.closest(slave.points(s))
    return np.asarray((slave.normals(s) * master.curve.normals(there)).sum(axis=1) < MAX_FACING_COSINE)


def on_grid(pairing: Pairing, grid: ContactGrid) -> Pairing:
    """The contact with pressures on a contact grid; slave nodes beyond the grid are monitored."""
    hats, facing = grid.hats, grid.facing
    place = grid.around(facing.locate(pairing.points))
    slack = COARSE_ROUND_OFF * (grid.last - grid.first)
    beyond = (place < grid.first - slack) | (place > grid.last + slack)
    points, partner, _ = facing.opposite(hats.place)
    count = len(hats.place)
    own = {
        "position": (np.full(count, -1), pairing.position),
        "points": (points, pairing.points),
        "arc": (hats.place, place),
        "weight": (hats.weight, pairing.weight),
        "partner": (partner, pairing.partner),
        "normal": (hats.at_places(grid.directions[0]), pairing.normal),
        "gap": (grid.gap - pairing.closed_by, pairing.gap),
        "spacing": (hats.weight, pairing.spacing),
        "around": (np.ones(count), pairing.around),
    }
    joined: dict[str, Any] = {name: np.concatenate([a, b[beyond]]) for name, (a, b) in own.items()}
    joined["candidate"] = np.arange(count + int(beyond.sum())) < count
    return replace(pairing, **joined, contact_grid=grid)


def pair_surfaces(
    name: str,
    slave_body: str,
    slave_cloud: Cloud,
    slave: Surface,
    master: tuple[str, Surface] | Shape,
    friction: float = 0.0,
) -> Pairing:
    """Pair the slave nodes with closest points that face them, of the exact curve of a ``master``, given by
    its body and surface, or of a rigid obstacle; none to an end of the master seen at an angle."""
    points = slave_cloud.points[slave.index]
    body, surface = master if isinstance(master, tuple) else (None, None)
    if isinstance(master, tuple):
        surface = master[1]
        s = surface.curve.closest(points)
        partner, normal = surface.curve.points(s), normals_towards(surface.curve, s, slave.normal)
    else:
        partner, normal = master.closest(points, slave.normal)
    away = points - partner
    tangential = np.abs(cross(away, normal))
    spacing = slave_cloud.spacing[slave.index]
    facing = (slave.normal * normal).sum(axis=1) < MAX_FACING_COSINE
    gap = (away * normal).sum(axis=1)
    # Coincident surfaces have zero gaps, whatever the round-off of their coordinates.
    gap[np.abs(gap) <= FINE_ROUND_OFF * np.abs(points).max()] = 0.0
    position = np.flatnonzero(facing & (tangential < COARSE_ROUND_OFF * spacing))
    if slave.curve.closed and len(position):
        # In order along the slave, from behind the widest stretch without pairs or, without any, as for a pin
        # in a hole, from the widest gap.
        start = int(np.argmax(gap))
        if len(position) < len(slave.index):
            s = slave.arc_length[position]
            start = int(np.argmax(np.diff(np.append(s, s[0] + slave.curve.length)))) + 1
        position = np.roll(position, -start)
    arc, weight = slave.arc_length[position], np.zeros(len(position))
    for part, own, on in facing_parts(slave, position, normal[position]):
        weight[on] += part.weight[own]
    return Pairing(
        name=name,
        slave_body=slave_body,
        slave=slave,
        master_body=body,
        master=surface,
        position=position,
        points=points[position],
        arc=arc + slave.curve.length * (arc < arc[:1]),
        weight=weight,
        partner=partner[position],
        normal=normal[position],
        gap=gap[position],
        spacing=spacing[position],
        around=slave_cloud.around_nodes(slave)[position],
        candidate=np.ones(len(position), dtype=bool),
        friction=friction,
    )


def facing_spacing(pairing: Pairing, cloud: Cloud) -> FloatArray:
    """Spacings (m,) of the master, a surface of ``cloud``, opposite the candidates."""
    master = pairing.surface_of(slave=False)
    around = master.curve.length if master.curve.closed else None
    place = master.curve.closest(pairing.partner[pairing.candidate])
    return np.asarray(np.interp(place, master.arc_length, cloud.spacing[master.index], period=around))


def spacing_ratio(pairing: Pairing, clouds: Mapping[str, Cloud]) -> float:
    """Largest ratio, either way, of the two spacings over the candidates; 1 for an obstacle."""
    chosen = pairing.candidate
    if pairing.master_body is None or not chosen.any():
        return 1.0
    ratio = pairing.spacing[chosen] / facing_spacing(pairing, clouds[pairing.master_body])
    return float(np.maximum(ratio, 1.0 / ratio).max())
