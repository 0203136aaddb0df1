"""Sources of the size function of a body by what acts on it. Tractions and displacements that end where a
boundary continues, or vary along it, have a length scale independent of the size of the body: a pressure on a
fiftieth of a block's side would fall between two nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries, prescribes
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.app.scene.loads import amounts_of, profiles, runs_of
from mlsanm_cli.app.scene.outlines import geometry_of, given_nodes
from mlsanm_cli.app.scene.sizes import (
    LEVELS,
    OUTLINE_SOURCES,
    PER_ROOT,
    SINGULAR_RATIO,
    Domain,
    along,
    banded,
    places_along,
)
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Body, Contact, Displacement, ExpressionError, Pressure, Traction, value_at
from mlsanm_cli.cloud.cloud import Cloud, SymmetryLine
from mlsanm_cli.cloud.curves import Curve, Outline, turn
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, ROUND_OFF

PER_PART, PER_PART_AT_ENDS, PER_PART_AT_FIXED_ENDS = 8.0, 32.0, 256.0
"""Length of a loaded or fixed part over the spacing along it, and over that at its ends."""
LINEARITY_TOLERANCE = 0.02
"""Largest deviation of values from linear over a spacing, relative to the largest value."""
FIELD_SAMPLES, OVERLAP = 5, 1.5
"""Samples per direction of a square, and size of the sampled region over that of the square, so that a kink
lies inside one."""
MAX_SQUARES = 64
"""Largest number of squares of one size that are divided: along lines of discontinuity no size suffices."""
CURVE_SAMPLES = 100
"""Chords per curve of an outline, to determine which points are inside."""
PER_CONTACT_DEPTH, PER_END_DISTANCE, PER_CRACK = 5.0, 10.0, 40.0
"""Spacings between a contact and the nearest other boundary, between the outermost of several minima of the
gap and the end of the surface, and over the length of a crack."""
EQUAL_MINIMA = 0.05
"""Another minimum of the gap counts if it is larger by less than this part of its distance from the end."""
TOUCHING, TIP_RADIUS = 0.01, 3.0
"""Largest gap at a corner that touches: relative to the span over which its fields decay, or the spacing;
and the span over the radius of the fine zone where curved conforming surfaces end in a corner."""
SHARP_RATIO, RIGHT = 16.0, 0.05
"""The coarse spacing over that at oblique corners on rigid obstacles, to which pressures answer within three
spacings, and the difference from a right angle (radian) below which pressures even out."""
BOND_RATIO = 2.0
"""The spacing of the finer body over that along bonds that end on a surface that continues."""
MIN_SPACING = 2.0**-14
"""Least spacing relative to that far away: with 6e-6 of it factors lose their digits."""
SMOOTH = float(np.cos(np.radians(10.0)))
"""Faces whose normals have at least this cosine form no corner."""
STRAINED_RATIO, STRAINED_BAND = 1.5, 3.0
"""The coarse spacing over that along surfaces in contact at finite strain, where strains are largest, and
depth of the fine band in its spacings."""


def clamped_ends(domain: Domain) -> Iterator[Zone]:
    """Zones at both ends of clamped sides, where stresses are singular beside a free one. They determine the
    stiffness of the clamping, which matters to bodies that bend, that extend so far from their clamped sides
    that these turn them, or that have no contact."""
    held = [place for condition, place in domain.conditions if all(prescribes(condition))]
    curves = [run.part for place in held for run in runs_of(domain.outline, place)]
    sides = [side for contact in domain.case.contact for side in contact.sides]
    length = sum(domain.length(curve) for curve in curves)
    leans = domain.material.stretch * domain.area > length**2
    if domain.bends or leans or all(side.body != domain.body.name for side in sides):
        for curve in curves:
            ends = curve.points(np.array([0.0, curve.length]))
            for end in () if curve.closed else ends[~domain.on_plane(ends)]:
                yield Zone.around(end, domain.far / SINGULAR_RATIO)


def loaded_parts(domain: Domain) -> Iterator[Zone]:
    """Zones along loaded and fixed parts of sides, and at their ends where the boundary continues
    smoothly."""
    for condition, place in domain.conditions:
        loose = getattr(condition, "spring", None) is not None or not any(prescribes(condition))
        for run in runs_of(domain.outline, place):
            curve, length, edges = run.part, domain.length(run.part), list[int]()
            for end in () if curve.closed else (0, 1):
                # Inside the run, or smoothly beyond its first or last piece.
                number = run.numbers[-end]
                sides = (number, run.outline.neighbours(number)[end])[:: 1 if end else -1]
                before, after = (run.outline.curves[side] for side in sides)
                inside = run.continues(run.range[0] + end * curve.length)
                edges += [end] if inside or np.cos(turn(before, after)) > SMOOTH else []
            if edges:
                yield Zone(curve, length / PER_PART)
            for tip in curve.points(curve.length * np.array(edges, dtype=float)):
                yield Zone.around(tip, length / (PER_PART_AT_ENDS if loose else PER_PART_AT_FIXED_ENDS))


def varying_loads(domain: Domain) -> Iterator[Zone]:
    """Zones along boundaries where a load varies, and at its discontinuities."""
    far = domain.far
    for load in domain.case.load:
        if not isinstance(load, Pressure | Traction | Displacement) or load.owner != domain.body.name:
            continue
        for run, values, jumps in profiles(domain.outline, load):
            curve = run.part
            arc = np.linspace(0.0, curve.length, len(values))
            sizes = resolved_sizes(values, curve.length, far)
            marks = np.array([0.0, *jumps, curve.length])
            for before, jump, after in zip(marks, marks[1:], marks[2:], strict=False):
                apart = float(min(jump - before, after - jump))
                least = apart / PER_PART_AT_ENDS
                # On each side of a jump the load is resolved by linear interpolation.
                near = np.abs(0.5 * (arc[1:] + arc[:-1]) - jump) < 0.5 * apart
                sizes = np.where(near, np.maximum(sizes, least), sizes)
                yield Zone.around(curve.points(np.array([jump]))[0], least)
            yield from banded(curve, sizes)


def resolved_sizes(values: FloatArray, length: float, far: float) -> FloatArray:
    """Spacings (s,) of at most ``far`` over which ``values`` (s + 1, c) at even steps along a ``length`` are
    nearly linear, by repeated halving of the length; s is a power of two.

    >>> resolved_sizes(np.array([[0.0], [0.0], [0.0], [0.0], [1.0]]), 1.0, 0.5).tolist()
    [0.5, 0.5, 0.25, 0.25]
    """
    count = len(values) - 1
    sizes, width = np.full(count, far), count
    while width > 1:
        # Windows overlap by half, so that a kink lies inside one.
        starts = np.arange(0, count - width + 1, width // 2)
        rows = values[starts[:, None] + np.arange(width + 1)]
        share = np.linspace(0.0, 1.0, width + 1)[:, None]
        lines = (1.0 - share) * rows[:, :1] + share * rows[:, -1:]
        width //= 2
        for start in starts[np.abs(rows - lines).max(axis=(1, 2)) > LINEARITY_TOLERANCE].tolist():
            inside = slice(start, start + 2 * width)
            sizes[inside] = np.minimum(sizes[inside], width * length / count)
    return sizes


def varying_fields(domain: Domain) -> Iterator[Zone]:
    """Zones where temperatures and body forces vary within a spacing."""
    for load in domain.case.load:
        if load.owner == domain.body.name and not load.places:
            for amount in amounts_of(load):
                if isinstance(amount, str):
                    yield from _field_zones(domain.outline, amount, domain.far)


@lru_cache(maxsize=64)
def _field_zones(outline: Outline, expression: str, far: float) -> tuple[Zone, ...]:
    """Zones of squares, halved until the field is linear in each."""
    found, samples = list[Zone](), np.linspace(0.0, 1.0, CURVE_SAMPLES + 1)
    chains = [curve.points(curve.length * samples) for curve in outline.curves]
    edges = np.concatenate([np.hstack([points[:-1], points[1:]]) for points in chains])
    low, high = edges[:, :2].min(axis=0), edges[:, :2].max(axis=0)
    size = float((high - low).max())
    count = int(np.ceil(size / far))
    size /= count
    ticks = size * (np.arange(count) - 0.5 * (count - 1))
    centers = 0.5 * (low + high) + np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    scale = 0.0
    for level in range(LEVELS):
        near = OVERLAP * size * np.linspace(-0.5, 0.5, FIELD_SAMPLES)
        points = centers[:, None] + np.stack(np.meshgrid(near, near), axis=-1).reshape(-1, 2)
        inside = inside_polygon(edges, points.reshape(-1, 2)).reshape(points.shape[:2])
        values, off = np.full(points.shape[:2], np.nan), np.zeros(len(points))
        for row, column in np.argwhere(inside).tolist():
            # Points without a value are reported when loads are evaluated at the nodes.
            with suppress(ExpressionError):
                values[row, column] = value_at(expression, *points[row, column].tolist())
        for square, known in enumerate(np.isfinite(values)):
            if known.sum() > FIELD_SAMPLES:
                # Deviation from the best linear function.
                away, inner = points[square] - points[square].mean(axis=0), values[square, known]
                basis = np.column_stack([np.ones(len(inner)), away[known]])
                off[square] = np.abs(inner - basis @ np.linalg.lstsq(basis, inner)[0]).max()
        scale = float(np.nanmax(np.abs(values), initial=0.0)) if not level else scale
        bent = off > LINEARITY_TOLERANCE * scale
        if scale == 0.0 or not bent.any() or (level and bent.sum() > MAX_SQUARES):
            break
        size *= 0.5
        found += [Zone.around(center, size, size) for center in centers[bent]]
        quarters = 0.5 * size * np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
        centers = (centers[bent][:, None] + quarters).reshape(-1, 2)
    return tuple(found)


def contacts(domain: Domain) -> Iterator[Zone]:
    """Zones at all contacts of a body. Bonds have the spacing of the finer body along them; one that ends on
    a surface that continues, where stresses are singular, has half of it, and finer nodes at its ends and at
    those of cracks beside it."""
    boundaries, name = domain.boundaries, domain.body.name
    # The points at which bonds end on a surface that continues.
    bond_ends = {
        contact.name: [
            point
            for place, run in boundaries.sides[contact.name]
            for point in place.ends or ()
            if run.continues(run.nearest(point)[0])
        ]
        for contact in domain.case.contact
        if contact.bonded
    }
    for contact in domain.case.contact:
        sides = boundaries.sides[contact.name]
        for (place, run), (other_place, other_run) in zip(sides, sides[::-1], strict=True):
            if place.body != name:
                continue
            partner, own, other = other_place.body, run.part, other_run.part
            if contact.bonded:
                fine, ends = _finest(domain, partner), bond_ends[contact.name]
                yield Zone(own, fine / (BOND_RATIO if ends else 1.0))
                for tip in ends:
                    yield Zone.around(tip, fine / SINGULAR_RATIO)
                continue
            if domain.case.model.revolved and partner != name:
                # Nodal pressures need similar spacings on both surfaces.
                fine = _finest(domain, partner)
                yield Zone(other, fine, fine)
            outline = domain.outline
            rest = [curve for k, curve in enumerate(outline.curves) if k not in run.numbers]
            yield from _contact(domain, contact, own, rest, other if len(sides) > 1 else None)
            slave = sides[0][1].part
            for end in slave.points(np.array([0.0, slave.length])):
                away = [np.hypot(*(end - tip)) for tips in bond_ends.values() for tip in tips]
                if min(away, default=np.inf) <= COARSE_ROUND_OFF * slave.length:
                    yield Zone.around(end, slave.length / PER_CRACK)


def _finest(domain: Domain, partner: str) -> float:
    """The finer one of the coarse spacings of a body and its ``partner``."""
    body = next(body for body in domain.case.body if body.name == partner)
    if isinstance(body.spacing, float):
        return min(domain.far, body.spacing)
    return domain.far if body.has_nodes else min(domain.far, Domain(domain.boundaries, body).far)


def _contact(
    domain: Domain, contact: Contact, own: Curve, rest: Sequence[Curve], other: Curve | None
) -> Iterator[Zone]:
    """Zones of a body where its boundary ``own`` is nearest to the ``other`` surface or to the obstacle, if
    the ``rest`` of its outline or an end is close."""
    points = along(own)
    if other is not None:
        partner = other.points(other.closest(points))
    else:
        assert contact.obstacle is not None
        partner, _ = shape_of(contact.obstacle).closest(points, own.normals(places_along(own)))
    gap = np.hypot(*(points - partner).T)
    nearest = np.flatnonzero(gap <= gap.min() + COARSE_ROUND_OFF * own.length)
    place = points[nearest[len(nearest) // 2]]
    beside = [np.zeros((0, 2)), *(along(curve) for curve in rest)]
    if not own.closed:
        ends = points[[0, -1]][~domain.on_plane(points[[0, -1]])]
        beside.append(ends)
        # The outermost of several minima of the gap may be near an end.
        step = float(np.hypot(*(points[1] - points[0])))
        least = np.array(valleys(gap, COARSE_ROUND_OFF * len(gap) * step), dtype=int)
        for end in ends:
            away = np.hypot(*(points[least] - end).T)
            close = gap[least] <= gap.min() + EQUAL_MINIMA * away
            outermost = float(away[close].min(initial=np.inf))
            if close.sum() > 1 and outermost > 0.0:
                yield Zone.around(end, outermost / PER_END_DISTANCE, outermost)
        if other is not None or domain.case.model.strain == "small":
            yield from _corner_ends(domain, own, rest, gap, other is None)
    distance = float(np.hypot(*(np.concatenate(beside) - place).T).min(initial=np.inf))
    if distance > COARSE_ROUND_OFF * own.length:
        yield Zone.around(place, distance / PER_CONTACT_DEPTH, distance)
    if domain.case.model.strain == "finite":
        fine = domain.far / STRAINED_RATIO
        yield Zone(own, fine, STRAINED_BAND * fine)


def _corner_ends(
    domain: Domain, own: Curve, rest: Sequence[Curve], gap: FloatArray, flat: bool
) -> Iterator[Zone]:
    """Zones where a surface that touches ends in a corner: if it is curved, as in a fit, or if the other side
    is a ``flat`` obstacle, on which other than right corners leave a trace of strain in smooth fits."""
    curved = float(np.abs(own.curvature(places_along(own))).max())
    for arc, apart in ((0.0, gap[0]), (own.length, gap[-1])):
        at = np.array([arc])
        for curve in rest:
            ends = np.array([0.0, curve.length])
            joins = np.hypot(*(curve.points(ends) - own.points(at)).T) <= COARSE_ROUND_OFF * own.length
            for cosine in (curve.normals(ends) @ own.normals(at)[0])[joins].tolist():
                span = min(own.length, curve.length, 1.0 / curved if curved else np.inf)
                if not flat and curved and cosine < SMOOTH and apart < TOUCHING * span:
                    yield Zone.around(own.points(at)[0], span / PER_ROOT, span / TIP_RADIUS)
                # The cosine of the angle to a right one, away from 0 and from 1.
                oblique = np.sin(RIGHT) < abs(cosine) < np.cos(RIGHT)
                if flat and oblique and apart <= TOUCHING * domain.far:
                    yield Zone.around(own.points(at)[0], domain.far / SHARP_RATIO)


def valleys(values: FloatArray, slack: float) -> list[int]:
    """Indices of the local minima of ``values`` (n,) between rises and falls of more than ``slack``, which
    ignores round-off."""
    found, falling, lowest, highest = list[int](), True, 0, 0
    row = values.tolist()
    for k, value in enumerate(row):
        if falling:
            lowest = k if value < row[lowest] else lowest
            if value > row[lowest] + slack:
                found.append(lowest)
                falling, highest = False, k
        else:
            highest = k if value > row[highest] else highest
            if value < row[highest] - slack:
                falling, lowest = True, k
    return [*found, lowest] if falling else found


CONDITION_SOURCES = (clamped_ends, loaded_parts, varying_loads, varying_fields, contacts)
"""Sources of the size function by what acts on a body."""


@lru_cache(maxsize=64)
def spacing_of(boundaries: Boundaries, body: Body) -> Spacing:
    """The size function of a body whose nodes are placed."""
    far, zones = body.spacing, list[Zone]()
    if isinstance(far, str):
        domain = Domain(boundaries, body)
        far = domain.far
        for source in (*OUTLINE_SOURCES, *CONDITION_SOURCES):
            for zone in source(domain):
                if zone.spacing < far:
                    zones.append(replace(zone, spacing=max(zone.spacing, MIN_SPACING * far)))
    for refine in body.refine:
        if refine.at is None:
            outline = boundaries.drawn[body.name]
            for number in outline.numbers(str(refine.along).rpartition(".")[2]):
                zones.append(Zone(outline.curves[number], refine.spacing, refine.radius, refine.growth))
        else:
            zones.append(Zone.around(refine.at, refine.spacing, refine.radius, refine.growth))
    return Spacing(far, tuple(zones))


def clouds(boundaries: Boundaries, zones: tuple[Zone, ...] = (), memo: Memo = NO_CACHE) -> dict[str, Cloud]:
    """Node clouds of all bodies of a case, refined in ``zones`` in addition to it, and symmetric about its
    line of symmetry where outline and spacing are."""
    placed, case, line = dict[str, Cloud](), boundaries.case, line_of(boundaries)
    for body in case.body:
        given = given_nodes(body)
        if given is None:
            spacing = spacing_of(boundaries, body).with_zones(zones)
            wanted = [support.near for support in case.support if support.body == body.name and support.near]
            placed[body.name] = build_cloud(
                boundaries.outline(body.name), spacing, body.seed, memo=memo, line=line, wanted=wanted
            )
        else:
            cloud = boundaries.split(body.name, given.cloud)
            placed[body.name] = (cloud.mirrored(line) if line is not None else None) or cloud
    if case.model.revolved:
        return {name: replace(cloud, revolved=True) for name, cloud in placed.items()}
    return placed


def line_of(boundaries: Boundaries) -> SymmetryLine | None:
    """The symmetry line of all bodies, None if there is none or if they are bodies of revolution. Not used
    with friction: there asymmetric errors cancel in part, and results are better."""
    case = boundaries.case
    if case.model.revolved or any(contact.friction for contact in case.contact):
        return None
    shapes = [geometry_of(body.shape) for body in case.body]
    if any(shape.digest and not body.has_nodes for shape, body in zip(shapes, case.body, strict=True)):
        return None
    size = max(shape.size for shape in shapes)

    def symmetric(body: Body, line: SymmetryLine) -> bool:
        given = given_nodes(body)
        if given is None:
            return spacing_of(boundaries, body).symmetric(line)
        nodes = given.points
        return line.images(nodes, np.full(len(nodes), size / np.sqrt(len(nodes)))) is not None

    for axis in (0, 1):
        line = SymmetryLine(axis, shapes[0].centre[axis])
        same = max(abs(shape.centre[axis] - line.at) for shape in shapes) <= ROUND_OFF * size
        if same and all(symmetric(body, line) for body in case.body):
            return line
    return None
