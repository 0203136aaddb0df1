"""Cells of a cloud's nodes: the median dual of its triangles, closed by the body's exact outline. Inner faces
run from edge mid-points to triangle centroids. On the outline the mid-point is taken on the curve, halfway in
arc length between two nodes, and the cell ends at the curve. The cells therefore fill the body, and the
divergence theorem holds on each of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.membership import cross, twice_area
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.records import dataclass

Rule: TypeAlias = tuple[tuple[float, float], ...]
"""Points on a face, from 0 to 1, and weights of a quadrature rule."""
GAUSS: dict[int, Rule] = {
    count: tuple(zip((0.5 + 0.5 * places).tolist(), (0.5 * weights).tolist(), strict=True))
    for count in range(1, 5)
    for places, weights in [np.polynomial.legendre.leggauss(count)]
}
"""Gauss-Legendre rules by number of points."""
FINE = GAUSS[4]
"""The rule for integrands of unknown smoothness."""
TRIANGLE_POINTS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
"""Points of a triangle (barycentric) whose mean is exact for quadratics."""
MAX_REPEATS = 16
CLOSURE_TOLERANCE = 1e-4
"""Closure tolerance of a cell: sum of its normals, relative to its perimeter."""
REFINE_DISTANCE = 2.0
"""A triangle closer to a singular point than this times its longest side is divided into four, ..."""
MAX_REFINEMENTS = 2
"""... up to this many times."""


@dataclass(frozen=True)
class Faces:
    """Inner faces (f,) between the cells of nodes ``one`` and ``other``, from ``start`` to ``end`` (f, 2).
    The normal points out of the cell of ``one``."""

    one: IntArray
    other: IntArray
    start: FloatArray
    end: FloatArray

    def between(self, labels: IntArray) -> Faces:
        """The faces between nodes with different ``labels`` (n,)."""
        return self.select(labels[self.one] != labels[self.other])

    def select(self, kept: BoolArray) -> Faces:
        """The faces selected by the mask ``kept`` (f,)."""
        return Faces(self.one[kept], self.other[kept], self.start[kept], self.end[kept])

    def quadrature(self, rule: Rule = GAUSS[2]) -> tuple[FloatArray, FloatArray]:
        """Points (f, g, 2) of a ``rule`` on every face, and normals times quadrature weights (f, g, 2)."""
        along = self.end - self.start
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
        points = np.stack([self.start + x * along for x, _ in rule], axis=1)
        return points, np.stack([weight * normal for _, weight in rule], axis=1)

    def edges(self, rule: Rule = GAUSS[2]) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Boundaries between the cells of two nodes, one face or two: the nodes ``one`` < ``other`` (e,), the
        g points (e, 2g, 2) of a ``rule`` on either face, and normals (e, 2g, 2) out of the cell of ``one``
        times quadrature weights, zero for a missing second face."""
        count = 1 + int(max(self.one.max(initial=0), self.other.max(initial=0)))
        low, high = np.minimum(self.one, self.other), np.maximum(self.one, self.other)
        key, first, edge = np.unique(low * count + high, return_index=True, return_inverse=True)
        second = np.full(len(key), -1, dtype=np.int64)
        later = np.flatnonzero(first[edge] != np.arange(len(edge)))
        second[edge[later]] = later
        points, normals = self.quadrature(rule)
        normals = normals * np.where(self.one == low, 1.0, -1.0)[:, None, None]
        alone = second < 0
        others = normals[second]
        others[alone] = 0.0
        points = np.concatenate([points[first], points[np.where(alone, first, second)]], axis=1)
        return key // count, key % count, points, np.concatenate([normals[first], others], axis=1)


@dataclass(frozen=True)
class Halves:
    """Quadrature points on a surface: each interval between neighbouring nodes is halved at the cell limit.
    Point g lies at arc length ``arc`` (g,) with weight ``length`` (g,), in the cell of the surface's node
    number ``own`` (g,). ``share`` (g,) is the linear hat function of that node; its neighbour ``other`` (g,)
    has 1 - ``share``."""

    own: IntArray
    other: IntArray
    share: FloatArray
    arc: FloatArray
    length: FloatArray

    @classmethod
    def of(cls, surface: Surface, rule: Rule = GAUSS[2]) -> Halves:
        """Apply a quadrature ``rule`` to each half interval of a ``surface``. The rule is repeated where the
        curve has more data points than nodes, else cells would not close."""
        times = max(1, min(-(-surface.curve.data_points // (2 * len(surface.index))), MAX_REPEATS))
        rule = tuple(((k + x) / times, weight / times) for k in range(times) for x, weight in rule)
        arc, step = surface.ends, np.diff(surface.ends)
        first = np.arange(len(step))
        second = (first + 1) % len(surface.index)
        parts = []
        for x, weight in rule:
            length = 0.5 * weight * step
            parts.append((first, second, 1.0 - 0.5 * x + 0.0 * step, arc[:-1] + 0.5 * x * step, length))
            parts.append(
                (second, first, 0.5 + 0.5 * x + 0.0 * step, arc[:-1] + 0.5 * (1.0 + x) * step, length)
            )
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def dual_faces(points: FloatArray, triangles: IntArray, surfaces: Mapping[str, Surface]) -> Faces:
    """Inner faces of all cells: three per triangle (t, 3) of ``points`` (n, 2)."""
    one, other = triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()
    middle, center = 0.5 * (points[one] + points[other]), np.tile(points[triangles].mean(axis=1), (3, 1))
    # On the outline the mid-points are on the curves.
    keys, halfway = [], []
    for surface in surfaces.values():
        arc, index = surface.ends, surface.index
        index = np.append(index, index[0]) if surface.curve.closed else index
        halfway.append(surface.curve.points(0.5 * (arc[1:] + arc[:-1])))
        keys.append(np.minimum(index[1:], index[:-1]) * len(points) + np.maximum(index[1:], index[:-1]))
    order = np.argsort(np.concatenate(keys))
    key, middles = np.concatenate(keys)[order], np.concatenate(halfway)[order]
    wanted = np.minimum(one, other) * len(points) + np.maximum(one, other)
    found = np.searchsorted(key, wanted)
    on = key[np.minimum(found, len(key) - 1)] == wanted
    middle[on] = middles[found[on]]
    return Faces(one, other, middle, center)


def cell_quadrature(
    points: FloatArray, triangles: IntArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Quadrature over the cells of straight ``triangles`` (t, 3), exact for quadratics. Three points in each
    of a triangle's six parts (corner, mid-side, centroid). Returns per point the triangle's nodes (e, 3), the
    owner of the cell first, the point (e, 2), its area weight (e,) and the nodes' linear shape functions
    there (e, 3)."""
    nodes, shares = [], []
    for turn in range(3):
        for flip in (False, True):
            corners = np.roll(triangles, -turn, axis=1)
            part = np.array([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [1.0 / 3.0] * 3])
            corners = corners[:, [0, 2, 1]] if flip else corners
            nodes.append(np.repeat(corners, 3, axis=0))
            shares.append(np.tile(TRIANGLE_POINTS @ part, (len(triangles), 1)))
    node, share = np.concatenate(nodes), np.concatenate(shares)
    twice = np.abs(twice_area(*(points[node[:, corner]] for corner in range(3))))
    return node, (share[:, :, None] * points[node]).sum(axis=1), twice / 36.0, share


def measure(
    points: FloatArray, faces: Faces, surfaces: Mapping[str, Surface], labels: IntArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Areas (k,) and centroids (k, 2) of the groups of cells with equal ``labels`` (n,), counted from the
    smallest one, and whether they are closed (k,): they are not where the triangulation misses an edge of the
    outline. -1 marks cells to be left out. By boundary integrals: A = 1/2 oint x . n, first moments 1/2 oint
    x^2 n_x and 1/2 oint y^2 n_y."""
    chosen = np.flatnonzero(labels >= 0)
    lowest = int(labels[chosen].min())
    labels = np.where(labels >= 0, labels - lowest, -1)
    count = int(labels.max()) + 1
    nodes = np.bincount(labels[chosen], minlength=count)[:, None]
    near = np.stack([np.bincount(labels[chosen], one, count) for one in points[chosen].T], axis=1) / nodes
    outer = faces.between(labels)
    at, normal = (values.reshape(-1, 2) for values in outer.quadrature())
    one, other = labels[np.repeat(outer.one, 2)], labels[np.repeat(outer.other, 2)]
    group, at, normal = np.append(one, other), np.tile(at, (2, 1)), np.concatenate([normal, -normal])
    for surface in surfaces.values():
        halves, curve = Halves.of(surface), surface.curve
        group = np.append(group, labels[surface.index[halves.own]])
        at = np.concatenate([at, curve.points(halves.arc)])
        normal = np.concatenate([normal, halves.length[:, None] * curve.normals(halves.arc)])
    kept = group >= 0
    group, at, normal = group[kept], at[kept], normal[kept]
    arm = at - near[group]

    def total(values: FloatArray) -> FloatArray:
        return np.stack([np.bincount(group, one, count) for one in values.T], axis=1)

    opening, length = total(normal), np.bincount(group, np.hypot(*normal.T), count)
    area = 0.5 * total(arm * normal).sum(axis=1)
    closed = (np.hypot(*opening.T) <= CLOSURE_TOLERANCE * length) & (area > 0.0)
    first = 0.5 * total(arm**2 * normal)
    middle = near + np.where(closed[:, None], first / np.where(closed, area, 1.0)[:, None], 0.0)
    return area, middle, closed


def graded_quadrature(
    nodes: FloatArray, triangles: IntArray, singular: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Midpoint rule over ``triangles`` (t, 3) of ``nodes`` (n, 2), graded towards ``singular`` points (k, 2)
    on the outline: points (e, 2) and areas (e,)."""
    tree, corners, points, areas = cKDTree(singular), nodes[triangles], [], []
    for time in range(MAX_REFINEMENTS + 1):
        middle = corners.mean(axis=1)
        sides = corners - np.roll(corners, 1, axis=1)
        size = np.hypot(*np.moveaxis(sides, 2, 0)).max(axis=1)
        close = (tree.query(middle)[0] < REFINE_DISTANCE * size) & (time < MAX_REFINEMENTS)
        (a, b) = np.moveaxis(sides[~close, 1:], 1, 0)
        points.append(middle[~close])
        areas.append(0.5 * np.abs(cross(a, b)))
        whole = corners[close]
        middles = 0.5 * (whole + np.roll(whole, -1, axis=1))
        before = np.roll(middles, 1, axis=1)
        ends = [np.stack([whole[:, i], middles[:, i], before[:, i]], axis=1) for i in range(3)]
        corners = np.concatenate([middles, *ends])
    return np.concatenate(points), np.concatenate(areas)
