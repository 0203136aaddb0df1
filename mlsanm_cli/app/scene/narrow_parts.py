"""Finer nodes in narrow parts of a body, between holes and edges and at necks, and at corners that touch
rigid obstacles, where pressures change within short lengths.

With the coarse spacing a plate with two holes a quarter of their diameter apart had three spacings in
between, therefore degree 2, and stresses 4 to 7 % low at the holes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.scene.default_spacing import GROWTH, TOUCHING, joints
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.curves import Curve, Outline
from mlsanm_cli.cloud.joined import part_of
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.contact.geometry.obstacles import Shape
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

SAMPLES_PER_SPACING, MIN_SAMPLES = 2.0, 8
"""Samples of the outline per coarse spacing, and of every curve at least."""
OPPOSITE_COSINE = 0.9
"""Faces are opposite if the cosine of the angle between their normals is below minus this."""
LEVELS, LEVEL_RATIO = 12, 2.0**-0.25
"""Number and ratio of the spacings, down to an eighth."""


def narrow_zones(outline: Outline, far: float, across: float, growth: float) -> Iterator[Zone]:
    """Zones with ``across`` spacings between opposite faces, if the spacing ``far`` is coarser. Faces that
    meet in a corner are excluded: wedges would have arbitrarily fine nodes."""
    owner, arc, step, points, normals = _samples(outline, far)
    width = np.full(len(owner), np.inf)
    pairs = cKDTree(points).query_pairs(across * far, output_type="ndarray")
    one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    kept = (normals[one] * normals[other]).sum(axis=1) < -OPPOSITE_COSINE
    kept &= ~_adjacent(outline)[owner[one], owner[other]]
    one, other = one[kept], other[kept]
    away = points[one] - points[other]
    depth = (away * normals[one]).sum(axis=1)
    aside = np.sqrt(np.maximum((away**2).sum(axis=1) - depth**2, 0.0))
    # The opposite point may lie between samples.
    aside = np.maximum(aside - step[other], 0.0)
    inside = depth > 0.0
    np.minimum.at(width, one[inside], depth[inside] + aside[inside] ** 2 / depth[inside])
    level = np.ceil(np.log(np.minimum(width / (across * far), 1.0)) / np.log(LEVEL_RATIO) - COARSE_ROUND_OFF)
    level = np.clip(level, 0, LEVELS)
    for number, curve in enumerate(outline.curves):
        own = np.flatnonzero(owner == number)
        cuts = np.flatnonzero(np.diff(level[own])) + 1
        half = 0.5 * curve.length / len(own)
        for first, last in pairwise([0, *cuts.tolist(), len(own)]):
            steps = float(level[own[first]])
            if steps:
                ends = float(arc[own[first]]) - half, float(arc[own[last - 1]]) + half
                whole = last - first == len(own)
                fine = far * LEVEL_RATIO**steps
                piece = curve if whole else part_of(curve, *ends)
                yield Zone(piece, fine, 0.5 * across * fine, growth)


def _samples(outline: Outline, far: float) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Curve number (m,), arc length (m,), sample distance (m,), points and normals (m, 2) of samples."""
    parts: list[tuple[Any, ...]] = []
    for number, curve in enumerate(outline.curves):
        count = 4 * max(MIN_SAMPLES // 4, int(np.ceil(0.25 * SAMPLES_PER_SPACING * curve.length / far)))
        size = curve.length / count
        s: FloatArray = size * (0.5 + np.arange(count, dtype=np.float64))
        parts.append((np.full(count, number), s, np.full(count, size), curve.points(s), curve.normals(s)))
    owner, arc, step, points, normals = (np.concatenate(column) for column in zip(*parts, strict=True))
    return owner, arc, step, points, normals


def _adjacent(outline: Outline) -> BoolArray:
    """Which pairs (c, c) of curves are adjacent."""
    result = np.zeros((len(outline.curves),) * 2, dtype=bool)
    for loop in outline.loops:
        numbers = np.arange(len(outline.curves))[loop]
        if len(numbers) > 1:
            following = np.roll(numbers, -1)
            result[numbers, following] = result[following, numbers] = True
    return result


AT_SHARP = 16.0
"""Spacings far away over those at such corners. Smooth fits leave a trace of strain at the tip, which
pressures answer to within three spacings. A jaw with a foot of 78 degrees felt 3.6 instead of 1.3 beside its
corner on a plane, without, and its pressures were 3 % off (L2); one of 60 degrees felt 3.2 and lifts off."""
RIGHT = 0.05
"""Corners within this angle (radian) of a right one bear pressures that even out."""


def sharp_ends(rest: Sequence[Curve], own: Curve, obstacle: Shape, far: float) -> Iterator[Zone]:
    """Zones at the ends of a surface ``own`` that touch a rigid ``obstacle`` as drawn, if it makes a corner
    other than a right one with a piece of the ``rest`` of its outline there. Where bodies touch each other
    both would need them: a dovetail had twice the nodes and was no better."""
    if own.closed:
        return
    for at, _, cosine in joints(own, rest):
        point = own.points(at)
        gap = np.hypot(*(point - obstacle.closest(point, own.normals(at))[0])[0])
        if gap <= TOUCHING * far and RIGHT < abs(np.arccos(cosine) - 0.5 * np.pi) < 0.5 * np.pi - RIGHT:
            x, y = point[0].tolist()
            yield Zone.around((x, y), far / AT_SHARP, 0.0, GROWTH)
