"""Node clouds of the bodies of a case, and the line about which they are symmetric."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.condition_sizes import spacing_of
from mlsanm_cli.app.scene.outlines import geometry_of, imported_geometry
from mlsanm_cli.case import Body
from mlsanm_cli.case.model.shapes import Mesh, Points
from mlsanm_cli.cloud.cloud import Cloud, build_cloud
from mlsanm_cli.cloud.loops import mirrored
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.cloud.spacing import Zone
from mlsanm_cli.memo import NO_CACHE, Memo
from mlsanm_cli.roundoff import ROUND_OFF


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
