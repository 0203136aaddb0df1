"""The size function and the node cloud of every body, and the line about which they are symmetric."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.condition_sizes import CONDITION_SOURCES
from mlsanm_cli.app.scene.outlines import geometry_of, given_nodes
from mlsanm_cli.app.scene.sizes import OUTLINE_SOURCES, Domain
from mlsanm_cli.case import Body
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.roundoff import ROUND_OFF

MIN_SPACING = 2.0**-14
"""Least spacing relative to that far away: with 6e-6 of it factors lose their digits."""


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
                    size = max(zone.spacing, MIN_SPACING * far)
                    zones.append(Zone(zone.curve, size, zone.radius, zone.growth))
    for refine in body.refine:
        if refine.at is not None:
            zones.append(Zone.around(refine.at, refine.spacing, refine.radius, refine.growth))
        else:
            outline = boundaries.drawn[body.name]
            for number in outline.numbers(str(refine.along).rpartition(".")[2]):
                zones.append(Zone(outline.curves[number], refine.spacing, refine.radius, refine.growth))
    return Spacing(far, tuple(zones))


def clouds(boundaries: Boundaries, zones: tuple[Zone, ...] = (), memo: Memo = NO_CACHE) -> dict[str, Cloud]:
    """Node clouds of all bodies of a case, refined in ``zones`` in addition to it, and symmetric about its
    line of symmetry where outline and spacing are."""
    placed, case, line = dict[str, Cloud](), boundaries.case, line_of(boundaries)
    for body in case.body:
        given = given_nodes(body)
        if given is not None:
            cloud = boundaries.split(body.name, given.cloud)
            placed[body.name] = (cloud.mirrored(line) if line is not None else None) or cloud
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
