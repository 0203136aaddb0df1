"""Clouds and bodies made by hand for the tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.assembly import assemble
from mlsanm_cli.mechanics.body import BodyModel, ElasticBody
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic
from mlsanm_cli.operators.linear.cholesky import CholeskySolver
from mlsanm_cli.operators.settings import MlsSettings, Scheme

STEEL = isotropic(210.0, 0.3, "strain")
Field = Callable[[FloatArray], FloatArray]


def jittered_square(side: int, jitter: float = 0.25, seed: int = 0) -> Cloud:
    """A lattice of ``side`` x ``side`` nodes on the unit square, inner ones moved by ``jitter`` h."""
    h = 1.0 / (side - 1)
    x = np.linspace(0.0, 1.0, side)
    inner = np.stack(np.meshgrid(x[1:-1], x[1:-1]), axis=-1).reshape(-1, 2)
    inner += jitter * h * np.random.default_rng(seed).uniform(-1.0, 1.0, inner.shape)
    outline = rectangle((0.0, 1.0), (0.0, 1.0))
    surfaces, chain, first = {}, [], 0
    for name, curve in zip(outline.names, outline.curves, strict=True):
        s = np.linspace(0.0, curve.length, side)
        index = (first + np.arange(side)) % (4 * (side - 1))
        surfaces[name] = Surface(name, curve, index, s, curve.normals(s))
        chain.append(curve.points(s)[:-1])
        first += side - 1
    points = np.concatenate([*chain, inner])
    return Cloud(points, np.full(len(points), h), surfaces)


def build(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    degree: int = 2,
    material: PlaneMaterial = STEEL,
    held_nodes: tuple[tuple[int, int], ...] = (),
    scheme: Scheme = "least-squares",
) -> ElasticBody:
    """A factorised body on ``cloud``."""
    clamped = [surface for surface, components in held.items() if all(components)]
    model = BodyModel.build("body", cloud, material, MlsSettings(degree, scheme=scheme), clamped)
    return assemble(model, held, held_nodes, CholeskySolver())


def boundary_values(body: ElasticBody, displacement: Field, stress: Field) -> FloatArray:
    """Right-hand side (r,) with the tractions and displacements of an exact solution on every surface.

    ``displacement`` (n, 2) and ``stress`` (n, 3) are functions of position.
    """
    cloud = body.model.cloud
    source = np.zeros(body.rows)
    for name, surface in cloud.surfaces.items():
        at = cloud.points[surface.index]
        s, n = stress(at), surface.normal
        traction = np.stack(
            [s[:, 0] * n[:, 0] + s[:, 2] * n[:, 1], s[:, 2] * n[:, 0] + s[:, 1] * n[:, 1]], axis=1
        )
        source += body.source(name, traction, held=False) + body.source(name, displacement(at), held=True)
    return source


def with_body_force(body: ElasticBody, source: FloatArray, force: FloatArray) -> FloatArray:
    """The same right-hand side (r,) with div sigma = -``force`` (n, 2) at the nodes."""
    nodes = len(force)
    loaded = source.copy()
    loaded[:nodes] = -force[:, 0]
    loaded[nodes : 2 * nodes] = -force[:, 1]
    return loaded
