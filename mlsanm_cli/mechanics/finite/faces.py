"""Quadrature points on the faces of a body's pieces, with the rows of displacement there.

Points are grouped in fits: the boundary between two nodes' cells (inner faces of the division), or one point
of the outline. Inner points and those of held sides carry the first Piola-Kirchhoff stress, the others
prescribed tractions. Every fit acts on one or two pieces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import Halves, Rule
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.pieces import rule_of
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_gradients
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class FacePoints:
    """Fits e of t points each: ``places`` (e, t, 2), ``normals`` (e, t, 2) times quadrature weights,
    ``stencils`` with the weights (nnz, 3 t) of value, d/dX and d/dY at each point.

    ``fit``, ``owner`` and ``sign`` (m,) assign fits to pieces: the row of a piece is the sum of ``sign``
    times the forces in the components ``kept`` (e, 2). ``along`` are the ranges of points of sides.
    """

    places: FloatArray
    normals: FloatArray
    stencils: Stencils
    fit: IntArray
    owner: IntArray
    sign: FloatArray
    kept: FloatArray
    along: Mapping[str, slice] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of points (q) of all fits."""
        return int(self.places.shape[0] * self.places.shape[1])

    @property
    def reached(self) -> tuple[IntArray, IntArray]:
        """Piece and node of all entries of the fits that act on the pieces."""
        taken = self.stencils.take(self.fit)
        return np.repeat(self.owner, np.diff(taken.indptr)), taken.indices

    def seen(self, displacement: FloatArray) -> FloatArray:
        """Value, d/dX, d/dY (q, 3, 2) of nodal ``displacement`` (2N,)."""
        return self.stencils.derivatives(displacement.reshape(-1, 2)).reshape(-1, 3, 2)


def inner_points(body: ElasticBody) -> FacePoints:
    """The faces between the body's pieces."""
    model, labels = body.model, body.pieces.labels
    one, other, points, normals = model.cloud.faces.between(labels).edges(rule_of(model))
    fits = np.arange(len(one))
    both, sign = np.tile(fits, 2), np.repeat([-1.0, 1.0], len(fits))
    owner = np.concatenate([labels[one], labels[other]])
    stencils = _stencils(model, points.mean(axis=1), points)
    return FacePoints(points, normals, stencils, both, owner, sign, np.ones((len(fits), 2)))


def outline_points(body: ElasticBody, kept: Mapping[str, Sequence[bool]], rule: Rule) -> FacePoints:
    """Points of sides, by name with the components of forces that are ``kept`` there."""
    cloud, labels, model = body.model.cloud, body.pieces.labels, body.model
    places, normals, owner, every = [np.zeros((0, 2))], [np.zeros((0, 2))], [labels[:0]], [np.zeros((0, 2))]
    along, first = {}, 0
    for name, components in kept.items():
        surface = cloud.surfaces[name]
        halves = Halves.of(surface, rule)
        places.append(surface.curve.points(halves.arc))
        normals.append(halves.length[:, None] * surface.curve.normals(halves.arc))
        owner.append(labels[surface.index[halves.own]])
        every.append(np.tile(np.array(components, dtype=float), (len(halves.arc), 1)))
        along[name] = slice(first, first + len(halves.arc))
        first = along[name].stop
    at, sign = np.concatenate(places), np.full(first, -1.0)
    stencils, fits = _stencils(model, at, at[:, None]), np.arange(first)
    owners, whole = np.concatenate(owner), np.concatenate(every)
    return FacePoints(
        at[:, None], np.concatenate(normals)[:, None], stencils, fits, owners, sign, whole, along
    )


def _stencils(model: BodyModel, centers: FloatArray, points: FloatArray) -> Stencils:
    sight = model.cloud.sight
    return build_gradients(
        model.cloud.points, model.cloud.tree, centers, points, model.settings, sight, values=True
    )
