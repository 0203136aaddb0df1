"""The node cloud of one body, its symmetry, and its images if it is revolved about the line x = 0."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import Faces, Halves, dual_faces
from mlsanm_cli.cloud.membership import boundary_chords, inside_body, joints, twice_area
from mlsanm_cli.cloud.sight import Tips, VisibilityCriterion, tips_of, triangulate, visibility_criterion
from mlsanm_cli.cloud.surface import SMOOTH_ANGLE, Surface, boundary_of
from mlsanm_cli.memo import digest
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

BATCH_SIZE = 8192
"""Points of a long compiled call, so that signals are handled meanwhile: a few hundredths of a second."""
FLAT_RADIUS = 10.0
"""Concave curves with a radius above this many times the body's extent count as flat."""
NEIGHBORS = 6
MAX_FACING, OPPOSITE_COSINE = 32, 0.9
"""Nearest boundary nodes searched for one on the opposite side, and the least -n1.n2 of such a pair."""
MAX_ACUTE_ANGLE = math.pi / 3.0
"""Interior angle (radian) below which nodes next to a corner are closer than a spacing."""


@dataclass(frozen=True)
class SymmetryLine:
    """A line of symmetry: coordinate ``axis`` (0 for x, 1 for y) equals ``at``."""

    axis: int
    at: float

    def __str__(self) -> str:
        return f"{'xy'[self.axis]} = {self.at:g}"

    def reflect(self, points: FloatArray) -> FloatArray:
        """Mirror images (n, 2) of ``points`` (n, 2)."""
        return self.signs * points + self.at * (1.0 - self.signs)

    @property
    def signs(self) -> FloatArray:
        """Factors (2,) of a vector's components under reflection."""
        signs = np.ones(2)
        signs[self.axis] = -1.0
        return signs

    def contains(self, points: FloatArray) -> bool:
        """Whether all ``points`` (n, 2) are on the line."""
        size = np.abs(points).max(initial=0.0) + abs(self.at)
        return bool((np.abs(points[:, self.axis] - self.at) <= ROUND_OFF * size).all())

    def images(self, points: FloatArray, size: FloatArray) -> IntArray | None:
        """Indices (n,) of the images of ``points`` (n, 2), within ROUND_OFF times ``size`` (n,); None
        if the points are not mirror-symmetric."""
        away, image = nearest(cKDTree(points), self.reflect(points))
        found: IntArray = np.asarray(image, dtype=np.int64)
        paired = np.array_equal(found[found], np.arange(len(points)))
        return found if paired and (np.asarray(away) <= ROUND_OFF * size).all() else None

    def mirror(self, points: FloatArray, size: FloatArray, edges: IntArray) -> Mirror | None:
        """The symmetry of ``points``, as in :meth:`images`; None also if the line runs along one of the
        ``edges`` (e, 2) of their outline."""
        image = self.images(points, size)
        if image is None:
            return None
        own = image == np.arange(len(image))
        if own[edges].all(axis=1).any():
            return None
        side = np.where(own, 0, np.sign(points[:, self.axis] - self.at)).astype(np.int64)
        return Mirror(self, image, side)


@dataclass(frozen=True)
class Mirror:
    """A cloud's symmetry about a ``line``. ``image`` (n,) is the image of every node (itself on the line),
    ``side`` (n,) the sign of its distance from the line."""

    line: SymmetryLine
    image: IntArray
    side: IntArray

    @cached_property
    def own(self) -> IntArray:
        """Nodes (h,) on the line and on its positive side; the others are their images."""
        return np.flatnonzero(self.side >= 0)

    @cached_property
    def place(self) -> IntArray:
        """Position (n,) of every node, or else of its image, in :attr:`own`."""
        place = np.empty(len(self.image), dtype=np.int64)
        place[self.own] = np.arange(len(self.own))
        beyond = self.side < 0
        place[beyond] = place[self.image[beyond]]
        return place

    def extended(self, count: int, upon: int) -> Mirror:
        """Symmetry of ``count`` nodes ordered as: these nodes, ``upon`` nodes on the line, further nodes on
        the positive side, their images."""
        first = len(self.image)
        on = np.arange(first, first + upon)
        adjacent, beyond = np.split(np.arange(first + upon, count), 2)
        image = np.concatenate([self.image, on, beyond, adjacent])
        side = [self.side, np.zeros_like(on), np.ones_like(adjacent), -np.ones_like(beyond)]
        return Mirror(self.line, image, np.concatenate(side))

    def derivative_signs(self, kinds: int) -> FloatArray:
        """Factors under reflection of value, d/dx, d/dy, d2/dx2, d2/dxdy, d2/dy2, the first ``kinds`` of
        them."""
        x, y = self.line.signs
        return np.array([1.0, x, y, 1.0, x * y, 1.0])[:kinds]


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

    def mirrored(self, line: SymmetryLine) -> Cloud | None:
        """The same cloud with its symmetry about a ``line``; None if its nodes are not symmetric or the line
        runs along its outline."""
        mirror = line.mirror(self.points, self.spacing, self.edges)
        if mirror is None:
            return None
        # The image of a quadrilateral may be split along its other diagonal: neighbour distances then differ.
        spacing = 0.5 * (self.spacing + self.spacing[mirror.image])
        return Cloud(self.points, spacing, self.surfaces, mirror)

    def around(self, points: FloatArray) -> FloatArray:
        """Circumference (...) of the circles of ``points`` (..., 2) of a body of revolution; 1, per unit
        thickness, of a plane one."""
        return 2.0 * np.pi * points[..., 0] if self.revolved else np.ones(points.shape[:-1])

    def around_nodes(self, surface: Surface) -> FloatArray:
        """Mean circumference (b,) of the part of a ``surface`` that each of its nodes stands for, by the
        nodes' linear shape functions."""
        halves, count = Halves.of(surface), len(surface.index)
        around = self.around(surface.curve.points(halves.arc))
        total, whole = (
            np.bincount(halves.own, halves.length * halves.share * values, count)
            + np.bincount(halves.other, halves.length * (1.0 - halves.share) * values, count)
            for values in (around, np.ones_like(around))
        )
        return np.asarray(total / whole)

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
        return edges_of(self.surfaces.values())

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
        ends = joints(*self.boundary)
        return [(int(index[first]), turn, (names[last], names[first])) for last, first, turn in ends]

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
        spacing difference of neighbours over their distance. At acute corners the distance between the faces
        counts, if it is smaller; nodes hidden from each other by a slit do not count."""
        room, outline = self.spacing.copy(), self.boundary_nodes
        for corner, angle in self.acute.items():
            away = np.hypot(*(self.points[outline] - self.points[corner]).T)
            away[away == 0.0] = np.inf
            room[outline] = np.minimum(room[outline], 2.0 * np.sin(0.5 * angle) * away)
        count = min(NEIGHBORS, len(self.points) - 1)
        distance, neighbour = nearest(self.tree, self.points, np.arange(2, count + 2))
        if self.sight is not None:
            one = np.repeat(np.arange(len(neighbour)), count)
            distance[self.sight.apart(one, neighbour.ravel()).reshape(neighbour.shape)] = np.inf
        growth = np.abs(self.spacing[neighbour] - self.spacing[:, None]) / distance
        return np.asarray(distance.min(axis=1) / room), float(growth.max())

    @cached_property
    def acute(self) -> dict[int, float]:
        """Corner nodes with an interior angle below MAX_ACUTE_ANGLE, and these angles (radians)."""
        angles = {node: math.pi - turn for node, turn, _ in self.corners}
        return {node: angle for node, angle in angles.items() if angle < MAX_ACUTE_ANGLE}

    @cached_property
    def widths(self) -> FloatArray:
        """Width (n,) of the body at its boundary nodes, infinite at others and where no part is thin: the
        diameter of the smallest circle inside that touches the boundary at the node and passes through
        another one on the opposite side."""
        index, normal, _ = self.boundary
        at = self.points[index]
        count = min(MAX_FACING, len(index) - 1)
        _, near = nearest(cKDTree(at), at, np.arange(2, count + 2))
        away = at[:, None] - at[near]
        depth = (away * normal[:, None]).sum(axis=2)
        across = (depth > 0.0) & ((normal[near] * normal[:, None]).sum(axis=2) < -OPPOSITE_COSINE)
        width = np.full(near.shape, np.inf)
        np.divide((away**2).sum(axis=2), depth, out=width, where=across)
        least = np.full(len(self.points), np.inf)
        np.minimum.at(least, index, width.min(axis=1))
        return least

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


def nearest(tree: cKDTree, points: FloatArray, k: int | IntArray = 1) -> tuple[FloatArray, IntArray]:
    """Distances and indices of the ``k`` nodes of a ``tree`` nearest to ``points`` (n, 2), in batches: (n,)
    for k = 1, otherwise (n, k)."""
    batches = np.split(points, range(BATCH_SIZE, len(points), BATCH_SIZE))
    distances, indices = zip(*(tree.query(batch, k=k) for batch in batches), strict=True)
    return np.concatenate(distances), np.concatenate(indices)


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


def edges_of(surfaces: Iterable[Surface]) -> IntArray:
    index, _, names = boundary_of(surfaces)
    return np.asarray(index[boundary_chords(index, names)])


def radius_of(points: FloatArray, nodes: FloatArray) -> FloatArray:
    """Distances (e,) of ``points`` (e, 2) from the axis, 0 up to round-off of a body's ``nodes`` (n, 2)."""
    x = points[:, 0]
    return np.where(x > ROUND_OFF * np.abs(nodes).max(), x, 0.0)


def at_axis(points: FloatArray, revolved: bool) -> BoolArray | None:
    """Mask (m,) of the ``points`` (m, 2) of a contact that are on the axis; None in plane scenes."""
    return np.asarray(radius_of(points, points) == 0.0) if revolved else None


def imaged(points: FloatArray, edges: IntArray) -> IntArray:
    """Numbers (g,) of the nodes ``points`` (n, 2) whose images behind the axis continue the body: those
    opposite to ``edges`` (b, 2) of its outline on the axis."""
    radius, beside = radius_of(points, points), np.zeros(len(points), dtype=bool)
    for low, high in np.sort(points[edges[(radius[edges] == 0.0).all(axis=1)], 1], axis=1):
        beside |= (points[:, 1] >= low) & (points[:, 1] <= high)
    return np.flatnonzero(beside & (radius > 0.0))


def with_images(points: FloatArray, own: IntArray) -> FloatArray:
    """The nodes ``points`` (n, 2) and the images of the nodes ``own`` (g,) behind the axis."""
    return np.concatenate([points, points[own] * np.array([-1.0, 1.0])])
