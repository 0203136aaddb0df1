"""Contact sides of bodies at finite strain, and their nominal tractions as loads of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.contact.finite.meeting import by_component
from mlsanm_cli.contact.finite.node_curve import NodeCurve
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.finite.loads import Loads
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex, as_real
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

Restraints: TypeAlias = Mapping[str, tuple[bool, bool]]
Wedges: TypeAlias = tuple[Corner | None, Corner | None]


@dataclass(frozen=True)
class ContactSide:
    """Consecutive ``nodes`` (c,) of surfaces of a ``body``.

    In the reference configuration: ``places`` (c, 2), outward normals ``outward`` (c, 2), ``arc`` (c,)
    lengths along the side, ``weight`` (c,) lengths of the nodes. ``members`` are the surfaces' names with the
    indices of their nodes among these. ``around`` is the length of a closed side, else None. ``held`` (c,)
    marks nodes with a prescribed displacement component. ``corners`` are the indices of nodes at corners and
    ends; at either end ``mirrors`` has the axis normal to a plane of symmetry, if any, and ``wedges`` a
    corner with known near field.
    """

    body: str
    members: tuple[tuple[str, IntArray], ...]
    nodes: IntArray
    places: FloatArray
    outward: FloatArray
    weight: FloatArray
    arc: FloatArray
    around: float | None
    held: BoolArray
    corners: tuple[int, ...]
    mirrors: tuple[int | None, int | None]
    wedges: Wedges = (None, None)

    @classmethod
    def of(
        cls,
        body: str,
        cloud: Cloud,
        surface: Surface,
        held: Restraints,
        nodes: Sequence[int] = (),
        wedges: Wedges = (None, None),
    ) -> ContactSide:
        """The side on a ``surface`` of a body's ``cloud`` with ``held`` components of surfaces and held
        ``nodes``, with ``wedges`` at its ends."""
        around = surface.curve.length if surface.curve.closed else None
        found = np.zeros(len(cloud.points), dtype=bool)
        for name, components in held.items():
            found[cloud.surfaces[name].index] |= any(components)
        found[list(nodes)] = True
        ends = (0, len(surface.index) - 1)
        known = {int(np.argmin(np.abs(surface.arc_length - one))) for one in surface.curve.corners}
        return cls(
            body,
            tuple((part.name, numbers) for part, numbers in surface.members),
            surface.index,
            cloud.points[surface.index],
            surface.normal,
            surface.weight,
            surface.arc_length,
            around,
            found[surface.index],
            tuple(sorted(known if around is not None else known.union(ends))),
            mirrors := (_mirror(cloud, surface, ends[0], held), _mirror(cloud, surface, ends[1], held)),
            (wedges[0] if mirrors[0] is None else None, wedges[1] if mirrors[1] is None else None),
        )

    @property
    def count(self) -> int:
        """Number of nodes (c)."""
        return len(self.nodes)

    @property
    def name(self) -> str:
        """Its first surface, as in the case."""
        return f"{self.body}.{self.members[0][0].partition('/')[0]}"

    def traction_rows(self, body: ElasticBody, some: Sequence[int] | IntArray) -> IntArray:
        """Rows (m,) of the tractions of ``some`` of the side's nodes, by index."""
        rows = [
            body.condition_rows(name, component)[np.isin(numbers, some)]
            for name, numbers in self.members
            for component in (0, 1)
        ]
        return np.concatenate(rows)

    @cached_property
    def curve(self) -> NodeCurve:
        """The curve through its nodes, over reference arc lengths."""
        inner = self.corners if self.around is not None else self.corners[1:-1]
        return NodeCurve(self.arc, self.around, inner)

    def turned(self, displacement: FloatArray) -> tuple[ComplexArray, sparse.csr_array]:
        """Rotations of the side at its nodes as unit complex numbers (c,), for nodal displacements (c, 2),
        and rows (c, 2c) of the derivatives of the angles."""
        slopes = self.curve.mean_slopes
        before, now = (as_complex(slopes @ one) for one in (self.places, self.places + displacement))
        turn = now * np.conj(before)
        across = as_real(1j * now) / (np.abs(now) ** 2)[:, None]
        return np.asarray(turn / np.abs(turn)), by_component(slopes, across)


def _mirror(cloud: Cloud, surface: Surface, end: int, held: Restraints) -> int | None:
    """Axis normal to a straight symmetry plane (a surface held in that component only) that a side meets at
    its ``end`` at a right angle; None without."""
    if surface.curve.closed:
        return None
    normal, own = surface.normal[end], [part.name for part, _ in surface.members]
    for name, components in held.items():
        adjacent = cloud.surfaces[name]
        if name in own or surface.index[end] not in adjacent.index or sum(components) != 1:
            continue
        axis = components.index(True)
        flat = float(np.ptp(cloud.points[adjacent.index, axis])) <= COARSE_ROUND_OFF * adjacent.curve.length
        if flat and abs(normal[axis]) <= COARSE_ROUND_OFF:
            return axis
    return None


def with_sides(loads: Loads, body: ElasticBody, sides: Sequence[ContactSide]) -> Loads:
    """The ``loads`` followed by unit tractions x and y at every node of the body's ``sides``, per reference
    length and linear between nodes."""
    more = 2 * sum(one.count for one in sides)
    if not more:
        return loads
    first, loads = loads.count, with_more(loads, more)
    sources, tractions = loads.sources, dict(loads.tractions)
    for side in sides:
        for name, numbers in side.members:
            halves = Halves.of(body.model.cloud.surfaces[name], FINE)
            shape = (len(halves.arc), 2, loads.count)
            hats, every = tractions.setdefault(name, np.zeros(shape)), np.arange(len(halves.arc))
            for component in (0, 1):
                columns = first + 2 * numbers + component
                sources[body.condition_rows(name, component), columns] = 1.0
                hats[every, component, columns[halves.own]] += halves.share
                hats[every, component, columns[halves.other]] += 1.0 - halves.share
        first += 2 * side.count
    return replace(loads, tractions=tractions)


def with_more(loads: Loads, more: int) -> Loads:
    """The ``loads`` followed by ``more`` zero loads."""
    sources = np.hstack([loads.sources, np.zeros((len(loads.sources), more))])
    tractions = {name: _wider(given, more) for name, given in loads.tractions.items()}
    force = None if loads.force is None else _wider(loads.force, more)
    turning = [replace(one, rate=np.append(one.rate, np.zeros(more))) for one in loads.turning]
    wider = replace(loads, count=loads.count + more, sources=sources, tractions=tractions, force=force)
    return replace(wider, turning=turning)


def _wider(values: FloatArray, more: int) -> FloatArray:
    """``values`` (e, 2, L) extended by ``more`` zero loads."""
    return np.concatenate([values, np.zeros((*values.shape[:2], more))], axis=2)
