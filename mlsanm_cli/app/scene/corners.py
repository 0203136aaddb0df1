"""Corners at the ends of surfaces, with the known fields of forces near them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from mlsanm_cli.app.scene.void import all_see
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud, continuations
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.surface import Surface, joined_surface
from mlsanm_cli.contact.geometry.unfolding import Planes
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.corner import Corner
from mlsanm_cli.mechanics.corner_faces import Face
from mlsanm_cli.mechanics.near_field import Isotropic, as_complex, as_real
from mlsanm_cli.mechanics.symmetry import SymmetryPlane, copies_around
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

Restraints: TypeAlias = Mapping[str, tuple[bool, bool] | None]
"""The surfaces of a body that are held, with their components; None with springs."""


@dataclass(frozen=True)
class SmoothPart:
    """A stretch of a surface without a corner, from arc length ``first`` to ``last``. At both ends: the
    corner if its fields are known, the plane of symmetry if any, whether the outline ``continues`` smoothly,
    and whether it is ``divided`` there, continuing without a contact."""

    first: float
    last: float
    corners: tuple[Corner | None, Corner | None] = (None, None)
    planes: Planes = (None, None)
    continues: tuple[bool, bool] = (False, False)
    divided: tuple[bool, bool] = (False, False)

    @property
    def known(self) -> tuple[bool, bool]:
        """Whether the fields of forces near either end are known."""
        first, last = (
            corner is not None or plane is not None
            for corner, plane in zip(self.corners, self.planes, strict=True)
        )
        return first, last

    @property
    def ended(self) -> tuple[bool, bool]:
        """Whether pressures may reach either end."""
        first, last = (any(each) for each in zip(self.known, self.divided, strict=True))
        return first, last

    def at_planes(self, chosen: tuple[bool, bool]) -> SmoothPart:
        """The same with the planes at ``chosen`` ends only, without the corners there."""
        planes = [plane if keep else None for plane, keep in zip(self.planes, chosen, strict=True)]
        corners = [None if keep else corner for corner, keep in zip(self.corners, chosen, strict=True)]
        return replace(self, planes=(planes[0], planes[1]), corners=(corners[0], corners[1]))


def stretches_of(
    model: BodyModel,
    surface: Surface,
    held: Restraints,
    touching: Collection[str],
    fixed: Collection[str] = (),
) -> tuple[SmoothPart, ...]:
    """The stretches of a surface between its corners; ``touching`` are the body's surfaces in contact,
    ``fixed`` those held at zero displacement."""
    curve = surface.curve
    if curve.closed and not len(curve.corners):
        return (SmoothPart(0.0, curve.length, continues=(True, True)),)
    found = []
    for parts, first in _between_corners(surface):
        own = joined_surface(surface.name, parts, False)
        names = {part.name for part in parts}
        beyond = dict(continuations(model.cloud, own))
        corners, planes, continues, divided = [], [], [], []
        for at_end, place in ((False, 0), (True, -1)):
            # A straight continuation that is held is a corner of 180 degrees.
            smooth = place in beyond and beyond[place] not in held
            corners.append(None if smooth else _corner(model, own, names, at_end, held))
            planes.append(None if smooth else symmetry_plane(model, own, names, at_end, held, fixed))
            continues.append(smooth)
            divided.append(smooth and beyond[place] not in touching)
        last = first + own.curve.length
        (a, b), (c, d), (e, f), (g, h) = corners, planes, continues, divided
        found.append(SmoothPart(first, last, (a, b), (c, d), (e, f), (g, h)))
    return tuple(found)


def shared_planes(stretches: Sequence[tuple[SmoothPart, ...]], slack: float) -> list[tuple[SmoothPart, ...]]:
    """The stretches of the bodies of a contact with those planes of symmetry only that all of them have, up
    to a distance ``slack``, and where two planes of a stretch make a whole number of copies of it."""
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
            kept.append(part.at_planes((first and not (last and both), last and not (first and both))))
        found.append(tuple(kept))
    return found


def ends_of(
    model: BodyModel, surface: Surface, held: Restraints
) -> tuple[Planes, tuple[Corner | None, Corner | None]]:
    """The planes of symmetry, and the corners, at both ends of a surface; None if there is none, its fields
    are not known, or the surface is closed."""
    if surface.curve.closed:
        return (None, None), (None, None)
    first, last = planes_of(model, surface, held)
    if first is not None and last is not None and copies_around(first, last) is None:
        last = None
    own = {part.name for part, _ in surface.members}
    corners = [
        _corner(model, surface, own, at_end, held) if plane is None else None
        for at_end, plane in ((False, first), (True, last))
    ]
    return (first, last), (corners[0], corners[1])


def planes_of(model: BodyModel, surface: Surface, held: Restraints) -> Planes:
    """The planes of symmetry at both ends of a surface, whatever their motion."""
    if surface.curve.closed:
        return None, None
    own = {part.name for part, _ in surface.members}
    first, last = (symmetry_plane(model, surface, own, at_end, held, held) for at_end in (False, True))
    return first, last


def _between_corners(surface: Surface) -> Iterator[tuple[list[Surface], float]]:
    """The parts of a surface from corner to corner with the arc length of their starts; on a closed surface
    the part that passes its start comes last."""
    parts = [part for part, _ in surface.members]
    starts = np.cumsum([0.0, *(part.curve.length for part in parts)])
    corners = surface.curve.corners
    small = ROUND_OFF * surface.curve.length
    cut = [bool((np.abs(corners - start) <= small).any()) for start in starts[:-1]]
    if surface.curve.closed and not cut[0]:
        turn = cut.index(True)
        parts, cut = parts[turn:] + parts[:turn], cut[turn:] + cut[:turn]
        starts = np.concatenate([starts[turn:-1], starts[:turn] + starts[-1]])
    cut[0] = True
    places = [k for k, begins in enumerate(cut) if begins]
    for k, after in zip(places, [*places[1:], len(parts)], strict=True):
        yield parts[k:after], float(starts[k])


def _corner(
    model: BodyModel, surface: Surface, own: Collection[str], at_end: bool, held: Restraints
) -> Corner | None:
    """The corner at one end of a surface, None if its fields are not known. They are if the adjacent face is
    free or clamped, or if both faces are straight and that of an isotropic body slides along a wall, for
    angles that are neither blunt nor very sharp."""
    face = _face(surface.curve, at_end)
    for name, adjacent, other in _adjacent(model, face, surface.curve.length, own):
        clamped = held.get(name) == (True, True)
        sliding = name in held and not clamped
        if sliding and not (_straight(adjacent.curve) and _slides(other.along, held[name])):
            return None
        # Outlines have the body on their left.
        turn = -1j if at_end else 1j
        wedge = Wedge(model.kernel, face.along, other.along, turn, sliding, clamped)
        if not _known(wedge):
            return None
        lengths = surface.curve.length, adjacent.curve.length
        spacing = float(model.cloud.spacing[surface.index[-1 if at_end else 0]])
        corner = Corner(wedge, face.tip, min(lengths), END_CLEARANCE * spacing)
        straight = _straight(surface.curve) and _straight(adjacent.curve)
        if straight and not model.cloud.contains(_behind(wedge, face.tip, *lengths)).any():
            return corner
        return None if wedge.sliding else _limited(model.cloud, corner, (face, other), spacing)
    return None


def symmetry_plane(
    model: BodyModel,
    surface: Surface,
    own: Collection[str],
    at_end: bool,
    held: Restraints,
    fixed: Collection[str],
) -> SymmetryPlane | None:
    """The plane of symmetry at one end of a surface, None if there is none: a straight side, held in its
    normal component at zero (``fixed``), that the surface meets at a right angle, with all of the body on one
    side. The angle may differ as that of splines through nodes does, by the square of their turn from node to
    node."""
    face = _face(surface.curve, at_end)
    for name, adjacent, other in _adjacent(model, face, surface.curve.length, own):
        if name not in fixed or not _straight(adjacent.curve) or not _slides(other.along, held[name]):
            return None
        end = surface.index[-1 if at_end else 0]
        plane = SymmetryPlane(other.tip, other.along, END_CLEARANCE * float(model.cloud.spacing[end]))
        bend = float(surface.curve.curvature(np.array([surface.curve.length * at_end]))[0])
        turn = (bend * model.cloud.spacing[end]) ** 2
        right = abs((face.along * np.conj(other.along)).real) <= max(ROUND_OFF, float(turn))
        size = float(np.ptp(model.cloud.points, axis=0).max())
        away = plane.height(as_complex(model.cloud.points)) * np.sign(
            plane.height(np.array(other.tip + face.along))
        )
        return plane if right and away.min() >= -ROUND_OFF * size and plane.reflects(model.kernel) else None
    return None


def _adjacent(
    model: BodyModel, face: Face, length: float, own: Collection[str]
) -> Iterator[tuple[str, Surface, Face]]:
    """The surface, not one of its ``own``, that begins or ends at the tip of a face of some ``length``, and
    its face there."""
    for name, surface in model.cloud.surfaces.items():
        if name not in own and not surface.curve.closed:
            ends = [_face(surface.curve, at) for at in (False, True)]
            other = min(ends, key=lambda end: abs(end.tip - face.tip))
            if abs(other.tip - face.tip) <= ROUND_OFF * length:
                yield name, surface, other


def _face(curve: Curve, at_end: bool) -> Face:
    """A boundary as a face of the corner at one of its ends."""
    arc = np.array([curve.length if at_end else 0.0])
    inward = -complex(as_complex(curve.normals(arc))[0])
    along = 1j * inward if at_end else -1j * inward
    return Face(complex(as_complex(curve.points(arc))[0]), along, inward, curve, at_end)


def _known(wedge: Wedge) -> bool:
    """Whether the fields of a corner with this angle are known."""
    inside = float(np.angle(wedge.other / wedge.along) * wedge.turn.imag) % (2.0 * np.pi)
    angle = inside * (2.0 if wedge.sliding else 1.0)
    # A straight outline is no corner; a wall at right angles is a symmetry line.
    straight = wedge.sliding and abs(angle - np.pi) <= ROUND_OFF
    blunt = BLUNTEST < angle < HOLLOW and not straight and not wedge.clamped
    isotropic = isinstance(wedge.kernel, Isotropic)
    sharpest = SHARPEST if isotropic else SHARPEST_ANISOTROPIC
    return sharpest <= inside <= angle <= WIDEST and not blunt and (isotropic or not wedge.sliding)


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
        if all_see(cloud, corner.tip + places, inward, center):
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


def _slides(other: complex, held: tuple[bool, bool] | None) -> bool:
    """Whether a face along the unit vector ``other``, x or y, is held in its normal direction only."""
    across = [abs(other.imag) > 1.0 - ROUND_OFF, abs(other.real) > 1.0 - ROUND_OFF]
    return held is not None and any(across) and list(held) == across


def _straight(curve: Curve) -> bool:
    """Whether a curve is a straight line."""
    ends = curve.points(np.array([0.0, curve.length]))
    straight = abs(float(np.hypot(*(ends[1] - ends[0]))) - curve.length) <= ROUND_OFF * curve.length
    return straight and not len(curve.corners)
