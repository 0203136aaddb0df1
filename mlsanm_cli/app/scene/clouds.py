"""Spacings and node clouds of the bodies of a case."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.contact_pairs import shape_of
from mlsanm_cli.app.scene.default_spacing import (
    GROWTH,
    NODAL_BAND,
    NODAL_GROWTH,
    NODAL_RATIO,
    PER_THICKNESS,
    arc_zones,
    automatic_spacing,
    bends,
    bond_zones,
    clamped_zones,
    contact_zone,
    crack_zones,
    leans,
)
from mlsanm_cli.app.scene.load_profiles import runs_of
from mlsanm_cli.app.scene.load_spacing import field_zones, load_zones
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.app.scene.narrow_parts import narrow_zones, sharp_ends
from mlsanm_cli.app.scene.outlines import drawn, imported_geometry, numbers_of
from mlsanm_cli.app.scene.roots import root_zones
from mlsanm_cli.case import Body, Case, Contact, Displacement, Place, Platen
from mlsanm_cli.case.model.shapes import Mesh, Points
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.curves import Curve
from mlsanm_cli.cloud.loops import mirrored
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.memo import NO_CACHE, Memo


def spacing_of(case: Case, boundaries: Boundaries, body: Body) -> Spacing:
    """The spacing field of a body whose nodes are placed."""
    outline = boundaries.drawn[body.name]
    far, zones = body.spacing, []
    if isinstance(far, str):
        finer = _finer(case, body)
        far = automatic_spacing(outline) / finer
        clamped = [one for place in _clamped(case, body.name) for _, _, one in runs_of(body.shape, place)]
        alone = all(side.body != body.name for contact in case.contact for side in contact.sides)
        if not (alone or bends(outline) or leans(outline, clamped, materials(case)[body.material].stretch)):
            clamped = []  # under a contact the far ends of a bulky body matter little
        finite = case.model.strain == "finite" and not bends(outline)
        sides = [side for contact in case.contact for side in _sides(boundaries, contact)]
        touching = [curve for place, curve, _ in sides if place.body == body.name]
        zones = [
            *arc_zones(outline, far, finer),
            *root_zones(outline, far, GROWTH, None if case.model.strain == "finite" else touching),
            *narrow_zones(outline, far, PER_THICKNESS * finer, GROWTH),
            *_contact_zones(case, boundaries, body, far),
            *load_zones(case, body, far),
            *field_zones(case, body, far),
            *(zone for curve in clamped for zone in clamped_zones(curve, far, finite)),
        ]
    for refine in body.refine:
        if refine.at is not None:
            zones.append(Zone.around(refine.at, refine.spacing, refine.radius, refine.growth))
        else:
            for number in numbers_of(outline, str(refine.along).rpartition(".")[2]):
                zones.append(Zone(outline.curves[number], refine.spacing, refine.radius, refine.growth))
    return Spacing(far, tuple(zones))


def _clamped(case: Case, body: str) -> Iterator[Place]:
    """The sides of a body on which both displacements are prescribed."""
    given: list[Place | None] = [one.place for one in case.support if None not in (one.ux, one.uy)]
    for load in case.load:
        if isinstance(load, Displacement) and None not in load.components:
            given.append(load.place)
        elif isinstance(load, Platen) and {"x", "y"} <= set(load.control):
            given += load.places
    for place in given:
        if place is not None and place.body == body:
            yield place


def _sides(boundaries: Boundaries, contact: Contact) -> list[tuple[Place, Curve, tuple[Curve, ...]]]:
    """The slave and, if there is one, the master of a contact: place, curve, and the rest of the outline."""
    roles = zip(("slave", "master"), boundaries.sides[contact.name], strict=False)
    return [(place, *boundaries.curve(place, f"contact.{contact.name}.{role}")) for role, place in roles]


def _contact_zones(case: Case, boundaries: Boundaries, body: Body, far: float) -> Iterator[Zone]:
    """Zones of finer nodes where contacts of a body are close to its other boundaries."""
    bonds = (contact.name for contact in case.contact if contact.bonded)
    bond_ends = [end for name in bonds for end in boundaries.bond_ends(name)]
    for contact in case.contact:
        sides = _sides(boundaries, contact)
        obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
        for (place, own, rest), (partner, other, _) in zip(sides, sides[::-1], strict=True):
            if place.body != body.name:
                continue
            if contact.bonded:
                ends = boundaries.bond_ends(contact.name)
                yield from bond_zones(own, ends, min(far, _far(case, partner.body)))
                continue
            facing = other if len(sides) > 1 else None
            yield from contact_zone(rest, own, facing, obstacle, far)
            yield from crack_zones(sides[0][1], bond_ends)
            if case.model.strain == "finite":
                fine = far / NODAL_RATIO
                yield Zone(own, fine, NODAL_BAND * fine, NODAL_GROWTH)
            elif obstacle is not None:
                yield from sharp_ends(rest, own, obstacle, far)


def _far(case: Case, name: str) -> float:
    """The coarsest spacing of a body, infinite for nodes from a file."""
    body = next(one for one in case.body if one.name == name)
    if isinstance(body.spacing, float):
        return body.spacing
    return np.inf if body.has_nodes else automatic_spacing(drawn(body.shape)) / _finer(case, body)


def _finer(case: Case, body: Body) -> float:
    """Ratio by which the spacing of a body is finer than that of an isotropic one: the geometric mean for
    fields that vary at different rates along the axes."""
    return math.sqrt(materials(case)[body.material].stretch)


def clouds(
    case: Case, zones: tuple[Zone, ...] = (), memo: Memo = NO_CACHE, line: SymmetryLine | None = None
) -> dict[str, Cloud]:
    """Node clouds of all bodies, refined in ``zones`` in addition to the case, and symmetric about ``line``
    where outline and spacing are."""
    placed, boundaries = {}, Boundaries.of(case)
    for body in case.body:
        if isinstance(body.shape, Mesh | Points) and body.shape.has_nodes:
            cloud = boundaries.split(body.name, imported_geometry(body.shape).cloud)
            placed[body.name] = (mirrored(cloud, line) if line is not None else None) or cloud
        else:
            spacing = spacing_of(case, boundaries, body).with_zones(zones)
            wanted = [support.near for support in case.support if support.body == body.name and support.near]
            placed[body.name] = build_cloud(
                boundaries.outline(body.name), spacing, body.seed, memo=memo, line=line, wanted=wanted
            )
    return placed
