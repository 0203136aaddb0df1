"""Boundary loops from tagged nodes; those of one tag are listed in order along it, in either direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.loops import MIN_COSINE, Loop
from mlsanm_cli.cloud.membership import coincident, cross, inside_polygon, signed_area, turns
from mlsanm_cli.errors import GeometryError
from mlsanm_cli.records import dataclass

GAP_RATIO = 4.0
"""A step this many times longer than adjacent ones is a gap in the boundary."""
BACKWARD_ANGLE = np.radians(150.0)
"""A boundary that turns by more than this runs backwards."""


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
