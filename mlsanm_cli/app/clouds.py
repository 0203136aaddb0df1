"""From a case's bodies to outlines, spacings and clouds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import accumulate

from mlsanm_cli.app.contacts import shape_of
from mlsanm_cli.app.foreign import foreign
from mlsanm_cli.app.usual_spacing import arc_zones, contact_zone, usual_spacing
from mlsanm_cli.case.base import split_boundary
from mlsanm_cli.case.chains import Piece, Side
from mlsanm_cli.case.files import Mesh, Points
from mlsanm_cli.case.model import Body, Case
from mlsanm_cli.case.polygon import Polygon
from mlsanm_cli.case.round_shapes import Annulus, HalfDisk, Sector
from mlsanm_cli.case.shapes import Rectangle
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.curves import Arc, Curve, Outline, Segment, annulus, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.mirror import Line
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.memo import AFRESH, Memo


def outline_of(body: Body) -> Outline:
    """The body's closed loops of named curves."""
    shape = body.shape
    if isinstance(shape, Rectangle):
        return rectangle(shape.x, shape.y)
    if isinstance(shape, HalfDisk):
        return half_disk(shape.center, shape.radius, shape.side)
    if isinstance(shape, Sector):
        first, last = (math.radians(angle) for angle in shape.angles)
        return sector(shape.center, shape.radii, (first, last))
    if isinstance(shape, Annulus):
        return annulus(shape.center, shape.radii)
    if isinstance(shape, Mesh | Points):
        return foreign(shape).traced.outline
    if isinstance(shape, Polygon):
        chain = [piece for loop in shape.loops for piece in loop]
        ends = accumulate(len(loop) for loop in shape.loops[:-1])
        return Outline(tuple(piece.name for piece in chain), tuple(map(_curve, chain)), (0, *ends))
    return disk(shape.center, shape.radius)


def _curve(piece: Piece) -> Curve:
    if isinstance(piece, Side):
        return Segment(piece.start, piece.end)
    return Arc(piece.center, piece.radius, piece.start, piece.sweep)


def spacing_of(case: Case, body: Body) -> Spacing:
    """The spacing field of a body whose nodes we place."""
    outline = outline_of(body)
    far, zones = body.spacing, []
    if isinstance(far, str):
        far = usual_spacing(outline)
        zones = [*arc_zones(outline, far), *_contact_zones(case, body, outline, far)]
    for refine in body.refine:
        if refine.at is not None:
            zones.append(Zone.around(refine.at, refine.spacing, refine.radius, refine.growth))
        else:
            curve = outline.curves[outline.names.index(str(refine.along).rpartition(".")[2])]
            zones.append(Zone(curve, refine.spacing, refine.radius, refine.growth))
    return Spacing(far, tuple(zones))


def _contact_zones(case: Case, body: Body, outline: Outline, far: float) -> Iterator[Zone]:
    """Finer nodes where a body's contacts are close to others of its boundaries."""
    bodies = {other.name: other for other in case.body}
    for contact in case.contact:
        sides = [split_boundary(boundary) for boundary in contact.boundaries]
        curves = [_curve_of(outline_of(bodies[owner]), name) for owner, name in sides]
        obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
        for (owner, _), own, other in zip(sides, curves, curves[::-1], strict=True):
            if owner == body.name:
                yield from contact_zone(outline, own, other if len(sides) > 1 else None, obstacle, far)


def _curve_of(outline: Outline, name: str) -> Curve:
    return outline.curves[outline.names.index(name)]


def clouds(
    case: Case, zones: tuple[Zone, ...] = (), memo: Memo = AFRESH, line: Line | None = None
) -> dict[str, Cloud]:
    """Node clouds of all bodies, refined in ``zones`` beyond what the case says, and about a ``line`` their
    own mirror images where outline and spacing are."""
    placed = {}
    for body in case.body:
        if isinstance(body.shape, Mesh | Points) and body.shape.brings_nodes:
            placed[body.name] = foreign(body.shape).cloud
        else:
            spacing = spacing_of(case, body).with_zones(zones)
            placed[body.name] = build_cloud(outline_of(body), spacing, body.seed, memo=memo, line=line)
    return placed
