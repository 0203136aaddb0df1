"""Quadrature points on the faces of a body's pieces, with the rows of displacement there.

Points are grouped in fits: the boundary between two nodes' cells (inner faces of the division), or one point
of the outline. Inner points and those of held sides carry the first Piola-Kirchhoff stress, the others
prescribed tractions. Every fit acts on one or two pieces.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, GAUSS, Halves, Rule
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.springs import FREE
from mlsanm_cli.operators.rows import pair_rows
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_gradients


@dataclass(frozen=True)
class FacePoints:
    """Fits e of t points each: ``places`` (e, t, 2), ``normals`` (e, t, 2) times quadrature weights,
    ``stencils`` with the weights (nnz, 3 t) of value, d/dX and d/dY at each point.

    ``fit``, ``owner`` and ``sign`` (m,) assign fits to pieces: the row of a piece is the sum of ``sign``
    times the forces in the components ``kept`` (e, 2).
    """

    places: FloatArray
    normals: FloatArray
    stencils: Stencils
    fit: IntArray
    owner: IntArray
    sign: FloatArray
    kept: FloatArray

    @property
    def count(self) -> int:
        """Number of points (q) of all fits."""
        return int(self.places.shape[0] * self.places.shape[1])

    def seen(self, displacement: FloatArray) -> FloatArray:
        """Value, d/dX, d/dY (3, q, 2) of nodal ``displacement`` (N, 2)."""
        found = self.stencils.derivatives(displacement)
        each = self.places.shape[1]
        return np.asarray(
            found.reshape(len(found), each, 3, 2).transpose(2, 0, 1, 3).reshape(3, self.count, 2)
        )

    def weights(self, point: int) -> FloatArray:
        """Weights (nnz, 3) of value, d/dX and d/dY at point number ``point`` of every fit."""
        return self.stencils.weights[:, 3 * point : 3 * point + 3]

    def entries(self) -> IntArray:
        """Fit (nnz,) of each stencil entry."""
        return np.repeat(np.arange(len(self.places)), np.diff(self.stencils.indptr))

    def rows(self, values: FloatArray) -> sparse.csr_array:
        """Rows (e, 2N) with ``values`` (nnz, 2)."""
        return pair_rows(self.stencils, values)


def inner_points(body: ElasticBody) -> FacePoints:
    """The faces between the body's pieces."""
    model, labels = body.model, body.pieces.labels
    edges = model.cloud.faces.between(labels).edges(rule_of(model))
    fits = np.arange(len(edges.one))
    both, sign = np.tile(fits, 2), np.repeat([-1.0, 1.0], len(fits))
    owner = np.concatenate([labels[edges.one], labels[edges.other]])
    stencils = _stencils(model, edges.middle, edges.points)
    kept = np.ones((len(fits), 2))
    return FacePoints(edges.points, edges.normals, stencils, both, owner, sign, kept)


def held_points(body: ElasticBody) -> FacePoints:
    """Points of the sides with held components, which carry stress."""
    model = body.model
    chosen = [name for name, components in body.gripped.items() if any(components)]
    found = [_along(body, name, rule_of(model)) for name in chosen]
    kept = [
        np.tile(np.array(body.gripped[name], dtype=float), (len(f[0]), 1))
        for name, f in zip(chosen, found, strict=True)
    ]
    return _outline_points(model, found, kept)


def loaded_points(body: ElasticBody, surfaces: Collection[str]) -> FacePoints:
    """FINE points of the ``surfaces`` with prescribed tractions, in components that are not held."""
    found = [_along(body, name, FINE) for name in surfaces]
    kept = [
        np.tile(1.0 - np.array(body.gripped.get(name, FREE), dtype=float), (len(f[0]), 1))
        for name, f in zip(surfaces, found, strict=True)
    ]
    return _outline_points(body.model, found, kept)


def _along(body: ElasticBody, name: str, rule: Rule) -> tuple[FloatArray, FloatArray, IntArray]:
    surface = body.model.cloud.surfaces[name]
    halves = Halves.of(surface, rule)
    normals = halves.length[:, None] * surface.curve.normals(halves.arc)
    return surface.curve.points(halves.arc), normals, body.pieces.labels[surface.index[halves.own]]


def _outline_points(
    model: BodyModel, found: list[tuple[FloatArray, FloatArray, IntArray]], kept: list[FloatArray]
) -> FacePoints:
    none = (np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.int64))
    places, normals, owner = (np.concatenate(some) for some in zip(*[*found, none], strict=True))
    stencils = _stencils(model, places, places[:, None])
    whole = np.concatenate([*kept, np.zeros((0, 2))])
    fits = np.arange(len(places))
    return FacePoints(
        places[:, None], normals[:, None], stencils, fits, owner, np.full(len(fits), -1.0), whole
    )


def _stencils(model: BodyModel, centers: FloatArray, points: FloatArray) -> Stencils:
    sight = model.cloud.sight
    return build_gradients(model.nodes, model.tree, centers, points, model.settings, sight, values=True)


def rule_of(model: BodyModel) -> Rule:
    """Gauss rule that integrates moments of stresses of the polynomial degree exactly."""
    return GAUSS[model.settings.degree // 2 + 1]


def middles(body: ElasticBody) -> sparse.csr_array:
    """Rows (k, N) of the means over the nodes of every piece."""
    labels = body.pieces.labels
    count = np.bincount(labels, minlength=body.pieces.count)
    entries = (1.0 / count[labels], (labels, np.arange(len(labels))))
    return sparse.csr_array(entries, shape=(body.pieces.count, len(body.model.nodes)))
