"""Point-in-polygon test, polygon area, and outlines that cross themselves; point-in-body test from the
boundary nodes alone, as run.h5 stores them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.roundoff import ROUND_OFF

MAX_PAIRS = 2**18
"""Pairs processed at once: large for speed, small for memory."""
SAGITTA_FACTOR = 1.1
"""Factor on the sagitta of an arc through two nodes: allowance for curves that are not arcs."""


def boundary_chords(index: IntArray, names: Sequence[str]) -> IntArray:
    """Pairs (b, 2) of positions in ``index`` (nb,) that are neighbours along the boundary, loop by loop.
    ``index`` holds the nodes surface by surface, ``names`` (nb,) the surface of each."""
    owner = np.array(names)
    chains = [np.flatnonzero(owner == name) for name in dict.fromkeys(names)]
    starts = {int(index[chain[0]]) for chain in chains}
    # A surface that no other one continues is closed.
    whole = [chain if int(index[chain[-1]]) in starts else np.append(chain, chain[:1]) for chain in chains]
    return np.concatenate([np.stack([chain[:-1], chain[1:]], axis=1) for chain in whole])


def joints(index: IntArray, normal: FloatArray, names: Sequence[str]) -> Iterator[tuple[int, int, float]]:
    """Where one surface ends and another begins: positions in the boundary nodes ``index`` (nb,) of the last
    node of one and the first of the other, and the angle (radian) by which the outline turns left. ``normal``
    (nb, 2) are outward; ``names`` as in :func:`boundary_chords`."""
    owner = np.array(names)
    ends = [np.flatnonzero(owner == name)[[0, -1]].tolist() for name in dict.fromkeys(names)]
    for (_, last), (first, _) in product(ends, repeat=2):
        if index[last] == index[first] and last != first:
            (x, y), (u, v) = normal[last], normal[first]
            yield last, first, float(np.arctan2(x * v - y * u, x * u + y * v))


def inside_body(
    points: FloatArray,
    index: IntArray,
    normal: FloatArray,
    names: Sequence[str],
    targets: FloatArray,
    slack: float = ROUND_OFF,
) -> BoolArray:
    """Mask (e,) of ``targets`` (e, 2) in the body of ``points`` (n, 2) or on its boundary, up to a ``slack``
    relative to its size. Boundary nodes ``index`` (nb,) have outward ``normal`` (nb, 2) and ``names`` as in
    :func:`boundary_chords`. A curve may lie outside its chord by the sagitta c tan(phi/4)/2, with c the chord
    length and phi the angle between the normals at its ends."""
    chords = boundary_chords(index, names)
    start, end = points[index[chords[:, 0]]], points[index[chords[:, 1]]]
    along = end - start
    length = np.hypot(along[:, 0], along[:, 1])
    cosine = (normal[chords[:, 0]] * normal[chords[:, 1]]).sum(axis=1)
    bulge = 0.5 * length * np.tan(0.25 * np.arccos(np.clip(cosine, -1.0, 1.0)))
    near = SAGITTA_FACTOR * bulge + slack * float(np.ptp(points, axis=0).max())
    inside = inside_polygon(np.concatenate([start, end], axis=1), targets)
    # Only targets outside the polygon but near a chord can lie between a chord and its curve.
    low, high = start.min(axis=0) - near.max(), start.max(axis=0) + near.max()
    around = ((targets >= low) & (targets <= high)).all(axis=1)
    asked = np.flatnonzero(around & ~inside)
    for some in np.array_split(asked, 1 + len(asked) * len(start) // MAX_PAIRS):
        offset = targets[some, None] - start
        share = np.clip((offset * along).sum(axis=2) / length**2, 0.0, 1.0)
        away = offset - share[:, :, None] * along
        inside[some] = (np.hypot(away[:, :, 0], away[:, :, 1]) <= near).any(axis=1)
    return inside


def inside_polygon(edges: FloatArray, points: FloatArray) -> BoolArray:
    """Mask (n,) of ``points`` (n, 2) inside closed loops of ``edges`` (e, 4), by the even-odd rule."""
    x0, y0, x1, y1 = edges[edges[:, 1] != edges[:, 3]].T
    inside = np.zeros(len(points), dtype=bool)
    step = max(1, MAX_PAIRS // max(1, len(x0)))
    for first in range(0, len(points), step):
        x, y = points[first : first + step].T
        # Few edges cross the level of a point: only for these is the intersection computed.
        point, edge = np.nonzero((y0 > y[:, None]) != (y1 > y[:, None]))
        crossing = x0[edge] + (y[point] - y0[edge]) / (y1[edge] - y0[edge]) * (x1[edge] - x0[edge])
        odd = np.bincount(point[x[point] < crossing], minlength=len(x)) % 2
        inside[first : first + step] = odd == 1
    return inside


def signed_area(points: FloatArray) -> FloatArray:
    """Areas (...) of closed polygons ``points`` (..., k, 2), negative if clockwise."""
    away = points - points[..., :1, :]
    area: FloatArray = 0.5 * cross(away, np.roll(away, -1, axis=-2)).sum(axis=-1)
    return area


def turns(points: FloatArray) -> FloatArray:
    """Angles (..., k) by which closed polygons ``points`` (..., k, 2) turn left at their vertices."""
    after = np.roll(points, -1, axis=-2) - points
    before = np.roll(after, 1, axis=-2)
    return np.asarray(np.arctan2(cross(before, after), (before * after).sum(axis=-1)))


def coincident(points: FloatArray) -> IntArray:
    """Pairs (p, 2) of ``points`` (n, 2) that coincide within round-off."""
    size = float(np.ptp(points, axis=0).max())
    return cKDTree(points).query_pairs(ROUND_OFF * size, output_type="ndarray")


def numbered(names: Sequence[str], shared: str, unnamed: str = "") -> tuple[str, ...]:
    """The ``names`` of all curves of an outline; several of one name, and ``unnamed`` ones, are numbered by
    the pattern ``shared``, as in "{}/{}"."""
    total, passed = Counter(names), Counter[str]()
    found = []
    for name in names:
        passed[name] += 1
        several = total[name] > 1 or not name
        found.append(shared.format(name or unnamed, passed[name]) if several else name)
    return tuple(found)


def first_crossing(chords: FloatArray) -> FloatArray | None:
    """A point (2,) near the crossing of two ``chords`` (e, 4), or None; sharing an end is no crossing."""
    start, end = chords[:, :2], chords[:, 2:]
    reach = float(np.hypot(*(end - start).T).max())
    pairs = cKDTree(0.5 * (start + end)).query_pairs(reach, output_type="ndarray")
    a, b, c, d = start[pairs[:, 0]], end[pairs[:, 0]], start[pairs[:, 1]], end[pairs[:, 1]]
    apart = twice_area(a, b, c) * twice_area(a, b, d) < 0.0
    apart &= twice_area(c, d, a) * twice_area(c, d, b) < 0.0
    return np.asarray(0.25 * (a + b + c + d)[np.argmax(apart)]) if apart.any() else None


def cross(one: FloatArray, other: FloatArray) -> FloatArray:
    """Cross products (...) of vectors (..., 2)."""
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def twice_area(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Twice the areas (...) of triangles with corners (..., 2), negative if clockwise."""
    return cross(b - a, c - a)
