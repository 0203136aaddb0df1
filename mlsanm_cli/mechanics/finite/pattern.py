"""Pattern of the derivative of a body's rows by nodal displacements, the same in all states.

Entries are numbered by row and node. The derivative is added up in arrays of their coefficients, two per
entry, and a third one, of the mean stress at the node, where that is a nodal field of its own: its
derivatives by displacements then follow, on more nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.loads import FacePoints
from mlsanm_cli.mechanics.springs import FREE
from mlsanm_cli.operators.least_squares import Symbolic, symbolic_of
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Entries:
    """Rows (r,) on ``nodes`` (m,), from ``begin`` (r + 1,) on, of ``count`` nodes; ``keys`` (m,) are row
    times count plus node, in ascending order."""

    keys: IntArray
    begin: IntArray
    nodes: IntArray
    count: int

    @classmethod
    def of(cls, keys: IntArray, rows: int, count: int) -> Entries:
        """The entries with sorted ``keys``."""
        return cls(keys, np.searchsorted(keys, count * np.arange(rows + 1)), keys % count, count)

    def at(self, keys: IntArray) -> IntArray:
        """Places of ``keys``."""
        return np.searchsorted(self.keys, keys)

    def coefficients(self, rows: sparse.csr_array, first: int) -> IntArray:
        """Places of the coefficients of ``rows`` (s, 2N), which begin with row ``first``, in an array (2m,)
        of pairs."""
        return np.asarray(2 * self.at(_keys(rows, first)) + rows.indices % 2)


def _keys(rows: sparse.csr_array, first: int) -> IntArray:
    """Keys of the entries of ``rows`` (s, 2N), which begin with row ``first``."""
    row = np.repeat(first + np.arange(rows.shape[0]), np.diff(rows.indptr))
    return np.asarray(row * (rows.shape[1] // 2) + rows.indices // 2)


@dataclass(frozen=True)
class Pattern:
    """Pattern of the rows of nodes, from the number ``pieces`` on of pieces of an ``elastic`` body, and from
    ``moments`` on of moments on them.

    Rows with stresses at nodes are the numbers ``row`` (s,), of the nodes ``stencil`` (s,); ``at`` are the
    places of their stencils' entries among the entries ``direct``, ``on_pieces`` those of groups of face
    points, in the three rows (3, e) of a piece. ``whole`` are all entries; there, ``at_constant`` are the
    places of ``constant`` rows (r - 3k, 2N) of springs and held displacements, and ``centers`` (N,) those of
    the nodes in the rows of moments on their pieces.
    """

    elastic: ElasticBody
    pieces: int
    moments: int
    row: IntArray
    stencil: IntArray
    direct: Entries
    at: IntArray
    on_pieces: Sequence[IntArray]
    whole: Entries
    constant: sparse.csr_array
    at_constant: IntArray
    centers: IntArray

    @classmethod
    def of(
        cls,
        elastic: ElasticBody,
        points: Iterable[FacePoints],
        pulls: sparse.csr_array,
        moments: Iterable[sparse.csr_array],
        nested: bool,
    ) -> Pattern:
        """The pattern of an ``elastic`` body with the face ``points`` of its pieces, contributions ``pulls``
        (r - 3k, 2N) of springs to its rows and ``moments`` (k, 2N) to those of the pieces."""
        stencils, count, labels = elastic.model.stencils, elastic.pieces.count, elastic.pieces.labels
        nodes, split = len(labels), elastic.rows - 3 * elastic.pieces.count
        row, stencil = [np.arange(2 * nodes)], [np.tile(np.arange(nodes), 2)]
        constant = pulls
        for name, surface in elastic.model.cloud.surfaces.items():
            for component in (0, 1):
                numbers = elastic.condition_rows(name, component)
                if elastic.held.get(name, FREE)[component]:
                    places = (numbers, 2 * surface.index + component)
                    constant = constant + sparse.csr_array((np.ones(len(numbers)), places), pulls.shape)
                else:
                    row.append(numbers)
                    stencil.append(surface.index)
        rows, own = np.concatenate(row), np.concatenate(stencil)
        on_nodes = np.repeat(rows, np.diff(stencils.indptr)[own]) * nodes + stencils.take(own).indices
        on_pieces = [
            (split + owner + count * np.arange(3)[:, None]) * nodes + node
            for owner, node in (one.reached for one in points)
        ]
        held, last = np.array([node for node, _ in elastic.held_nodes], dtype=np.int64), split + 2 * count
        single = np.arange(split - len(held), split) * nodes + held
        centers = (last + labels) * nodes + np.arange(nodes)
        further = [_keys(constant, 0), single, centers, *(_keys(one, last) for one in moments)]
        keys = np.concatenate([on_nodes, *(one.ravel() for one in on_pieces), *further])
        direct = whole = Entries.of(np.unique(keys), elastic.rows, nodes)
        if nested:
            # Also the nodes that equilibrium and pieces reach through a stencil.
            some = (direct.keys < 2 * nodes * nodes) | (direct.keys >= split * nodes)
            at = np.divmod(direct.keys[some], nodes)
            fitted = sparse.csr_array((np.ones(len(at[0])), at), shape=(elastic.rows, nodes))
            entries = (np.ones(len(stencils.indices)), stencils.indices, stencils.indptr)
            beyond = sparse.coo_array(fitted @ sparse.csr_array(entries, shape=(nodes, nodes))).coords
            through = np.union1d(direct.keys, beyond[0].astype(np.int64) * nodes + beyond[1])
            whole = Entries.of(through, elastic.rows, nodes)
        return cls(
            elastic=elastic,
            pieces=split,
            moments=last,
            row=rows,
            stencil=own,
            direct=direct,
            at=direct.at(on_nodes),
            on_pieces=[direct.at(one) for one in on_pieces],
            whole=whole,
            constant=constant,
            at_constant=whole.coefficients(constant, 0),
            centers=whole.at(centers),
        )

    def rows(self, values: FloatArray) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (r - 3k, 2N) of nodes and (3k, 2N) of pieces with coefficients ``values`` (m, 2)."""
        indptr = (2 * self.whole.begin).astype(np.int32)
        indices = np.stack([2 * self.whole.nodes, 2 * self.whole.nodes + 1], axis=1).ravel().astype(np.int32)
        width, middle = 2 * self.whole.count, indptr[self.pieces]
        flat, ends = values.reshape(-1), (indptr[: self.pieces + 1], indptr[self.pieces :] - middle)
        parts = ((flat[:middle], indices[:middle]), (flat[middle:], indices[middle:]))
        nodes, pieces = (
            sparse.csr_array((*part, end), shape=(len(end) - 1, width))
            for part, end in zip(parts, ends, strict=True)
        )
        return nodes, pieces

    @cached_property
    def symbolic(self) -> Symbolic:
        """Pattern of the equations and their elimination order."""
        rows, strong = self.rows(np.ones((len(self.whole.nodes), 2)))
        owner = np.tile(np.arange(self.elastic.pieces.count), 3)
        return symbolic_of(rows, strong, owner, self.elastic.model.cloud.points, self.elastic.pieces.middle)
