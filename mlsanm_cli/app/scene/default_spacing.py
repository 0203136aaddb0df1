"""Automatic spacing of a body by its outline.

Contacts need no fine nodes, as the fields of their pressures are known in closed form; the remainder varies
over the distance from the contact to the nearest other boundary. Bodies that bend need some nodes across
their thickness, arcs and hollows some along them, and corners that point into the material enough between
them that fits know the singular fields of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, turn
from mlsanm_cli.cloud.sight import OPPOSITE_COSINE
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.cloud.tips import SMOOTH_TURN, distances
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

PER_SIZE, PER_THICKNESS = 20.0, 6.0
"""Spacings over the size of a body, and over its mean thickness, twice its area divided by its perimeter."""
PER_RADIUS, PER_CONCAVE_RADIUS = 5.0, 14.0
"""Spacings over the radius of an arc; stresses concentrate around holes and in hollows. Orthotropic bodies
have more along concave arcs, by the ratio of decay lengths."""
GROWTH = 0.15
"""Increase of the spacing per unit length: with faster growth the wide, flat stencils hardly resist
displacements that alternate from node to node."""
PER_ROOT, PER_ROOT_DISTANCE = 20.0, 14.0
"""Spacings along sides between two corners that point into the material, and at such corners over their
distance across the material: fits then know the fields of both corners."""
SINGULAR_RATIO = 4.0
"""The coarse spacing over that where stresses are unbounded: at corners that point into the material, ends of
clamped sides and of bonds. What is lost there, other than at its mirror image by another cloud, bends a body
that should not."""
MIN_SPACING = 2.0**-14
"""Least spacing relative to that far away: with 6e-6 of it factors lose their digits."""
SAMPLES, PER_POINT = 200, 4
"""Samples along a curve, and at least for each of its data points."""
LEVELS, TURN_RATIO, WIDTH_RATIO = 12, 2.0**-0.5, 2.0**-0.25
"""Number of the spacings that are tried, and their ratio on curves and in narrow parts."""
HOLLOW_ANGLE = 0.5
"""Curves that turn to the concave side by more than this angle (radian) within a coarse spacing are
hollows."""
SAMPLES_PER_SPACING = 2
"""Samples of the outline per coarse spacing in the search for narrow parts; of every curve at least
four times as many."""


def zone_at(point: FloatArray, spacing: float, radius: float = 0.0, growth: float = GROWTH) -> Zone:
    """The zone about a ``point`` (2,)."""
    x, y = point.tolist()
    return Zone.around((x, y), spacing, radius, growth)


def banded(curve: Curve, sizes: FloatArray, far: float, depth: float = 0.0) -> Iterator[Zone]:
    """Zones with the spacings ``sizes`` (m,) on m equal parts of a curve, where these are below ``far``, each
    within ``depth`` times its spacing."""
    ends = np.linspace(0.0, curve.length, len(sizes) + 1)
    for first, last in pairwise([0, *(np.flatnonzero(np.diff(sizes)) + 1).tolist(), len(sizes)]):
        size, whole = float(sizes[first]), last - first == len(sizes)
        if size < far:
            piece = curve if whole else curve.part(float(ends[first]), float(ends[last]))
            yield Zone(piece, size, depth * size, GROWTH)


def automatic_spacing(outline: Outline) -> float:
    """The coarsest spacing of a body."""
    return min(_sizes(outline))


def bends(outline: Outline) -> bool:
    """Whether the thickness of a body, and not its size, determines its spacing."""
    along, across = _sizes(outline)
    return across < along


def leans(outline: Outline, clamped: Sequence[Curve], stretch: float) -> bool:
    """Whether a body extends so far from its ``clamped`` sides that their compliance rotates it. The depth of
    fields that decay ``stretch`` times as slowly as in an isotropic body counts accordingly."""
    return stretch * _area(outline) > sum(curve.length for curve in clamped) ** 2 > 0.0


def _sizes(outline: Outline) -> tuple[float, float]:
    """The spacings required by the size and by the thickness of a body."""
    length = sum(curve.length for curve in outline.curves)
    return _extent(outline) / PER_SIZE, 2.0 * _area(outline) / length / PER_THICKNESS


def _area(outline: Outline) -> float:
    """Enclosed area."""
    area = 0.0
    for curve in outline.curves:
        (x, y), (ahead_x, ahead_y) = (points := along(curve))[:-1].T, points[1:].T
        area += 0.5 * float((x * ahead_y - ahead_x * y).sum())
    return area


def _extent(outline: Outline) -> float:
    """The longer side of the smallest bounding box parallel to a straight side, or the largest width of a
    body without one: invariant under rotation."""
    points = [along(curve) for curve in outline.curves]
    straight = [
        ends[-1] - ends[0] for ends, c in zip(points, outline.curves, strict=True) if isinstance(c, Segment)
    ]
    axes = np.array(straight) if straight else np.concatenate([np.diff(chain, axis=0) for chain in points])
    axes = axes[np.hypot(*axes.T) > 0.0]
    axes /= np.hypot(*axes.T)[:, None]
    both = np.stack([axes, axes[:, ::-1] * [-1.0, 1.0]])
    sides = np.ptp(np.einsum("nc,bkc->bkn", np.concatenate(points), both), axis=2).max(axis=0)
    return float(sides.min() if straight else sides.max())


def arc_zones(outline: Outline, far: float, finer: float = 1.0) -> Iterator[Zone]:
    """Zones along arcs of small radius and where curves turn, with a further factor ``finer``, in hollows
    with its square; and at short sides, whose ends are nodes, above all at roots of slits."""
    corners = _inward_corners(outline)
    roots = {before for before, _ in corners.values() if before in corners}
    for number, curve in enumerate(outline.curves):
        if isinstance(curve, Segment):
            parts = PER_ROOT if number in roots else 1.0
            if curve.length < parts * far:
                yield Zone(curve, max(curve.length / parts, MIN_SPACING * far), 0.0, GROWTH)
        elif isinstance(curve, Arc):
            fine = curve.radius / (PER_RADIUS * finer if curve.sweep > 0.0 else PER_CONCAVE_RADIUS * finer**2)
            if fine < far:
                yield Zone(curve, fine, 0.0, GROWTH)
        else:
            yield from _turning_zones(curve, far, finer)


def _turning_zones(curve: Curve, far: float, finer: float) -> Iterator[Zone]:
    """Zones where a curve turns within a spacing by more than an arc with ``PER_RADIUS`` spacings over its
    radius. The turning angle counts, not the curvature: shallow waves, however short, need no fine nodes.
    """
    count = max(SAMPLES, PER_POINT * curve.data_points)
    s = np.linspace(0.0, curve.length, count + 1)
    x, y = curve.normals(s).T
    angle = np.unwrap(np.arctan2(y, x))
    step = curve.length / count
    wanted = np.full(len(s), np.inf)
    whole = _turns(angle, max(round(far / step), 1), curve.closed)
    for level in range(LEVELS):
        size = far * TURN_RATIO**level
        width = round(size / step)
        if width < 1:
            break
        least, most, net = _turns(angle, width, curve.closed)
        hollow = (net < 0.0) & (whole[2] < -HOLLOW_ANGLE)
        allowed = np.where(hollow, 1.0 / (PER_CONCAVE_RADIUS * finer**2), 1.0 / (PER_RADIUS * finer))
        wanted = np.where(np.isinf(wanted) & (most - least <= allowed), size, wanted)
        if np.isfinite(wanted).all():
            break
    wanted = np.where(np.isinf(wanted), far * TURN_RATIO**LEVELS, wanted)
    yield from banded(curve, wanted[:-1], far)


def _turns(angle: FloatArray, width: int, closed: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least and largest direction (n,) within a window of ``width`` steps about each sample with the
    direction ``angle`` (n,), and the turning angle over the window."""
    before, after = width // 2, width - width // 2
    if closed:
        around = angle[-1] - angle[0]
        before, after = min(before, len(angle) - 1), min(after, len(angle) - 1)
        start, end = angle[len(angle) - 1 - before : -1] - around, angle[1 : 1 + after] + around
    else:
        start, end = np.full(before, angle[0]), np.full(after, angle[-1])
    windows = np.lib.stride_tricks.sliding_window_view(
        np.concatenate([start, angle, end]), before + after + 1
    )
    return windows.min(axis=1), windows.max(axis=1), windows[:, -1] - windows[:, 0]


def root_zones(outline: Outline, far: float, touching: Sequence[Curve] | None) -> Iterator[Zone]:
    """Zones at the corners of an outline with the spacing ``far`` that point into the material; ``touching``
    are its sides in contact, None at finite strain.

    Corners of sides in contact have no finer nodes than others across the material require: pressures would
    follow the trace of the singular field into the corner. Nor have those at finite strain.
    """
    corners = _inward_corners(outline)
    if not corners:
        return
    at = np.concatenate([outline.curves[number].points(np.zeros(1)) for number in corners])
    for place, apart in zip(at, _apart(outline, corners, at).tolist(), strict=True):
        fine = apart / PER_ROOT_DISTANCE
        away = [(curve, curve.points(curve.closest(place[None]))[0] - place) for curve in touching or ()]
        if touching is not None and all(
            np.hypot(*way) > COARSE_ROUND_OFF * curve.length for curve, way in away
        ):
            fine = min(fine, far / SINGULAR_RATIO)
        if fine < far:
            yield zone_at(place, fine)


def _inward_corners(outline: Outline) -> dict[int, tuple[int, float]]:
    """The corners that point into the material, by the number of the curve that begins there: that of the
    curve that ends there, and the angle between the two."""
    befores = {number: outline.neighbours(number)[0] for number in range(len(outline.curves))}
    angles = {
        number: turn(outline.curves[before], outline.curves[number]) for number, before in befores.items()
    }
    return {number: (befores[number], angle) for number, angle in angles.items() if angle < -SMOOTH_TURN}


def _apart(outline: Outline, corners: Mapping[int, tuple[int, float]], at: FloatArray) -> FloatArray:
    """Distance (c,) of every corner ``at`` (c, 2) to the nearest other one that is seen across the material,
    infinite without any."""
    into, half = [], []
    for number, (before, angle) in corners.items():
        ending, starting = outline.curves[before], outline.curves[number]
        normal = ending.normals(np.array([ending.length]))[0] + starting.normals(np.zeros(1))[0]
        into.append(-normal / np.hypot(*normal))
        half.append(0.5 * (np.pi - angle))
    away, seen = distances(at, np.array(into), np.array(half))
    return np.asarray(np.where(seen, away, np.inf).min(axis=1))


def narrow_zones(outline: Outline, far: float, across: float) -> Iterator[Zone]:
    """Zones with ``across`` spacings between opposite faces, if the spacing ``far`` is coarser. Faces that
    meet in a corner are excluded: wedges would have arbitrarily fine nodes."""
    owner, step, points, normals = _samples(outline, far)
    width = np.full(len(owner), np.inf)
    pairs = cKDTree(points).query_pairs(across * far, output_type="ndarray")
    near, opposite = np.concatenate([pairs, pairs[:, ::-1]]).T
    kept = (normals[near] * normals[opposite]).sum(axis=1) < -OPPOSITE_COSINE
    kept &= ~_adjacent(outline)[owner[near], owner[opposite]]
    near, opposite = near[kept], opposite[kept]
    away = points[near] - points[opposite]
    depth = (away * normals[near]).sum(axis=1)
    aside = np.sqrt(np.maximum((away**2).sum(axis=1) - depth**2, 0.0))
    # The opposite point may lie between samples.
    aside = np.maximum(aside - step[opposite], 0.0)
    inside = depth > 0.0
    np.minimum.at(width, near[inside], depth[inside] + aside[inside] ** 2 / depth[inside])
    level = np.ceil(np.log(np.minimum(width / (across * far), 1.0)) / np.log(WIDTH_RATIO) - COARSE_ROUND_OFF)
    sizes = far * WIDTH_RATIO ** np.clip(level, 0, LEVELS)
    for number, curve in enumerate(outline.curves):
        yield from banded(curve, sizes[owner == number], far, 0.5 * across)


def _samples(outline: Outline, far: float) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Curve number (m,), sample distance (m,), points and normals (m, 2) of samples."""
    parts: list[tuple[Any, ...]] = []
    for number, curve in enumerate(outline.curves):
        count = 4 * max(SAMPLES_PER_SPACING, int(np.ceil(0.25 * SAMPLES_PER_SPACING * curve.length / far)))
        size = curve.length / count
        s: FloatArray = size * (0.5 + np.arange(count, dtype=np.float64))
        parts.append((np.full(count, number), np.full(count, size), curve.points(s), curve.normals(s)))
    owner, step, points, normals = (np.concatenate(column) for column in zip(*parts, strict=True))
    return owner, step, points, normals


def _adjacent(outline: Outline) -> BoolArray:
    """Which pairs (c, c) of curves are adjacent."""
    result = np.zeros((len(outline.curves),) * 2, dtype=bool)
    for number in range(len(outline.curves)):
        result[number, list(outline.neighbours(number))] = True
    np.fill_diagonal(result, False)
    return result


def along(curve: Curve) -> FloatArray:
    """Points (s, 2) along a curve, both ends included."""
    return curve.points(places_along(curve))


def places_along(curve: Curve) -> FloatArray:
    """Arc lengths (s,) that sample a curve."""
    return np.linspace(0.0, curve.length, max(SAMPLES, PER_POINT * curve.data_points) + 1)
