"""From the ordered boundary nodes of a body to its outline, with corners kept sharp. The outline is split at
corners and where names change. Between two corners one spline interpolates all nodes, so that a change of
name causes no kink; collinear stretches become straight lines."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve, Outline, Segment
from mlsanm_cli.cloud.membership import cross, numbered, signed_area, turns
from mlsanm_cli.cloud.splines import NodeSpline, Spline
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.errors import GeometryError
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

MIN_COSINE = 0.9
"""Least cosine between a given normal and the outline's own."""


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
