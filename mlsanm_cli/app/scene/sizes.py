"""The size function h of a body, the spacing of its nodes, by its outline; `clouds` adds what acts
on it.

Every source k asks for a spacing h_k within r_k of a curve or point c_k, and h is the least of the body's
coarse spacing and of what sources ask for (table in docs/method.md):

    h(x) = min(far, min_k (h_k + 0.15 max(|x - c_k| - r_k, 0))).

Sides on planes of symmetry ask for nothing, but for contacts beside them, and lengths are those of the whole
body: a half has half of the nodes of the whole. Contacts need no fine nodes, as the fields of their pressures
are known in closed form. Fields of bodies whose stiffness depends on the direction decay at different rates
along its axes: their spacings are smaller by the geometric mean of these.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.scene.boundaries import Boundaries, prescribes
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.case import Body
from mlsanm_cli.case.model.conditions import Support
from mlsanm_cli.cloud.cloud import OPPOSITE_COSINE
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, turn
from mlsanm_cli.cloud.sight import SMOOTH_TURN
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

PER_SIZE, PER_THICKNESS = 20.0, 6.0
"""Spacings over the size of a body, and over its thickness: the mean one is twice its area divided by its
perimeter."""
PER_RADIUS, PER_CONCAVE_RADIUS = 5.0, 14.0
"""Spacings over the radius of an arc; stresses concentrate around holes and in hollows."""
PER_ROOT = 20.0
"""Spacings along sides between two corners that point into the material: fits then know the fields of
both."""
SINGULAR_RATIO = 4.0
"""The coarse spacing over that where stresses are unbounded: at corners that point into the material, ends of
clamped sides and of bonds. What is lost there bends a body that should not."""
FLOW_RATIO = 2.0
"""Automatic spacing of elastic bodies, of fits of degree 4, over that of bodies that flow, of degree 2."""
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


class Domain:
    """A ``body`` whose spacing is asked for: its ``conditions`` and ``outline`` without cuts; the ``planes``
    of symmetry on it, axis and coordinate by the number of the curve on them, and the other, ``free`` curves;
    the whole of all ``copies``, with its ``area``, mean ``thickness`` and ``size``, the longer side of the
    smallest bounding box parallel to a straight side, or the largest width without one, both invariant under
    rotation; the coarse spacing ``far``, and whether the thickness determines it (``bends``). Spacings are
    ``finer`` than those of an isotropic elastic body by the geometric mean of the rates at which fields decay
    along the axes, and in bodies that flow."""

    def __init__(self, boundaries: Boundaries, body: Body) -> None:
        self.boundaries, self.body, self.case = boundaries, body, boundaries.case
        self.outline, name = boundaries.drawn[body.name], body.name
        self.conditions = [(one, place) for _, one, place in boundaries.conditions if place.body == name]
        self.material = materials(self.case)[body.material]
        self.finer = math.sqrt(self.material.stretch) * (FLOW_RATIO if self.material.flows else 1.0)
        chains = [along(curve) for curve in self.outline.curves]
        self.planes = {} if self.case.model.revolved else self._planes(np.concatenate(chains))
        self.free = [curve for k, curve in enumerate(self.outline.curves) if k not in self.planes]
        self.copies = int(2 ** len(self.planes))
        self.area = 0.0
        for points in chains:
            (x, y), (ahead_x, ahead_y) = points[:-1].T, points[1:].T
            self.area += 0.5 * self.copies * float((x * ahead_y - ahead_x * y).sum())
        self.thickness = 2.0 * self.area / (self.copies * sum(curve.length for curve in self.free))
        straight = [np.array(curve.ends) for curve in self.free if isinstance(curve, Segment)]
        chains = [points for k, points in enumerate(chains) if k not in self.planes]
        axes = np.concatenate([np.diff(chain, axis=0) for chain in straight or chains])
        axes = axes[np.hypot(*axes.T) > 0.0]
        axes /= np.hypot(*axes.T)[:, None]
        both = np.stack([axes, axes[:, ::-1] * [-1.0, 1.0]])
        sides = np.ptp(np.einsum("nc,bkc->bkn", self.unfolded(np.concatenate(chains)), both), axis=2)
        self.size = float(sides.max(axis=0).min() if straight else sides.max())
        self.far = min(self.size / PER_SIZE, self.thickness / PER_THICKNESS) / self.finer
        self.bends = self.thickness / PER_THICKNESS < self.size / PER_SIZE

    def _planes(self, points: FloatArray) -> dict[int, tuple[int, float]]:
        """The straight sides that are held in their normal component only, with all ``points`` (n, 2) of the
        body on one side. Of two parallel ones, between which the whole is without end, none; nor in bodies of
        revolution, which are supported rather than cut there."""
        held, planes = dict[int, set[int]](), dict[int, tuple[int, float]]()
        for condition, place in self.conditions:
            roller = isinstance(condition, Support) and place.ends is None
            # What moves, or holds a part of a side, is no symmetry.
            components = {axis for axis, fixed in enumerate(prescribes(condition)) if fixed or not roller}
            for number in self.outline.numbers(*place.edges):
                held.setdefault(number, set()).update(components)
        slack = ROUND_OFF * float(np.ptp(points, axis=0).max())
        for number, components in held.items():
            curve = self.outline.curves[number]
            if isinstance(curve, Segment) and len(components) == 1:
                (axis,), (at,), (normal,) = components, curve.points(np.zeros(1)), curve.normals(np.zeros(1))
                if abs(normal[axis]) > 1.0 - ROUND_OFF and ((points - at) @ normal).max() <= slack:
                    planes[number] = axis, float(at[axis])
        axes = [axis for axis, _ in planes.values()]
        return {number: plane for number, plane in planes.items() if axes.count(plane[0]) == 1}

    def unfolded(self, vectors: FloatArray, directions: bool = False) -> FloatArray:
        """Points or ``directions`` (n, 2), followed by their images behind the planes of symmetry."""
        for axis, at in self.planes.values():
            image = vectors.copy()
            image[:, axis] = (0.0 if directions else 2.0 * at) - image[:, axis]
            vectors = np.concatenate([vectors, image])
        return vectors

    def on_plane(self, points: FloatArray) -> BoolArray:
        """Mask (n,) of ``points`` (n, 2) on planes of symmetry."""
        on = np.zeros(len(points), dtype=bool)
        for axis, at in self.planes.values():
            on |= np.abs(points[:, axis] - at) <= COARSE_ROUND_OFF * self.size
        return on

    def length(self, curve: Curve) -> float:
        """The length of a curve and of its images that continue it."""
        return float(curve.length * 2 ** self.on_plane(np.array(curve.ends)).sum())


def along(curve: Curve) -> FloatArray:
    """Points (s, 2) along a curve, both ends included."""
    return curve.points(places_along(curve))


def places_along(curve: Curve) -> FloatArray:
    """Arc lengths (s,) that sample a curve."""
    return np.linspace(0.0, curve.length, max(SAMPLES, PER_POINT * curve.data_points) + 1)


def banded(curve: Curve, sizes: FloatArray, depth: float = 0.0) -> Iterator[Zone]:
    """Zones with the spacings ``sizes`` (m,) on m equal parts of a curve, each within ``depth`` times its
    spacing."""
    ends = np.linspace(0.0, curve.length, len(sizes) + 1)
    for first, last in pairwise([0, *(np.flatnonzero(np.diff(sizes)) + 1).tolist(), len(sizes)]):
        size, whole = float(sizes[first]), last - first == len(sizes)
        piece = curve if whole else curve.part(float(ends[first]), float(ends[last]))
        yield Zone(piece, size, depth * size)


def curved_parts(domain: Domain) -> Iterator[Zone]:
    """Zones along arcs, and where other curves turn; finer in hollows, the more so in bodies whose fields
    decay at different rates. The turning angle counts, not the curvature: shallow waves, however short, need
    no fine nodes."""
    convex, concave = PER_RADIUS * domain.finer, PER_CONCAVE_RADIUS * domain.finer**2
    for curve in domain.free:
        if isinstance(curve, Arc):
            yield Zone(curve, curve.radius / (convex if curve.sweep > 0.0 else concave))
        if isinstance(curve, Arc | Segment):
            continue
        arcs = places_along(curve)
        x, y = curve.normals(arcs).T
        angle, step = np.unwrap(np.arctan2(y, x)), curve.length / (len(arcs) - 1)
        # Spacings within which the curve turns by no more than 1 / ``convex``, in hollows 1 / ``concave``.
        sizes = np.full(len(arcs), np.inf)
        hollow = _turns(angle, max(round(domain.far / step), 1), curve.closed)[2] < -HOLLOW_ANGLE
        for level in range(LEVELS):
            size = domain.far * TURN_RATIO**level
            width = round(size / step)
            if width < 1 or np.isfinite(sizes).all():
                break
            least, most, net = _turns(angle, width, curve.closed)
            allowed = np.where(hollow & (net < 0.0), 1.0 / concave, 1.0 / convex)
            sizes = np.where(np.isinf(sizes) & (most - least <= allowed), size, sizes)
        yield from banded(curve, np.where(np.isinf(sizes), domain.far * TURN_RATIO**LEVELS, sizes)[:-1])


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
    chain = np.concatenate([start, angle, end])
    windows = np.lib.stride_tricks.sliding_window_view(chain, before + after + 1)
    return windows.min(axis=1), windows.max(axis=1), windows[:, -1] - windows[:, 0]


def short_sides(domain: Domain) -> Iterator[Zone]:
    """Zones along straight sides, whose ends are nodes; finer at roots of slits, between two corners that
    point into the material."""
    for number, curve in enumerate(domain.outline.curves):
        if isinstance(curve, Segment) and number not in domain.planes:
            ends = number, domain.outline.neighbours(number)[1]
            root = all(_reentrant(domain.outline, corner) for corner in ends)
            yield Zone(curve, domain.length(curve) / (PER_ROOT if root else 1.0))


def _reentrant(outline: Outline, number: int) -> bool:
    """Whether the corner at which a curve begins points into the material."""
    return turn(outline.curves[outline.neighbours(number)[0]], outline.curves[number]) < -SMOOTH_TURN


def reentrant_corners(domain: Domain) -> Iterator[Zone]:
    """Zones at corners that point into the material. Those of sides in contact have none, as pressures would
    follow the trace of the singular field into the corner; nor have those at finite strain."""
    if domain.case.model.strain == "finite":
        return
    sides = [side for sides in domain.boundaries.sides.values() for side in sides]
    touching = [run.part for place, run in sides if place.body == domain.body.name]
    for number, curve in enumerate(domain.outline.curves):
        if _reentrant(domain.outline, number):
            corner = curve.points(np.zeros(1))
            away = [np.hypot(*(side.points(side.closest(corner)) - corner)[0]) for side in touching]
            if all(far > COARSE_ROUND_OFF * side.length for far, side in zip(away, touching, strict=True)):
                yield Zone.around(corner[0], domain.far / SINGULAR_RATIO)


def narrow_parts(domain: Domain) -> Iterator[Zone]:
    """Zones with as many spacings between opposite faces as over the thickness. Faces that meet in a corner
    are excluded: wedges would have arbitrarily fine nodes."""
    outline, far, across = domain.outline, domain.far, PER_THICKNESS * domain.finer
    arcs, count = list[FloatArray](), len(domain.free)
    for curve in domain.free:
        parts = 4 * max(SAMPLES_PER_SPACING, math.ceil(0.25 * SAMPLES_PER_SPACING * curve.length / far))
        arcs.append(np.asarray((np.arange(parts) + 0.5) * (curve.length / parts)))
    owner = np.tile(np.repeat(np.arange(count), [len(s) for s in arcs]), domain.copies)
    copy = np.repeat(np.arange(domain.copies), len(owner) // domain.copies)
    step = np.concatenate([np.full(len(s), 2.0 * s[0]) for s in arcs])
    placed = list(zip(domain.free, arcs, strict=True))
    points = domain.unfolded(np.concatenate([curve.points(s) for curve, s in placed]))
    normals = domain.unfolded(np.concatenate([curve.normals(s) for curve, s in placed]), directions=True)
    numbers = [number for number in range(len(outline.curves)) if number not in domain.planes]
    beside = np.array([[b != a and b in outline.neighbours(a) for b in numbers] for a in numbers])
    pairs = cKDTree(points).query_pairs(across * far, output_type="ndarray")
    near, opposite = np.concatenate([pairs, pairs[:, ::-1]]).T
    kept = (normals[near] * normals[opposite]).sum(axis=1) < -OPPOSITE_COSINE
    kept &= ~(beside[owner[near], owner[opposite]] & (copy[near] == copy[opposite])) & (copy[near] == 0)
    near, opposite = near[kept], opposite[kept]
    away = points[near] - points[opposite]
    depth = (away * normals[near]).sum(axis=1)
    aside = np.sqrt(np.maximum((away**2).sum(axis=1) - depth**2, 0.0))
    # The opposite point may lie between samples.
    aside = np.maximum(aside - np.tile(step, domain.copies)[opposite], 0.0)
    inside, width = depth > 0.0, np.full(len(step), np.inf)
    np.minimum.at(width, near[inside], depth[inside] + aside[inside] ** 2 / depth[inside])
    level = np.ceil(np.log(np.minimum(width / (across * far), 1.0)) / np.log(WIDTH_RATIO) - COARSE_ROUND_OFF)
    sizes = far * WIDTH_RATIO ** np.clip(level, 0, LEVELS)
    for number, curve in enumerate(domain.free):
        yield from banded(curve, sizes[owner[: len(step)] == number], 0.5 * across)


OUTLINE_SOURCES = (curved_parts, short_sides, reentrant_corners, narrow_parts)
"""Sources of the size function by the outline alone."""
