"""A body at finite strain: its equations, rows and derivatives.

Total Lagrangian: all derivatives are taken on the reference cloud. Rows are those of the linear body with the
first Piola-Kirchhoff stress P in place of the Cauchy stress::

    Div P + b = 0  at every node        P N = t  on free sides        u = g  on held ones
    sum over the faces of a piece of P N + int t + int b = 0          forces
    sum of (x - x_P) x (P N) + int (x - x_P) x t + ... = 0            moments about deformed places

x = X + u is the deformed position, x_P that of the piece, the mean of its nodes. Moments are taken in the
deformed configuration: in the reference one, forces times deflections would be missing. Springs keep their
directions: t = -k u, per reference length.

Equations (16) and (22) of docs/method.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import Rule
from mlsanm_cli.mechanics.assembly import spring_rows
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.equations import RowTable
from mlsanm_cli.mechanics.finite.cells import moments_of_force
from mlsanm_cli.mechanics.finite.faces import FacePoints, held_points, inner_points, middles, rule_of
from mlsanm_cli.mechanics.finite.law import Law, determinant
from mlsanm_cli.mechanics.finite.loads import Applied, Loads


@dataclass(frozen=True)
class FiniteBody:
    """An ``elastic`` body, whose cloud, rows and pieces are used, with its ``law`` and ``loads``. The last
    ``pins`` of its single held nodes are held along directions rotated by ``angle``."""

    elastic: ElasticBody
    law: Law
    loads: Loads
    pins: int = 0
    angle: float = 0.0

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns."""
        return self.elastic.model.unknowns

    @property
    def count(self) -> int:
        """Number of pieces (k)."""
        return self.elastic.pieces.count

    @property
    def rule(self) -> Rule:
        """Quadrature rule of faces and held sides."""
        return rule_of(self.elastic.model)

    @cached_property
    def stressed(self) -> tuple[FacePoints, FacePoints]:
        """Quadrature points with stress: inner faces, held sides."""
        return inner_points(self.elastic), held_points(self.elastic)

    @cached_property
    def applied(self) -> Applied:
        """The loads at the quadrature points of the pieces."""
        return Applied.on(self.elastic, self.loads)

    @cached_property
    def single(self) -> sparse.csr_array:
        """Rows (s, 2N) of the displacements of single held nodes."""
        held, unknowns = self.elastic.held_nodes, self.unknowns
        rows = np.zeros((len(held), 2))
        node = np.array([one for one, _ in held], dtype=np.int64)
        rows[np.arange(len(held)), [component for _, component in held]] = 1.0
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        last = len(held) - self.pins
        rows[last:] = rows[last:] @ np.array([[cos, sin], [-sin, cos]])
        entries = (rows.ravel(), (np.repeat(np.arange(len(held)), 2), (2 * node[:, None] + [0, 1]).ravel()))
        return sparse.csr_array(entries, shape=(len(held), unknowns))

    @property
    def pinned(self) -> sparse.csr_array:
        """Rows (p, 2N) of the pins."""
        return self.single[self.single.shape[0] - self.pins :]

    def turn(self, displacement: FloatArray) -> float:
        """Mean rotation of the body under a ``displacement`` (2N,)."""
        xx, xy, yx, yy = self.gradient(displacement) @ self.elastic.model.cloud.areas
        return float(np.arctan2(yx - xy, 2.0 * self.elastic.model.cloud.areas.sum() + xx + yy))

    @cached_property
    def table(self) -> RowTable:
        """Positions of the nodes' rows."""
        elastic = self.elastic
        single = len(elastic.held_nodes)
        total = elastic.rows - 3 * self.count - single
        modulus = elastic.model.material.modulus
        return RowTable(elastic.first_row, total, total + single, modulus, elastic.springs)

    @cached_property
    def pulls(self) -> sparse.csr_array:
        """Contribution (r - 3k, 2N) of springs to the nodes' rows."""
        model = self.elastic.model
        return spring_rows(model.cloud, self.table, len(model.nodes))

    @cached_property
    def _face_expansion(self) -> list[FloatArray]:
        places = np.concatenate([one.places.reshape(-1, 2) for one in self.stressed])
        return [one.at(places) for one in self.loads.warming]

    def stretch(self, factors: FloatArray) -> FloatArray | None:
        """Thermal stretches (n,) at the nodes at load ``factors`` (L,); None for bodies without temperature
        change."""
        jets = self.stretch_jets(factors, 0)
        return None if jets is None else np.asarray(jets[0])

    def stretch_at(self, points: FloatArray, factors: FloatArray) -> FloatArray | None:
        """Thermal stretches (e,) at ``points`` (e, 2)."""
        if not self.loads.warming:
            return None
        return np.asarray(1.0 + sum(factors[one.number] * one.at(points) for one in self.loads.warming))

    def stretch_jets(self, factors: FloatArray, order: int) -> FloatArray | None:
        """Coefficient of ``order`` of the thermal stretches, a jet (3, n), from that of the factors (L,)."""
        if not self.loads.warming:
            return None
        stencils = self.elastic.model.stencils
        nodal = sum(factors[one.number] * one.nodal for one in self.loads.warming)
        found = stencils.derivatives(np.asarray(nodal)[:, None])[:, :3, 0].T.copy()
        found[0] = nodal + (not order)
        return np.asarray(found)

    def face_stretch(self, factors: FloatArray, order: int = 0) -> FloatArray | None:
        """The same, values only (q,), at the quadrature points with stress."""
        if not self.loads.warming:
            return None
        parts = zip(self.loads.warming, self._face_expansion, strict=True)
        return np.asarray(sum(factors[one.number] * values for one, values in parts) + (not order))

    @cached_property
    def centers(self) -> sparse.csr_array:
        """Rows (k, N) of the means over the nodes of every piece."""
        return middles(self.elastic)

    @cached_property
    def of_force(self) -> FloatArray:
        """Force and moment (3k, L) of body forces on the pieces in the reference configuration."""
        if self.loads.known is not None:
            return self.loads.known
        found = np.zeros((3 * self.count, self.loads.count))
        if self.loads.force is not None:
            for number in range(self.loads.count):
                found[:, number] = self.elastic.pieces.of_force(self.loads.force[:, :, number])
        return found

    @cached_property
    def turning(self) -> list[sparse.csr_array]:
        """For every load, rows (k, 2N) of the moments over size that its body force gains by displacements;
        empty without body forces."""
        force = self.loads.force
        if force is None:
            return []
        return [moments_of_force(self.elastic, self.centers, one) for one in np.moveaxis(force, 2, 0)]

    @cached_property
    def conditions(self) -> list[tuple[str, IntArray, FloatArray, tuple[bool, bool]]]:
        """Name, nodes (b,), normals (b, 2) and held components of every surface."""
        return [
            (name, surface.index, surface.normal, self.elastic.held.get(name, (False, False)))
            for name, surface in self.elastic.model.cloud.surfaces.items()
        ]

    def gradient(self, displacement: FloatArray) -> FloatArray:
        """Displacement gradient (4, n) at the nodes, components 11, 12, 21, 22."""
        found = self.elastic.model.stencils.derivatives(displacement.reshape(-1, 2))
        return np.stack([found[:, 1, 0], found[:, 2, 0], found[:, 1, 1], found[:, 2, 1]])

    def ellipticity(self, displacement: FloatArray, factors: FloatArray) -> FloatArray:
        """Ellipticity (n,) at the nodes (:meth:`Law.ellipticity`)."""
        return self.law.ellipticity(self.gradient(displacement), self.stretch(factors))

    def face_gradient(self, displacement: FloatArray) -> FloatArray:
        """Displacement gradient (4, q) at the quadrature points with stress."""
        parts = [_gradient(one, displacement.reshape(-1, 2)) for one in self.stressed]
        return np.concatenate(parts, axis=1)

    def least_volume(self, displacement: FloatArray) -> float:
        """Smallest in-plane det F over nodes and faces."""
        parts = (self.gradient(displacement), self.face_gradient(displacement))
        return 1.0 + min(float(determinant(one).min(initial=np.inf)) for one in parts)


def _gradient(points: FacePoints, displacement: FloatArray) -> FloatArray:
    _, by_x, by_y = points.seen(displacement)
    return np.stack([by_x[:, 0], by_y[:, 0], by_x[:, 1], by_y[:, 1]])
