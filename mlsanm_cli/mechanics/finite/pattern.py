"""Pattern of the derivative of a body's rows by nodal displacements, the same in all states. Entries are
numbered by row and node. The derivative is added up in arrays of their coefficients, two per entry, and a
third one, of the mean stress at the node, where that is a nodal field of its own: its derivatives by
displacements then follow, on more nodes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.finite.loads import FacePoints
from mlsanm_cli.mechanics.supports import FREE
from mlsanm_cli.operators.least_squares import symbolic_of


class Entries:
    """Rows (r,) on ``nodes`` (m,), from ``begin`` (r + 1,) on, of ``count`` nodes; ``keys`` (m,) are row
    times count plus node, in ascending order."""

    def __init__(self, keys: IntArray, rows: int, count: int) -> None:
        self.keys, self.nodes, self.count = keys, keys % count, count
        self.begin = np.searchsorted(keys, count * np.arange(rows + 1))

    def at(self, keys: IntArray) -> IntArray:
        """Places of ``keys``."""
        return np.searchsorted(self.keys, keys)

    def coefficients(self, rows: sparse.csr_array, first: int) -> IntArray:
        """Places of the coefficients of ``rows`` (s, 2N) from ``first`` on in an array (2m,) of pairs."""
        return np.asarray(2 * self.at(_keys(rows, first)) + rows.indices % 2)


def _keys(rows: sparse.csr_array, first: int) -> IntArray:
    """Keys of the entries of ``rows`` (s, 2N), which begin with row ``first``."""
    row = np.repeat(first + np.arange(rows.shape[0]), np.diff(rows.indptr))
    return np.asarray(row * (rows.shape[1] // 2) + rows.indices // 2)


class Pattern:
    """Pattern of the rows of nodes, from the number ``pieces`` on of pieces of an ``elastic`` body, and
    from ``moments`` on of moments on them. Rows with stresses at nodes are the numbers ``row`` (s,), of
    the nodes ``stencil`` (s,); ``at`` are the places of their stencils' entries among the entries
    ``direct``, ``on_pieces`` those of groups of face points, in the three rows (3, e) of a piece.
    ``whole`` are all entries; there, ``at_constant`` are the places of ``constant`` rows (r - 3k, 2N) of
    springs and held displacements, and ``centers`` (N,) those of the nodes in the rows of moments on
    their pieces."""

    def __init__(
        self,
        elastic: ElasticBody,
        points: Iterable[FacePoints],
        pulls: sparse.csr_array,
        moments: Iterable[sparse.csr_array],
        nested: bool,
    ) -> None:
        """The pattern of an ``elastic`` body with the face ``points`` of its pieces, contributions ``pulls``
        (r - 3k, 2N) of springs to its rows and ``moments`` (k, 2N) to those of the pieces."""
        stencils, count, labels = elastic.model.stencils, elastic.pieces.count, elastic.pieces.labels
        nodes, split = len(labels), elastic.rows - 3 * elastic.pieces.count
        self.pieces, self.moments, last = split, split + 2 * count, split + 2 * count
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
        self.row, self.stencil, self.constant = np.concatenate(row), np.concatenate(stencil), constant
        lengths, reached = np.diff(stencils.indptr)[self.stencil], stencils.take(self.stencil).indices
        on_nodes = np.repeat(self.row, lengths) * nodes + reached
        on_pieces = [
            (split + owner + count * np.arange(3)[:, None]) * nodes + node
            for owner, node in (one.reached for one in points)
        ]
        held = np.array([node for node, _ in elastic.held_nodes], dtype=np.int64)
        single = np.arange(split - len(held), split) * nodes + held
        centers = (last + labels) * nodes + np.arange(nodes)
        further = [_keys(constant, 0), single, centers, *(_keys(one, last) for one in moments)]
        keys = np.concatenate([on_nodes, *(one.ravel() for one in on_pieces), *further])
        direct = self.direct = self.whole = Entries(np.unique(keys), elastic.rows, nodes)
        if nested:
            # Also the nodes that equilibrium and pieces reach through a stencil.
            some = (direct.keys < 2 * nodes * nodes) | (direct.keys >= split * nodes)
            at = np.divmod(direct.keys[some], nodes)
            fitted = sparse.csr_array((np.ones(len(at[0])), at), shape=(elastic.rows, nodes))
            entries = (np.ones(len(stencils.indices)), stencils.indices, stencils.indptr)
            beyond = sparse.coo_array(fitted @ sparse.csr_array(entries, shape=(nodes, nodes))).coords
            through = np.union1d(direct.keys, beyond[0].astype(np.int64) * nodes + beyond[1])
            self.whole = Entries(through, elastic.rows, nodes)
        self.at, self.on_pieces = direct.at(on_nodes), [direct.at(one) for one in on_pieces]
        self.at_constant, self.centers = self.whole.coefficients(constant, 0), self.whole.at(centers)
        self._indptr = (2 * self.whole.begin).astype(np.int32)
        both = np.stack([2 * self.whole.nodes, 2 * self.whole.nodes + 1], axis=1)
        self._indices = both.ravel().astype(np.int32)
        rows, strong = self.rows(np.ones((len(self.whole.nodes), 2)))
        owner, cloud = np.tile(np.arange(count), 3), elastic.model.cloud
        # The equations and their elimination order.
        self.symbolic = symbolic_of(rows, strong, owner, cloud.points, elastic.pieces.middle)

    def rows(self, values: FloatArray) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (r - 3k, 2N) of nodes and (3k, 2N) of pieces with coefficients ``values`` (m, 2)."""
        indptr, indices, flat = self._indptr, self._indices, values.reshape(-1)
        split, middle, width = self.pieces, indptr[self.pieces], 2 * self.whole.count
        nodes = flat[:middle], indices[:middle], indptr[: split + 1]
        pieces = flat[middle:], indices[middle:], indptr[split:] - middle
        shape = len(indptr) - 1 - split, width
        return sparse.csr_array(nodes, shape=(split, width)), sparse.csr_array(pieces, shape=shape)
