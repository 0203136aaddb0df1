"""Response of sides to their own tractions, of any wave length.

The displacements K of the undeformed side's knots due to unit tractions there are computed as for contact
grids: closed-form near fields, and a smooth remainder (:mod:`mlsanm_cli.mechanics.remainder`). They replace
what the cloud alone answers, E C P, in directions that turn with the side; so tractions need no nodes, and
small loads give the small-strain response. Equation (25) of docs/method.md."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import nearest
from mlsanm_cli.contact.finite.sides import HALF_WINDOW, ContactSide, Points, SideNodes
from mlsanm_cli.contact.geometry.contact_grid import ContactGrid
from mlsanm_cli.contact.geometry.facing import Facing, turned
from mlsanm_cli.contact.geometry.grid import Hats
from mlsanm_cli.contact.geometry.surface_response import SurfaceResponse
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.corner import CorneredForces
from mlsanm_cli.mechanics.finite.projector import Projector
from mlsanm_cli.mechanics.finite.tangent import load_columns
from mlsanm_cli.mechanics.near_field import SURFACE_INSET, ComplexArray, SurfaceForces, as_complex
from mlsanm_cli.mechanics.remainder import remainder_sources
from mlsanm_cli.mechanics.rigid import free_motions
from mlsanm_cli.operators.stencil_weights import nodal_pairs
from mlsanm_cli.operators.system import BLOCK_COLUMNS

DEEP = 0.5
"""Nodes at this part of the largest depth are far from all sides."""


class NearField:
    """Closed-form near fields of tractions at points of a ``side`` of a ``body``, linear between them: those
    of contact grids, observed at the points."""

    def __init__(self, side: Points, body: ElasticBody) -> None:
        self.side, self._kernel = side, body.model.kernel
        self._center = center = side.centers[0]
        ends, corners = side.ends, tuple(replace(one, fades=True) for one in side.wedges if one)
        hats = Hats.on(ends, (True, True), side.around)
        around = (center, None), (corners, ()), side.planes
        facing, first, last = Facing(side.geometry, None), float(ends[0]), float(ends[-1])
        self._grid = ContactGrid(facing, first, last, 1, hats, *around)
        # Forces at ends are shifted inwards.
        self._arc = side.arc.copy()
        if side.around is None:
            self._arc[[0, -1]] += SURFACE_INSET * side.weight[[0, -1]] * np.array([1.0, -1.0])

    def forces(self, chosen: IntArray | slice = slice(None)) -> CorneredForces:
        """Unit forces at all or the ``chosen`` points (k,)."""
        place, inward = self._grid.facing.side(self._arc[chosen], True)
        own = SurfaceForces(self._kernel, place, inward, self._center)
        return CorneredForces(own, self._grid.corners_of(True), self._grid.images_of(True))

    def displaced(self, places: FloatArray) -> FloatArray:
        """Displacements (2n, 2c) at ``places`` (n, 2) inside the body by unit tractions."""
        found = self.forces().displacement(as_complex(places)) * self.side.weight[:, None, None]
        return _interleaved(found)

    @property
    def field(self) -> FloatArray:
        """Displacements (2c, 2c) of the points due to unit tractions."""
        response = SurfaceResponse(self._grid, self._kernel, True)
        sharp = response.singular(self.side.arc)
        if self.side.around is not None:
            sharp[:, 0] += sharp[:, -1]
        smooth = response.smooth(self._arc, self._arc) * self.side.weight[:, None, None]
        return _interleaved(smooth + sharp[:, : self.side.count])


def _interleaved(table: FloatArray) -> FloatArray:
    """Displacements (e, k, 2, 2) as a matrix (2e, 2k), x and y in turn."""
    rows, columns = table.shape[:2]
    return np.asarray(table.transpose(0, 2, 1, 3).reshape(2 * rows, 2 * columns))


class Compliance:
    """What an undeformed body answers at all of its nodes, x and y in turn: ``cloud`` (2N, 2c) to unit
    tractions at the ``nodes`` of a side, and ``remainder`` (2N, 2c) to unit forces there, less their near
    fields, which at nodes without these is that of the nearest with them. The whole of a loose body moves as
    the nodes ``deep`` (m,) inside do: what clouds answer is seen from pins, and there it is as wrong as next
    to the sides, which would be a spring between one side and all others."""

    def __init__(self, nodes: SideNodes, projector: Projector, first: int) -> None:
        """From a body's equations before loading, whose loads from ``first`` on are the unit tractions."""
        body, elastic = projector.body, projector.body.elastic
        self.nodes, self.body, cloud = nodes, elastic, elastic.model.cloud
        still, none = np.zeros(body.unknowns), np.zeros(body.loads.count)
        columns = load_columns(body, still, none, slice(first, first + 2 * nodes.count))
        self.cloud = -projector.factorised(still, none).solve_unrefined(projector.scaled(columns.toarray()))
        bearing = elastic.held_nodes[: len(elastic.held_nodes) - body.pins]
        self.patterns = free_motions(cloud, elastic.held, bearing, elastic.springs).patterns
        self.deep = np.zeros(0, dtype=np.int64)
        if body.pins:
            outer = np.concatenate([surface.index for surface in cloud.surfaces.values()])
            depth = nearest(cKDTree(cloud.points[outer]), cloud.points)[0]
            self.deep = np.flatnonzero(depth >= DEEP * depth.max())
        self.remainder = np.zeros((elastic.model.unknowns, 2 * nodes.count))
        chosen = np.flatnonzero(nodes.share)
        if not len(chosen):
            return
        near, moved = NearField(nodes, elastic), []
        for begin in range(0, len(chosen), BLOCK_COLUMNS):
            sources = remainder_sources(elastic, near.forces(chosen[begin : begin + BLOCK_COLUMNS]))
            sources = sources.reshape(elastic.rows, 2, -1).transpose(0, 2, 1)
            moved.append(elastic.system.solve(sparse.csc_array(sources.reshape(elastic.rows, -1))))
        beside = np.abs(chosen - np.arange(nodes.count)[:, None]).argmin(axis=1)
        found = np.concatenate(moved, axis=1)[:, (2 * beside[:, None] + np.arange(2)).ravel()]
        found[nodes.unknowns] = found[(2 * nodes.index[chosen[beside]][:, None] + np.arange(2)).ravel()]
        self.remainder = found

    def beyond_cloud(self, side: ContactSide) -> FloatArray:
        """K - E C P (2g, 2g) for unit tractions at the knots of a side with these nodes."""
        if not side.share.any():
            return np.zeros((2 * side.count, 2 * side.count))
        near, both, seen = NearField(side, self.body), np.repeat(side.share, 2), side.nodes.unknowns
        moved = near.field + side.rows @ self.remainder[seen] @ side.forces
        moved -= side.onto @ self.cloud[seen] @ side.spread + self._offset(near, side, side.places)
        return _uneven(side, both[:, None] * moved * both, own=True)

    def inside(self, side: ContactSide) -> FloatArray:
        """The same (2N, 2g) at all nodes of the body but those of the side, where it is 0."""
        points, found = self.body.model.cloud.points, np.zeros((self.body.model.unknowns, 2 * side.count))
        if not side.share.any():
            return found
        near = NearField(side, self.body)
        moved = self.remainder @ side.forces - self.cloud @ side.spread - self._offset(near, side, points)
        others = np.setdiff1d(np.arange(len(points)), side.nodes.index)
        rows = (2 * others[:, None] + np.arange(2)).ravel()
        found[rows] = moved[rows] + near.displaced(points[others])
        return _uneven(side, found * np.repeat(side.share, 2), own=False)

    def _offset(self, near: NearField, side: ContactSide, places: FloatArray) -> FloatArray | float:
        """Motion (2n, 2g) of a loose body on the whole, which is that of the cloud, at ``places`` (n, 2)."""
        if not len(self.deep):
            return 0.0
        points, seen = self.body.model.cloud.points[self.deep], 2 * self.deep[:, None] + np.arange(2)
        moved = self.remainder[seen.ravel()] @ side.forces - self.cloud[seen.ravel()] @ side.spread
        apart = moved + near.displaced(points)
        return np.asarray(self.patterns(places) @ np.linalg.lstsq(self.patterns(points), apart)[0])


class SideResponse:
    """Displacements (2s,) of sides in a state: ``smooth`` (2s, 2N) applied to the cloud's, plus
    ``by_traction`` (2s, 2s), which changes with the former by ``by_turning`` (2s, 2s)."""

    def __init__(
        self,
        missing: FloatArray,
        smooth: sparse.csr_array,
        turn: ComplexArray,
        angles: sparse.csr_array,
        traction: FloatArray,
    ) -> None:
        """From what is ``missing`` (2s, 2s) of the responses of undeformed sides, the rows of ``smooth``
        displacements, rotations ``turn`` (s,) with rows ``angles`` (s, 2s), and the ``traction`` (2s,)."""
        self.smooth, self.by_traction = smooth, rotated(missing, turn, turn)
        answered, pulled = _across(self.by_traction @ traction), _across(traction)
        self.by_turning = (answered - self.by_traction @ pulled) @ angles

    def moved(self, displacement: FloatArray, traction: FloatArray) -> FloatArray:
        """Displacements (2s,) of the sides for the cloud's ``displacement`` (2N,)."""
        return np.asarray(self.smooth @ displacement + self.by_traction @ traction)

    def followed(self, smooth: FloatArray) -> FloatArray:
        """Derivative of these, applied to changes (2s, ...) of the smooth displacements."""
        return np.asarray(smooth + self.by_turning @ smooth)


def rotated(answers: FloatArray, rows: ComplexArray, columns: ComplexArray) -> FloatArray:
    """``answers`` (2n, 2g) in directions turned by unit complex numbers at rows (n,) and columns (g,)."""
    parts = answers.reshape(len(rows), 2, len(columns), 2)
    seen = (parts[:, 0] + 1j * parts[:, 1]) * rows[:, None, None]
    by_x, by_y = seen[..., 0], seen[..., 1]
    cos, sin = columns.real, columns.imag
    found = np.stack([by_x * cos - by_y * sin, by_x * sin + by_y * cos], axis=2)
    return np.ascontiguousarray(np.stack([found.real, found.imag], axis=1)).reshape(answers.shape)


def _across(values: FloatArray) -> sparse.csr_array:
    """Derivative (2c, c) of vectors (2c,) by their rotation angles."""
    every = np.arange(len(values) // 2)
    return sparse.csr_array(nodal_pairs(every, -turned(values.reshape(-1, 2)), len(every)).T)


def _uneven(side: ContactSide, missing: FloatArray, own: bool) -> FloatArray:
    """Part of a response ``missing`` (2n, 2g) for non-uniform tractions: the cloud responds exactly to a
    uniform one. At the side's ``own`` knots where the share of near fields is below 1, near corners, only
    some neighbours count, and terms that cancel elsewhere would remain: there it acts on differences from the
    knot's own traction."""
    blocks = missing.reshape(-1, 2, side.count, 2).copy()
    if own:
        # Positions of the knots in the sequence of the nodes.
        number, ends = np.arange(side.count), side.nodes.ends
        beside = np.interp(side.arc, ends, np.arange(len(ends)))
        near = np.abs(beside[:, None] - beside) <= 3 * HALF_WINDOW
        blocks[number, :, number] -= np.einsum("ibjd,ij->ibd", blocks, (1.0 - side.share)[:, None] * near)
    blocks -= blocks.sum(axis=2)[:, :, None] * (side.weight / side.weight.sum())[:, None]
    return blocks.reshape(missing.shape)
