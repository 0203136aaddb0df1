"""Node spacing field h(x), a far value and zones around points or curves where it is smaller; and the nodes
of a body by it. An advancing front fills the region, in time slices so that signals and limits are served.
Then nodes repel each other until their distances match the spacing: a filled cloud is irregular where fronts
meet, and every irregularity is noise in the compliance."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import BATCH_SIZE, Cloud, Mirror, SymmetryLine, edges_of, nearest
from mlsanm_cli.cloud.curves import Curve, Outline, Segment
from mlsanm_cli.cloud.membership import inside_body
from mlsanm_cli.cloud.surface import Surface, boundary_of
from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.fill import DONE, EMPTY, FULL_POINTS, FULL_TABLE, advance_front, spacing_at
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

MAX_STEPS = 2_000_000
"""Largest number of nodes along one curve; with more, the interior nodes would not fit in memory."""
GROWTH = 0.15
"""Increase of automatic spacings per unit length: with faster growth the wide, flat stencils hardly resist
displacements that alternate from node to node."""
MIN_DISTANCE = 0.5
"""Least distance of wanted nodes from ends and from each other, in spacings."""
CANDIDATES = 15
"""Directions in which the front grows from a node."""
STRIPS = 512
"""Horizontal strips into which the chords of a boundary are sorted."""
SLICE_SECONDS = 0.05
"""Target duration of a slice, s: the delay of Ctrl-C."""
FIRST_PARENTS = 500
"""Parent nodes processed in the first slice."""
WEYL = 0x9E3779B97F4A7C15
MODULUS = 2**64
SWEEPS = 10
SEARCH_INTERVAL = 5
"""Neighbours are searched again every so many sweeps."""
NEIGHBORS = 9
DOUBLINGS = 2
"""The repulsion is (spacing / distance)^(2^DOUBLINGS) = (h/d)^4."""
STEP = 0.05
MAX_STEP = 0.2
"""Longest step, in spacings: a node must not pass its neighbours or leave the body."""
SNAP_DISTANCE = 0.3
"""Nodes closer to the line than this fraction of the spacing are moved onto it."""
HOLE_RADIUS = 0.85
"""A point of the line farther than this many spacings from all nodes gets a node."""
HOLE_STEP = 0.1
"""Step of the search for such points, in spacings."""


@dataclass(frozen=True)
class Zone:
    """``spacing`` within ``radius`` of ``curve``, growing by ``growth`` per unit length outside."""

    curve: Curve
    spacing: float
    radius: float = 0.0
    growth: float = GROWTH

    @classmethod
    def around(
        cls, point: Iterable[float], spacing: float, radius: float = 0.0, growth: float = GROWTH
    ) -> Zone:
        """Zone about a point."""
        x, y = (float(coordinate) for coordinate in point)
        return cls(Segment((x, y), (x, y)), spacing, radius, growth)


@dataclass(frozen=True)
class Spacing:
    """Spacing field: the minimum of ``far`` and the spacings of all zones."""

    far: float
    zones: tuple[Zone, ...] = ()

    def table(self) -> FloatArray:
        """Zones as rows (z, 9) in the format of the kernels."""
        asked = [(zone, (zone.spacing, zone.radius, zone.growth)) for zone in self.zones]
        rows = [(*part, *wanted) for zone, wanted in asked for part in zone.curve.zones()]
        return np.array(rows, dtype=np.float64).reshape(-1, 9)

    def at(self, points: FloatArray) -> FloatArray:
        """Spacing (n,) at ``points`` (n, 2)."""
        table, points = self.table(), np.ascontiguousarray(points)
        piece = BATCH_SIZE * 8 // (len(table) + 1) + 1
        batches = np.split(points, range(piece, len(points), piece))
        return np.concatenate([spacing_at(self.far, table, batch) for batch in batches])

    def with_zones(self, zones: tuple[Zone, ...]) -> Spacing:
        """The same field with further zones."""
        return replace(self, zones=(*self.zones, *zones))

    def symmetric(self, line: SymmetryLine) -> bool:
        """Whether every zone is symmetric about ``line`` or has its mirror image among the zones: zones of
        equal spacing, radius, growth and circle radius (z, 4), with three points (z, 3, 2) of their lines and
        arcs, of full circles the centre, at mirror images."""
        table = self.table()
        first, last = table[:, 1:3], table[:, 3:5]
        marks = np.stack([first, 0.5 * (first + last), last], axis=1)
        asked = np.concatenate([table[:, 6:9], np.zeros((len(table), 1))], axis=1)
        for zone in np.flatnonzero(table[:, 0] == 1.0):
            radius, start, sweep = table[zone, 3:6]
            angle = start + sweep * np.array([0.0, 0.5, 1.0])
            around = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            marks[zone] = table[zone, 1:3] + (around if sweep < 2.0 * np.pi else 0.0)
            asked[zone, 3] = radius
        images = line.reflect(marks.reshape(-1, 2)).reshape(marks.shape)
        slack = ROUND_OFF * asked[:, :1, None]
        for image, wanted in zip(images, asked, strict=True):
            like = np.isclose(asked, wanted, rtol=ROUND_OFF, atol=0.0).all(axis=1)
            near = [np.abs(marks - way).max(axis=(1, 2)) <= slack[:, 0, 0] for way in (image, image[::-1])]
            if not (like & (near[0] | near[1])).any():
                return False
        return True

    def steps_along(
        self, curve: Curve, line: SymmetryLine | None = None, places: Sequence[float] = ()
    ) -> FloatArray:
        """Arc lengths of nodes on ``curve``, ends included, at equal increments of the integral of ds/h.
        There are nodes at the ``places`` (arc lengths), and at the middle if it is on the symmetry ``line``.
        Places within half a spacing of an end or of another place are dropped. Equal increments, unlike steps
        of h rescaled at the end, keep a fine zone in its place, so that fine zones of two bodies face each
        other. Raises RunError for more than MAX_STEPS nodes."""
        too_many = RunError(f"more than {MAX_STEPS} nodes along one boundary", "use larger spacings")
        if not curve.length <= MAX_STEPS * self.far:
            raise too_many
        s = np.linspace(0.0, curve.length, 257)
        for _ in range(40):
            # Refine the samples until 1/h varies little between them; then the trapezoidal rule is enough.
            h = self.at(curve.points(s))
            coarse = np.maximum(h[1:], h[:-1]) > 1.05 * np.minimum(h[1:], h[:-1])
            # A zone may lie between two samples.
            coarse |= np.diff(s) > 2.0 * np.minimum(h[1:], h[:-1])
            if not coarse.any():
                break
            s = np.sort(np.concatenate([s, (0.5 * (s[1:] + s[:-1]))[coarse]]))
            if len(s) > 2 * MAX_STEPS:
                raise too_many
        density = 1.0 / self.at(curve.points(s))
        integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(s) * (density[1:] + density[:-1]))])
        if not integral[-1] <= MAX_STEPS:
            raise too_many
        total, halved = float(integral[-1]), False
        if line is not None:
            middle = curve.points(np.array([0.5 * curve.length]))[0, line.axis]
            halved = bool(abs(middle - line.at) <= ROUND_OFF * curve.length)
        ends = [0.0, *([0.5 * total] if halved else ()), total]
        for place in np.interp(places, s, integral).tolist() if len(places) else ():
            if min(abs(place - end) for end in ends) > MIN_DISTANCE:
                ends.append(place)
        # The small shift decides ties alike in every system of units.
        if len(ends) == 2 + halved:
            part, least = 1 + halved, 8 if curve.closed else 2
            even = np.linspace(0.0, total, max(least, part * int(total / part + 0.5 - 1e-6)) + 1)
        else:
            least = 4 if curve.closed else 1
            parts = [
                np.linspace(low, high, max(least, int(high - low + 0.5 - 1e-6)) + 1)
                for low, high in pairwise(sorted(ends))
            ]
            even = np.append(np.concatenate([part[:-1] for part in parts]), total)
        steps: FloatArray = np.interp(even, integral, s)
        steps[0], steps[-1] = 0.0, curve.length
        return steps


def build_cloud(
    outline: Outline,
    spacing: Spacing,
    seed: int,
    limit: int = 50_000_000,
    memo: Memo = NO_CACHE,
    line: SymmetryLine | None = None,
    wanted: Sequence[tuple[float, float]] = (),
) -> Cloud:
    """Place nodes on the outline and inside it; deterministic for a given ``seed``. Points ``wanted`` become
    nodes, or shift to the outline if they are closer to it than half a spacing; they are dropped if they are
    that close to a corner or to each other. About a ``line`` the cloud is its own mirror image if outline,
    spacing and points are, and if the line does not run along the outline. Raises RunError if ``limit`` nodes
    or more would be needed."""
    asked = np.array(wanted, dtype=float).reshape(-1, 2)
    # The wanted points next to the outline by the curve that is nearest, and the others.
    arcs = np.array([curve.closest(asked) for curve in outline.curves])
    near = np.array([curve.points(s) for curve, s in zip(outline.curves, arcs, strict=True)])
    away = np.hypot(*np.moveaxis(near - asked, 2, 0))
    number = np.where(away.min(axis=0) <= MIN_DISTANCE * spacing.at(asked), away.argmin(axis=0), -1)
    places, inner = [arc[number == k] for k, arc in enumerate(arcs)], asked[number < 0]
    half = None
    if line is not None and spacing.symmetric(line) and line.contains(inner):
        boundary, surfaces, edges = _bounded(outline, spacing, places, line)
        half = halved(line, boundary, edges, spacing)
    if half is None:
        boundary, surfaces, edges = _bounded(outline, spacing, places)
        first, chords = boundary, boundary[edges].reshape(-1, 4)
    else:
        mirror, chords, cuts = half
        first = boundary[mirror.own]
    # Wanted points that are not too close to an earlier one.
    room = MIN_DISTANCE * spacing.at(inner)
    kept = inside_body(boundary, *boundary_of(surfaces.values()), inner)
    for k in np.flatnonzero(kept):
        others = np.flatnonzero(kept[:k])
        kept[k] = (np.hypot(*(inner[others] - inner[k]).T) > room[k]).all()
    inside = np.ascontiguousarray(inner[kept])
    start, fixed = np.concatenate([first, inside]), len(boundary) + len(inside)

    def made() -> Cloud:
        points = fill_region(start, chords, spacing, seed, limit)
        if half is None:
            points = relax(points, fixed, spacing)
            return Cloud(points, spacing.at(points), surfaces)
        inner, upon = with_line_nodes(mirror.line, boundary, cuts, points[len(first) :], spacing)
        points = relax(np.concatenate([boundary, inner]), fixed, spacing, line, upon - len(inside))
        return Cloud(points, spacing.at(points), surfaces, mirror.extended(len(points), upon))

    content = boundary, start, chords, spacing.far, spacing.table(), seed, limit, list(surfaces)
    return memo.value("cloud", content, made)


def _bounded(
    outline: Outline, spacing: Spacing, places: Sequence[FloatArray], line: SymmetryLine | None = None
) -> tuple[FloatArray, dict[str, Surface], IntArray]:
    """Boundary nodes (b, 2), surfaces and edges (b, 2), numbered loop by loop, with nodes at ``places``, arc
    lengths on every curve, and where the middle of a curve lies on the symmetry ``line``."""
    curves = list(zip(outline.names, outline.curves, places, strict=True))
    points, surfaces, first = list[FloatArray](), dict[str, Surface](), 0
    for loop in outline.loops:
        steps = [spacing.steps_along(curve, line, at.tolist()) for _, curve, at in curves[loop]]
        total, passed = sum(len(s) - 1 for s in steps), 0
        for (name, curve, _), s in zip(curves[loop], steps, strict=True):
            points.append(curve.points(s[:-1]))
            s = s[:-1] if curve.closed else s
            index = first + (passed + np.arange(len(s), dtype=np.int64)) % total
            surfaces[name] = Surface(name, curve, index, s, curve.normals(s))
            passed += len(points[-1])
        first += total
    return np.concatenate(points), surfaces, edges_of(surfaces.values())


def fill_region(
    boundary: FloatArray, edges: FloatArray, spacing: Spacing, seed: int, limit: int
) -> FloatArray:
    """Nodes (n, 2) inside the closed boundary of chords ``edges`` (e, 4): the boundary nodes (b, 2) first,
    then the interior ones. The result depends on ``seed``, not on the timing of slices. Raises RunError if
    there would be ``limit`` nodes or more."""
    far, zones, strips = spacing.far, spacing.table(), _strips(edges)
    count = len(boundary)
    room = 2 * count + 1024
    points, h = np.empty((room, 2)), np.empty(room)
    points[:count], h[:count] = boundary, spacing_at(far, zones, boundary)
    following = np.full(room, EMPTY, np.int64)
    keys, heads = np.full((2, 8192), EMPTY, np.int64)
    state = (seed * 2 + 1) * WEYL % MODULUS
    progress = np.array([count, 0, 0, 0, state - MODULUS if 2 * state >= MODULUS else state], np.int64)
    parents, stopped = FIRST_PARENTS, None
    while stopped != DONE:
        begun = time.monotonic()
        stopped = advance_front(
            *(points, h, following, keys, heads, progress, edges, *strips),
            *(far, zones, CANDIDATES, limit, parents),
        )
        if stopped == FULL_POINTS:
            points, h = np.concatenate([points, np.empty_like(points)]), np.append(h, np.empty_like(h))
            following = np.append(following, np.full(len(following), EMPTY, np.int64))
        elif stopped == FULL_TABLE:
            # Hash table too full for fast probing: continue with a larger one; all nodes are re-entered.
            keys, heads = np.full((2, 8 * int(progress[3] + progress[0] - progress[2])), EMPTY, np.int64)
            progress[2] = progress[3] = 0
        else:
            spent = time.monotonic() - begun
            wanted = parents * SLICE_SECONDS / max(spent, 1e-3 * SLICE_SECONDS)
            parents = int(np.clip(wanted, parents / 8, 2 * parents)) + 1
    if progress[0] >= limit:
        raise RunError(f"more than {limit} nodes in one body", "use larger spacings or smaller refinements")
    return points[: progress[0]].copy()


def _strips(edges: FloatArray) -> tuple[IntArray, IntArray, float, float]:
    """Edges (e, 4) sorted into horizontal strips: (start, edge numbers, lowest y, strip height)."""
    low, high = np.minimum(edges[:, 1], edges[:, 3]), np.maximum(edges[:, 1], edges[:, 3])
    bottom = float(low.min())
    height = float(high.max() - bottom) / STRIPS * (1.0 + 1e-12)
    first, last = (np.clip(((y - bottom) / height).astype(np.int64), 0, STRIPS - 1) for y in (low, high))
    count = np.where(low == high, 0, last - first + 1)
    number = np.repeat(np.arange(len(edges)), count)
    strip = np.repeat(first, count) + np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    order = np.argsort(strip, kind="stable")
    start = np.searchsorted(strip[order], np.arange(STRIPS + 1))
    return start.astype(np.int64), number[order].astype(np.int64), bottom, height


def relax(
    points: FloatArray, fixed: int, spacing: Spacing, line: SymmetryLine | None = None, upon: int = 0
) -> FloatArray:
    """Move all but the first ``fixed`` nodes of ``points`` (n, 2) a little. A neighbour at distance d repels
    with (h/d)^4, h the mean spacing of both: with the spacing of the node alone, nodes would leave refined
    surfaces. With a symmetry ``line``, ``upon`` nodes on it follow the ``fixed`` ones, then nodes on one
    side; the images of the latter are appended to the result."""
    end = len(points)
    on, adjacent, moving = slice(fixed, fixed + upon), slice(fixed + upon, end), slice(fixed, end)
    points = points.copy()
    if line is not None:
        points = np.concatenate([points, line.reflect(points[adjacent])])
    count = min(NEIGHBORS, len(points) - 1)
    if end == fixed or count < 1:
        return points
    h = spacing.at(points)
    for sweep in range(SWEEPS):
        if sweep % SEARCH_INTERVAL == 0:
            _, found = nearest(cKDTree(points), points[moving], np.arange(2, count + 2))
            neighbour = np.ascontiguousarray(found.T)
        h[moving] = own = spacing.at(points[moving])
        if line is not None:
            h[end:] = h[adjacent]
        # Separate coordinates with the neighbours along the first axis: numpy is slow on axes of length 2.
        x, y = np.ascontiguousarray(points.T)
        across, along = x[moving] - x[neighbour], y[moving] - y[neighbour]
        distance = np.sqrt(across**2 + along**2)
        push = 0.5 * (own + h[neighbour]) / distance
        for _ in range(DOUBLINGS):
            push *= push
        push /= distance
        force = np.stack([(push * across).sum(axis=0), (push * along).sum(axis=0)], axis=1)
        size = np.sqrt((force**2).sum(axis=1))
        length = np.minimum(STEP * size / (1.0 + 0.25 * size), MAX_STEP)
        points[moving] += (own * length)[:, None] * force / np.maximum(size, np.finfo(float).tiny)[:, None]
        if line is not None:
            points[on, line.axis] = line.at
            points[end:] = line.reflect(points[adjacent])
    return points


def with_line_nodes(
    line: SymmetryLine, boundary: FloatArray, cuts: FloatArray, inner: FloatArray, spacing: Spacing
) -> tuple[FloatArray, int]:
    """Interior nodes ``inner`` (n, 2) of the half of a body with ``boundary`` nodes (b, 2), with holes along
    the ``cuts`` (k, 2, 2) filled, those on the ``line`` first, and the number of the latter."""
    inner = inner.copy()
    upon = np.abs(inner[:, line.axis] - line.at) < SNAP_DISTANCE * spacing.at(inner)
    inner[upon, line.axis] = line.at
    tree = cKDTree(np.concatenate([boundary, inner]))
    added = np.zeros((0, 2))
    for (a, b), (c, d) in cuts.tolist():
        segment = Segment((a, b), (c, d))
        steps = spacing.steps_along(segment)
        fine = np.interp(np.arange(0.0, len(steps) - 1.0, HOLE_STEP), np.arange(len(steps)), steps)
        places = segment.points(fine)
        sizes, last = spacing.at(places), -np.inf
        for k in np.flatnonzero(nearest(tree, places)[0] > HOLE_RADIUS * sizes):
            if fine[k] - last >= sizes[k]:
                last, added = fine[k], np.append(added, places[[k]], axis=0)
    return np.concatenate([inner[upon], added, inner[~upon]]), int(upon.sum()) + len(added)


def halved(
    line: SymmetryLine, boundary: FloatArray, edges: IntArray, spacing: Spacing
) -> tuple[Mirror, FloatArray, FloatArray] | None:
    """Symmetry of ``boundary`` nodes (b, 2) joined by ``edges`` (e, 2), chords (c, 4) of the closed outline
    of the half on the positive side, and its cuts (k, 2, 2) along the ``line``, the last of the chords. None
    if the nodes are not mirror-symmetric, or if the line runs along the boundary."""
    mirror = line.mirror(boundary, spacing.at(boundary), edges)
    if mirror is None:
        return None
    ends = mirror.side[edges]
    crossing = ends.prod(axis=1) < 0
    if not np.array_equal(mirror.image[edges[crossing, 0]], edges[crossing, 1]):
        return None
    points = boundary[edges]
    middle = points.mean(axis=1)
    middle[:, line.axis] = line.at
    adjacent = (ends.sum(axis=1) > 0) | crossing
    chords = np.where(ends[:, :, None] < 0, middle[:, None], points)[adjacent]
    along = 1 - line.axis
    crossed = np.sort(np.concatenate([boundary[mirror.side == 0, along], middle[crossing, along]]))
    if len(crossed) % 2:
        return None
    cuts = np.full((len(crossed) // 2, 2, 2), line.at)
    cuts[:, :, along] = crossed.reshape(-1, 2)
    return mirror, np.concatenate([chords, cuts]).reshape(-1, 4), cuts
