"""Strain energy of a body, and integrals of products over its triangles and along its surfaces.

The strong form does not use energy: that twice the strain energy is the work of all external forces is an
independent check. Equation (30) of docs/method.md."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cells import GAUSS, TRIANGLE_POINTS
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import twice_area
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import strain_of, stress_of
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.rigid import ROTATION, RigidBodyModes, motions_of
from mlsanm_cli.roundoff import FINE_ROUND_OFF

MAX_STEPS, EXTENSION_TOLERANCE = 500, 1e-5
"""Step limit and relative residual of the extension of boundary values."""
TIP_RADIUS = 3.0
"""Triangles within this many spacings of a reentrant corner are integrated with fitted stresses."""
MIN_THERMAL_SHARE = 0.1
"""Energies below this part of that of fully restrained expansion are not checked; free expansion has none."""


def least_thermal_energy(model: BodyModel, degrees: FloatArray) -> float:
    """Energy below which that of a body with temperature changes ``degrees`` (n,) is not checked."""
    free, stiffness = model.material.expansion, model.material.stiffness
    blocked = float(model.cloud.volumes @ degrees**2) * float(free @ stiffness @ free)
    return MIN_THERMAL_SHARE * blocked


def over_body(
    cloud: Cloud, first: FloatArray, second: FloatArray, triangles: IntArray | None = None
) -> float:
    """Integral over the body, or ``triangles`` (t, 3), of the product of two nodal fields (n, c)."""
    own = cloud.triangles if triangles is None else triangles
    a, b, around = (one[own] for one in (first, second, cloud.around(cloud.points)))
    products = np.einsum("ijk,ti,tjc,tkc->t", _TRIPLE, around, a, b, optimize=True)
    return 0.5 * float(twice_area(*np.moveaxis(cloud.points[own], 1, 0)) @ products)


_TRIPLE = np.array(
    [[[(6.0, 2.0, 1.0)[len({i, j, k}) - 1] for k in range(3)] for j in range(3)] for i in range(3)]
)
_TRIPLE /= 60.0
"""Means of products of three of a triangle's linear shape functions."""


def along_surface(surface: Surface, first: FloatArray, second: FloatArray) -> float:
    """Integral of the product of two fields (b, c) at a surface's nodes, summed over components. Between two
    nodes at distance L: L / 6 (2 a_0 b_0 + a_0 b_1 + a_1 b_0 + 2 a_1 b_1)."""
    arc, a, b = surface.ends, first, second
    if surface.curve.closed:
        a, b = np.concatenate([a, a[:1]]), np.concatenate([b, b[:1]])
    same = (a * b).sum(axis=1)
    across = (a[:-1] * b[1:] + a[1:] * b[:-1]).sum(axis=1)
    return float(np.diff(arc) @ (2.0 * same[:-1] + across + 2.0 * same[1:])) / 6.0


def gradients(cloud: Cloud) -> tuple[FloatArray, FloatArray]:
    """Areas (t,) of the triangles, and gradients (t, 3, 2) of their linear shape functions."""
    a, b, c = np.moveaxis(cloud.points[cloud.triangles], 1, 0)
    opposite, twice = np.stack([c - b, a - c, b - a], axis=1), twice_area(a, b, c)
    slopes = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2) / twice[:, None, None]
    return 0.5 * twice, slopes


def inner_work(cloud: Cloud, stress: FloatArray, virtual: FloatArray) -> float:
    """Integral of nodal ``stress`` (n, 3) times the strain of a ``virtual`` displacement (n, 2)."""
    areas, slopes = gradients(cloud)
    by, middle = np.einsum("tki,tkc->tic", slopes, virtual[cloud.triangles]), cloud.points[cloud.triangles]
    derivatives = np.concatenate([virtual[cloud.triangles].mean(axis=1)[:, None], by], axis=1)
    strain = strain_of(derivatives, cloud.radius(middle.mean(axis=1)))
    product = (stress[cloud.triangles].mean(axis=1) * strain).sum(axis=1)
    return float(areas @ (cloud.around(middle.mean(axis=1)) * product))


def extended(cloud: Cloud, values: FloatArray, known: BoolArray) -> FloatArray:
    """A nearly harmonic nodal field (n, 2) with the ``values`` (n, 2) where ``known``; 0 if nothing is
    known."""
    areas, slopes = gradients(cloud)
    entries = areas[:, None, None] * np.einsum("tki,tli->tkl", slopes, slopes)
    rows, columns = np.repeat(cloud.triangles, 3, axis=1).ravel(), np.tile(cloud.triangles, 3).ravel()
    count = len(cloud.points)
    matrix = sparse.csr_array((entries.ravel(), (rows, columns)), shape=(count, count))
    result = np.where(known, values, 0.0)
    for component in (0, 1):
        free = np.flatnonzero(~known[:, component])
        if len(free) < count:
            rest = -(matrix @ result[:, component])[free]
            # Importing scipy's conjugate gradients takes longer.
            inner, found, left, direction = matrix[free][:, free], np.zeros(len(free)), rest.copy(), rest
            square = first = float(left @ left)
            for _ in range(MAX_STEPS):
                if square <= EXTENSION_TOLERANCE**2 * first:
                    break
                image = inner @ direction
                length = square / float(direction @ image)
                found += length * direction
                left -= length * image
                last, square = square, float(left @ left)
                direction = left + square / last * direction
            result[free, component] = found
    return result


def twice_strain_energy(cloud: Cloud, material: PlaneMaterial, stress: FloatArray) -> float:
    """Integral of nodal ``stress`` (n, 3) times elastic strain."""
    return over_body(cloud, stress, stress @ np.linalg.inv(material.stiffness))


def energy_at_tips(model: BodyModel, displacement: FloatArray, stress: FloatArray) -> float:
    """Correction of :func:`twice_strain_energy` by the triangles around reentrant corners, where stress is
    singular: fitted stresses at the Gauss points of triangles collapsed to the corner nearest to the tip,
    where the integrand times the distance is nearly constant."""
    around, away = _at_tips(model)
    own = model.cloud.triangles[around]
    own = np.take_along_axis(own, (away[own].argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    rule = [
        ([1.0 - out, out * (1.0 - across), out * across], 2.0 * out * weight * other_weight)
        for (out, weight), (across, other_weight) in product(GAUSS[3], repeat=2)
    ]
    return _beyond_linear(model, displacement, stress, own, rule)


def energy_between_nodes(model: BodyModel, displacement: FloatArray, stress: FloatArray) -> float:
    """The same correction by all other triangles: near the surface fits are better between nodes."""
    own = model.cloud.triangles[~_at_tips(model)[0]]
    rule = [(share, 1.0 / 3.0) for share in TRIANGLE_POINTS.tolist()]
    return _beyond_linear(model, displacement, stress, own, rule)


def _at_tips(model: BodyModel) -> tuple[BoolArray, FloatArray]:
    """Mask (t,) of the triangles around reentrant corners, and distance (n,) of the nodes from these."""
    cloud, tips = model.cloud, model.tips
    if tips is None:
        return np.zeros(len(cloud.triangles), dtype=bool), np.full(len(cloud.points), np.inf)
    near = cloud.tree.query(tips.place)[1]
    away = np.hypot(*(cloud.points[:, None] - tips.place).transpose(2, 0, 1))
    around = (away <= TIP_RADIUS * cloud.spacing[near]).any(axis=1)
    return around[cloud.triangles].any(axis=1), away.min(axis=1)


def _beyond_linear(
    model: BodyModel,
    displacement: FloatArray,
    stress: FloatArray,
    own: IntArray,
    rule: Sequence[tuple[Sequence[float], float]],
) -> float:
    """Twice the strain energy of triangles ``own`` (t, 3) with fitted stress, minus that with linear stress,
    by a ``rule`` of barycentric shares and weights. Stress that is not from fits is linear."""
    if not len(own):
        return 0.0
    cloud, c = model.cloud, model.material.stiffness
    if model.material.nearly_incompressible:
        c = c - model.material.bulk_part
    compliance = np.linalg.inv(model.material.stiffness)
    linear = stress - stress_of(model.stencils.derivatives(displacement), c, model.stencils.radius)
    total, areas = 0.0, 0.5 * twice_area(*np.moveaxis(cloud.points[own], 1, 0))
    for share, weight in rule:
        points = np.einsum("k,tkc->tc", share, cloud.points[own])
        fitted = stress_of(model.stencils_at(points, 1).derivatives(displacement), c, cloud.radius(points))
        here = fitted + np.einsum("k,tkc->tc", share, linear[own])
        total += weight * float((areas * cloud.around(points)) @ ((here @ compliance) * here).sum(axis=1))
    return total - over_body(cloud, stress @ compliance, stress, own)


def rigid_part(cloud: Cloud, displacement: FloatArray, levels: Sequence[FloatArray]) -> FloatArray:
    """The rigid motion (n, 2) closest to the nodal ``displacement`` (n, 2), by weights (n, 2), ``levels`` in
    order of priority: each decides what earlier ones leave undetermined, the mean over the body the rest."""
    size = float(np.ptp(cloud.points, axis=0).max())
    middle, motions = cloud.areas @ cloud.points / cloud.areas.sum(), motions_of(cloud)
    patterns = RigidBodyModes((float(middle[0]), float(middle[1])), motions).patterns(cloud.points)
    patterns[:, [motion == ROTATION for motion in motions]] /= size
    chosen, free = np.zeros(len(motions)), np.eye(len(motions))
    for one in [*levels, np.repeat(cloud.volumes[:, None], 2, axis=1)]:
        weight = one.ravel() / max(float(one.sum()), np.finfo(float).tiny)
        moving, missing = patterns @ free, displacement.ravel() - patterns @ chosen
        size_of, axes = np.linalg.eigh(moving.T @ (weight[:, None] * moving))
        decided = size_of > FINE_ROUND_OFF
        found = (axes.T @ (moving.T @ (weight * missing)))[decided] / size_of[decided]
        chosen = chosen + free @ (axes[:, decided] @ found)
        free = free @ axes[:, ~decided]
    return np.asarray((patterns @ chosen).reshape(-1, 2))
