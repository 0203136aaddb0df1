"""Response of sides to their own tractions, of any wave length.

For the undeformed body the displacements K of a side's knots due to unit tractions there, linear between
knots, are computed as for contact grids: closed-form near fields, and a smooth remainder
(:mod:`mlsanm_cli.mechanics.remainder`) of forces at the nodes, interpolated. The cloud alone answers the
projected tractions P T with E C P T at the knots. The change of the response with the state is smooth, and
that of the cloud::

    displacement of the side = E u + Q (K - E C P) Q^T T

with the cloud's displacements u and the knots' rotations Q. Tractions thus need no nodes, and small loads
give the small-strain response.

Equation (25) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.finite.meeting import vectors_along
from mlsanm_cli.contact.finite.near_field import NearField
from mlsanm_cli.contact.finite.sides import HALF_WINDOW, ContactSide, SideNodes
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.near_field import ComplexArray
from mlsanm_cli.mechanics.remainder import remainder_sources
from mlsanm_cli.mechanics.rigid import free_motions
from mlsanm_cli.operators.system import BLOCK_COLUMNS
from mlsanm_cli.records import dataclass

DEEP = 0.5
"""Nodes at this part of the largest depth are far from all sides."""


@dataclass(frozen=True)
class Compliance:
    """What an undeformed body answers at all of its nodes, x and y in turn: ``cloud`` (2N, 2c) to unit
    tractions at the ``nodes`` of a side, and ``remainder`` (2N, 2c) to unit forces there, less their near
    fields. The whole of a loose body moves as the nodes ``deep`` (m,) inside do, by free motions of
    ``patterns`` (2n, d) at places (n, 2)."""

    nodes: SideNodes
    body: ElasticBody
    deep: IntArray
    patterns: Callable[[FloatArray], FloatArray]
    cloud: FloatArray
    remainder: FloatArray

    @classmethod
    def of(cls, nodes: SideNodes, projector: Projector, first: int) -> Compliance:
        """From a body's equations in the undeformed state, whose loads from number ``first`` on are the unit
        tractions."""
        body = projector.body
        still, none = np.zeros(body.unknowns), np.zeros(body.loads.count)
        columns = load_columns(body, still, none, slice(first, first + 2 * nodes.count))
        moved = -projector.factorised(still, none).solve_unrefined(projector.scaled(columns.toarray()))
        return cls(nodes, body.elastic, *_deep(body), moved, _remainder(nodes, body.elastic))

    def beyond_cloud(self, side: ContactSide) -> FloatArray:
        """K - E C P (2g, 2g) for unit tractions at the knots of a side with these nodes."""
        near, both, seen = self._near(side), np.repeat(side.share, 2), side.nodes.unknowns
        moved = near.field + side.rows @ self.remainder[seen] @ self._forces(side)
        moved -= side.onto @ self.cloud[seen] @ side.spread + self._offset(near, side.places)
        return _uneven(side, both[:, None] * moved * both, own=True)

    def inside(self, side: ContactSide) -> FloatArray:
        """The same (2N, 2g) at all nodes of the body but those of the side, where it is 0."""
        points, shape = self.body.model.cloud.points, (self.body.model.unknowns, 2 * side.count)
        if not side.share.any():
            return np.zeros(shape)
        near = self._near(side)
        moved = self.remainder @ self._forces(side) - self.cloud @ side.spread - self._offset(near, points)
        others = np.setdiff1d(np.arange(len(points)), side.nodes.index)
        found = np.zeros_like(moved)
        rows = (2 * others[:, None] + np.arange(2)).ravel()
        found[rows] = moved[rows] + near.displaced(points[others])
        return _uneven(side, found * np.repeat(side.share, 2), own=False)

    def _near(self, side: ContactSide) -> NearField:
        return NearField(side, self.body, side.nodes.centers[0])

    def _forces(self, side: ContactSide) -> FloatArray:
        """Forces (2c, 2g) at the nodes for unit tractions at the knots."""
        return np.asarray(side.rows.T.toarray() * np.repeat(side.weight, 2))

    def _offset(self, near: NearField, places: FloatArray) -> FloatArray | float:
        """Motion (2n, 2g) of a loose body on the whole, which is that of the cloud, at ``places`` (n, 2)."""
        if not len(self.deep):
            return 0.0
        points, seen = self.body.model.cloud.points[self.deep], 2 * self.deep[:, None] + np.arange(2)
        side = near.side
        assert isinstance(side, ContactSide)
        moved = self.remainder[seen.ravel()] @ self._forces(side) - self.cloud[seen.ravel()] @ side.spread
        apart = moved + near.displaced(points)
        return np.asarray(self.patterns(places) @ np.linalg.lstsq(self.patterns(points), apart)[0])


def beyond_clouds(
    compliances: Sequence[Compliance], sides: Sequence[tuple[ContactSide, slice]]
) -> FloatArray:
    """Displacements (2s, 2s) of all sides for their own unit tractions, beyond those of the clouds."""
    size = max((here.stop for _, here in sides), default=0)
    found = np.zeros((size, size))
    for compliance, (side, here) in zip(compliances, sides, strict=True):
        if side.share.any():
            found[here, here] = compliance.beyond_cloud(side)
    return found


def _remainder(nodes: SideNodes, body: ElasticBody) -> FloatArray:
    """Displacements (2N, 2c) of a body by the remainders of unit forces at the nodes; those of nodes without
    near fields are those of the nearest with them."""
    chosen = np.flatnonzero(nodes.share)
    found = np.zeros((body.model.unknowns, 2 * nodes.count))
    if not len(chosen):
        return found
    near, moved = NearField(nodes, body, nodes.centers[0]), []
    for first in range(0, len(chosen), BLOCK_COLUMNS):
        some = chosen[first : first + BLOCK_COLUMNS]
        sources = remainder_sources(body, near.forces(some)).reshape(body.rows, 2, -1).transpose(0, 2, 1)
        moved.append(body.system.solve(sparse.csc_array(sources.reshape(body.rows, -1))))
    beside = np.abs(chosen - np.arange(nodes.count)[:, None]).argmin(axis=1)
    found = np.concatenate(moved, axis=1)[:, (2 * beside[:, None] + np.arange(2)).ravel()]
    found[nodes.unknowns] = found[(2 * nodes.index[chosen[beside]][:, None] + np.arange(2)).ravel()]
    return found


@dataclass(frozen=True)
class SideResponse:
    """Displacements (2s,) of sides in a state: ``smooth`` (2s, 2N) applied to the cloud's, plus
    ``by_traction`` (2s, 2s), which changes with the former by ``by_turning`` (2s, 2s)."""

    smooth: sparse.csr_array
    by_traction: FloatArray
    by_turning: FloatArray

    @classmethod
    def of(
        cls,
        sides: Sequence[tuple[ContactSide, slice]],
        missing: FloatArray,
        smooth: sparse.csr_array,
        displacement: FloatArray,
        traction: FloatArray,
    ) -> SideResponse:
        """From the sides and their ranges, what is ``missing`` (2s, 2s) of their responses, the rows of
        ``smooth`` displacements, the cloud's ``displacement`` (2N,), and their ``traction`` (2s,)."""
        surface = smooth @ displacement
        turns = [side.turned(surface[here].reshape(-1, 2)) for side, here in sides]
        turn = np.concatenate([np.zeros(0, dtype=complex), *(one for one, _ in turns)])
        angles = sparse.block_diag([sparse.csr_array((0, 0)), *(rows for _, rows in turns)], format="csr")
        whole = rotated(missing, turn, turn)
        answered, pulled = (_across(one) for one in (whole @ traction, traction))
        return cls(smooth, whole, (answered - whole @ pulled) @ angles)

    def moved(self, displacement: FloatArray, traction: FloatArray) -> FloatArray:
        """Displacements (2s,) of the sides for the cloud's ``displacement`` (2N,)."""
        return np.asarray(self.smooth @ displacement + self.by_traction @ traction)

    def changed(self, displacement: FloatArray) -> FloatArray:
        """Derivative of these, applied to changes (2N, ...) of the cloud's displacements."""
        return self.followed(self.smooth @ displacement)

    def followed(self, smooth: FloatArray) -> FloatArray:
        """The same, applied to changes (2s, ...) of the smooth displacements."""
        return np.asarray(smooth + self.by_turning @ smooth)


def _deep(body: FiniteBody) -> tuple[IntArray, Callable[[FloatArray], FloatArray]]:
    """Nodes (m,) of a loose body far from its sides, at which it moves on the whole, and its free motions
    (2n, d) of places (n, 2); none of others.

    What clouds answer is seen from pins, and there it is as wrong as next to the sides: as a motion of one
    side against all others that would be a spring.
    """
    elastic = body.elastic
    cloud, bearing = elastic.model.cloud, elastic.held_nodes[: len(elastic.held_nodes) - body.pins]
    free = free_motions(cloud, elastic.held, bearing, elastic.springs)
    if not body.pins:
        return np.zeros(0, dtype=np.int64), free.patterns
    outer = np.concatenate([surface.index for surface in cloud.surfaces.values()])
    depth = nearest(cKDTree(cloud.points[outer]), cloud.points)[0]
    return np.flatnonzero(depth >= DEEP * depth.max()), free.patterns


def rotated(answers: FloatArray, rows: ComplexArray, columns: ComplexArray) -> FloatArray:
    """``answers`` (2n, 2g) in directions that have turned by unit complex numbers at the ``rows`` (n,) and
    ``columns`` (g,)."""
    parts = answers.reshape(len(rows), 2, len(columns), 2)
    seen = (parts[:, 0] + 1j * parts[:, 1]) * rows[:, None, None]
    by_x, by_y = seen[..., 0], seen[..., 1]
    cos, sin = columns.real, columns.imag
    found = np.stack([by_x * cos - by_y * sin, by_x * sin + by_y * cos], axis=2)
    return np.ascontiguousarray(np.stack([found.real, found.imag], axis=1)).reshape(answers.shape)


def _across(values: FloatArray) -> sparse.csr_array:
    """Derivative (2c, c) of vectors (2c,) by their rotation angles."""
    return vectors_along(np.stack([-values[1::2], values[::2]], axis=1))


def _uneven(side: ContactSide, missing: FloatArray, own: bool) -> FloatArray:
    """Part of a response ``missing`` (2n, 2g) for non-uniform tractions: the cloud responds exactly to a
    uniform one. At the side's ``own`` knots where the share of near fields is below 1, near corners, only
    some neighbours count, and terms that cancel elsewhere would remain: there it acts on differences from the
    knot's own traction."""
    blocks = missing.reshape(-1, 2, side.count, 2).copy()
    if own:
        number, beside = np.arange(side.count), side.node_number
        near = np.abs(beside[:, None] - beside) <= 3 * HALF_WINDOW
        blocks[number, :, number] -= np.einsum("ibjd,ij->ibd", blocks, (1.0 - side.share)[:, None] * near)
    blocks -= blocks.sum(axis=2)[:, :, None] * (side.weight / side.weight.sum())[:, None]
    return blocks.reshape(missing.shape)
