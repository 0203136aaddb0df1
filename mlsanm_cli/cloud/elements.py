"""The boundary of a body given as finite elements, and the checks of such meshes. An element is a ring of
nodes: its corners and mid-side nodes in cyclic order, either way round."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.loops import Loop
from mlsanm_cli.cloud.membership import coincident, signed_area, turns
from mlsanm_cli.errors import GeometryError
from mlsanm_cli.roundoff import ROUND_OFF


def boundary_loops(
    points: FloatArray,
    rings: Sequence[IntArray],
    lines: IntArray,
    names: Sequence[str],
    node_sets: Mapping[str, IntArray],
) -> tuple[Loop, ...]:
    """Boundary loops of the elements ``rings`` (each (e, m)) of nodes ``points`` (n, 2), all in use. Line
    elements ``lines`` (l, 2) name edges by ``names`` (l,), "" for none; a node set names the edges between
    its nodes, unless it contains interior nodes. Raises GeometryError for coincident nodes, degenerate or
    overlapping elements, edges of three elements, separate parts, a boundary that touches itself, and edge
    names that do not fit."""
    pairs = coincident(points)
    if len(pairs):
        raise GeometryError(
            f"{len(pairs)} pairs of nodes coincide, the first at {_at(points, pairs[:1, 0])}",
            "merge duplicate nodes before you write the file",
        )
    turned = [_counter_clockwise(points, ring) for ring in rings]
    edges = np.concatenate(
        [np.stack([ring.ravel(), np.roll(ring, -1, axis=1).ravel()], axis=1) for ring in turned]
    )
    key, back = _key(edges, len(points)), _key(edges[:, ::-1], len(points))
    known, times = np.unique(key, return_counts=True)
    if (times > 1).any():
        edge = divmod(known[int(np.argmax(times > 1))], len(points))
        raise GeometryError(
            f"elements overlap, or an edge belongs to more than two of them, near {_at(points, edge)}"
        )
    _refuse_parts(points, edges)
    boundary = edges[~np.isin(key, back)]
    start, times = np.unique(boundary[:, 0], return_counts=True)
    if (times > 1).any():
        place = _at(points, start[[int(np.argmax(times > 1))]])
        raise GeometryError(f"the boundary touches itself in the node at {place}", "two parts share one node")
    named = _edge_names(points, edges, boundary, lines, names, node_sets)
    following = {a: (b, name) for (a, b), name in zip(boundary.tolist(), named, strict=True)}
    loops = []
    while following:
        node, nodes, along = next(iter(following)), list[int](), list[str]()
        while node in following:
            nodes.append(node)
            node, name = following.pop(node)
            along.append(name)
        loops.append(Loop(np.array(nodes, dtype=np.int64), tuple(along)))
    if sum(signed_area(points[loop.nodes]) > 0.0 for loop in loops) != 1:
        raise GeometryError("the elements overlap: their boundary does not go around them once")
    return tuple(loops)


def _key(edges: IntArray, count: int) -> IntArray:
    return np.asarray(edges[:, 0] * count + edges[:, 1])


def _at(points: FloatArray, nodes: IntArray | Sequence[int]) -> str:
    x, y = points[np.asarray(nodes)].mean(axis=0)
    return f"({x:.6g}, {y:.6g})"


def _counter_clockwise(points: FloatArray, ring: IntArray) -> IntArray:
    """The rings (e, m), all counter-clockwise."""
    corners = points[ring]
    area = signed_area(corners)
    flat = np.abs(area) <= ROUND_OFF * np.ptp(corners, axis=1).max(axis=1) ** 2
    # Curved sides may be slightly concave, but a corner that turns the wrong way is a folded element.
    bends = (turns(corners) * np.sign(area)[:, None]) < 0.0
    flat |= bends[:, :: 1 if ring.shape[1] in (3, 4) else 2].any(axis=1)
    if flat.any():
        place = _at(points, ring[int(np.argmax(flat))])
        raise GeometryError(f"{int(flat.sum())} elements are flat or folded, the first near {place}")
    return np.where((area < 0.0)[:, None], ring[:, ::-1], ring)


def _refuse_parts(points: FloatArray, edges: IntArray) -> None:
    # Imported here: it loads the eigenvalue solvers, and only meshes need it.
    from scipy.sparse.csgraph import connected_components

    count, on_edge = len(points), np.unique(edges)  # nodes in the middle of elements are on no edge
    graph = sparse.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    part = connected_components(graph, directed=False)[1][on_edge]
    labels = np.unique(part)
    if len(labels) > 1:
        places = ", ".join(_at(points, on_edge[part == label]) for label in labels[:3])
        more = " and more" if len(labels) > 3 else ""
        raise GeometryError(
            f"the elements form {len(labels)} separate parts, around {places}{more}",
            "one file per body, or name the group of elements it consists of with group",
        )


def _edge_names(
    points: FloatArray,
    edges: IntArray,
    boundary: IntArray,
    lines: IntArray,
    line_names: Sequence[str],
    node_sets: Mapping[str, IntArray],
) -> tuple[str, ...]:
    """Names (b,) of the boundary edges."""
    inner, outer, keys = (_key(np.sort(one, axis=1), len(points)) for one in (edges, boundary, lines))
    known = np.isin(keys, inner)
    if not known.all():
        lost = lines[int(np.argmin(known))]
        raise GeometryError(f"the line element near {_at(points, lost)} is not an edge of an element")
    place = {key: number for number, key in enumerate(outer.tolist())}
    named = zip(keys.tolist(), line_names, strict=True)
    marks = [(place[key], name) for key, name in named if name and key in place]
    for name, nodes in node_sets.items():
        if np.isin(nodes, boundary).all():
            marks += [(int(edge), name) for edge in np.flatnonzero(np.isin(boundary, nodes).all(axis=1))]
    names = [""] * len(boundary)
    for edge, name in marks:
        if names[edge] not in ("", name):
            raise GeometryError(
                f'the groups "{names[edge]}" and "{name}" share the edge near {_at(points, boundary[edge])}',
                "an edge belongs to one group only",
            )
        names[edge] = name
    return tuple(names)
