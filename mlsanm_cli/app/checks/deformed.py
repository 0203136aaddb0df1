"""Deformed outlines of bodies, and the errors of their positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
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
BLOCK_SIZE = 2**18
"""Pairs of a point and an edge that are processed together."""


@dataclass(frozen=True)
class DeformedOutline:
    """Deformed outline of a body: ``points`` (n, 2), their displacements ``moved`` (n, 2) and initial
    positions ``drawn`` (n, 2), outward normals (n, 2), the numbers ``surface`` (n,) of their surfaces, and
    the position errors ``slack`` (n,) between nodes. ``chords`` (c, 2) are pairs of adjacent points,
    ``names`` (s) and ``ends`` (s, 2) the names and the first and last points of the surfaces."""

    points: FloatArray
    moved: FloatArray
    drawn: FloatArray
    normal: FloatArray
    surface: IntArray
    slack: FloatArray
    chords: IntArray
    names: tuple[str, ...]
    ends: IntArray

    @property
    def edges(self) -> FloatArray:
        """Ends (c, 4) of the chords."""
        return np.hstack([self.points[self.chords[:, 0]], self.points[self.chords[:, 1]]])

    @property
    def size(self) -> float:
        """Longer side of the initial bounding box."""
        return float(np.ptp(self.drawn, axis=0).max())

    @property
    def tolerance(self) -> float:
        """Error of the positions due to the small-displacement theory and the discretisation."""
        apart = float(np.hypot(*np.ptp(self.moved, axis=0)))
        return (
            SECOND_ORDER_FACTOR * apart**2 / self.size
            + DISPLACEMENT_ERROR * apart
            + COARSE_ROUND_OFF * self.size
        )


def outline_of(cloud: Cloud, displacement: FloatArray) -> DeformedOutline:
    """Deformed outline of a body with the nodal ``displacement`` (n, 2)."""
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
        unknown = _between(s, u)
        slack.append(np.append(np.maximum(unknown[:-1], unknown[1:])[first], unknown[-1]))
        surface.append(np.full(len(fine), number))
        own = count + np.arange(len(fine))
        chords.append(np.stack([own[:-1], own[1:]], axis=1))
        ends.append(own[[0, -1]])
        count += len(fine)
    places, shifts = np.concatenate(drawn), np.concatenate(moved)
    return DeformedOutline(
        places + shifts,
        shifts,
        places,
        np.concatenate(normal),
        np.concatenate(surface),
        np.concatenate(slack),
        np.concatenate(chords),
        tuple(cloud.surfaces),
        np.array(ends),
    )


def _between(s: FloatArray, u: FloatArray) -> FloatArray:
    """Estimated error of linear interpolation of displacements ``u`` (b, 2) at arc lengths ``s`` (b,)."""
    off = np.zeros(len(s))
    if len(s) > 2:
        share = (s[1:-1] - s[:-2]) / (s[2:] - s[:-2])
        off[1:-1] = np.hypot(*(u[1:-1] - (1.0 - share[:, None]) * u[:-2] - share[:, None] * u[2:]).T)
        off[0], off[-1] = off[1], off[-2]
    return 0.15 * off


def distances(points: FloatArray, edges: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distance (e,) of ``points`` (e, 2) from the nearest of ``edges`` (c, 4), and its number (e,)."""
    start, way = edges[:, :2], edges[:, 2:] - edges[:, :2]
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    distance, nearest = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    step = max(1, BLOCK_SIZE // len(edges))
    for first in range(0, len(points), step):
        away = points[first : first + step, None] - start
        share = np.clip((away * way).sum(axis=2) / square, 0.0, 1.0)
        squares = ((away - share[:, :, None] * way) ** 2).sum(axis=2)
        nearest[first : first + step] = squares.argmin(axis=1)
        distance[first : first + step] = np.sqrt(squares.min(axis=1))
    return distance, nearest
