"""Triangle meshes of half-cylinder and block, and of the patch test's blocks, by Shewchuk's Triangle.

Along the surface nodes stand so that the straight pieces between them miss a profile with square roots at
its ends equally everywhere: the spacing falls with the distance d to such a point as d^0.6. Below the surface
it grows linearly with depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scenes import HALF_SIDE, HALF_WIDTH, RADIUS, STICK, Array

SLACK = 1.5
"""Largest area of a triangle, over the equilateral one's of the spacing asked for."""

Spacing = Callable[[Array, Array], Array]
Mesh = dict[str, NDArray[np.float64] | NDArray[np.int64]]
"""``upper_points`` and ``lower_points`` (n, 2), ``upper_triangles`` and ``lower_triangles`` (k, 3)."""


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

    def at(self, x: Array, y: Array) -> Array:
        """Spacing in the plane."""
        end = max(self.even, self.points[-1])
        adjacent = np.maximum(np.abs(x) - end, 0.0)
        on_surface = self.surface(np.clip(x, -end, end))
        return np.minimum(on_surface + self.growth * np.hypot(adjacent, y), self.coarse)


KINKS = (-HALF_WIDTH, -STICK, STICK, HALF_WIDTH)
EVEN = (10, 20, 40, 80, 160)
GRADINGS = {
    "graded-coarse": Grading(0.0008, 0.008, 0.6, 0.4),
    "graded-medium": Grading(0.0003, 0.005, 0.5, 0.4),
    "graded-fine": Grading(0.0002, 0.003, 0.3, 0.3),
    "graded-finest": Grading(0.0001, 0.002, 0.22, 0.25),
    **{f"even-{n}": Grading(1.0, HALF_WIDTH / n, 0.3, 0.3, even=1.2 * HALF_WIDTH) for n in EVEN},
    "kinked-coarse": Grading(0.0008, 0.006, 0.5, 0.3, KINKS),
    "kinked-fine": Grading(0.0002, 0.0025, 0.3, 0.3, KINKS),
}
"""The meshes by name; even-20 has 20 spacings in half of the contact. "patch" is the patch test's."""


def load(source: str) -> Mesh:
    """A mesh given as an .npz file, or made here and now if ``source`` is a mesh's name."""
    if source.endswith(".npz"):
        with np.load(source) as arrays:
            return dict(arrays)
    return make(patch_outlines() if source == "patch" else hertz_outlines(GRADINGS[source]))


def make(bodies: dict[str, tuple[Array, Spacing]]) -> Mesh:
    """Bodies, each an outline and the spacing inside."""
    arrays: Mesh = {}
    for body, (outline, spacing) in bodies.items():
        arrays[f"{body}_points"], arrays[f"{body}_triangles"] = fill(outline, spacing)
    return arrays


def vertices(mesh: Mesh) -> int:
    """Number of vertices of both bodies."""
    return len(mesh["upper_points"]) + len(mesh["lower_points"])


def fill(outline: Array, spacing: Spacing) -> tuple[Array, NDArray[np.int64]]:
    """Points (n, 2) and triangles (k, 3) inside an outline whose nodes are kept."""
    from triangle import triangulate

    k = np.arange(len(outline))
    ends = np.column_stack([k, np.roll(k, -1)])
    mesh = triangulate({"vertices": outline, "segments": ends}, "pq28YYQ")
    for _ in range(2):  # each refinement judges the triangles of the mesh before
        x, y = mesh["vertices"][mesh["triangles"]].mean(axis=1).T
        mesh["triangle_max_area"] = SLACK * 0.25 * 3.0**0.5 * spacing(x, y)[:, None] ** 2
        mesh = triangulate(mesh, "prq28aYYQ")
    return mesh["vertices"], mesh["triangles"].astype(np.int64)


def divide(spacing: Callable[[Array], Array], knots: Array) -> Array:
    """Points between the knots at equal increments of the integral of 1/spacing, knots included."""
    pieces = []
    for start, end in pairwise(knots):
        # The spacing is finest at the knots, so that is where the integral is sampled most densely.
        s = start + (end - start) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 4001)))
        density = 1.0 / spacing(s)
        count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
        steps = max(1, round(count[-1]))
        pieces.append(np.interp(np.linspace(0.0, count[-1], steps + 1), count, s)[:-1])
    return np.concatenate([*pieces, knots[-1:]])


def hertz_outlines(grading: Grading) -> dict[str, tuple[Array, Spacing]]:
    """Half-cylinder and block: boundary nodes in their order around, and the spacing inside.

    The arc's nodes lie on the circle.
    """

    def steps(length: float, x: float, y: float) -> int:
        return max(1, round(length / float(grading.at(np.array([x]), np.array([y]))[0])))

    knots = np.array(grading.points)
    angle = divide(grading.surface, np.array([-np.pi / 2, *np.arcsin(knots / RADIUS), np.pi / 2]))
    arc = RADIUS * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    arc[[0, -1]] = [(-RADIUS, RADIUS), (RADIUS, RADIUS)]
    flat = np.linspace(RADIUS, -RADIUS, 1 + steps(2.0 * RADIUS, 0.0, RADIUS))[1:-1]
    top = divide(lambda x: grading.block * grading.surface(x), np.array([-HALF_SIDE, *knots, HALF_SIDE]))
    side = np.linspace(0.0, 1.0, 1 + steps(HALF_SIDE, HALF_SIDE, -HALF_SIDE))
    bottom = np.linspace(1.0, -1.0, 2 * len(side) - 1)
    upper = np.vstack([arc, np.column_stack([flat, np.full_like(flat, RADIUS)])])
    lower = np.vstack(
        [
            np.column_stack([top, np.zeros_like(top)]),
            HALF_SIDE * np.column_stack([np.ones_like(side), -side])[1:-1],
            HALF_SIDE * np.column_stack([bottom, -np.ones_like(bottom)]),
            HALF_SIDE * np.column_stack([-np.ones_like(side), side - 1.0])[1:-1],
        ]
    )
    return {"upper": (upper, grading.at), "lower": (lower, grading.at)}


def patch_outlines() -> dict[str, tuple[Array, Spacing]]:
    """The two blocks of the patch test, spacings as in cases/patch.toml."""

    def block(bottom: float, spacing: float) -> tuple[Array, Spacing]:
        outline = rectangle((0.0, 2.0), (bottom, bottom + 1.0), spacing)
        return outline, lambda x, _y: np.full_like(x, spacing)

    return {"upper": block(1.0, 0.1), "lower": block(0.0, 0.137)}


def rectangle(x: tuple[float, float], y: tuple[float, float], spacing: float) -> Array:
    """Boundary nodes of a rectangle at equal steps."""
    corners = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])])
    sides = []
    for a, b in pairwise(corners):
        steps = max(1, round(float(np.abs(b - a).sum()) / spacing))
        sides.append(a + np.arange(steps)[:, None] / steps * (b - a))
    return np.vstack(sides)
