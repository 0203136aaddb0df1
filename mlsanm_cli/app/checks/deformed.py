"""Deformed outlines of bodies with the errors of their positions, and overlaps of two of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import permutations
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

MAX_CHORD_TURN = 0.02
"""Largest turning angle between chords of curves."""
MIN_CHORDS, MAX_CHORDS = 4, 64
"""Chords between two nodes: tips of two bodies may cross between the nodes of straight sides."""
SECOND_ORDER_FACTOR = 0.6
"""Overlaps below this multiple of the square of a body's largest displacement over its size are ignored: the
end of a cantilever approaches its root by that."""
DISPLACEMENT_ERROR = 0.01
"""Displacements below this part of those of a body are discretisation errors."""
SPACING_SHARE = 0.5
"""Part of the spacing to which surfaces are known between nodes at finite strain."""


@dataclass(frozen=True)
class DeformedOutline:
    """Deformed outline of a body: ``points`` (n, 2), ``moved`` from where they are ``drawn``, with outward
    normals, the numbers ``surface`` (n,) of their surfaces and the ``uncertainty`` (n,) of their positions.
    ``chords`` (c, 2) are pairs of adjacent points, ``names`` (s) and ``ends`` (s, 2) those of surfaces."""

    points: FloatArray
    moved: FloatArray
    drawn: FloatArray
    normal: FloatArray
    surface: IntArray
    uncertainty: FloatArray
    chords: IntArray
    names: tuple[str, ...]
    ends: IntArray

    @property
    def edges(self) -> FloatArray:
        """Ends (c, 4) of the chords."""
        return np.hstack([self.points[self.chords[:, 0]], self.points[self.chords[:, 1]]])

    @property
    def size(self) -> float:
        return float(np.ptp(self.drawn, axis=0).max())


def outline_of(cloud: Cloud, displacement: FloatArray, exact: bool = False) -> DeformedOutline:
    """Deformed outline of a body with the nodal ``displacement`` (n, 2), which at small strain has errors of
    second order; ``exact`` ones are known up to a part of the spacing, as surfaces between nodes are."""
    drawn, moved, normal, surface, slack, chords, ends = ([] for _ in range(7))
    count = 0
    for number, one in enumerate(cloud.surfaces.values()):
        s, u, n = one.arc_length, displacement[one.index], one.normal
        if one.curve.closed:
            s, u, n = np.append(s, one.curve.length), np.vstack([u, u[:1]]), np.vstack([n, n[:1]])
        turn = np.arccos(np.clip((n[1:] * n[:-1]).sum(axis=1), -1.0, 1.0))
        pieces = np.clip(np.ceil(turn / MAX_CHORD_TURN), MIN_CHORDS, MAX_CHORDS).astype(np.int64)
        first = np.repeat(np.arange(len(pieces)), pieces)
        start = np.cumsum(pieces) - pieces
        share = (np.arange(pieces.sum()) - start[first]) / pieces[first]
        fine = np.append(s[first] + share * (s[1:] - s[:-1])[first], s[-1])
        drawn.append(one.curve.points(np.minimum(fine, one.curve.length)))
        normal.append(one.curve.normals(np.minimum(fine, one.curve.length)))
        moved.append(np.vstack([u[first] + share[:, None] * np.diff(u, axis=0)[first], u[-1:]]))
        spacing = np.append(cloud.spacing[one.index], cloud.spacing[one.index[:1]])[: len(s)]
        unknown = SPACING_SHARE * spacing
        if not exact:
            # The error of linear interpolation of displacements.
            unknown = np.zeros(len(s))
            if len(s) > 2:
                part = ((s[1:-1] - s[:-2]) / (s[2:] - s[:-2]))[:, None]
                unknown[1:-1] = 0.15 * np.hypot(*(u[1:-1] - (1.0 - part) * u[:-2] - part * u[2:]).T)
                unknown[[0, -1]] = unknown[[1, -2]]
        slack.append(np.append(np.maximum(unknown[:-1], unknown[1:])[first], unknown[-1]))
        surface.append(np.full(len(fine), number))
        own = count + np.arange(len(fine))
        chords.append(np.stack([own[:-1], own[1:]], axis=1))
        ends.append(own[[0, -1]])
        count += len(fine)
    places, shifts, size = np.concatenate(drawn), np.concatenate(moved), np.ptp(cloud.points, axis=0).max()
    apart = 0.0 if exact else float(np.hypot(*np.ptp(shifts, axis=0)))
    whole = SECOND_ORDER_FACTOR * apart**2 / size + DISPLACEMENT_ERROR * apart + COARSE_ROUND_OFF * size
    return DeformedOutline(
        places + shifts,
        shifts,
        places,
        np.concatenate(normal),
        np.concatenate(surface),
        np.concatenate(slack) + whole,
        np.concatenate(chords),
        tuple(cloud.surfaces),
        np.array(ends),
    )


def distances(points: FloatArray, edges: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distance (e,) of ``points`` (e, 2) from the nearest of ``edges`` (c, 4), and its number (e,)."""
    start, way = edges[:, :2], edges[:, 2:] - edges[:, :2]
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    distance, nearest = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    # Not more pairs at once than the memory bears.
    step = max(1, 2**18 // len(edges))
    for first in range(0, len(points), step):
        away = points[first : first + step, None] - start
        share = np.clip((away * way).sum(axis=2) / square, 0.0, 1.0)
        squares = ((away - share[:, :, None] * way) ** 2).sum(axis=2)
        nearest[first : first + step] = squares.argmin(axis=1)
        distance[first : first + step] = np.sqrt(squares.min(axis=1))
    return distance, nearest


class Overlap(NamedTuple):
    """A boundary inside another body or an obstacle, with the largest ``depth`` and its ``place``."""

    depth: float
    place: tuple[float, float]
    boundary: str
    other: str

    @property
    def owners(self) -> set[str]:
        other = self.other if self.other.startswith("the ") else self.other.partition(".")[0]
        return {self.boundary.partition(".")[0], other}


def inside(own: DeformedOutline, there: DeformedOutline) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Points (e,) of an outline inside another body, the points (e,) of that next to them, their depths (e,),
    and the uncertainties (e,) of these."""
    low, high = there.points.min(axis=0), there.points.max(axis=0)
    near = np.flatnonzero(((own.points > low) & (own.points < high)).all(axis=1))
    near = near[inside_polygon(there.edges, own.points[near])] if len(near) else near
    if not len(near):
        return near, near, np.zeros(0), np.zeros(0)
    depth, chord = distances(own.points[near], there.edges)
    facing = there.chords[chord, 0]
    return near, facing, depth, own.uncertainty[near] + there.uncertainty[facing]


def between_bodies(
    outlines: Mapping[str, DeformedOutline],
    given: Mapping[str, float] = MappingProxyType({}),
    spared: Callable[[str, str, IntArray, IntArray], BoolArray] | None = None,
) -> Iterator[Overlap]:
    """Overlaps of every body with every other, deeper than the gaps ``given`` for either, without the points
    ``spared`` of two bodies, next to points of the other one."""
    for one, other in permutations(outlines, 2):
        own, there = outlines[one], outlines[other]
        near, facing, depth, uncertainty = inside(own, there)
        deep = depth > max(given.get(one, 0.0), given.get(other, 0.0)) + uncertainty
        if spared is not None:
            deep &= ~spared(one, other, near, facing)
        others = [f"{other}.{label(there.names[number])}" for number in there.surface[facing[deep]]]
        yield from deepest(own, near[deep], depth[deep], one, others)


def deepest(
    own: DeformedOutline, at: IntArray, depth: FloatArray, body: str, others: Sequence[str]
) -> Iterator[Overlap]:
    """The deepest of the points ``at`` (e,) for each pair of boundaries."""
    boundaries = [f"{body}.{label(own.names[number])}" for number in own.surface[at]]
    pairs_found = set()
    for worst in np.argsort(-depth, kind="stable"):
        pair = boundaries[worst], others[worst]
        if pair not in pairs_found:
            pairs_found.add(pair)
            x, y = own.points[at[worst]].tolist()
            yield Overlap(float(depth[worst]), (x, y), *pair)


def label(name: str) -> str:
    """Name of the boundary of a surface in the case."""
    return name.partition("/")[0]


def overlap_check(
    found: Sequence[Overlap], position: float, hint: Callable[[Overlap, Sequence[Overlap]], str]
) -> Check:
    if not found:
        return Check("overlap", 0.0, "")
    worst = max(found, key=lambda overlap: overlap.depth)
    x, y = worst.place
    message = (
        f"{worst.boundary} lies inside {worst.other} by {worst.depth:.3g} near ({x:.6g}, {y:.6g}) at "
        f"position {position:.6g}, and no contact is defined there"
    )
    return Check("overlap", len(found), message, hint(worst, found))
