"""Contact sides of bodies at finite strain: their nodes on the cloud, and the knots of their tractions,
linear between knots, which need not know the nodes. The cloud is loaded with their projection onto the hat
functions of its own nodes, which has the same force and moment. What it answers is smooth, and is
interpolated at the knots. Equation (25) of docs/method.md."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import AnyArray, BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.contact.finite.node_curve import NodeCurve, integration
from mlsanm_cli.contact.geometry.unfolding import Planes
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.near_field import ComplexArray, as_complex, as_real
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

CORNER_NODES = 2
"""Nodes from corners without near field with the cloud's response, from twice as many on with near fields."""
HALF_WINDOW = 4
"""Half-width of the fits' windows, in nodes: they suppress waves shorter than about six nodes."""

Wedges: TypeAlias = tuple[Corner | None, Corner | None]


@dataclass(frozen=True)
class Points:
    """Consecutive points (c,) on the ``geometry`` of a boundary of a ``body``, as drawn: ``places`` and
    ``outward`` normals (c, 2), arc lengths ``arc`` and lengths ``weight`` (c,); ``around`` is the length of a
    closed side. ``held`` (c,) marks points with a prescribed displacement component, ``corners`` are indices
    of corners and ends; an end may be at a plane of symmetry (``planes``) or a corner with known near field
    (``wedges``). Near fields end at the one of ``centers``, None for infinity; there are none without one."""

    body: str
    places: FloatArray
    outward: FloatArray
    weight: FloatArray
    arc: FloatArray
    around: float | None
    held: BoolArray
    corners: tuple[int, ...]
    planes: Planes
    wedges: Wedges
    geometry: Curve
    centers: Sequence[complex | None]

    @property
    def count(self) -> int:
        """Number of points (c)."""
        return len(self.arc)

    @cached_property
    def curve(self) -> NodeCurve:
        """The curve through the points, over reference arc lengths."""
        inner = self.corners if self.around is not None else self.corners[1:-1]
        return NodeCurve(self.arc, self.around, inner)

    @property
    def ends(self) -> FloatArray:
        """Arc lengths of the ends of the intervals; on a closed side the first one is repeated."""
        return self.curve.knots

    @cached_property
    def mass(self) -> sparse.csr_array:
        """Integrals (c, c) of the products of the points' hat functions."""
        hats, _, _, length = integration(self.curve, self.arc, self.curve)
        return sparse.csr_array(hats.T @ sparse.diags_array(length) @ hats)

    def at(self, arc: FloatArray, values: AnyArray) -> FloatArray:
        """Values (c,) at the points interpolated linearly at arc lengths (e,)."""
        return np.interp(arc, self.arc, np.asarray(values, np.float64), period=self.around)

    def deformed(self, displacement: FloatArray) -> tuple[ComplexArray, sparse.csr_array]:
        """Stretches times rotations (c,) of the side as complex numbers for a ``displacement`` (2c or more,),
        and rows (c, 2c) of the angles."""
        slopes, moved = self.curve.mean_slopes, displacement[: 2 * self.count].reshape(-1, 2)
        before, now = (as_complex(slopes @ one) for one in (self.places, self.places + moved))
        across = as_real(1j * now) / (np.abs(now) ** 2)[:, None]
        return now / before, by_component(slopes, across)


def _ends(side: Points, given: Sequence[object]) -> set[int]:
    """Indices of the ends at which something is ``given``."""
    return {end for end, one in zip((0, side.count - 1), given, strict=True) if one is not None}


@dataclass(frozen=True)
class SideNodes(Points):
    """The nodes of a side, with the numbers ``index`` (c,). ``members`` are the names of the surfaces with
    the indices of their nodes among these."""

    index: IntArray
    members: tuple[tuple[str, IntArray], ...]

    @property
    def unknowns(self) -> IntArray:
        """Displacement components (2c,) of the nodes among those of the body."""
        return np.asarray((2 * self.index[:, None] + np.arange(2)).ravel())

    def traction_rows(self, body: ElasticBody, some: Sequence[int] | IntArray) -> IntArray:
        """Rows (m,) of the tractions of ``some`` of the side's nodes, by index."""
        chosen = [(name, np.isin(numbers, some)) for name, numbers in self.members]
        rows = [body.condition_rows(name, axis)[own] for name, own in chosen for axis in (0, 1)]
        return np.concatenate(rows)

    def add_unit_tractions(
        self, body: ElasticBody, first: int, sources: FloatArray, tractions: dict[str, FloatArray]
    ) -> None:
        """Set the loads from number ``first`` on to unit tractions x and y at every node, per reference
        length and linear between nodes: ``sources`` (r, L) of the rows, and ``tractions`` (g, 2, L) at the
        FINE points of surfaces."""
        for name, numbers in self.members:
            halves = Halves.of(body.model.cloud.surfaces[name], FINE)
            every = np.arange(len(halves.arc))
            hats = tractions.setdefault(name, np.zeros((len(every), 2, sources.shape[1])))
            for component in (0, 1):
                columns = first + 2 * numbers + component
                sources[body.condition_rows(name, component), columns] = 1.0
                hats[every, component, columns[halves.own]] += halves.share
                hats[every, component, columns[halves.other]] += 1.0 - halves.share

    @cached_property
    def share(self) -> FloatArray:
        """Fraction (c,) of near fields in the response: zero at held nodes, except on planes of symmetry, and
        near corners without near field."""
        if not self.centers:
            return np.zeros(self.count)
        part = np.clip(self._away(_ends(self, self.wedges)) / CORNER_NODES - 1.0, 0.0, 1.0)
        mirrored = list(_ends(self, self.planes))
        return np.where(self.held & ~np.isin(np.arange(self.count), mirrored), 0.0, part)

    @property
    def inner(self) -> BoolArray:
        """Mask (c,) of the nodes with near fields that are away from all corners but planes of symmetry."""
        return np.asarray((self.share == 1.0) & (self._away(()) >= 2 * CORNER_NODES))

    def _away(self, ignored: Collection[int]) -> FloatArray:
        """Numbers (c,) of nodes to the nearest corner not ``ignored`` or at a plane of symmetry."""
        corners = sorted(set(self.corners) - _ends(self, self.planes) - set(ignored))
        apart = np.abs(np.arange(self.count)[:, None] - np.array(corners, dtype=np.int64))
        apart = apart if self.around is None else np.minimum(apart, self.count - apart)
        return np.asarray(np.min(apart.astype(float), axis=1, initial=np.inf))

    @cached_property
    def fit(self) -> FloatArray:
        """Local cubic fits along the side at its nodes (2c, 2c), continued behind planes of symmetry, where
        near fields have a share."""
        count, number = self.count, np.arange(self.count)
        copies = [(self.arc, number, np.eye(2))]
        if self.around is not None:
            copies += [(self.arc + turn, number, np.eye(2)) for turn in (-self.around, self.around)]
        for end, plane in enumerate(self.planes):
            if plane is not None:
                behind = np.delete(number, -end)
                copies.append((2.0 * self.arc[-end] - self.arc[behind], behind, plane.image.matrix))
        arc, node = (np.concatenate(one) for one in list(zip(*copies, strict=True))[:2])
        turned = np.concatenate([np.tile(one, (len(nodes), 1, 1)) for _, nodes, one in copies])
        order = np.argsort(arc)
        arc, node, turned, own = arc[order], node[order], turned[order], np.argsort(order)
        fit = np.zeros((count, count, 2, 2))
        for i in number:
            here = int(own[i])
            low, high = max(0, here - 3 * HALF_WINDOW), min(len(arc), here + 3 * HALF_WINDOW + 1)
            x, away = arc[low:high] - self.arc[i], np.arange(low, high) - here
            weight = np.exp(-((away / HALF_WINDOW) ** 2.0))
            basis = (x / np.abs(x).max())[:, None] ** np.arange(min(4, len(x)))
            values = np.linalg.solve(basis.T @ (weight[:, None] * basis), basis.T * weight)[0]
            np.add.at(fit[i], node[low:high], values[:, None, None] * turned[low:high])
        both = np.repeat(self.share, 2)
        smooth = fit.transpose(0, 2, 1, 3).reshape(2 * count, 2 * count)
        return np.asarray(np.diag(1.0 - both) + both[:, None] * smooth)


@dataclass(frozen=True)
class ContactSide(Points):
    """The knots of a side's tractions, on the same boundary as its ``nodes``; they include its corners."""

    nodes: SideNodes

    @classmethod
    def on(cls, nodes: SideNodes, arc: FloatArray) -> ContactSide:
        """Knots at arc lengths (g,), of which the first is that of the nodes."""
        geometry, around = nodes.geometry, nodes.around
        step = np.diff(arc if around is None else np.append(arc, arc[0] + around))
        step = np.pad(step, 1, mode="constant" if around is None else "wrap")
        weight = 0.5 * (step[1:] + step[:-1])[: len(arc)]
        corners = tuple(int(np.argmin(np.abs(arc - nodes.arc[one]))) for one in nodes.corners)
        outward = geometry.normals(arc)
        outward[list(corners)] = nodes.outward[list(nodes.corners)]
        held = nodes.at(arc, nodes.held) > 1.0 - COARSE_ROUND_OFF
        kept = (nodes.body, geometry.points(arc), outward, weight, arc, around, held, corners)
        return cls(*kept, nodes.planes, nodes.wedges, geometry, nodes.centers, nodes)

    @cached_property
    def rows(self) -> sparse.csr_array:
        """Rows (2g, 2c) of the values at the knots of functions with nodal vectors."""
        return both_components(self.nodes.curve.rows(self.arc)[0])

    @cached_property
    def forces(self) -> FloatArray:
        """Forces (2c, 2g) at the nodes for unit tractions at the knots."""
        return np.asarray(self.rows.T.toarray() * np.repeat(self.weight, 2))

    @cached_property
    def onto(self) -> sparse.csr_array:
        """Rows (2g, 2c) of displacements of the knots by those of the nodes (E)."""
        return sparse.csr_array(self.rows @ self.nodes.fit)

    @cached_property
    def spread(self) -> sparse.csr_array:
        """Nodal tractions (2c, 2g) by those at the knots (P), with the same force and moment."""
        own, nodal, _, length = integration(self.curve, self.arc, self.nodes.curve)
        shared = (nodal.T @ sparse.diags_array(length) @ own).toarray()
        return both_components(np.linalg.solve(self.nodes.mass.toarray(), shared))

    @cached_property
    def share(self) -> FloatArray:
        """Fraction (g,) of near fields in the response."""
        return self.nodes.at(self.arc, self.nodes.share)


def by_component(rows: sparse.csr_array, directions: FloatArray) -> sparse.csr_array:
    """Rows (c, m) of a scalar as rows (c, 2m) of the component along ``directions`` (c, 2)."""
    pairs = rows.data[:, None] * np.repeat(directions, np.diff(rows.indptr), axis=0)
    columns = np.stack([2 * rows.indices, 2 * rows.indices + 1], axis=1)
    shape = rows.shape[0], 2 * rows.shape[1]
    return sparse.csr_array((pairs.ravel(), columns.ravel(), 2 * rows.indptr), shape=shape)


def both_components(rows: sparse.csr_array | FloatArray) -> sparse.csr_array:
    """Rows (g, c) applied to both components (2g, 2c)."""
    return sparse.csr_array(sparse.kron(sparse.csr_array(rows), sparse.eye_array(2), format="csr"))
