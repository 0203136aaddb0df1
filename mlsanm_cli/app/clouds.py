"""From a case's bodies to outlines, spacings and clouds."""

from __future__ import annotations

import math
from itertools import accumulate

from mlsanm_cli.app.foreign import foreign
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


def spacing_of(body: Body) -> Spacing:
    """The spacing field of a body whose nodes we place."""
    assert body.spacing is not None
    outline = outline_of(body)
    zones = []
    for refine in body.refine:
        if refine.at is not None:
            zones.append(Zone.around(refine.at, refine.spacing, refine.radius, refine.growth))
        else:
            curve = outline.curves[outline.names.index(str(refine.along).rpartition(".")[2])]
            zones.append(Zone(curve, refine.spacing, refine.radius, refine.growth))
    return Spacing(body.spacing, tuple(zones))


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
            spacing = spacing_of(body).with_zones(zones)
            placed[body.name] = build_cloud(outline_of(body), spacing, body.seed, memo=memo, line=line)
    return placed
