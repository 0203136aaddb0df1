"""Visibility criterion at slits, where the outline faces itself across a narrow void: the displacement may
jump there, so nodes on the two faces are no neighbours. Chords over a hollow or past a corner are allowed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.membership import cross, inside_polygon, joints, twice_area
from mlsanm_cli.kernels.sight import cut_lines
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF

MIN_DETOUR = 3.0
"""A void is a slit if the way along the outline from face to face is at least this many times its width. A
notch is a slit if it is deeper than wide, a wedge if it opens by less than about 40 degrees."""
MAX_WIDTH = 12.0
"""Voids wider than this many spacings are wider than any stencil."""
INWARD_SHIFT = 1e-3
"""Points on the outline are shifted inward by this fraction of the edge length before visibility tests."""
FACE_SHIFT = 0.3
"""Each face of a slit is shifted by this fraction of the edge length for the triangulation."""


@dataclass(frozen=True)
class VisibilityCriterion:
    """Visibility between the nodes ``points`` (n, 2) of a body with slits. ``edges`` (e, 2) are the outline's
    chords as node pairs, ``normals`` (e, 2) their outward normals, ``along`` (e, 2) the arc lengths of their
    ends along the outline, ``loop`` (e,) the lengths of their loops, ``slits`` the edges that face another
    one across a slit."""

    points: FloatArray
    edges: IntArray
    normals: FloatArray
    along: FloatArray
    loop: FloatArray
    slits: IntArray

    def near(self, targets: FloatArray, radius: FloatArray) -> BoolArray:
        """Mask (t,) of circles of ``radius`` (t,) about ``targets`` (t, 2) that reach a slit."""
        distance = cKDTree(self._middles[self.slits]).query(targets)[0]
        return np.asarray(distance <= radius + self._longest)

    def cut(self, targets: FloatArray, numbers: IntArray) -> BoolArray:
        """Mask (t, k) of nodes ``numbers`` (t, k) hidden from ``targets`` (t, 2) by a slit."""
        span = self.points[numbers] - targets[:, None]
        reach = np.sqrt((span**2).sum(axis=2).max(axis=1)) + self._longest
        start, near = _neighbours(self._tree, targets, reach)
        return cut_lines(
            *(self._inward(targets), self._shifted, numbers, start, near),
            *(self._chords, self.along, self.loop, self.normals, MIN_DETOUR),
        )

    def apart(self, one: IntArray, other: IntArray) -> BoolArray:
        """Mask (p,) of pairs of nodes ``one``, ``other`` (p,) that a slit hides from each other."""
        apart = np.zeros(len(one), dtype=bool)
        span = self.points[other] - self.points[one]
        asked = np.flatnonzero(self.near(self.points[one], np.sqrt((span**2).sum(axis=1))))
        if len(asked):
            apart[asked] = self.cut(self.points[one[asked]], other[asked, None])[:, 0]
        return apart

    @cached_property
    def _chords(self) -> FloatArray:
        return np.ascontiguousarray(self.points[self.edges].reshape(-1, 4))

    @cached_property
    def _middles(self) -> FloatArray:
        return np.asarray(0.5 * (self._chords[:, :2] + self._chords[:, 2:]))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._middles)

    @cached_property
    def _shifted(self) -> FloatArray:
        """The nodes (n, 2), those of the boundary moved slightly inward."""
        return self.drawn_in(INWARD_SHIFT, np.arange(len(self.edges)))

    @cached_property
    def _longest(self) -> float:
        return float((self.along[:, 1] - self.along[:, 0]).max())

    @cached_property
    def _corners(self) -> FloatArray:
        """Outward unit vectors (n, 2) at the boundary nodes: mean of the adjacent edge normals."""
        total = np.zeros_like(self.points)
        for end in (0, 1):
            total[self.edges[:, end]] += self.normals
        size = np.sqrt((total**2).sum(axis=1, keepdims=True))
        return np.asarray(total / np.where(size > 0.0, size, 1.0))

    def drawn_in(self, part: float, which: IntArray) -> FloatArray:
        """The nodes (n, 2), those of edges ``which`` moved inward by ``part`` of the edge length."""
        points = self.points.copy()
        for end in (0, 1):
            node = self.edges[which, end]
            step = part * (self.along[which, 1] - self.along[which, 0])
            points[node] = self.points[node] - step[:, None] * self._corners[node]
        return points

    def _inward(self, targets: FloatArray) -> FloatArray:
        """The targets, those on the outline or outside a chord moved slightly inward."""
        start, near = _neighbours(self._tree, targets, np.full(len(targets), 1.01 * self._longest))
        row = np.repeat(np.arange(len(targets)), np.diff(start))
        a, step = self._chords[near, :2], self._chords[near, 2:] - self._chords[near, :2]
        part = np.clip(((targets[row] - a) * step).sum(axis=1) / (step**2).sum(axis=1), 0.0, 1.0)
        foot = a + part[:, None] * step
        distance = np.sqrt(((targets[row] - foot) ** 2).sum(axis=1))
        order = np.lexsort((distance, row))
        chosen = order[np.flatnonzero(np.diff(row[order], prepend=-1))]
        depth = INWARD_SHIFT * np.sqrt((step[chosen] ** 2).sum(axis=1))
        outside = ~inside_polygon(self._chords, targets[row[chosen]])
        chosen, depth = (x[(distance[chosen] < depth) | outside] for x in (chosen, depth))
        first, last = (self._corners[self.edges[near[chosen], end]] for end in (0, 1))
        outward = (1.0 - part[chosen, None]) * first + part[chosen, None] * last
        inward = targets.copy()
        inward[row[chosen]] = foot[chosen] - depth[:, None] * outward
        return inward


def visibility_criterion(points: FloatArray, edges: IntArray) -> VisibilityCriterion | None:
    """Visibility of ``points`` (n, 2) inside loops of ``edges`` (e, 2); None for outlines without slits."""
    step = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.sqrt((step**2).sum(axis=1))
    begins = np.flatnonzero(np.append(True, edges[1:, 0] != edges[:-1, 1]))
    if len(begins) == 1:
        following = np.roll(step, -1, axis=0)
        turn = cross(step, following)
        if (turn >= -FINE_ROUND_OFF * length * np.roll(length, -1)).all():
            return None  # a convex outline does not face itself across a void
    number = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(edges))))
    end = np.cumsum(length)
    along = np.stack([end - length, end], axis=1) - (end - length)[begins][number][:, None]
    loop = np.add.reduceat(length, begins)[number]
    normals = np.stack([step[:, 1], -step[:, 0]], axis=1) / length[:, None]
    # Edges that face another one across a narrow void.
    middles = 0.5 * (points[edges[:, 0]] + points[edges[:, 1]])
    start, other = _neighbours(cKDTree(middles), middles, MAX_WIDTH * (along[:, 1] - along[:, 0]))
    one = np.repeat(np.arange(len(middles)), np.diff(start))
    across = middles[other] - middles[one]
    out, back = (across * normals[one]).sum(axis=1), -(across * normals[other]).sum(axis=1)
    adjacent = np.abs(across[:, 0] * normals[one, 1] - across[:, 1] * normals[one, 0])
    edge = along[:, 1] - along[:, 0]
    facing = (out > 0.0) & (back > 0.0) & ((normals[one] * normals[other]).sum(axis=1) < 0.0)
    # Only edges in front of each other: others may have opposed normals past the material between them.
    facing &= adjacent <= np.maximum(out, back) + 0.5 * (edge[one] + edge[other])
    one, other, width = one[facing], other[facing], np.maximum(out, back)[facing]
    at = along.mean(axis=1)
    way = np.abs(at[one] - at[other])
    way = np.where(number[one] == number[other], np.minimum(way, loop[one] - way), np.inf)
    narrow = way > MIN_DETOUR * width
    slits = np.unique(np.concatenate([one[narrow], other[narrow]]))
    return VisibilityCriterion(points, edges, normals, along, loop, slits) if len(slits) else None


def _neighbours(tree: cKDTree, targets: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
    """Indices of tree points within ``radius`` (t,) of ``targets`` (t, 2), in CSR form."""
    found = tree.query_ball_point(targets, radius)
    start = np.concatenate([[0], np.cumsum([len(one) for one in found])]).astype(np.int64)
    return start, np.concatenate([np.zeros(0, dtype=np.int64), *map(np.array, found)]).astype(np.int64)


def triangulate(points: FloatArray, edges: IntArray, sight: VisibilityCriterion | None) -> IntArray:
    """Delaunay triangles (t, 3), counter-clockwise, of ``points`` (n, 2) inside loops of ``edges`` (e, 2).
    Triangles across slits are removed by ``sight``."""
    # The faces of slits are moved apart, so that slit edges are Delaunay edges.
    placed = points if sight is None else sight.drawn_in(FACE_SHIFT, sight.slits)
    triangles = np.asarray(Delaunay(placed).simplices, dtype=np.int64)
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice = twice_area(a, b, c)
    triangles[twice < 0.0] = triangles[twice < 0.0][:, ::-1]
    # Only triangles of three boundary nodes can lie outside, across a hollow or flat along a curve. Where
    # slits are opened: drawn, those next to a slit's end may turn about and lie over their neighbours.
    on_boundary = np.zeros(len(points), dtype=bool)
    on_boundary[edges] = True
    outside = np.abs(twice) <= ROUND_OFF * ((b - a) ** 2).sum(axis=1)
    doubtful = np.flatnonzero(on_boundary[triangles].all(axis=1) & ~outside)
    centers = placed[triangles[doubtful]].mean(axis=1)
    outside[doubtful] = ~inside_polygon(placed[edges].reshape(-1, 4), centers)
    inner: IntArray = triangles[~outside]
    if sight is not None:
        ends = np.roll(inner, -1, axis=1)
        inner = inner[~np.any([sight.apart(inner[:, side], ends[:, side]) for side in range(3)], axis=0)]
    return inner


SMOOTH_TURN = 0.3
"""Corners that turn inward by less (radians) count as smooth: their displacements are nearly linear."""
MAX_EXPONENT = 0.97
"""Singular exponents above this are as good as 1 (linear displacements)."""


@dataclass(frozen=True)
class Tips:
    """Reentrant corners at ``place`` (t, 2) between traction-free faces. ``axis`` (t, 2) is the unit bisector
    into the material, which fills the angle ``half`` (t,) on either side of it. ``apart`` (t,) is the
    distance to the nearest other corner in outline edges, doubled if that one is seen across the material.
    ``kappa`` is Muskhelishvili's constant of the material, nan until it is known."""

    place: FloatArray
    axis: FloatArray
    half: FloatArray
    apart: FloatArray
    kappa: float = math.nan

    @cached_property
    def modes(self) -> tuple[tuple[tuple[float, bool], ...], ...]:
        """Singular exponents of each corner up to MAX_EXPONENT, and whether their modes open (else shear) it.
        Displacements r^p with sin(2 p half) = -+ p sin(2 half) (Williams 1952, doi:10.1115/1.4010553)."""
        grid, modes = np.linspace(0.4, MAX_EXPONENT, 400), []
        for angle in 2.0 * self.half:
            found = []
            for opens, sign in ((True, 1.0), (False, -1.0)):
                value = np.sin(grid * angle) + sign * grid * np.sin(angle)
                for i in np.flatnonzero((value[:-1] * value[1:] <= 0.0) & (value[:-1] != 0.0)).tolist():
                    low, high = grid[i], grid[i + 1]
                    for _ in range(50):
                        middle = 0.5 * (low + high)
                        at = np.sin(middle * angle) + sign * middle * np.sin(angle)
                        low, high = (middle, high) if at * value[i] > 0.0 else (low, middle)
                    found.append((float(0.5 * (low + high)), opens))
            modes.append(tuple(sorted(found)))
        return tuple(modes)


def tips_of(points: FloatArray, index: IntArray, normal: FloatArray, names: Sequence[str]) -> Tips | None:
    """Reentrant corners of the outline of a body with nodes ``points`` (n, 2), whose boundary nodes ``index``
    (b,) have outward ``normal`` (b, 2) and belong to surfaces ``names`` (b,); None without any."""
    place, axis, half, edge = [], [], [], []
    for last, first, turn in sorted(joints(index, normal, names), key=lambda joint: int(index[joint[1]])):
        if turn < -SMOOTH_TURN:
            tip, (x, y) = points[index[first]], normal[last]
            place.append(tip)
            # Rotated by half the turn: at a crack the two normals would cancel.
            axis.append(np.array([x, y]) * np.cos(0.5 * turn) + np.array([-y, x]) * np.sin(0.5 * turn))
            half.append(0.5 * (np.pi - turn))
            edge.append(float(np.hypot(*(points[index[[last - 1, first + 1]]] - tip).T).max()))
    if not place:
        return None
    at, into, angle = np.array(place), -np.array(axis), np.array(half)
    way = at - at[:, None]
    away = np.hypot(*way.T)
    np.fill_diagonal(away, np.inf)
    seen = (way * into[:, None]).sum(axis=2) > np.cos(angle - SMOOTH_TURN)[:, None] * away
    # Across the material both singular fields add; along a face one is undefined beyond the other's void.
    counted = np.where(seen & seen.T, 2.0 * away, away)
    return Tips(at, into, angle, counted.min(axis=1) / np.array(edge))
