"""Quadratic triangles of a case's bodies, as a reference: scikit-fem's stiffness, our clouds as vertices.

Only outlines and places of vertices are shared with mlsanm; stiffness, loads and contact are not.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, LinearForm, MeshTri

from benchmarks.scenes.scene import Array, Table
from mlsanm_cli.case.model.expressions import value_at
from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.spacing import Spacing, build_cloud

POINTS, SHARES = np.polynomial.legendre.leggauss(4)
POINTS, SHARES = 0.5 + 0.5 * POINTS, 0.5 * SHARES
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Side:
    """A boundary: its curve, and per edge the vertices (e, 2), arc lengths (e, 2) and dofs (e, 3, 2)."""

    curve: Curve
    ends: Ints
    arc: Array
    dofs: Ints

    def shapes(self, t: Array) -> Array:
        """Quadratic shape functions (n, 3) of start, end and middle at ``t`` (n,) of an edge."""
        return np.stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)], axis=1)

    def at(self, s: Array) -> tuple[Ints, Array]:
        """Edges and places in them of arc lengths."""
        edge = np.clip(np.searchsorted(self.arc[:, 0], s, side="right") - 1, 0, len(self.arc) - 1)
        t = (s - self.arc[edge, 0]) / (self.arc[edge, 1] - self.arc[edge, 0])
        return edge, np.clip(t, 0.0, 1.0)

    def rows(self, edge: Ints, t: Array, vectors: Array, size: int) -> sparse.csr_matrix:
        """Displacement along ``vectors`` (n, 2) at places of edges, as a matrix on all dofs."""
        values = self.shapes(t)[:, :, None] * vectors[:, None, :]
        rows = np.repeat(np.arange(len(edge)), 6)
        return sparse.csr_matrix((values.ravel(), (rows, self.dofs[edge].ravel())), shape=(len(edge), size))

    def components(self, size: int) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Both components of the displacement at all Gauss points."""
        edge, t, _, _ = self.quadrature()
        x, y = (self.rows(edge, t, np.tile(axis, (len(edge), 1)), size) for axis in np.eye(2))
        return x, y

    def quadrature(self) -> tuple[Ints, Array, Array, Array]:
        """Edges, places in them, arc lengths and weights of all Gauss points."""
        edge = np.repeat(np.arange(len(self.ends)), len(POINTS))
        t = np.tile(POINTS, len(self.ends))
        long = self.arc[edge, 1] - self.arc[edge, 0]
        return edge, t, self.arc[edge, 0] + t * long, np.tile(SHARES, len(self.ends)) * long


class Solid:
    """One body: stiffness on its own dofs, shifted by ``first`` among those of all bodies."""

    def __init__(self, outline: Outline, spacing: Spacing, material: Table, plane: str, first: int) -> None:
        cloud = build_cloud(outline, spacing, 3)
        self.cloud, self.first = cloud, first
        self.mesh = MeshTri(*(np.ascontiguousarray(part.T) for part in (cloud.points, cloud.triangles)))
        self.basis = Basis(self.mesh, ElementVector(ElementTriP2()), intorder=3)
        moduli = plane_moduli(material, plane)
        self.young = float(moduli[0, 0])
        self.stiffness = elasticity(moduli).assemble(self.basis)
        self.size = self.basis.N
        self.mass = area.assemble(self.basis)
        self.axis = np.zeros(self.size, dtype=np.int64)
        self.axis[np.concatenate([self.basis.nodal_dofs[1], self.basis.facet_dofs[1]])] = 1
        self.sides = {name: self._side(surface) for name, surface in cloud.surfaces.items()}

    def _side(self, surface) -> Side:  # type: ignore[no-untyped-def]
        index, arc = surface.index, surface.arc_length
        if surface.curve.closed:
            index, arc = np.append(index, index[0]), np.append(arc, surface.curve.length)
        ends = np.column_stack([index[:-1], index[1:]])
        facet = _facets(self.mesh, ends)
        nodal, middle = self.basis.nodal_dofs.T, self.basis.facet_dofs.T
        dofs = np.stack([nodal[ends[:, 0]], nodal[ends[:, 1]], middle[facet]], axis=1) + self.first
        return Side(surface.curve, ends, np.column_stack([arc[:-1], arc[1:]]), dofs)

    def uniform(self, force: Array) -> Array:
        """Forces of a body force."""
        return np.asarray(self.mass * force[self.axis])

    def at(self, point: Array, values: Array) -> Array:
        """Displacement at a point, inside or on the outline."""
        place = np.array(point, float)[None, :]
        for side in self.sides.values():
            s = side.curve.closest(place)
            if np.hypot(*(side.curve.points(s) - place)[0]) < 1e-9 * np.ptp(self.mesh.p):
                edge, t = side.at(s)
                return np.asarray(side.shapes(t)[0] @ values[side.dofs[edge[0]]])
        own = values[self.first : self.first + self.size]
        return np.asarray(self.basis.probes(place.T) @ own).ravel()


def plane_moduli(material: Table, plane: str) -> Array:
    """Matrix (3, 3) from strains xx, yy, 2xy to stresses, from compliances along the material's axes."""
    if "E" in material:
        E, nu = material["E"], material["nu"]
        one = two = three = E
        nu12 = nu13 = nu23 = nu
        shear = E / (2 * (1 + nu))
    else:
        one, two, shear, nu12 = (material[key] for key in ("E1", "E2", "G12", "nu12"))
        three, nu13, nu23 = (material.get(key, 1.0) for key in ("E3", "nu13", "nu23"))
    compliance = np.array(
        [
            [1 / one, -nu12 / one, -nu13 / one],
            [-nu12 / one, 1 / two, -nu23 / two],
            [-nu13 / one, -nu23 / two, 1 / three],
        ]
    )
    full = np.zeros((3, 3))
    full[:2, :2] = np.linalg.inv(compliance[:2, :2] if plane == "stress" else compliance)[:2, :2]
    full[2, 2] = shear
    c, s = (f(math.radians(material.get("angle", 0.0))) for f in (math.cos, math.sin))
    turn = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    return np.asarray(turn.T @ full @ turn)


@LinearForm
def area(v, w):  # type: ignore[no-untyped-def]
    """Area that every dof stands for."""
    return v[0] + v[1]


def elasticity(moduli: Array) -> BilinearForm:
    """Twice the strain energy."""

    def strains(grad: Array) -> list[Array]:
        return [grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]]

    @BilinearForm
    def form(u, v, w):  # type: ignore[no-untyped-def]
        of_u, of_v = strains(u.grad), strains(v.grad)
        return sum(moduli[i, j] * of_u[j] * of_v[i] for i in range(3) for j in range(3))

    return form


def _facets(mesh: MeshTri, ends: Ints) -> Ints:
    """Numbers of the facets between vertices."""
    number = {tuple(pair): k for k, pair in enumerate(np.sort(mesh.facets, axis=0).T.tolist())}
    # KeyError: a side of the outline is no side of a triangle.
    return np.array([number[tuple(pair)] for pair in np.sort(ends, axis=1).tolist()])


def value_of(given: object, points: Array) -> Array:
    """A number or an expression at points (n, 2)."""
    if not isinstance(given, str):
        return np.full(len(points), float(given))  # type: ignore[arg-type]
    return np.array([value_at(given, x, y) for x, y in points.tolist()])


def obstacle_at(obstacle: Table, places: Array) -> tuple[Array, Array]:
    """Closest points of an obstacle, and its outward normals."""
    if obstacle["kind"] == "plane":
        normal = np.array(obstacle["normal"]) / np.hypot(*obstacle["normal"])
        away = (places - obstacle["point"]) @ normal
        return places - away[:, None] * normal, np.tile(normal, (len(places), 1))
    if obstacle["kind"] == "disk":
        away = places - obstacle["center"]
        normal = away / np.hypot(*away.T)[:, None] * (-1.0 if obstacle.get("inside") else 1.0)
        sign = -1.0 if obstacle.get("inside") else 1.0
        return np.array(obstacle["center"]) + sign * obstacle["radius"] * normal, normal
    points = np.array(obstacle["points"], float)
    best = np.full(len(places), np.inf)
    to, out = np.zeros_like(places), np.zeros_like(places)
    for a, b in itertools.pairwise(points):
        way = b - a
        t = np.clip((places - a) @ way / (way @ way), 0.0, 1.0)
        near = a + t[:, None] * way
        far = np.hypot(*(places - near).T)
        closer = far < best
        best = np.where(closer, far, best)
        to[closer] = near[closer]
        out[closer] = np.array([way[1], -way[0]]) / np.hypot(*way)  # the obstacle lies on the left
    return to, out


def thickness(outline: Outline) -> float:
    """Twice the area over the perimeter; curves count as 4000 chords."""
    twice = 0.0
    for curve in outline.curves:
        x, y = curve.points(np.linspace(0.0, curve.length, 4001)).T
        twice += float((x[:-1] * y[1:] - y[:-1] * x[1:]).sum())
    return twice / sum(curve.length for curve in outline.curves)
