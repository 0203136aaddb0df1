"""Node spacing field h(x): a far value, and zones around points or curves where it is smaller; zones that
approximate a wanted field, and the number of nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.curves import Curve, Outline, Segment
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.search import BATCH_SIZE, in_batches
from mlsanm_cli.errors import RunError
from mlsanm_cli.kernels.fill import spacing_at
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

MAX_STEPS = 2_000_000
"""Largest number of nodes along one curve; with more, the interior nodes would not fit in memory."""

GROWTH = 0.15
"""Increase of automatic spacings per unit length: with faster growth the wide, flat stencils hardly resist
displacements that alternate from node to node."""
MIN_DISTANCE = 0.5
"""Least distance of wanted nodes from ends and from each other, in spacings."""


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
        table = self.table()
        piece = BATCH_SIZE * 8 // (len(table) + 1) + 1
        return in_batches(lambda some: spacing_at(self.far, table, some), np.ascontiguousarray(points), piece)

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
        other. Raises RunError for more than MAX_STEPS nodes.
        """
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


NODES_PER_SQUARE = 0.89
"""Nodes per area h^2 of an advancing-front cloud, fitted to 16 uniform and graded clouds."""
MAX_CELLS = 500_000
NODES_PER_STEP = 0.44
"""Extra nodes per boundary node, from the same fit: half of a boundary node's area lies outside."""


def estimate_nodes(outline: Outline, spacing: Spacing, limit: float = 1e9) -> float:
    """Estimated number of nodes, at most ``limit``. From the integrals of 1/h^2 over the region, by quadtree,
    and of 1/h along its outline."""
    chains = [curve.points(np.linspace(0.0, curve.length, 65)) for curve in outline.curves]
    edges = np.concatenate([np.hstack([chain[:-1], chain[1:]]) for chain in chains])
    low, high = edges[:, :2].min(axis=0), edges[:, :2].max(axis=0)
    size = float((high - low).max())
    cells = low[None, :] + 0.5 * size
    total = 0.0
    while len(cells):
        h = spacing.at(cells)
        # Fine enough when a cell holds few nodes: the spacing is then nearly uniform in it.
        fine = size <= 4.0 * h
        inside = inside_polygon(edges, cells[fine])
        total += NODES_PER_SQUARE * float((size**2 / h[fine] ** 2)[inside].sum())
        if total > limit:
            return limit
        if len(cells) > MAX_CELLS:
            # With at least 16 nodes in each of so many cells, the rest need not be refined.
            coarse = inside_polygon(edges, cells[~fine])
            total += NODES_PER_SQUARE * float((size**2 / h[~fine] ** 2)[coarse].sum())
            break
        quarter = 0.25 * size
        corners = quarter * np.array([(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
        cells = (cells[~fine][:, None, :] + corners).reshape(-1, 2)
        outside = ((cells < low - quarter) | (cells > high + quarter)).any(axis=1)
        cells = cells[~outside]
        size *= 0.5
    try:
        steps = sum(len(spacing.steps_along(curve)) - 1 for curve in outline.curves)
    except RunError:
        return limit
    return min(total + NODES_PER_STEP * steps, limit)


LIMIT = 24
SPACING_TOLERANCE = 1.25
"""Accepted ratio of actual to wanted spacing."""
SNAP_DISTANCE = 0.5
"""Zone centres closer to the symmetry line than this fraction of the wanted spacing are moved onto it."""


def cover(
    points: FloatArray,
    spacing: FloatArray,
    wanted: FloatArray,
    planned: Spacing,
    growth: float,
    line: SymmetryLine | None = None,
) -> tuple[Zone, ...]:
    """Circular refinement zones for nodes ``points`` (n, 2) of ``spacing`` (n,) that want ``wanted`` (n,).

    At most LIMIT zones, twice as many with a symmetry ``line``. Greedy: the node with the largest ratio of
    actual to wanted spacing becomes the centre of a zone, whose radius grows as long as most of the area
    inside wants that spacing; infinity wants nothing. ``planned`` is the spacing without these zones. With a
    ``line`` the zones are symmetric if ``planned`` and ``wanted`` are.
    """
    has, area, zones = planned.at(points), spacing**2, list[Zone]()
    for _ in range(LIMIT):
        ratio = has / wanted
        worst = int(np.argmax(ratio))
        if ratio[worst] <= SPACING_TOLERANCE:
            break
        h = float(wanted[worst])
        middle = points[worst]
        if line is not None and abs(middle[line.axis] - line.at) < SNAP_DISTANCE * h:
            middle = np.where(np.arange(2) == line.axis, line.at, middle)
        distance = np.hypot(*(points - middle).T)
        near = np.argsort(distance)
        fine = area[near] * (wanted[near] <= SPACING_TOLERANCE * h)
        mostly = np.cumsum(fine) >= 0.7 * np.cumsum(area[near])
        # The largest circle such that this spacing is needed in most of it and of all smaller ones.
        last = int(np.argmin(mostly)) - 1 if not mostly.all() else len(near) - 1
        radius = max(float(distance[near[max(last, 0)]]), h)
        places = [middle] if line is None else np.unique([middle, *line.reflect(middle[None])], axis=0)
        added = tuple(Zone.around(place, h, radius, growth) for place in places)
        zones += added
        has = np.minimum(has, Spacing(planned.far, added).at(points))
    return tuple(zones)
