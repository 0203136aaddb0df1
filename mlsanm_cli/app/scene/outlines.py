"""The outline of the shape of a body, its named pieces, and boundaries as consecutive pieces; meshes and
point clouds are read once per content."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Body, Geometry, Place
from mlsanm_cli.case.model import shapes
from mlsanm_cli.case.model.shapes import AnyShape, FileShape, Mesh, Points
from mlsanm_cli.cloud import drawing
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline, annulus, disk, half_disk, rectangle, sector
from mlsanm_cli.cloud.elements import boundary_loops
from mlsanm_cli.cloud.loops import TaggedNodes, cloud_of_nodes, tagged_loops, trace
from mlsanm_cli.cloud.membership import first_crossing
from mlsanm_cli.cloud.surface import BoundaryRun
from mlsanm_cli.errors import CaseError, CaseProblem, GeometryError, RunError
from mlsanm_cli.inputs import MB, read_input
from mlsanm_cli.io.meshes import read_mesh, read_points
from mlsanm_cli.records import dataclass

MAX_BYTES = 256 * MB
"""Largest file of a body: a million nodes or more."""
BOX_SAMPLES = 33
"""Points on a curve by which its bounding box is known."""


@lru_cache(maxsize=256)
def drawn(shape: AnyShape) -> Outline:
    """The outline of a shape: closed loops of named curves, "name/1" and so on for several pieces of a name.
    Raises GeometryError for shapes that are not the closed boundary of a body."""
    match shape:
        case shapes.Rectangle(x=x, y=y):
            return rectangle(x, y)
        case shapes.Disk(center=center, radius=radius):
            return disk(center, radius)
        case shapes.HalfDisk(center=center, radius=radius, side=side):
            return half_disk(center, radius, side)
        case shapes.Annulus(center=center, radii=radii):
            return annulus(center, radii)
        case shapes.Sector(center=center, radii=radii, angles=(first, last)):
            return sector(center, radii, (math.radians(first), math.radians(last)))
        case Mesh() | Points():
            return imported_geometry(shape).outline
        case shapes.Polygon():
            outer = drawing.polygon(shape.points, shape.names, shape.rounding, shape.corners)
        case _:
            targets, curves = [side.to for side in shape.sides], [side.points for side in shape.sides]
            outer = drawing.closed_chain(shapes.side_names(shape), targets, curves)
    named = zip(shapes.hole_names(shape), shape.holes, strict=True)
    holes = [(name, hole.center, hole.radius) for name, hole in named]
    return drawing.with_holes(outer, holes, "points" if isinstance(shape, shapes.Polygon) else "sides")


def run_of(outlines: Mapping[str, Outline], place: Place, key: str) -> BoundaryRun:
    """The pieces of a place in the outline of its body as drawn. Raises CaseError if they do not join."""
    outline = outlines[place.body]
    chains = outline.chains(outline.numbers(*place.edges))
    if len(chains) == 1:
        return BoundaryRun(outline, *chains[0], place.ends)
    names = [dict.fromkeys(outline.names[k].partition("/")[0] for k in chain) for chain, _ in chains]
    *groups, last = (f'"{"+".join(some)}"' for some in names)
    message = f"{', '.join(groups)} and {last} do not join end to end"
    hint = "the pieces of one surface are consecutive along the outline"
    raise CaseError((CaseProblem(key, message, hint=hint),))


@dataclass(frozen=True, eq=False)
class ImportedGeometry:
    """The nodes ``points`` (n, 2) of a body, its traced outline, and ``normals`` (n, 2) if given."""

    digest: str
    points: FloatArray
    outline: Outline
    normals: FloatArray | None

    @cached_property
    def cloud(self) -> Cloud:
        """The cloud of the nodes of the file."""
        return cloud_of_nodes(self.points, self.outline, self.normals)


def imported_geometry(shape: FileShape) -> ImportedGeometry:
    """The body in a shape's file. Raises GeometryError, whose message begins with the file's name."""
    path = Path(shape.file)
    try:
        content = read_input(path, MAX_BYTES)
    except RunError as error:
        raise GeometryError(error.message, error.hint) from error
    digest = hashlib.sha256(content).hexdigest()
    try:
        if not content:
            raise GeometryError("it is empty")
        if shape.sha256 not in (None, digest):
            raise GeometryError("it has changed since the case was resolved", "remove sha256 to use it")
        return _read(shape.model_copy(update={"sha256": digest}))
    except GeometryError as error:
        raise GeometryError(f"{path.name}: {error.message}", error.hint) from error


def given_nodes(body: Body) -> ImportedGeometry | None:
    """The geometry of a body whose nodes are those of its file, None for others."""
    if isinstance(body.shape, Mesh | Points) and body.has_nodes:
        return imported_geometry(body.shape)
    return None


@lru_cache(maxsize=16)
def _read(shape: FileShape) -> ImportedGeometry:
    path, normals = Path(shape.file), None
    if isinstance(shape, Mesh):
        mesh = read_mesh(path, shape.group)
        points = mesh.points
        loops = boundary_loops(points, mesh.rings, mesh.lines, mesh.names, mesh.node_sets)
    else:
        nodes = TaggedNodes(*read_points(path))
        points, normals = nodes.points, nodes.normals
        loops = tagged_loops(nodes)
    chains = [points[loop.nodes] for loop in loops]
    crossing = first_crossing(np.vstack([np.hstack([p, np.roll(p, -1, axis=0)]) for p in chains]))
    if crossing is not None:
        raise GeometryError(f"the outline crosses itself near ({crossing[0]:.6g}, {crossing[1]:.6g})")
    outline = trace(points, loops, math.radians(shape.corner))
    return ImportedGeometry(str(shape.sha256), points, outline, normals)


def geometry_of(shape: AnyShape) -> Geometry:
    """The geometry of a shape for the checks of a case. Raises GeometryError."""
    outline, digest = drawn(shape), ""
    if isinstance(shape, Mesh | Points):
        body = imported_geometry(shape)
        points, digest = body.points, body.digest
    else:
        points = np.concatenate([c.points(np.linspace(0.0, c.length, BOX_SAMPLES)) for c in outline.curves])
    names = tuple(dict.fromkeys(name.partition("/")[0] for name in outline.names))
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = (0.5 * (low + high)).tolist()
    return Geometry(names, (x, y), float((high - low).max()), float(low[0]), digest)
