"""From tagged nodes to the loops of a boundary, and from the ordered nodes of these to the outline of a body,
with corners kept sharp. The outline is split at corners and where names change. Between two corners one
spline interpolates all nodes, so that a change of name causes no kink; collinear stretches become straight
lines."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve, Outline, Segment
from mlsanm_cli.cloud.membership import coincident, cross, inside_polygon, numbered, signed_area, turns
from mlsanm_cli.cloud.splines import NodeSpline, Spline
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.errors import GeometryError
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

MIN_COSINE = 0.9
"""Least cosine between a given normal and the outline's own."""
GAP_RATIO = 4.0
"""A step this many times longer than adjacent ones is a gap in the boundary."""
BACKWARD_ANGLE = np.radians(150.0)
"""A boundary that turns by more than this runs backwards."""


@dataclass(frozen=True)
class Loop:
    """Boundary nodes ``nodes`` (k,) in order, the material on the left; ``names[j]`` is the name of the edge
    from node j to the next, "" for none."""

    nodes: IntArray
    names: tuple[str, ...]


def trace(points: FloatArray, loops: Sequence[Loop], corner: float) -> Outline:
    """The outline through the loops' nodes, with corners where it turns by more than ``corner`` (radians).
    The outer loop comes first; each loop begins at its lowest corner, or else change of name, or else node.
    Names of several curves are numbered along the outline, unnamed curves are edge1, edge2 and so on. Raises
    GeometryError if two curves still share a name."""
    small = ROUND_OFF * float(np.ptp(points, axis=0).max())
    loops = sorted(loops, key=lambda loop: bool(signed_area(points[loop.nodes]) <= 0.0))
    cut = [list(_pieces(points, loop, corner, small)) for loop in loops]
    names, curves, nodes = zip(*(piece for loop in cut for piece in loop), strict=True)
    starts = np.cumsum([0, *map(len, cut)])[:-1].tolist()
    named = numbered(names, "{}{}", "edge")
    for name, times in Counter(named).items():
        if times > 1:
            raise GeometryError(f'two boundaries would be called "{name}"', "rename that group in the file")
    return Outline(named, curves, tuple(starts), nodes)


def cloud_of_nodes(points: FloatArray, outline: Outline, normals: FloatArray | None = None) -> Cloud:
    """The cloud of given nodes and their outline; its spacing is the mean neighbour distance. Given
    ``normals`` (n, 2) replace those of the curves where they agree within 25 degrees: a corner node has one
    normal in a file and two here."""
    surfaces = {}
    for name, curve, nodes in zip(outline.names, outline.curves, outline.nodes, strict=True):
        if isinstance(curve, Spline):
            arc = curve.node_arcs[: len(nodes)]
        else:
            arc = curve.closest(points[nodes])
            arc[-1] = curve.length
        normal = curve.normals(arc)
        if normals is not None:
            given = normals[nodes]
            normal = np.where((given * normal).sum(axis=1, keepdims=True) > MIN_COSINE, given, normal)
        surfaces[name] = Surface(name, curve, nodes, arc, normal)
    # Median edge length at every node, averaged over its neighbours; 0 at nodes of no triangle.
    triangles = Cloud(points, np.ones(len(points)), surfaces).triangles
    ends = np.concatenate([triangles[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    length = np.tile(np.hypot(*(points[ends[:, 0]] - points[ends[:, 1]]).T), 2)
    node, other = ends.T.ravel(), ends[:, ::-1].T.ravel()
    order = np.lexsort((length, node))
    count = np.bincount(node, minlength=len(points))
    first = np.cumsum(count) - count
    length = np.append(length[order], 0.0)
    low, high = first + (count - 1) // 2, first + count // 2
    spacing = 0.5 * (length[np.minimum(low, len(length) - 1)] + length[np.minimum(high, len(length) - 1)])
    spacing[count == 0] = 0.0
    # Averaged, as mesh sizes vary more from node to node than a spacing field does.
    spacing = (spacing + np.bincount(node, spacing[other], len(points))) / (count + 1)
    return Cloud(points, spacing, surfaces)


def _pieces(
    points: FloatArray, loop: Loop, corner: float, small: float
) -> Iterator[tuple[str, Curve, IntArray]]:
    """Name, curve and nodes of the pieces of one loop, in order; nodes within ``small`` of a line lie on
    it."""
    sharp = np.abs(turns(points[loop.nodes])) > corner
    pairs = zip((loop.names[-1], *loop.names), loop.names, strict=False)
    renamed = np.array([name != before for before, name in pairs])
    choice = next((mask for mask in (sharp, renamed) if mask.any()), np.ones(len(sharp), dtype=bool))
    candidates = np.flatnonzero(choice)
    x, y = points[loop.nodes[candidates]].T
    first, count = int(candidates[np.lexsort((x, y))[0]]), len(sharp)
    sharp, renamed = np.roll(sharp, -first), np.roll(renamed, -first)
    nodes, names = np.roll(loop.nodes, -first), (*loop.names[first:], *loop.names[:first])
    corners, ends = np.flatnonzero(sharp), np.flatnonzero(sharp | renamed)
    around = np.append(nodes, nodes[0])
    if not len(ends):
        yield names[0], NodeSpline(points[around], True).between(0, count), nodes
        return
    if len(ends) == 1:
        # A curve that ends where it begins is split: no surface contains a node twice.
        ends = np.array([0, count // 2])
    chains = np.append(corners, count) if len(corners) else np.array([0, count])
    for first, last in pairwise(chains.tolist()):
        spline = NodeSpline(points[around[first : last + 1]], not len(corners))
        inner = np.concatenate([ends[(ends >= first) & (ends < last)], [last]])
        for start, stop in pairwise(inner.tolist()):
            place = points[around[start : stop + 1]]
            (x0, y0), (x1, y1) = place[[0, -1]].tolist()
            along, length = place[-1] - place[0], math.dist((x0, y0), (x1, y1))
            straight = length > small and (np.abs(cross(place - place[0], along)) <= small * length).all()
            curve: Curve = spline.between(start - first, stop - first)
            if straight and (stop - start > 1 or len(inner) == 2):
                curve = Segment((x0, y0), (x1, y1))
            yield names[start], curve, around[start : stop + 1]


@dataclass(frozen=True)
class TaggedNodes:
    """Nodes ``points`` (n, 2) with ``tags`` (n,), "" inside, ``normals`` (n, 2), nan where not given, and
    ``places`` (n,) in the file for messages."""

    points: FloatArray
    tags: tuple[str, ...]
    normals: FloatArray
    places: tuple[str, ...]

    def at(self, node: int) -> str:
        """The coordinates of a node in words."""
        x, y = self.points[node]
        return f"({x:.6g}, {y:.6g})"


def tagged_loops(nodes: TaggedNodes) -> tuple[Loop, ...]:
    """Closed loops through the tagged nodes, the material on the left. A corner between two tags is the end
    node at which the outline turns more; it belongs to both. Raises GeometryError, naming the place in the
    file, for coincident nodes, an open or unordered boundary, loops side by side, nodes outside, and given
    normals that do not point out of the material."""
    pairs = coincident(nodes.points)
    if len(pairs):
        one, other = np.sort(pairs[np.argmin(pairs.max(axis=1))])
        raise GeometryError(
            f"{nodes.places[other]}: the node {nodes.at(other)} repeats that of {nodes.places[one]}",
            "list a corner once, with either tag",
        )
    loops = _linked(nodes, _chains(nodes))
    area = [signed_area(nodes.points[loop.nodes]) for loop in loops]
    outer = int(np.argmax(np.abs(area)))
    for k, loop in enumerate(loops):
        # The outer loop counter-clockwise, holes clockwise.
        if (area[k] > 0.0) != (k == outer):
            loops[k] = Loop(loop.nodes[::-1], (*loop.names[-2::-1], loop.names[-1]))
    places = [nodes.points[loop.nodes] for loop in loops]
    chords = [np.hstack([place, np.roll(place, -1, axis=0)]) for place in places]
    for k, loop in enumerate(loops):
        others = [chords[j] for j in range(len(loops)) if j != k]
        if k != outer and not inside_polygon(np.concatenate(others), places[k][:1])[0]:
            first = int(loop.nodes.min())
            raise GeometryError(
                f'the loop of "{nodes.tags[first]}" ({nodes.places[first]}) is not a hole in the body',
                "one body per file",
            )
    inner = np.flatnonzero([not tag for tag in nodes.tags])
    outside = inner[~inside_polygon(np.concatenate(chords), nodes.points[inner])]
    if len(outside):
        place = nodes.places[outside[0]]
        raise GeometryError(f"{place}: the node {nodes.at(outside[0])} lies outside the boundary")
    _check_normals(nodes, loops)
    return tuple(loops)


def _check_normals(nodes: TaggedNodes, loops: Sequence[Loop]) -> None:
    for loop in loops:
        place, given = nodes.points[loop.nodes], nodes.normals[loop.nodes]
        before, after = place - np.roll(place, 1, axis=0), np.roll(place, -1, axis=0) - place
        # At a corner the normal of either side, or one between them, is accepted.
        sides = [step / np.hypot(*step.T)[:, None] for step in (before, after, before + after)]
        along = np.max([cross(given, t) for t in sides], axis=0)
        wrong = ~(np.isnan(along) | (along > MIN_COSINE))
        if wrong.any():
            worst = int(np.argmax(wrong))
            node = loop.nodes[worst]
            way = "inward" if along[worst] < 0.0 else "sideways"
            raise GeometryError(
                f"{nodes.places[node]}: the normal at {nodes.at(node)} points {way} "
                f'({int(wrong.sum())} such normals on the loop of "{nodes.tags[node]}")',
                "normals point out of the material; leave nx and ny empty to have them derived",
            )
    inside = np.flatnonzero(~np.isnan(nodes.normals[:, 0]) & np.array([not tag for tag in nodes.tags]))
    if len(inside):
        raise GeometryError(f"{nodes.places[inside[0]]}: a normal at a node without a tag")


def _chains(nodes: TaggedNodes) -> dict[str, IntArray]:
    """The nodes of every tag in file order."""
    tags = np.array(nodes.tags, dtype=object)
    chains = {name: np.flatnonzero(tags == name) for name in dict.fromkeys(nodes.tags) if name}
    if not chains:
        raise GeometryError("no node has a tag: there is no boundary", "the column tag names the boundary")
    for name, chain in chains.items():
        if len(chain) < 2:
            raise GeometryError(f'{nodes.places[chain[0]]}: "{name}" has one node only', "two nodes or more")
        step = np.hypot(*np.diff(nodes.points[chain], axis=0).T)
        adjacent = np.maximum(np.append(0.0, step[:-1]), np.append(step[1:], 0.0))
        leap = (step > GAP_RATIO * adjacent) & (len(step) > 1)
        back = np.append(False, np.abs(turns(nodes.points[chain]))[1:-1] > BACKWARD_ANGLE)
        if (leap | back).any():
            place = int(np.argmax(leap | back))
            one, other = (nodes.places[chain[k]] for k in (place, place + 1))
            raise GeometryError(
                f'the nodes of "{name}" do not form a curve: it {"jumps" if leap[place] else "turns back"} '
                f"from {one} to {other}",
                "list the nodes of a boundary in order along it, and give separate parts separate tags",
            )
    return chains


def _linked(nodes: TaggedNodes, chains: dict[str, IntArray]) -> list[Loop]:
    """Chains joined end to end, closest ends first; the loops run either way round. At a corner between two
    chains the edge goes to the one that does not own it. Raises GeometryError for ends that are too far apart
    to be neighbours."""
    points, ends = nodes.points, [(name, side) for name in chains for side in (0, -1)]
    tips = np.array([chains[name][side] for name, side in ends])
    beside = np.array([chains[name][1 if side == 0 else -2] for name, side in ends])
    steps = np.hypot(*(points[beside] - points[tips]).T)
    distance = np.hypot(*(points[tips][:, None] - points[tips]).T)
    distance[np.diag_indices(len(ends))] = np.inf
    for k, (name, _) in enumerate(ends):
        if len(chains[name]) == 2:
            distance[k, k ^ 1] = np.inf
    partner: dict[int, int] = {}
    for flat in np.argsort(distance, axis=None, kind="stable"):
        one, other = divmod(int(flat), len(ends))
        gap = distance[one, other]
        if not np.isfinite(gap) or one in partner or other in partner:
            continue
        if gap > GAP_RATIO * max(steps[one], steps[other]):
            raise GeometryError(
                f'the boundary is open between "{ends[one][0]}" ({nodes.places[tips[one]]}) and '
                f'"{ends[other][0]}" ({nodes.places[tips[other]]}), {gap:.4g} apart',
                "give all nodes of the boundary a tag",
            )
        partner[one], partner[other] = other, one
    loops, left = [], set(range(len(ends)))
    while left:
        end, along, names = min(left), list[IntArray](), list[str]()
        while end in left:
            left -= {end, end ^ 1}
            name, side = ends[end]
            along.append(chains[name] if side == 0 else chains[name][::-1])
            names.append(name)
            end = partner[end ^ 1]
        ring, edges, at = np.concatenate(along), list[str](), 0
        turn = np.abs(turns(points[ring]))
        for chain, name, following in zip(along, names, [*names[1:], names[0]], strict=True):
            at += len(chain)
            last = following if turn[at - 1] > turn[at % len(ring)] else name
            edges += [name] * (len(chain) - 1) + [last]
        loops.append(Loop(ring, tuple(edges)))
    return loops
