"""Spacings and node clouds of the bodies of a case, and the line about which they are symmetric."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.conditions import conditions, prescribes
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.app.scene.contact_spacing import (
    bond_zones,
    clamped_zones,
    contact_zone,
    crack_zones,
    sharp_ends,
    strained_zone,
)
from mlsanm_cli.app.scene.default_spacing import (
    PER_THICKNESS,
    arc_zones,
    automatic_spacing,
    bends,
    leans,
    narrow_zones,
    root_zones,
)
from mlsanm_cli.app.scene.load_profiles import runs_of
from mlsanm_cli.app.scene.load_spacing import field_zones, load_zones
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.app.scene.outlines import drawn, geometry_of, imported_geometry
from mlsanm_cli.case import Body, Case, Place
from mlsanm_cli.case.model.shapes import Mesh, Points
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.loops import mirrored
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.roundoff import ROUND_OFF

FLOW_RATIO = 2.0
"""Automatic spacing of elastic bodies, of fits of degree 4, over that of bodies that flow, of degree 2."""


@lru_cache(maxsize=64)
def spacing_of(boundaries: Boundaries, body: Body) -> Spacing:
    """The spacing field of a body whose nodes are placed."""
    case, outline = boundaries.case, boundaries.drawn[body.name]
    far, zones = body.spacing, []
    if isinstance(far, str):
        finer = _finer(case, body)
        far = automatic_spacing(outline) / finer
        clamped = [
            curve
            for _, condition, place in conditions(case)
            if place.body == body.name and all(prescribes(condition))
            for curve in (run.part for run in runs_of(body.shape, place))
        ]
        alone = all(side.body != body.name for contact in case.contact for side in contact.sides)
        if not (alone or bends(outline) or leans(outline, clamped, materials(case)[body.material].stretch)):
            clamped = []  # under a contact the far ends of a bulky body matter little
        finite = case.model.strain == "finite"
        sides = _sides(boundaries)
        touching = [curve for both in sides.values() for place, curve, _ in both if place.body == body.name]
        zones = [
            *arc_zones(outline, far, finer),
            *root_zones(outline, far, None if finite else touching),
            *narrow_zones(outline, far, PER_THICKNESS * finer),
            *_contact_zones(boundaries, sides, body, far),
            *load_zones(case, body, far),
            *field_zones(case, body, far),
            *(zone for curve in clamped for zone in clamped_zones(curve, far, finite and not bends(outline))),
        ]
    for refine in body.refine:
        if refine.at is not None:
            zones.append(Zone.around(refine.at, refine.spacing, refine.radius, refine.growth))
        else:
            for number in outline.numbers(str(refine.along).rpartition(".")[2]):
                zones.append(Zone(outline.curves[number], refine.spacing, refine.radius, refine.growth))
    return Spacing(far, tuple(zones))


def _sides(boundaries: Boundaries) -> dict[str, list[tuple[Place, Curve, tuple[Curve, ...]]]]:
    """The slave and, if there is one, the master of every contact: place, curve, and the rest of the
    outline."""
    return {
        name: [(place, *boundaries.curve(place, key)) for place, key in boundaries.keyed(name)]
        for name in boundaries.sides
    }


def _contact_zones(
    boundaries: Boundaries,
    sides: Mapping[str, list[tuple[Place, Curve, tuple[Curve, ...]]]],
    body: Body,
    far: float,
) -> Iterator[Zone]:
    """Zones of finer nodes where contacts of a body are close to its other boundaries."""
    case = boundaries.case
    bonds = [contact.name for contact in case.contact if contact.bonded]
    bond_ends = {name: boundaries.bond_ends(name) for name in bonds}
    all_ends = [end for ends in bond_ends.values() for end in ends]
    for contact in case.contact:
        both = sides[contact.name]
        obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
        for (place, own, rest), (partner, other, _) in zip(both, both[::-1], strict=True):
            if place.body != body.name:
                continue
            if contact.bonded:
                yield from bond_zones(own, bond_ends[contact.name], min(far, _far(case, partner.body)))
                continue
            yield from contact_zone(rest, own, other if len(both) > 1 else None, obstacle, far)
            yield from crack_zones(both[0][1], all_ends)
            if case.model.strain == "finite":
                yield strained_zone(own, far)
            elif obstacle is not None:
                yield from sharp_ends(rest, own, obstacle, far)


def _far(case: Case, name: str) -> float:
    """The coarsest spacing of a body, infinite for nodes from a file."""
    body = next(body for body in case.body if body.name == name)
    if isinstance(body.spacing, float):
        return body.spacing
    return np.inf if body.has_nodes else automatic_spacing(drawn(body.shape)) / _finer(case, body)


def _finer(case: Case, body: Body) -> float:
    """Ratio by which the spacing of a body is finer than that of an isotropic elastic one: the geometric mean
    for fields that vary at different rates along the axes, and that for bodies that flow."""
    material = materials(case)[body.material]
    return math.sqrt(material.stretch) * (FLOW_RATIO if material.flows else 1.0)


def clouds(boundaries: Boundaries, zones: tuple[Zone, ...] = (), memo: Memo = NO_CACHE) -> dict[str, Cloud]:
    """Node clouds of all bodies of a case, refined in ``zones`` in addition to it, and symmetric about its
    line of symmetry where outline and spacing are."""
    placed, case, line = dict[str, Cloud](), boundaries.case, line_of(boundaries)
    for body in case.body:
        if isinstance(body.shape, Mesh | Points) and body.shape.has_nodes:
            cloud = boundaries.split(body.name, imported_geometry(body.shape).cloud)
            placed[body.name] = (mirrored(cloud, line) if line is not None else None) or cloud
        else:
            spacing = spacing_of(boundaries, body).with_zones(zones)
            wanted = [support.near for support in case.support if support.body == body.name and support.near]
            placed[body.name] = build_cloud(
                boundaries.outline(body.name), spacing, body.seed, memo=memo, line=line, wanted=wanted
            )
    if case.model.revolved:
        return {name: replace(cloud, revolved=True) for name, cloud in placed.items()}
    return placed


def line_of(boundaries: Boundaries) -> SymmetryLine | None:
    """The symmetry line of all bodies, None if there is none or if they are bodies of revolution. Not used
    with friction: there asymmetric errors cancel in part, and results are better."""
    case = boundaries.case
    if case.model.revolved or any(contact.friction for contact in case.contact):
        return None
    if any(isinstance(body.shape, Mesh | Points) and not body.has_nodes for body in case.body):
        return None
    shapes = [geometry_of(body.shape) for body in case.body]
    size = max(shape.size for shape in shapes)
    for axis in (0, 1):
        line = SymmetryLine(axis, shapes[0].centre[axis])
        same = max(abs(shape.centre[axis] - line.at) for shape in shapes) <= ROUND_OFF * size
        if same and all(_is_symmetric(boundaries, body, line, size) for body in case.body):
            return line
    return None


def _is_symmetric(boundaries: Boundaries, body: Body, line: SymmetryLine, size: float) -> bool:
    """Whether the spacing of a body, or its nodes from a file, are symmetric about a ``line``."""
    if not isinstance(body.shape, Mesh | Points):
        return spacing_of(boundaries, body).symmetric(line)
    nodes = imported_geometry(body.shape).points
    return line.images(nodes, np.full(len(nodes), size / np.sqrt(len(nodes)))) is not None
