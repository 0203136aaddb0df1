"""Ends of surfaces: corners with the known fields of forces near them, planes of symmetry, and where outside
the body the fields end, at infinity or at a center in a hollow."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud, continuations
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.surface import Surface, joined_surface
from mlsanm_cli.contact.geometry.unfolding import Planes
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.corner_faces import Face
from mlsanm_cli.mechanics.near_field import ComplexArray, Isotropic, as_complex, as_real
from mlsanm_cli.mechanics.symmetry import Image, SymmetryPlane, copies_around
from mlsanm_cli.mechanics.wedge import Wedge
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import ROUND_OFF

END_CLEARANCE = 4.0
"""Distance of pressures from the ends of their surfaces, in spacings: the remainder of their fields then
varies over at least this distance."""
SHARPEST, BLUNTEST, HOLLOW, WIDEST = np.radians([25.0, 170.0, 190.0, 270.0 + 1e-9]).tolist()
"""Angles of corners with known fields: from the first to the second, from the third to the last, and a
straight line."""
SHARPEST_ANISOTROPIC = np.radians(60.0)
"""The first of these angles for anisotropic bodies, whose fields leave tractions on sharper faces."""
NEAREST_SAMPLE, FARTHEST_SAMPLE, SAMPLES = 1e-3, 1e2, 40
"""Distances, in lengths of the faces, and number of the points at which the extensions of a corner's faces
and the cuts of its fields are checked to be outside the body."""
MIN_SPAN = 2.0
"""Least span, in spacings, of fields along curved faces."""
CENTER_DISTANCE = 0.5
"""Distance from a tip in a hollow at which such fields end, relative to their span."""

MIN_CLEARANCE = 0.1
"""Least distance of centers from the outline, relative to the extent of the places, if others are visible."""
HALVES = 0.5 ** np.arange(6)
SELF = Image(0j, 1.0, False)
"""A body as the image of itself."""
CHORDS = 200
"""Number of chords by which every boundary is approximated."""

Restraints: TypeAlias = Mapping[str, tuple[bool, bool] | None]
"""The surfaces of a body that are held, with their components; None with springs."""


@dataclass(frozen=True)
class SmoothPart:
    """A stretch of a surface without a corner, from arc length ``first`` to ``last``. At both ends: the
    corner if its fields are known, the plane of symmetry if any, whether the outline ``continues`` smoothly,
    and whether it is ``divided`` there, continuing without a contact."""

    first: float
    last: float
    corners: tuple[Corner | None, ...] = (None, None)
    planes: tuple[SymmetryPlane | None, ...] = (None, None)
    continues: tuple[bool, ...] = (False, False)
    divided: tuple[bool, ...] = (False, False)

    @property
    def known(self) -> tuple[bool, ...]:
        """Whether the fields of forces near either end are known."""
        ends = zip(self.corners, self.planes, strict=True)
        return tuple(any(one is not None for one in end) for end in ends)


def stretches_of(
    model: BodyModel, surface: Surface, held: Restraints, touching: Collection[str], fixed: Collection[str]
) -> list[SmoothPart]:
    """The stretches of a surface between its corners; ``touching`` are the body's surfaces in contact,
    ``fixed`` those held at zero displacement. The one that passes the start of a closed surface is the last.
    """
    curve, corners = surface.curve, surface.curve.corners
    if curve.closed and not len(corners):
        return [SmoothPart(0.0, curve.length, continues=(True, True))]
    parts = [part for part, _ in surface.members]
    starts = np.cumsum([0.0, *(part.curve.length for part in parts)])
    cut = [bool((np.abs(corners - at) <= ROUND_OFF * curve.length).any()) for at in starts[:-1]]
    if curve.closed and not cut[0]:
        turn = cut.index(True)
        parts, cut = parts[turn:] + parts[:turn], cut[turn:] + cut[:turn]
        starts = np.concatenate([starts[turn:-1], starts[:turn] + starts[-1]])
    places, found = [k for k, begins in enumerate(cut) if begins or not k], []
    for k, after in pairwise([*places, len(parts)]):
        own = joined_surface(surface.name, parts[k:after], False)
        beyond = dict(continuations(model.cloud, own))
        # A straight continuation that is held is a corner of 180 degrees.
        smooth = tuple(place in beyond and beyond[place] not in held for place in (0, -1))
        sides = zip((0, -1), smooth, strict=True)
        divided = tuple(beyond.get(place, "") not in touching and on for place, on in sides)
        ends = [
            (None, None) if on else end_of(model, own, at, held, fixed)
            for at, on in zip((False, True), smooth, strict=True)
        ]
        wedges, planes = tuple(corner for corner, _ in ends), tuple(plane for _, plane in ends)
        first = float(starts[k])
        found.append(SmoothPart(first, first + own.curve.length, wedges, planes, smooth, divided))
    return found


def shared_planes(stretches: Sequence[list[SmoothPart]], slack: float) -> list[list[SmoothPart]]:
    """The stretches of the bodies of a contact with those planes of symmetry only that all of them have, up
    to a distance ``slack``, and where two planes of a stretch make a whole number of copies of it; corners
    at other ends only."""
    found = []
    for number, parts in enumerate(stretches):
        others = [
            [plane for part in other for plane in part.planes if plane is not None]
            for other in (*stretches[:number], *stretches[number + 1 :])
        ]
        kept = []
        for part in parts:
            first, last = (
                plane is not None and all(any(plane.coincides(one, slack) for one in some) for some in others)
                for plane in part.planes
            )
            one, other = part.planes
            both = one is not None and other is not None and copies_around(one, other) is None
            chosen = first and not (last and both), last and not (first and both)
            planes = tuple(plane if at else None for plane, at in zip(part.planes, chosen, strict=True))
            corners = tuple(None if at else corner for corner, at in zip(part.corners, chosen, strict=True))
            kept.append(replace(part, planes=planes, corners=corners))
        found.append(kept)
    return found


def ends_of(
    model: BodyModel, surface: Surface, held: Restraints
) -> tuple[Planes, tuple[Corner | None, Corner | None]]:
    """The planes of symmetry, and the corners, at both ends of a surface; None if there is none, its fields
    are not known, or the surface is closed."""
    if surface.curve.closed:
        return (None, None), (None, None)
    (start, first), (end, last) = (end_of(model, surface, at, held, held) for at in (False, True))
    if first is not None and last is not None and copies_around(first, last) is None:
        last = None
    return (first, last), (None if first else start, None if last else end)


def end_of(
    model: BodyModel, surface: Surface, at_end: bool, held: Restraints, fixed: Collection[str]
) -> tuple[Corner | None, SymmetryPlane | None]:
    """The corner and the plane of symmetry at one end of a surface, None without known fields. The fields of
    a corner are known if the adjacent face is free or clamped, or if both faces are straight and that of an
    isotropic body slides along a wall, for angles that are neither blunt nor very sharp. A plane of symmetry
    is a straight side, held in its normal component at zero (``fixed``), that the surface meets at a right
    angle, with all of the body on one side."""
    face, cloud = _face(surface.curve, at_end), model.cloud
    faces = [
        (name, other)
        for name, adjacent in cloud.surfaces.items()
        if name not in {part.name for part, _ in surface.members} and not adjacent.curve.closed
        for other in (_face(adjacent.curve, at) for at in (False, True))
        if abs(other.tip - face.tip) <= ROUND_OFF * surface.curve.length
    ]
    if not faces:
        return None, None
    name, other = faces[0]
    assert other.curve is not None
    spacing = float(cloud.spacing[surface.index[-1 if at_end else 0]])
    straight, clamped = _straight(other.curve), held.get(name) == (True, True)
    axes = [abs(other.along.imag) > 1.0 - ROUND_OFF, abs(other.along.real) > 1.0 - ROUND_OFF]
    slides = straight and any(axes) and list(held.get(name) or ()) == axes
    plane = None
    if slides and name in fixed:
        found = SymmetryPlane(other.tip, other.along, END_CLEARANCE * spacing)
        # The angle may differ as that of splines through nodes does, by the square of their turn per node.
        bend = float(surface.curve.curvature(np.array([surface.curve.length * at_end]))[0]) * spacing
        right = abs((face.along * np.conj(other.along)).real) <= max(ROUND_OFF, bend**2)
        side = np.sign(found.height(np.array(other.tip + face.along)))
        away = found.height(as_complex(cloud.points)) * side
        one_sided = away.min() >= -ROUND_OFF * float(np.ptp(cloud.points, axis=0).max())
        plane = found if right and one_sided and found.reflects(model.kernel) else None
    sliding = name in held and not clamped
    if sliding and not slides:
        return None, plane
    # Outlines have the body on their left.
    wedge = Wedge(model.kernel, face.along, other.along, -1j if at_end else 1j, sliding, clamped)
    inside = float(np.angle(wedge.other / wedge.along) * wedge.turn.imag) % (2.0 * np.pi)
    angle = inside * (2.0 if sliding else 1.0)
    # A straight outline is no corner; a wall at right angles is a symmetry line.
    flat = sliding and abs(angle - np.pi) <= ROUND_OFF
    blunt = BLUNTEST < angle < HOLLOW and not flat and not clamped
    isotropic = isinstance(model.kernel, Isotropic)
    sharpest = SHARPEST if isotropic else SHARPEST_ANISOTROPIC
    if blunt or not sharpest <= inside <= angle <= WIDEST or (sliding and not isotropic):
        return None, plane
    lengths = surface.curve.length, other.curve.length
    corner = Corner(wedge, face.tip, min(lengths), END_CLEARANCE * spacing)
    if straight and _straight(surface.curve) and not cloud.contains(_behind(wedge, face.tip, *lengths)).any():
        return corner, plane
    return None if wedge.sliding else _limited(cloud, corner, (face, other), spacing), plane


def _face(curve: Curve, at_end: bool) -> Face:
    """A boundary as a face of the corner at one of its ends."""
    arc = np.array([curve.length if at_end else 0.0])
    inward = -complex(as_complex(curve.normals(arc))[0])
    along = 1j * inward if at_end else -1j * inward
    return Face(complex(as_complex(curve.points(arc))[0]), along, inward, curve, at_end)


def _limited(cloud: Cloud, corner: Corner, faces: tuple[Face, Face], spacing: float) -> Corner | None:
    """The corner with fields along its faces only, None if these cannot end outside the body."""
    curves = [face.curve for face in faces if face.curve is not None]
    curved = max(float(np.abs(one.curvature(np.linspace(0.0, one.length, SAMPLES))).max()) for one in curves)
    span = min(corner.length, 1.0 / curved if curved else np.inf)
    if span < MIN_SPAN * spacing:
        return None
    x = span * np.geomspace(NEAREST_SAMPLE, 1.0, SAMPLES)
    places, inward = (np.concatenate(some) for some in zip(*(face.places(x) for face in faces), strict=True))
    between = faces[0].inward + faces[1].inward
    centers = None, corner.tip - span * CENTER_DISTANCE * between / abs(between)
    for center in centers:
        if _all_see(cloud, corner.tip + places, inward, center):
            return replace(corner, curved=faces, span=span, center=center)
    return None


def _behind(wedge: Wedge, tip: complex, along: float, other: float) -> FloatArray:
    """Points (e, 2) that must lie outside the body: on the extensions of the faces of a wedge, of lengths
    ``along`` and ``other``, where its forces continue, behind a wall, and on the branch cuts of their
    fields."""
    far = np.geomspace(NEAREST_SAMPLE, FARTHEST_SAMPLE, SAMPLES)
    starts = tip + wedge.along * along * (1.0 + far), tip + wedge.second * other * (1.0 + far)
    if wedge.sliding:
        starts = starts[0], tip + wedge.second * along * far
    size = max(along, other)
    cuts = [
        tip + way * size * far[:, None] - inward * size * far
        for way, inward in zip((wedge.along, wedge.second), wedge.inward, strict=True)
    ]
    return as_real(np.concatenate([*starts, *(cut.ravel() for cut in cuts)]))


def _straight(curve: Curve) -> bool:
    """Whether a curve is a straight line."""
    ends = curve.points(np.array([0.0, curve.length]))
    straight = abs(float(np.hypot(*(ends[1] - ends[0]))) - curve.length) <= ROUND_OFF * curve.length
    return straight and not len(curve.corners)


def void_center(
    cloud: Cloud, place: ComplexArray, inward: ComplexArray, images: Sequence[Image] = ()
) -> list[complex | None]:
    """Where the fields of forces at places (e,) of an outline end: [None] at infinity if the outward rays are
    free, else a center visible from all places; empty if there is none. The ``images`` of the body are in the
    way as it is itself."""
    whole = (SELF, *images)
    free = np.min([_free(cloud, one.points(place), -one.directions(inward)) for one in whole], axis=0)
    if np.isinf(free).all():
        return [None]
    middle = len(place) // 2
    away, wide = 0.5 * float(free.min()), float(np.abs(place - place[middle]).max())
    # A wall that overhangs one end of the places is near that end, but not necessarily near the middle; the
    # nodes of a surface close to a center would not resolve its fields.
    for size in min(0.5 * float(free[middle]), wide) * HALVES if away < MIN_CLEARANCE * wide else (away,):
        center = complex(place[middle] - size * inward[middle])
        if _all_see(cloud, place, inward, center, images):
            return [center]
    # The visible center farthest from the outline, of those outward of any place: the mouth of a slot is
    # visible from its rounded edge and from its wall, the region outward of their middle is not.
    sizes = np.minimum(0.5 * free, wide)[:, None] * HALVES
    centers = (place[:, None] - sizes * inward[:, None]).ravel()
    outline = np.concatenate(_chords(cloud))
    clear = np.array([np.abs(outline - center).min() for center in centers])
    for number in np.argsort(-clear):
        if clear[number] < MIN_CLEARANCE * wide:
            break
        if _all_see(cloud, place, inward, complex(centers[number]), images):
            return [complex(centers[number])]
    return []


def _all_see(
    cloud: Cloud,
    place: ComplexArray,
    inward: ComplexArray,
    center: complex | None,
    images: Sequence[Image] = (),
) -> bool:
    """Whether the segments from places (e,) of an outline to a ``center``, or the outward rays without one,
    are outside the body and its ``images``."""
    for one in (SELF, *images):
        start, ahead, size = one.points(place), -one.directions(inward), np.array(np.finfo(float).max)
        if center is not None:
            lines = one.points(np.array(center)) - start
            size = np.abs(lines)
            ahead = lines / size
        if not (_free(cloud, start, ahead) > size).all():
            return False
    return True


def _free(cloud: Cloud, place: ComplexArray, ahead: ComplexArray) -> FloatArray:
    """Distance (e,) from places (e,) along unit directions ``ahead`` (e,) to the outline, ignoring hits
    within a chord length."""
    chains = _chords(cloud)
    start = np.concatenate([points[:-1] for points in chains])
    way = np.concatenate([np.diff(points) for points in chains])
    across = (np.conj(ahead)[:, None] * way).imag
    apart = start - place[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.conj(apart) * way).imag / across
        share = -(np.conj(ahead)[:, None] * apart).imag / across
    hit = (np.abs(across) > ROUND_OFF * np.abs(way)) & (share >= 0.0) & (share <= 1.0)
    hit &= distance > np.abs(way).max()
    return np.asarray(np.where(hit, distance, np.inf).min(axis=1))


def _chords(cloud: Cloud) -> list[ComplexArray]:
    """Ends (c + 1,) of the chords of every boundary."""
    curves = [surface.curve for surface in cloud.surfaces.values()]
    return [as_complex(one.points(np.linspace(0.0, one.length, CHORDS + 1))) for one in curves]
