"""Loads on a body at finite strain, and the quadrature points on the faces of its pieces, where they and the
stresses act. Dead loads keep their direction and their amount per reference length or volume. A follower
pressure acts per current length along the current normal: its nominal traction is - p cof(F) N, linear in F
in the plane. Points are grouped in fits: the boundary between two nodes' cells, or one point of the outline.
Every fit acts on one or two pieces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, Halves, Rule
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.eigenstress import Heating
from mlsanm_cli.mechanics.pieces import rule_of
from mlsanm_cli.mechanics.supports import FREE
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Turning:
    """A rigid plate that rotates by ``rate`` (L,) per load factor: nodes with the ``rows`` (b,) of a
    displacement ``component`` x (0) or y (1) have ``arms`` (b, 2) from its centre."""

    rate: FloatArray
    component: int
    rows: IntArray
    arms: FloatArray

    def moved(self, cos: float, sin: float) -> FloatArray:
        """Displacements (b,) of points whose arms are multiplied by a rotation matrix."""
        x, y = self.arms.T
        return np.asarray(cos * x - sin * y if self.component == 0 else sin * x + cos * y)


@dataclass(frozen=True)
class Loads:
    """All loads on a body, with ``count`` load factors (L).

    ``sources`` (r, L) are right-hand sides of the nodes' rows: displacements, tractions, minus forces per
    volume. ``tractions[surface]`` (g, 2, L) are dead ones at the FINE points of a surface, ``force`` (n, 2,
    L) is per volume, linear between nodes; ``pressing[surface]`` are follower pressures at its nodes (b, L)
    and its FINE points (g, L), ``turning`` plates with finite rotation, ``warming`` temperature changes."""

    count: int
    sources: FloatArray
    tractions: Mapping[str, FloatArray] = field(default_factory=dict)
    force: FloatArray | None = None
    pressing: Mapping[str, tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    warming: Sequence[Heating] = ()
    turning: Sequence[Turning] = ()


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
    model, labels = body.model, body.pieces.labels
    places, normals, every = ([np.zeros((0, 2))] for _ in range(3))
    owner, along, first = [labels[:0]], {}, 0
    for name, components in kept.items():
        surface = model.cloud.surfaces[name]
        halves = Halves.of(surface, rule)
        places.append(surface.curve.points(halves.arc))
        normals.append(halves.length[:, None] * surface.curve.normals(halves.arc))
        owner.append(labels[surface.index[halves.own]])
        every.append(np.tile(np.array(components, dtype=float), (len(halves.arc), 1)))
        along[name] = slice(first, first + len(halves.arc))
        first = along[name].stop
    at, normal, whole = (np.concatenate(one) for one in (places, normals, every))
    pieces = np.concatenate(owner)
    stencils, fits, sign = _stencils(model, at, at[:, None]), np.arange(first), np.full(first, -1.0)
    return FacePoints(at[:, None], normal[:, None], stencils, fits, pieces, sign, whole, along)


def _stencils(model: BodyModel, centers: FloatArray, points: FloatArray) -> Stencils:
    cloud = model.cloud
    return build_stencils(cloud.points, cloud.tree, points, 1, model.settings, cloud.sight, centers=centers)


class Applied:
    """Loads at the quadrature points of a ``body``'s pieces: ``dead`` (2, q, L) forces, follower ``pressure``
    (q, L); at its nodes ``pressed`` (r, L) for every traction row, 0 for others; whether there are any of
    these (``follows``). Soft springs have the stiffness ``pulling`` (2, q)."""

    def __init__(self, body: ElasticBody, loads: Loads) -> None:
        surfaces = dict.fromkeys([*loads.tractions, *loads.pressing, *body.soft_springs])
        kept = {name: [not one for one in body.restrained.get(name, FREE)] for name in surfaces}
        points = self.points = outline_points(body, kept, FINE)
        self.dead, self.pulling = np.zeros((2, points.count, loads.count)), np.zeros((2, points.count))
        self.pressure = np.zeros((points.count, loads.count))
        self.pressed = np.zeros((body.rows, loads.count))
        for name, here in points.along.items():
            length = Halves.of(body.model.cloud.surfaces[name], FINE).length
            if name in body.soft_springs:
                self.pulling[:, here] = np.outer(body.soft_springs[name], length)
            if name in loads.tractions:
                self.dead[:, here] += length[:, None] * loads.tractions[name].transpose(1, 0, 2)
        self.dead *= points.kept.T[:, :, None]
        for name, (nodal, between) in loads.pressing.items():
            self.pressure[points.along[name]] += between
            for component in (0, 1):
                if not body.held.get(name, FREE)[component]:
                    self.pressed[body.condition_rows(name, component)] += nodal
        self.pulling *= points.kept.T
        self.follows = bool(self.pressure.any() or self.pressed.any())


def cofactor_normal(gradient: FloatArray, normal: FloatArray) -> FloatArray:
    """cof(F) N (2, n) from the components 11, 12, 21, 22 of F (4, n) and N (n, 2); linear in F."""
    xx, xy, yx, yy = gradient
    return np.stack([yy * normal[:, 0] - yx * normal[:, 1], -xy * normal[:, 0] + xx * normal[:, 1]])
