"""Equilibrium of pieces of a body: the flux through their faces equals the load on them.

Weighted node by node, a force that is lost little by little costs less than the discretisation error of
correct bending. In the norm that suits equilibrium, H^-1, long waves of the residual weigh more (Bramble,
Lazarov and Pasciak 1997, doi:10.1090/S0025-5718-97-00848-X). So force x, force y and moment of connected
pieces are strong rows, with stresses of local fits at the Gauss points of the faces::

    - int_(inner faces) sigma n - int_(held sides) sigma n = int_(free sides) t + int_piece b

Fluxes through inner faces cancel: what holds for each piece holds for the whole body, there exactly.
Pieces of bodies of revolution are rings, in which the hoop stress resists radial displacement and turning
in the meridian plane; only axial forces of rings add up. Equations (3) and (3a) of docs/method.md."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property
from itertools import chain
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, GAUSS, Halves, Rule, cell_quadrature, measure
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross
from mlsanm_cli.cloud.pieces import divide, pair_up
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import HOOP, force_sums
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.supports import FREE, WEIGHT_REACH, Held, thickness
from mlsanm_cli.roundoff import ROUND_OFF

BOUNDARY_NODES = 16
"""Nodes of a piece at the outline."""
EQUILIBRIUM_WEIGHT = 3000.0
"""Weight of the strain that corresponds to the force imbalance of a piece. Pieces smaller than half a body's
thickness are weaker in proportion: all forces count alike, as in H^-1."""
MAX_MODULUS_RATIO = 150.0
"""Largest modulus over shear modulus for this weight; beyond, pieces are made weaker in proportion."""
PAIR_WEIGHT = 10.0
"""The same for pairs of nodes at contacts, which separate one node's pressure from its neighbours'."""


StressAround: TypeAlias = Callable[[FloatArray, FloatArray], "sparse.csr_array | FloatArray"]
"""Rows (3 e t | 4 e t, ...) or values (3 e t | 4 e t,) of stresses, as by :meth:`BodyModel.stress_around`."""

Faces: TypeAlias = tuple[sparse.csr_array, FloatArray, FloatArray, FloatArray]
"""The matrix (3k, 3e) from forces and moments about centres (e, 2) of faces to minus those that leave pieces;
the centres, quadrature points (e, t, 2), and normals times weights (e, t, 2)."""


class Pieces:
    """The division of a ``cloud`` into k pieces of about BOUNDARY_NODES nodes, which make up the body
    (``main``), and pairs along the contact surfaces ``touching``, each ``strength`` (k,) times as strong as a
    node's rows. ``levels`` are piece numbers of all nodes (n,), -1 for none, the first ``labels`` without.
    ``middle`` (k, 2) are centroids; pieces that are not ``closed`` (k,) miss a part of the outline. Loads and
    fluxes are 3k rows: forces x of all pieces, forces y, and moments about the centroids over ``size`` (k,),
    the square root of the area."""

    def __init__(
        self, cloud: Cloud, touching: Collection[str] = (), held: Held = MappingProxyType({})
    ) -> None:
        labels = divide(cloud, BOUNDARY_NODES)
        levels: tuple[IntArray, ...] = (labels,)
        strength: FloatArray = np.full(int(labels.max()) + 1, EQUILIBRIUM_WEIGHT)
        stops = [name for name, components in held.items() if any(components)]
        paired = pair_up(cloud, touching, stops) if touching else np.full(len(labels), -1)
        if (paired >= 0).any():
            first = len(strength)
            strength = np.append(strength, np.full(int(paired.max()) + 1, PAIR_WEIGHT))
            levels = (labels, np.where(paired >= 0, first + paired, -1))
        parts = [measure(cloud.points, cloud.faces, cloud.surfaces, level) for level in levels]
        area, middle, closed = (np.concatenate(values) for values in zip(*parts, strict=True))
        nodal = sum(np.bincount(one[one >= 0], cloud.areas[one >= 0], len(strength)) for one in levels)
        size: FloatArray = np.sqrt(np.where(closed, area, nodal))
        main: BoolArray = np.arange(len(size)) <= labels.max()
        strength[main] *= np.minimum(1.0, size[main] / (WEIGHT_REACH * thickness(cloud)))
        self.cloud, self.levels, self.labels, self.main, self.count = cloud, levels, labels, main, len(size)
        self.middle: FloatArray = middle
        self.closed: BoolArray = closed
        self.size, self.strength = size, strength

    def strengths_of(self, material: PlaneMaterial) -> FloatArray:
        """Strengths (k,) in a body of a ``material``, per force on a circle of unit length."""
        strength = min(1.0, MAX_MODULUS_RATIO * material.shear / material.modulus) * self.strength
        return strength / self.cloud.around(self.middle)

    def fluxes(self, stress: StressAround, held: Held, rule: Rule, wanted: BoolArray | None = None) -> Any:
        """Rows or values (3k, ...) of minus the force and moment of a ``stress`` that leave every piece, at
        least those ``wanted`` (k,), through inner faces and ``held`` components of the outline."""
        wanted = np.ones(self.count, dtype=bool) if wanted is None else wanted
        parts = list(_through(chain(self._faces(wanted, rule), self._outline(held, rule)), stress))
        if self.cloud.revolved:
            for owner, centers, points, weight in self._rings(rule):
                hoop = stress(centers, points)[HOOP * owner.size :]
                # A turn displaces a circle by minus its height, which strains it by that over the radius.
                nodes, around = owner.ravel(), 2.0 * np.pi * weight.ravel()
                forces, column = np.stack([around, 0.0 * around], axis=1), np.arange(len(nodes))
                onto = self.per_column(nodes, points.reshape(-1, 2), forces, column, len(nodes))
                parts.append(onto @ hoop)
        return sum(parts[1:], parts[0])

    def reaction(self, stress: StressAround, held: Held, rule: Rule, center: tuple[float, float]) -> Any:
        """Rows or values (3, ...) of force and moment about ``center`` on the body through ``held``
        components of the outline."""
        return -self.totals(center) @ sum(_through(self._outline(held, rule), stress))

    def _rings(self, rule: Rule) -> Iterator[tuple[IntArray, FloatArray, FloatArray, FloatArray]]:
        """Quadrature over the cells, about triangles and between chords and outline: nodes (e, t), centres
        (e, 2), points (e, t, 2), and areas (e, t)."""
        cloud = self.cloud
        node, points, area, _ = cell_quadrature(cloud.points, cloud.triangles)
        # Point by point of every triangle: the parts of all triangles have three points each, part by part.
        parts = np.arange(len(node)).reshape(-1, len(cloud.triangles), 3).swapaxes(0, 1)
        order = parts.reshape(len(cloud.triangles), -1)
        yield node[order, 0], cloud.points[cloud.triangles].mean(axis=1), points[order], area[order]
        for surface in cloud.surfaces.values():
            halves = Halves.of(surface, rule)
            own, other = surface.index[halves.own], surface.index[halves.other]
            step = np.tile(np.diff(surface.ends), len(own) // len(np.diff(surface.ends)))
            ahead = np.where(np.arange(len(own)) // len(np.diff(surface.ends)) % 2 == 0, 1.0, -1.0)
            along = (ahead / step)[:, None] * (cloud.points[other] - cloud.points[own])
            chord = cloud.points[other] + halves.share[:, None] * (cloud.points[own] - cloud.points[other])
            bulge = surface.curve.points(halves.arc) - chord
            turned = surface.curve.normals(halves.arc)[:, ::-1] * np.array([-1.0, 1.0]) - along
            # At fractions of the way from the chord to the outline.
            share, part = np.array(rule).T
            points = chord[:, None] + share[:, None] * bulge[:, None]
            weight = np.outer(cross(bulge, along), part) + np.outer(cross(bulge, turned), part * share)
            weight *= halves.length[:, None]
            if (np.abs(weight) > ROUND_OFF * cloud.spacing[own][:, None] ** 2).any():
                yield np.tile(own[:, None], len(rule)), points.mean(axis=1), points, weight

    def _faces(self, wanted: BoolArray, rule: Rule) -> Iterator[Faces]:
        """Inner faces of ``wanted`` pieces (k,)."""
        for level in self.levels:
            faces, chosen = self.cloud.faces.between(level), np.append(wanted, False)
            faces = faces.select(chosen[level[faces.one]] | chosen[level[faces.other]])
            *ends, points, normals = faces.edges(rule)
            normals = self.cloud.around(points)[..., None] * normals
            middle = points.mean(axis=1)
            out, into = (self._spread(level[at], middle) for at in ends)
            yield sparse.csr_array(into - out), middle, points, normals

    def _outline(self, held: Held, rule: Rule) -> Iterator[Faces]:
        """``held`` parts of the outline."""
        for name, components in held.items():
            if any(components):
                surface = self.cloud.surfaces[name]
                halves = Halves.of(surface, rule)
                points = surface.curve.points(halves.arc)
                length = halves.length * self.cloud.around(points)
                normals = length[:, None] * surface.curve.normals(halves.arc)
                kept = sparse.diags_array(np.repeat([*components, False], len(points)).astype(float))
                spread = self._spread_from(surface.index[halves.own], points)
                yield sparse.csr_array(-spread @ kept), points, points[:, None], normals[:, None]

    def _spread(self, owner: IntArray, center: FloatArray) -> sparse.csr_array:
        """Matrix (3k, 3e) from forces and moments about ``center`` (e, 2) to those on pieces ``owner`` (e,)
        or -1."""
        number = np.flatnonzero(owner >= 0)
        own = owner[number]
        arm = (center[number] - self.middle[own]) / self.size[own][:, None]
        return gathering(number, own, np.ones(len(own)), arm, self.size, len(owner))

    def _spread_from(self, nodes: IntArray, points: FloatArray) -> sparse.csr_array:
        """The same to the pieces of ``nodes`` (e,) on all levels, from ``points`` (e, 2)."""
        empty = sparse.csr_array((3 * self.count, 3 * len(nodes)))
        return sum((self._spread(level[nodes], points) for level in self.levels), empty)

    def loads(self, first_row: Mapping[str, int], rows: int, held: Held) -> sparse.csr_array:
        """Force and moment (3k, rows) on the pieces per right-hand side of a body's rows, the last 3k of
        which are such forces and moments themselves. Tractions, of components that are not ``held``, are
        linear between nodes along normal and tangent of the exact outline. Right-hand sides of equilibrium do
        not count here: see :meth:`of_force`."""
        own = np.arange(3 * self.count)
        entries = (np.ones(len(own)), (own, rows - len(own) + own))
        total = sparse.csr_array(entries, shape=(len(own), rows))
        for name, surface in self.cloud.surfaces.items():
            axes = np.flatnonzero(~np.array(held.get(name, FREE)))
            halves, size = Halves.of(surface), len(surface.index)
            points, normal = surface.curve.points(halves.arc), surface.curve.normals(halves.arc)
            length = halves.length * self.cloud.around(points)
            straight = np.broadcast_to(np.eye(2), (len(halves.own), 2, 2))
            for who, share in ((halves.own, halves.share), (halves.other, 1.0 - halves.share)):
                turn = turned_along(surface.normal[who], normal) if len(axes) == 2 else straight
                for axis in axes.tolist():
                    force = (length * share)[:, None] * turn[:, :, axis]
                    column = first_row[name] + axis * size + who
                    total = total + self.per_column(surface.index[halves.own], points, force, column, rows)
        return sparse.csr_array(total)

    def per_column(
        self, nodes: IntArray, points: FloatArray, force: FloatArray, column: IntArray, columns: int
    ) -> sparse.csr_array:
        """Force and moment (3k, columns) on the pieces of ``nodes`` (e,) by forces (e, 2) at ``points`` (e,
        2), each by the unit value of its ``column`` (e,)."""
        count = 2 * len(nodes)
        entries = (force.T.ravel(), (np.arange(count), np.tile(column, 2)))
        nodal = sparse.csr_array(entries, shape=(count, columns))
        return sparse.csr_array(self._spread_from(nodes, points)[:, :count] @ nodal)

    def of_force(self, force: FloatArray) -> FloatArray:
        """Force and moment (3k,) on the pieces by a body force, linear between nodal ``force`` (n, 2)."""
        cloud, total = self.cloud, np.zeros(3 * self.count)
        # A uniform force has no moment about the centroid of the piece with its exact outline.
        even = force.mean(axis=0) * (not cloud.revolved)
        total[: 2 * self.count] = np.outer(even, self.size**2).ravel()
        return np.asarray(total + self._of_forces @ (force - even).T.ravel())

    @cached_property
    def _of_forces(self) -> sparse.csr_array:
        """Matrix (3k, 2n) from a body force, linear between nodes, to force and moment on the pieces."""
        cloud, total = self.cloud, sparse.csr_array((3 * self.count, 2 * len(self.cloud.points)))
        node, at, area, share = cell_quadrature(cloud.points, cloud.triangles)
        parts = [(node, at, area[:, None] * share)]
        for own, _, places, weight in list(self._rings(FINE))[1:]:
            parts.append((own.reshape(-1, 1), places.reshape(-1, 2), weight.reshape(-1, 1)))
        for nodes, at, weight in parts:
            entries = (weight * cloud.around(at)[:, None]).ravel()
            where = np.repeat(np.arange(len(at)), nodes.shape[1]), nodes.ravel()
            values = sparse.csr_array((entries, where), shape=(len(at), len(cloud.points)))
            spread = self._spread_from(nodes[:, 0], at)[:, : 2 * len(at)]
            total = total + spread @ sparse.block_diag([values, values], format="csr")
        return sparse.csr_array(total)

    def gathered(self, nodes: IntArray, points: FloatArray, force: FloatArray) -> FloatArray:
        """Force and moment (3k, ...) on the pieces of ``nodes`` by forces (e, 2, ...) at ``points`` (e,
        2)."""
        spread = self._spread_from(nodes, points)[:, : 2 * len(nodes)]
        flat = np.concatenate([force[:, 0], force[:, 1]]).reshape(2 * len(nodes), -1)
        return np.asarray(spread @ flat).reshape(3 * self.count, *force.shape[2:])

    def totals(self, center: tuple[float, float]) -> sparse.csr_array:
        """Matrix (3, 3k) from forces and moments on pieces to those of the body, about ``center``."""
        one, none = self.main.astype(float), np.zeros(self.count)
        x, y = one * (self.middle - np.array(center)).T
        lines = [[one, none, none], [none, one, none], [-y, x, one * self.size]]
        return sparse.csr_array(np.stack([np.concatenate(line) for line in lines]))

    def sums(self, known: BoolArray) -> sparse.csr_array:
        """Rows (s, 3k) that sum forces and moment on the body, if those on its pieces are ``known`` (3k,)."""
        middle = self.cloud.points.mean(axis=0)
        closed: BoolArray = np.array([(one | ~self.main).all() for one in known.reshape(3, -1)])
        closed[2] = closed.all()
        if self.cloud.revolved:
            closed[[0, 2]] = False
        return sparse.csr_array(self.totals((float(middle[0]), float(middle[1])))[np.flatnonzero(closed)])

    def rows_known(self, hidden: list[tuple[int, int]]) -> BoolArray:
        """Mask (3k,) of the rows of closed pieces, without those of (node, component) pairs ``hidden``."""
        known = np.tile(self.closed, 3)
        for node, component in hidden:
            for level in self.levels:
                if level[node] >= 0:
                    known[[component * self.count + level[node], 2 * self.count + level[node]]] = False
        return known


def _through(faces: Iterator[Faces], stress: StressAround) -> Iterator[Any]:
    """Rows or values (3k, ...) of forces and moments on pieces through ``faces`` by a ``stress``."""
    for matrix, middle, points, normals in faces:
        sums = force_sums(points - middle[:, None], normals)
        yield matrix @ (sums @ stress(middle, points)[: sums.shape[1]])


def gathering(
    number: IntArray, owner: IntArray, sign: FloatArray, arm: FloatArray, size: FloatArray, total: int
) -> sparse.csr_array:
    """Matrix (3k, 3 ``total``) from forces x, forces y and moments at places to those on pieces, moments over
    ``size`` (k,). The place ``number`` (m,) acts on the piece ``owner`` (m,) with a ``sign`` (m,) and an
    ``arm`` (m, 2), over its size."""
    count = len(size)
    lines = [owner, count + owner, *[2 * count + owner] * 3]
    columns = [number, total + number, number, total + number, 2 * total + number]
    values = [sign, sign, -sign * arm[:, 1], sign * arm[:, 0], sign / size[owner]]
    entries = (np.concatenate(values), (np.concatenate(lines), np.concatenate(columns)))
    return sparse.csr_array(entries, shape=(3 * count, 3 * total))


def rule_of(model: BodyModel) -> Rule:
    """Gauss rule that integrates moments of stresses of the polynomial degree exactly."""
    return GAUSS[model.settings.degree // 2 + 1]


def turned_along(start: FloatArray, end: FloatArray) -> FloatArray:
    """Rotations (e, 2, 2) that map unit vectors ``start`` (e, 2) to ``end`` (e, 2)."""
    cosine = (start * end).sum(axis=1)
    sine = cross(start, end)
    return np.stack([np.stack([cosine, -sine], axis=1), np.stack([sine, cosine], axis=1)], axis=1)
