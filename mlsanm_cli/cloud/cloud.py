"""The node cloud of one body, with nodes at points where they are wanted, on the outline or inside."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import Faces, Halves, dual_faces
from mlsanm_cli.cloud.curves import Outline
from mlsanm_cli.cloud.front import fill_region, halved, relax, with_line_nodes
from mlsanm_cli.cloud.joined import SMOOTH_ANGLE
from mlsanm_cli.cloud.membership import boundary_chords, inside_body, joints, twice_area
from mlsanm_cli.cloud.mirror import Mirror, SymmetryLine
from mlsanm_cli.cloud.revolution import imaged, radius_of, with_images
from mlsanm_cli.cloud.sight import VisibilityCriterion, separation, triangulate, visibility_criterion, widths
from mlsanm_cli.cloud.spacing import MIN_DISTANCE, Spacing
from mlsanm_cli.cloud.surface import Surface, boundary_of
from mlsanm_cli.cloud.tips import Tips, tips_of
from mlsanm_cli.errors import RunError
from mlsanm_cli.memo import NO_CACHE, Memo, digest
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

CANDIDATES = 15
FLAT_RADIUS = 10.0
"""Concave curves with a radius above this many times the body's extent count as flat."""
STRIPS = 512
MAX_ACUTE_ANGLE = math.pi / 3.0
"""Interior angle (radian) below which nodes next to a corner are closer than a spacing."""


@dataclass(frozen=True)
class Cloud:
    """Nodes of one body: ``points`` (n, 2), target ``spacing`` (n,), its surfaces by name, and its symmetry
    if it was built with one. A ``revolved`` body is one of revolution about x = 0, and its nodes are
    circles."""

    points: FloatArray
    spacing: FloatArray
    surfaces: dict[str, Surface]
    mirror: Mirror | None = None
    revolved: bool = False

    @cached_property
    def content(self) -> str:
        """Digest of the nodes and surfaces."""
        surfaces = {s.name: [s.index, s.arc_length, s.normal] for s in self.surfaces.values()}
        return digest(self.points, self.spacing, surfaces, self.mirror, self.revolved)

    def around(self, points: FloatArray) -> FloatArray:
        """Circumference (...) of the circles of ``points`` (..., 2) of a body of revolution; 1, per unit
        thickness, of a plane one."""
        return 2.0 * np.pi * points[..., 0] if self.revolved else np.ones(points.shape[:-1])

    def around_nodes(self, surface: Surface) -> FloatArray:
        """Mean circumference (b,) of the part of a ``surface`` that each of its nodes stands for, by the
        nodes' linear shape functions."""
        halves, count = Halves.of(surface), len(surface.index)
        around = self.around(surface.curve.points(halves.arc))
        sums = [
            np.bincount(halves.own, halves.length * halves.share * values, count)
            + np.bincount(halves.other, halves.length * (1.0 - halves.share) * values, count)
            for values in (around, np.ones_like(around))
        ]
        return np.asarray(sums[0] / sums[1])

    def radius(self, points: FloatArray) -> FloatArray | None:
        """Distances (e,) of ``points`` (e, 2) from the axis of revolution; None in plane bodies."""
        return radius_of(points, self.points) if self.revolved else None

    def on_axis(self, surface: Surface) -> bool:
        """Whether a surface is part of the axis of revolution."""
        radius = self.radius(self.points[surface.index])
        return radius is not None and not radius.any()

    @cached_property
    def images(self) -> IntArray | None:
        """Nodes (g,) with images behind the axis of revolution; None in plane bodies."""
        return imaged(self.points, self.edges) if self.revolved else None

    @cached_property
    def fitted(self) -> tuple[FloatArray, cKDTree, VisibilityCriterion | None]:
        """Nodes (n + g, 2) that stencils may use, images included, their search tree, and visibility."""
        if self.images is None or not len(self.images):
            return self.points, self.tree, self.sight
        points = with_images(self.points, self.images)
        return points, cKDTree(points), None if self.sight is None else replace(self.sight, points=points)

    @cached_property
    def boundary_nodes(self) -> IntArray:
        """Indices of all boundary nodes, each once."""
        return np.unique(self.boundary[0])

    @cached_property
    def edges(self) -> IntArray:
        """Pairs (b, 2) of neighbours along the boundary, loop by loop, the material on their left."""
        return _edges(self.surfaces.values())

    def contains(self, targets: FloatArray, slack: float = ROUND_OFF) -> BoolArray:
        """Which of the ``targets`` (e, 2) lie in the body or, up to a ``slack`` relative to its size, on its
        boundary."""
        return inside_body(self.points, *self.boundary, targets, slack)

    @cached_property
    def sight(self) -> VisibilityCriterion | None:
        """Visibility between nodes past the body's slits; None without slits."""
        return visibility_criterion(self.points, self.edges)

    @cached_property
    def tips(self) -> Tips | None:
        """Reentrant corners; None without any."""
        return tips_of(self.points, *self.boundary)

    @cached_property
    def corners(self) -> list[tuple[int, float, tuple[str, str]]]:
        """Nodes where one surface ends and another begins, angle (radian) by which the outline turns left
        there, and names of both."""
        index, _, names = self.boundary
        return [
            (int(index[first]), turn, (names[last], names[first]))
            for last, first, turn in joints(*self.boundary)
        ]

    @cached_property
    def room(self) -> FloatArray:
        """Distance (n,) to the nearest concave part of the outline (fillet, notch, hole) plus its radius;
        infinite without any."""
        room = np.full(len(self.points), np.inf)
        flattest = FLAT_RADIUS * float(np.ptp(self.points, axis=0).max())
        for surface in self.surfaces.values():
            curve = surface.curve
            if (curve.curvature(surface.arc_length) < 0.0).any():
                near = curve.closest(self.points)
                away = self.points - curve.points(near)
                bend = np.minimum(curve.curvature(near), 0.0)
                radius = 1.0 / np.maximum(-bend, 1.0 / flattest)
                room = np.minimum(room, np.hypot(away[:, 0], away[:, 1]) + radius)
        return room

    @cached_property
    def tree(self) -> cKDTree:
        """Search tree of the nodes."""
        return cKDTree(self.points)

    @cached_property
    def separation(self) -> tuple[FloatArray, float]:
        """Distance (n,) of every node from the nearest other one over the local spacing, and the largest
        spacing difference of neighbours over their distance."""
        return separation(self.points, self.tree, self.spacing, self.sight, self._between_faces)

    @cached_property
    def acute(self) -> dict[int, float]:
        """Corner nodes with an interior angle below MAX_ACUTE_ANGLE, and these angles (radians)."""
        angles = {node: math.pi - turn for node, turn, _ in self.corners}
        return {node: angle for node, angle in angles.items() if angle < MAX_ACUTE_ANGLE}

    @property
    def _between_faces(self) -> FloatArray:
        """Distance (n,) between the faces of acute corners at their nodes, infinite elsewhere."""
        room = np.full(len(self.points), np.inf)
        for corner, angle in self.acute.items():
            away = np.hypot(*(self.points[self.boundary_nodes] - self.points[corner]).T)
            away[away == 0.0] = np.inf
            across = np.minimum(room[self.boundary_nodes], 2.0 * np.sin(0.5 * angle) * away)
            room[self.boundary_nodes] = across
        return room

    @cached_property
    def widths(self) -> FloatArray:
        """Width (n,) of the body at its boundary nodes; infinite at others and where no part is thin."""
        return widths(self.points, *self.boundary[:2])

    @property
    def spacings_across(self) -> float:
        """Number of spacings across the thinnest part of the body."""
        return float((self.widths / self.spacing).min())

    @cached_property
    def boundary(self) -> tuple[IntArray, FloatArray, tuple[str, ...]]:
        """The nodes (b,) of all surfaces, with corners twice, their normals (b, 2) and the names of their
        surfaces."""
        return boundary_of(self.surfaces.values())

    @cached_property
    def triangles(self) -> IntArray:
        """Delaunay triangles (t, 3) of the nodes inside the body, counter-clockwise. They serve quality
        figures, checks and the nodes' cells; no shape function is defined on them."""
        return triangulate(self.points, self.edges, self.sight)

    @cached_property
    def faces(self) -> Faces:
        """Inner faces of the nodes' cells."""
        return dual_faces(self.points, self.triangles, self.surfaces)

    @cached_property
    def areas(self) -> FloatArray:
        """Area (n,) of a node: a third of each of its triangles."""
        twice = twice_area(*(self.points[self.triangles[:, corner]] for corner in range(3)))
        shares = np.repeat(twice / 6.0, 3)
        areas: FloatArray = np.bincount(self.triangles.ravel(), shares, len(self.points)).astype(np.float64)
        # Four nodes on a circle have two triangulations, and the mirror image may have the other.
        return areas if self.mirror is None else 0.5 * (areas + areas[self.mirror.image])

    @cached_property
    def volumes(self) -> FloatArray:
        """Volume (n,) of a node: its area times its circumference, per unit thickness of a plane body."""
        return self.areas * self.around(self.points)


def build_cloud(
    outline: Outline,
    spacing: Spacing,
    seed: int,
    limit: int = 50_000_000,
    memo: Memo = NO_CACHE,
    line: SymmetryLine | None = None,
    wanted: Sequence[tuple[float, float]] = (),
) -> Cloud:
    """Place nodes on the outline and inside it; deterministic for a given ``seed``.

    Points ``wanted`` become nodes, or shift to the outline if they are closer to it than half a spacing; they
    are dropped if they are that close to a corner or to each other.
    About a ``line`` the cloud is its own mirror image if outline, spacing and points are, and if the line
    does not run along the outline.
    Raises RunError if more than ``limit`` nodes would be needed.
    """
    half, (places, inner) = None, _located(outline, spacing, np.array(wanted, dtype=float).reshape(-1, 2))
    if line is not None and spacing.symmetric(line) and line.contains(inner):
        boundary, surfaces, edges = _bounded(outline, spacing, places, line)
        half = halved(line, boundary, edges, spacing)
    if half is None:
        boundary, surfaces, edges = _bounded(outline, spacing, places)
        first, chords = boundary, boundary[edges].reshape(-1, 4)
    else:
        mirror, chords, cuts = half
        first = boundary[mirror.own]
    inside = _apart(inner, boundary, surfaces, spacing) if len(inner) else inner
    start, fixed = np.concatenate([first, inside]), len(boundary) + len(inside)
    far, zones = spacing.far, spacing.table()

    def made() -> Cloud:
        points = fill_region(start, chords, _strips(chords), far, zones, CANDIDATES, seed, limit)
        if len(points) >= limit:
            hint = "use larger spacings or smaller refinements"
            raise RunError(f"more than {limit} nodes in one body", hint)
        if half is None:
            points = relax(points, fixed, spacing)
            return Cloud(points, spacing.at(points), surfaces)
        inner, upon = with_line_nodes(mirror.line, boundary, cuts, points[len(first) :], spacing)
        points = relax(np.concatenate([boundary, inner]), fixed, spacing, line, upon - len(inside))
        return Cloud(points, spacing.at(points), surfaces, mirror.extended(len(points), upon))

    key = digest(boundary, start, chords, far, zones, seed, limit, list(surfaces))
    return memo.value("cloud", key, made)


def continuations(cloud: Cloud, surface: Surface) -> Iterator[tuple[int, str]]:
    """Ends (0 or -1) of an open surface at which another surface continues without a corner, and the name of
    that surface."""
    own = {part.name for part, _ in surface.members}
    for place in () if surface.curve.closed else (0, -1):
        node, normal = surface.index[place], surface.normal[place]
        for name, other in cloud.surfaces.items():
            smooth = other.normal[other.index == node] @ normal >= math.cos(SMOOTH_ANGLE)
            if name not in own and smooth.any():
                yield place, name


def _bounded(
    outline: Outline, spacing: Spacing, places: Sequence[FloatArray], line: SymmetryLine | None = None
) -> tuple[FloatArray, dict[str, Surface], IntArray]:
    """Boundary nodes (b, 2), surfaces and edges (b, 2), with nodes at ``places``, arc lengths on every curve,
    and where the middle of a curve lies on the symmetry ``line``."""
    steps = [
        spacing.steps_along(curve, line, at.tolist())
        for curve, at in zip(outline.curves, places, strict=True)
    ]
    points = np.concatenate([curve.points(s[:-1]) for curve, s in zip(outline.curves, steps, strict=True)])
    surfaces = _surfaces(outline, steps)
    return points, surfaces, _edges(surfaces.values())


def _surfaces(outline: Outline, steps: list[FloatArray]) -> dict[str, Surface]:
    """Surfaces with nodes at arc lengths ``steps``, numbered loop by loop."""
    surfaces = {}
    first = 0
    for loop in outline.loops:
        total = sum(len(s) - 1 for s in steps[loop])
        passed = 0
        for name, curve, s in zip(outline.names[loop], outline.curves[loop], steps[loop], strict=True):
            s = s[:-1] if curve.closed else s
            index = first + (passed + np.arange(len(s), dtype=np.int64)) % total
            surfaces[name] = Surface(name, curve, index, s, curve.normals(s))
            passed += len(s) - 1
        first += total
    return surfaces


def _edges(surfaces: Iterable[Surface]) -> IntArray:
    index, _, names = boundary_of(surfaces)
    return np.asarray(index[boundary_chords(index, names)])


def _strips(edges: FloatArray) -> tuple[IntArray, IntArray, float, float]:
    """Edges (e, 4) sorted into horizontal strips: (start, edge numbers, lowest y, strip height)."""
    low = np.minimum(edges[:, 1], edges[:, 3])
    high = np.maximum(edges[:, 1], edges[:, 3])
    bottom = float(low.min())
    height = float(high.max() - bottom) / STRIPS * (1.0 + 1e-12)
    first = np.clip(((low - bottom) / height).astype(np.int64), 0, STRIPS - 1)
    last = np.clip(((high - bottom) / height).astype(np.int64), 0, STRIPS - 1)
    count = np.where(edges[:, 1] == edges[:, 3], 0, last - first + 1)
    number = np.repeat(np.arange(len(edges)), count)
    strip = np.repeat(first, count) + np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    order = np.argsort(strip, kind="stable")
    start = np.searchsorted(strip[order], np.arange(STRIPS + 1))
    return start.astype(np.int64), number[order].astype(np.int64), bottom, height


def _located(outline: Outline, spacing: Spacing, points: FloatArray) -> tuple[list[FloatArray], FloatArray]:
    """Of wanted ``points`` (k, 2), the arc lengths on every curve of those on or next to it, and the others
    (m, 2)."""
    number, arc, least = np.full(len(points), -1), np.zeros(len(points)), np.full(len(points), np.inf)
    for k, curve in enumerate(outline.curves if len(points) else ()):
        s = curve.closest(points)
        away = np.hypot(*(curve.points(s) - points).T)
        nearer = away < least
        number[nearer], arc[nearer], least[nearer] = k, s[nearer], away[nearer]
    number[least > MIN_DISTANCE * spacing.at(points)] = -1
    return [arc[number == k] for k in range(len(outline.curves))], points[number < 0]


def _apart(
    points: FloatArray, boundary: FloatArray, surfaces: Mapping[str, Surface], spacing: Spacing
) -> FloatArray:
    """Those of the ``points`` (k, 2) inside the body of ``boundary`` nodes (b, 2) that are not too close to
    an earlier one."""
    room = MIN_DISTANCE * spacing.at(points)
    kept = inside_body(boundary, *boundary_of(surfaces.values()), points)
    for k in np.flatnonzero(kept):
        others = np.flatnonzero(kept[:k])
        kept[k] = (np.hypot(*(points[others] - points[k]).T) > room[k]).all()
    return np.ascontiguousarray(points[kept])
