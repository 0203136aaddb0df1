"""Triangle meshes of half-cylinder and block, made by gmsh before anything is timed.

Along the surface nodes stand so that the straight pieces between them miss a profile with square roots at
its ends equally everywhere: the spacing falls with the distance d to such a point as d^0.6. Below the surface
it grows linearly with depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scenes import HALF_SIDE, HALF_WIDTH, RADIUS, Array


@dataclass(frozen=True)
class Grading:
    """Spacings: at the ``points`` where profiles have kinks, in the middle of the contact, far away."""

    edge: float
    centre: float
    growth: float  # per unit length, downwards and outside the contact
    coarse: float
    points: tuple[float, ...] = (-HALF_WIDTH, HALF_WIDTH)
    even: float = 0.0  # positive: this spacing all over |x| < even, no grading towards the points
    block: float = 1.0  # the block's spacing on the surface relative to the cylinder's

    def surface(self, x: Array) -> Array:
        """Spacing on the surface at x."""
        outside = np.maximum(np.abs(x) - max(self.even, self.points[-1]), 0.0)
        if self.even:
            return np.minimum(self.centre + self.growth * outside, self.coarse)
        distance = np.min(np.abs(x[:, None] - np.array(self.points)), axis=1)
        law = self.edge + (self.centre - self.edge) * np.minimum(distance / (0.7 * HALF_WIDTH), 1.0) ** 0.6
        law = np.minimum(law, self.edge + 2.0 * self.growth * distance)
        return np.minimum(np.where(outside > 0, self.edge + self.growth * outside, law), self.coarse)

    def at(self, x: float, y: float) -> float:
        """Spacing in the plane."""
        end = max(self.even, self.points[-1])
        beside = abs(x) - end
        on_surface = float(self.surface(np.array([min(max(x, -end), end)]))[0])
        return min(on_surface + self.growth * float(np.hypot(max(beside, 0.0), y)), self.coarse)


def divide(spacing: Callable[[Array], Array], knots: Array) -> Array:
    """Points between the knots at equal increments of the integral of 1/spacing, knots included."""
    pieces = []
    for start, end in pairwise(knots):
        s = np.linspace(start, end, 100_001)
        density = 1.0 / spacing(s)
        count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
        steps = max(1, round(count[-1]))
        pieces.append(np.interp(np.linspace(0.0, count[-1], steps + 1), count, s)[:-1])
    return np.concatenate([*pieces, knots[-1:]])


def outlines(grading: Grading) -> dict[str, Array]:
    """Boundary nodes of both bodies in their order around; the arc's lie on the circle."""
    knots = np.array(grading.points)
    angle = divide(grading.surface, np.array([-np.pi / 2, *np.arcsin(knots / RADIUS), np.pi / 2]))
    arc = RADIUS * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    arc[[0, -1]] = [(-RADIUS, RADIUS), (RADIUS, RADIUS)]
    flat = np.linspace(RADIUS, -RADIUS, 1 + max(1, round(2.0 * RADIUS / grading.at(0.0, RADIUS))))[1:-1]
    top = divide(lambda x: grading.block * grading.surface(x), np.array([-HALF_SIDE, *knots, HALF_SIDE]))
    side = np.linspace(0.0, 1.0, 1 + max(1, round(HALF_SIDE / grading.at(HALF_SIDE, -HALF_SIDE))))
    bottom = np.linspace(1.0, -1.0, 2 * len(side) - 1)
    return {
        "upper": np.vstack([arc, np.column_stack([flat, np.full_like(flat, RADIUS)])]),
        "lower": np.vstack(
            [
                np.column_stack([top, np.zeros_like(top)]),
                HALF_SIDE * np.column_stack([np.ones_like(side), -side])[1:-1],
                HALF_SIDE * np.column_stack([bottom, -np.ones_like(bottom)]),
                HALF_SIDE * np.column_stack([-np.ones_like(side), side - 1.0])[1:-1],
            ]
        ),
    }


def fill(outline: Array, spacing: Callable[[float, float], float]) -> tuple[Array, NDArray[np.int64]]:
    """Points (n, 2) and triangles (k, 3) inside an outline whose nodes are kept."""
    import gmsh

    gmsh.model.add("body")
    geometry = gmsh.model.geo
    points = [geometry.addPoint(x, y, 0.0) for x, y in outline]
    lines = [geometry.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    for line in lines:
        geometry.mesh.setTransfiniteCurve(line, 2)
    geometry.addPlaneSurface([geometry.addCurveLoop(lines)])
    geometry.synchronize()
    gmsh.model.mesh.setSizeCallback(lambda _dim, _tag, x, y, _z, _size: spacing(x, y))
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    (nodes,) = gmsh.model.mesh.getElements(2)[2]
    gmsh.model.remove()
    used, triangles = np.unique(nodes.astype(np.int64), return_inverse=True)
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    return coordinates.reshape(-1, 3)[place[used], :2], triangles.reshape(-1, 3)


def rectangle(x: tuple[float, float], y: tuple[float, float], spacing: float) -> Array:
    """Boundary nodes of a rectangle at equal steps."""
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])])
    sides = []
    for a, b in pairwise(corners):
        steps = max(1, round(float(np.abs(b - a).sum()) / spacing))
        sides.append(a + np.arange(steps)[:, None] / steps * (b - a))
    return np.vstack(sides)


def hertz_mesh(path: Path, grading: Grading) -> int:
    """Half-cylinder and block to one .npz file; the number of vertices."""
    return write_mesh(path, {body: (line, grading.at) for body, line in outlines(grading).items()})


def patch_mesh(path: Path) -> int:
    """The two blocks of the patch test, spacings as in cases/patch.toml."""
    blocks = {"upper": ((1.0, 2.0), 0.1), "lower": ((0.0, 1.0), 0.137)}
    bodies = {body: (rectangle((0.0, 2.0), y, h), lambda _x, _y, h=h: h) for body, (y, h) in blocks.items()}
    return write_mesh(path, bodies)


def write_mesh(path: Path, bodies: dict[str, tuple[Array, Callable[[float, float], float]]]) -> int:
    """Bodies, each an outline and the spacing inside, to one .npz file; the number of vertices."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    for option in ("MeshSizeFromPoints", "MeshSizeExtendFromBoundary", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    arrays, vertices = {}, 0
    for body, (outline, spacing) in bodies.items():
        points, triangles = fill(outline, spacing)
        arrays[f"{body}_points"], arrays[f"{body}_triangles"] = points, triangles
        vertices += len(points)
    gmsh.finalize()
    np.savez(path, **arrays)
    return vertices
