"""A body at finite strain, total Lagrangian: all derivatives are taken on the reference cloud. Rows are those
of the linear body with the first Piola-Kirchhoff stress P in place of the Cauchy stress; moments on a piece
are taken in the deformed configuration, about the mean of its nodes: in the reference one, forces times
deflections would be missing. Springs keep their directions: t = -k u, per reference length. Equations (17)
and (18) of docs/method.md."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import cell_quadrature
from mlsanm_cli.mechanics.assembly import single_rows, spring_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.finite.loads import Applied, FacePoints, Loads, inner_points, outline_points
from mlsanm_cli.mechanics.finite.pattern import Pattern
from mlsanm_cli.mechanics.laws.law import Law, determinant, gradient_of
from mlsanm_cli.mechanics.near_field import ComplexArray
from mlsanm_cli.mechanics.pieces import rule_of
from mlsanm_cli.operators.stencil_weights import pair_rows
from mlsanm_cli.records import dataclass

PINNED = ("angle", "single")
"""What depends on the rotation of the pins."""


@dataclass(frozen=True)
class FiniteBody:
    """An ``elastic`` body, whose cloud, rows and pieces are used, with its ``law`` and ``loads``. The last
    ``pins`` of its single held nodes are held along directions rotated by ``angle``. In nearly incompressible
    bodies volume changes are those of the fits of ``coarser`` if given: those of the next degree are not
    smooth, and the bulk modulus multiplies them."""

    elastic: ElasticBody
    law: Law
    loads: Loads
    pins: int = 0
    angle: float = 0.0
    coarser: BodyModel | None = None

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns."""
        return self.elastic.model.unknowns

    @property
    def count(self) -> int:
        """Number of pieces (k)."""
        return self.elastic.pieces.count

    @property
    def node_rows(self) -> int:
        """Number r - 3k of rows before those of the pieces."""
        return self.elastic.rows - 3 * self.count

    @cached_property
    def points(self) -> tuple[FacePoints, FacePoints, FacePoints]:
        """Quadrature points: of inner faces and of held sides, with stress, and of sides with loads."""
        elastic = self.elastic
        held = {name: components for name, components in elastic.restrained.items() if any(components)}
        held_sides = outline_points(elastic, held, rule_of(elastic.model))
        return inner_points(elastic), held_sides, self.applied.points

    @cached_property
    def on_pieces(self) -> tuple[IntArray, IntArray, FloatArray]:
        """All points in turn, numbered, for every piece (m,) that they act on, the piece, and the sign."""
        found, first = [], 0
        for one in self.points:
            each = one.places.shape[1]
            numbers = first + (each * one.fit[:, None] + np.arange(each)).ravel()
            found.append((numbers, np.repeat(one.owner, each), np.repeat(one.sign, each)))
            first += one.count
        point, owner, sign = (np.concatenate(one) for one in zip(*found, strict=True))
        return point, owner, sign

    @cached_property
    def applied(self) -> Applied:
        """The loads at the quadrature points of the pieces."""
        return Applied(self.elastic, self.loads)

    @cached_property
    def single(self) -> sparse.csr_array:
        """Rows (s, 2N) of the displacements of single held nodes."""
        nodes = len(self.elastic.model.cloud.points)
        return single_rows(self.elastic.held_nodes, nodes, self.pins, self.angle)

    def rotated(self, angle: float) -> FiniteBody:
        """The body with its pins rotated by ``angle``; everything else is computed once for both."""
        made = replace(self, angle=angle)
        made.__dict__.update({name: known for name, known in vars(self).items() if name not in PINNED})
        return made

    @cached_property
    def pattern(self) -> Pattern:
        """Pattern of the derivative of the rows."""
        return Pattern(self.elastic, self.points, self.pulls, self.turning.values(), self.law.nested)

    @property
    def pinned(self) -> sparse.csr_array:
        """Rows (p, 2N) of the pins."""
        return self.single[self.single.shape[0] - self.pins :]

    def turn(self, displacement: FloatArray) -> float:
        """Mean rotation of the body under a ``displacement`` (2N,)."""
        xx, xy, yx, yy = self.gradient(displacement) @ self.elastic.model.cloud.areas
        return float(np.arctan2(yx - xy, 2.0 * self.elastic.model.cloud.areas.sum() + xx + yy))

    def turns(self, displacement: FloatArray) -> ComplexArray:
        """Rotations (n,) of the nodes under a ``displacement`` (2N,), as unit complex numbers."""
        xx, xy, yx, yy = self.gradient(displacement)
        found = 2.0 + xx + yy + 1j * (yx - xy)
        return np.asarray(found / np.abs(found))

    @cached_property
    def pulls(self) -> sparse.csr_array:
        """Contribution (r - 3k, 2N) of springs to the nodes' rows."""
        return spring_rows(self.elastic.model.cloud, self.elastic.springs, self.node_rows)

    def degrees(self, factors: FloatArray, points: FloatArray | None = None) -> FloatArray | None:
        """Temperature changes at the nodes (n,) or at ``points`` (e, 2); None for bodies without any."""
        if not self.loads.warming:
            return None
        values = [one.values if points is None else one.field.at(points) for one in self.loads.warming]
        parts = zip(self.loads.warming, values, strict=True)
        return np.asarray(sum(factors[one.number] * value for one, value in parts))

    def degrees_jets(self, factors: FloatArray) -> FloatArray | None:
        """Temperature changes at the nodes as jets (3, n)."""
        nodal = self.degrees(factors)
        if nodal is None:
            return None
        found = self.elastic.model.stencils.derivatives(nodal[:, None])[:, :3, 0].T.copy()
        found[0] = nodal
        return np.asarray(found)

    def face_degrees(self, factors: FloatArray) -> FloatArray | None:
        """Temperature changes (q,) at the quadrature points with stress."""
        if not self.loads.warming:
            return None
        parts = zip(self.loads.warming, self._warmth, strict=True)
        return np.asarray(sum(factors[one.number] * values for one, values in parts))

    @cached_property
    def _warmth(self) -> list[FloatArray]:
        places = np.concatenate([one.places.reshape(-1, 2) for one in self.points[:2]])
        return [heating.field.at(places) for heating in self.loads.warming]

    @cached_property
    def centers(self) -> sparse.csr_array:
        """Rows (k, N) of the means over the nodes of every piece."""
        labels = self.elastic.pieces.labels
        count = np.bincount(labels, minlength=self.count)
        entries = (1.0 / count[labels], (labels, np.arange(len(labels))))
        return sparse.csr_array(entries, shape=(self.count, len(labels)))

    @cached_property
    def _forces(self) -> dict[int, FloatArray]:
        """Body forces (n, 2) by number of their loads."""
        force = np.zeros((0, 2, 0)) if self.loads.force is None else self.loads.force
        return {number: force[:, :, number] for number in np.flatnonzero(force.any(axis=(0, 1))).tolist()}

    @cached_property
    def of_force(self) -> FloatArray:
        """Force and moment (3k, L) of body forces on the pieces in the reference configuration."""
        found = np.zeros((3 * self.count, self.loads.count))
        for number, force in self._forces.items():
            found[:, number] = self.elastic.pieces.of_force(force)
        return found

    @cached_property
    def turning(self) -> dict[int, sparse.csr_array]:
        """Rows (k, 2N), by load, of the moments over size that body forces gain by displacements."""
        forces = self._forces.items()
        return {number: moments_of_force(self.elastic, self.centers, force) for number, force in forces}

    @cached_property
    def conditions(self) -> list[tuple[str, IntArray, FloatArray, tuple[bool, bool]]]:
        """Name, nodes (b,), normals (b, 2) and held components of every surface."""
        return [
            (name, surface.index, surface.normal, self.elastic.held.get(name, (False, False)))
            for name, surface in self.elastic.model.cloud.surfaces.items()
        ]

    def gradient(self, displacement: FloatArray) -> FloatArray:
        """Displacement gradient (4, n) at the nodes, components 11, 12, 21, 22."""
        return gradient_of(self.elastic.model.stencils.derivatives(displacement.reshape(-1, 2)))

    def mean_stress(self, displacement: FloatArray, factors: FloatArray) -> FloatArray | None:
        """Nodal values (n,) of the mean stress of volume changes, None if it is not a nodal field."""
        if not self.law.nested:
            return None
        return self.law.mean(self.gradient(displacement), self.degrees(factors))[0]

    def stress(self, displacement: FloatArray, factors: FloatArray) -> FloatArray:
        """P (4, n) at the nodes, with the fit of a nodal mean stress: equilibrium controls only that."""
        gradient, nodal = self.gradient(displacement), self.mean_stress(displacement, factors)
        found = self.law.state(gradient, self.degrees(factors), apart=nodal is not None).stress[:, 0, 0]
        if nodal is not None:
            xx, xy, yx, yy = gradient
            cofactor = np.stack([1.0 + yy, -yx, -xy, 1.0 + xx])
            found = found + self.elastic.model.stencils.derivatives(nodal[:, None])[:, 0, 0] * cofactor
        return np.asarray(found)

    def ellipticity(self, displacement: FloatArray, factors: FloatArray) -> FloatArray:
        """Ellipticity (n,) at the nodes (:meth:`Law.ellipticity`)."""
        return self.law.ellipticity(self.gradient(displacement), self.degrees(factors))

    def least_volume(self, displacement: FloatArray) -> float:
        """Smallest in-plane det F over nodes and faces."""
        faces = (gradient_of(one.seen(displacement)) for one in self.points[:2])
        parts = (self.gradient(displacement), *faces)
        return 1.0 + min(float(determinant(one).min(initial=np.inf)) for one in parts)


def moments_of_force(body: ElasticBody, centers: sparse.csr_array, force: FloatArray) -> sparse.csr_array:
    """Rows (k, 2N) of int (u - u_P) x b over every piece, over its size. The ``force`` b per volume, with
    nodal values (n, 2), and u are quadratic in the cell of every node; u_P is the mean of the piece's nodes,
    with rows ``centers`` (k, N)."""
    model, pieces = body.model, body.pieces
    cloud, labels, count = model.cloud, pieces.labels, len(model.cloud.points)
    node, points, area, _ = cell_quadrature(cloud.points, cloud.triangles)
    own = node[:, 0]
    x, y = (points - cloud.points[own]).T
    monomials = np.stack([np.ones(len(x)), x, y, 0.5 * x**2, x * y, 0.5 * y**2])
    fitted = model.stencils.derivatives(force)
    pull = area[:, None] * np.einsum("kg,gkc->gc", monomials, fitted[own])
    moments = np.array([[np.bincount(own, one * b, count) for one in monomials] for b in pull.T])
    entry = np.repeat(np.arange(count), np.diff(model.stencils.indptr))
    weights = model.stencils.weights
    on_x, on_y = ((weights * moments[axis].T[entry]).sum(axis=1) for axis in (1, 0))
    rows = pair_rows(model.stencils, np.stack([on_x, -on_y], axis=1))
    added = sparse.csr_array((np.ones(count), (labels, np.arange(count))), shape=(pieces.count, count))
    whole = np.stack([np.bincount(labels, moments[axis, 0], pieces.count) for axis in (0, 1)])
    means = centers.tocoo()
    piece, nodal = means.coords
    columns = np.concatenate([2 * nodal, 2 * nodal + 1])
    values = np.concatenate([whole[1, piece] * means.data, -whole[0, piece] * means.data])
    mean = sparse.csr_array((values, (np.tile(piece, 2), columns)), shape=(pieces.count, model.unknowns))
    return sparse.csr_array(sparse.diags_array(1.0 / pieces.size) @ (added @ rows - mean))


MAX_STRETCH = 1.25
"""Equations are renewed after a step at whose end some node is stretched by more than this, or less than its
inverse, relative to the base state: equations of the reference may lead onto another branch."""
MAX_ROTATION = 1.2
"""Or rotated by more than this angle: J_0^T W^2 J(u) becomes indefinite for rotations beyond a right angle,
and has limit points that the body does not have."""


def far_from(body: FiniteBody, displacement: FloatArray, base_state: FloatArray) -> bool:
    """Whether a body at ``displacement`` (2N,) is stretched or rotated so much relative to the ``base_state``
    (2N,) that its equations should be renewed."""
    turned = np.abs(body.turns(displacement) - body.turns(base_state)).max()
    stretched = most_stretched(body, displacement, base_state)[0] > MAX_STRETCH
    return bool(stretched or turned > 2.0 * np.sin(0.5 * MAX_ROTATION))


def most_stretched(body: FiniteBody, displacement: FloatArray, base_state: FloatArray) -> tuple[float, int]:
    """Largest stretch of a node, or inverse of the smallest, between two states (2N,), and the node."""
    now, then = (body.gradient(u).T.reshape(-1, 2, 2) + np.eye(2) for u in (displacement, base_state))
    ratios = np.linalg.svd(now @ np.linalg.inv(then), compute_uv=False)
    largest = np.maximum(ratios.max(axis=1), 1.0 / ratios.min(axis=1))
    return float(largest.max()), int(largest.argmax())
