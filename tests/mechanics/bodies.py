"""Clouds and bodies made by hand for the tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cells import FINE, Halves
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Outline, Segment, rectangle
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic
from mlsanm_cli.operators.neighbors import MlsSettings

STEEL = isotropic(210.0, 0.3, "strain")
Field = Callable[[FloatArray], FloatArray]


def jittered_square(side: int, jitter: float = 0.25, seed: int = 0, size: float = 1.0) -> Cloud:
    """A lattice of ``side`` x ``side`` nodes on a square, inner ones moved by ``jitter`` h."""
    h = size / (side - 1)
    x = np.linspace(0.0, size, side)
    inner = np.stack(np.meshgrid(x[1:-1], x[1:-1]), axis=-1).reshape(-1, 2)
    inner += jitter * h * np.random.default_rng(seed).uniform(-1.0, 1.0, inner.shape)
    outline = rectangle((0.0, size), (0.0, size))
    surfaces, chain, first = {}, [], 0
    for name, curve in zip(outline.names, outline.curves, strict=True):
        s = np.linspace(0.0, curve.length, side)
        index = (first + np.arange(side)) % (4 * (side - 1))
        surfaces[name] = Surface(name, curve, index, s, curve.normals(s))
        chain.append(curve.points(s)[:-1])
        first += side - 1
    points = np.concatenate([*chain, inner])
    return Cloud(points, np.full(len(points), h), surfaces)


def polygon(corners: Sequence[tuple[float, float]], names: Sequence[str] = ()) -> Outline:
    """The outline through ``corners``, its sides called by ``names`` or their numbers."""
    sides = tuple(Segment(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
    return Outline(tuple(names or map(str, range(len(sides)))), sides)


def build(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    degree: int = 2,
    material: PlaneMaterial = STEEL,
    held_nodes: tuple[tuple[int, int], ...] = (),
) -> ElasticBody:
    """A factorised body on ``cloud``."""
    model = BodyModel.build("body", cloud, material, MlsSettings(degree))
    return assemble(model, held, held_nodes, "auto")


def solved(body: ElasticBody, source: FloatArray) -> FloatArray:
    """Displacements (N, 2) of all nodes for a right-hand side (r,)."""
    return body.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)


def boundary_values(body: ElasticBody, displacement: Field, stress: Field) -> FloatArray:
    """Right-hand side (r,) with the tractions and displacements of an exact solution on every surface.

    ``displacement`` (n, 2) and ``stress`` (n, 3) are functions of position.
    """
    cloud = body.model.cloud
    source = np.zeros(body.rows)
    for name, surface in cloud.surfaces.items():
        at, arc = cloud.points[surface.index], Halves.of(surface, FINE).arc
        traction = traction_of(stress(at), surface.normal)
        between = traction_of(stress(surface.curve.points(arc)), surface.curve.normals(arc))
        source += body.source(name, traction, held=False, between=between)
        source += body.source(name, displacement(at), held=True)
    return source


def with_body_force(body: ElasticBody, source: FloatArray, force: Field) -> FloatArray:
    """The same right-hand side (r,) and div sigma = -``force`` (n, 2), a function of position.

    Its force and moment on each piece are those of the function itself, not of its nodal values.
    """
    pieces, cloud = body.pieces, body.model.cloud
    loaded = body.force_source(force(cloud.points))
    mean = force(pieces.middle)
    exact = np.append((pieces.size[:, None] ** 2 * mean).T.ravel(), np.zeros(pieces.count))
    node, points, area = _fine_cells(cloud)
    for level in pieces.levels:
        values = area[:, None] * (force(points) - mean[level[node]])
        single = copy(pieces)
        single.levels = (level,)
        exact += single.gathered(node, points, values)
    loaded[body.rows - len(exact) :] = exact
    return source + loaded


def _fine_cells(cloud: Cloud) -> tuple[IntArray, FloatArray, FloatArray]:
    """Node (e,), place (e, 2) and area (e,) of quadrature over all cells, exact up to degree 6 where the
    outline is straight."""
    places, weights = np.polynomial.legendre.leggauss(4)
    u, v = (one.ravel() for one in np.meshgrid(0.5 + 0.5 * places, 0.5 + 0.5 * places))
    weight = 0.25 * np.outer(weights, weights).ravel() * u
    nodes, points, areas = [], [], []
    for turn in range(3):
        corners = np.roll(cloud.triangles, -turn, axis=1)
        a, center = cloud.points[corners[:, 0]], cloud.points[corners].mean(axis=1)
        for other in (1, 2):
            # The corner of the cell, half a side, the centroid; squares shrunk to triangles.
            one, two = 0.5 * (cloud.points[corners[:, other]] - a), center - a
            twice = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
            for x, y, part in zip(u * (1.0 - v), u * v, weight, strict=True):
                nodes.append(corners[:, 0])
                points.append(a + x * one + y * two)
                areas.append(part * twice)
    return np.concatenate(nodes), np.concatenate(points), np.concatenate(areas)
