"""Strain energy of a body, and integrals of products over its triangles and along its surfaces.

The solution comes from equations node by node and knows of no energy. That twice the strain energy is the
work of all that acts on a body is therefore a check of its own. The products integrated here are those of two
fields that are linear between the nodes, and integrated exactly: sums over nodal areas were 14 % off on a
thin beam with five nodes across.

Equation (19) of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.surface import Surface
from mlsanm_cli.mechanics.elasticity import stress_of
from mlsanm_cli.mechanics.material import PlaneMaterial
from mlsanm_cli.mechanics.rigid import rigid_pattern
from mlsanm_cli.operators.stencils import build_stencils

if TYPE_CHECKING:
    from mlsanm_cli.mechanics.body_model import BodyModel

MIN_MOTION = 1e-13
"""Rigid motions with less of a mean square than this part of a unit motion's are not seen, but round-off."""

MAX_STEPS = 500
EXTENSION_TOLERANCE = 1e-6
"""Tolerance of extensions of boundary values, or the result of so many steps: any smooth one suffices."""


TIP_SPACINGS = 3.0
"""Distance from a sharp corner, in spacings, within which the energy of triangles is that of fits. A bracket
with six nodes across lacks 10 % of its energy if stresses are linear in all of them."""
GAUSS_RULE = tuple(
    0.5 * (one + shift) for one, shift in zip(np.polynomial.legendre.leggauss(3), (1.0, 0.0), strict=True)
)
"""Gauss's points and weights between 0 and 1."""
TRIANGLE_POINTS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
"""Barycentric coordinates of points of triangles whose mean is exact for quadratics."""


def over_body(cloud: Cloud, first: FloatArray, second: FloatArray) -> float:
    """Integral of the product of two nodal fields (n, c), summed over their components c.

    On a triangle of area A it is A / 12 (sum_i a_i b_i + (sum_i a_i) (sum_i b_i)).
    """
    a, b = first[cloud.triangles], second[cloud.triangles]
    products = (a * b).sum(axis=(1, 2)) + (a.sum(axis=1) * b.sum(axis=1)).sum(axis=1)
    return float(_areas(cloud, cloud.triangles) @ products) / 12.0


def _areas(cloud: Cloud, triangles: IntArray) -> FloatArray:
    """Areas (t,) of ``triangles`` (t, 3)."""
    corners = cloud.points[triangles]
    (ux, uy), (vx, vy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.asarray(0.5 * (ux * vy - uy * vx))


def along_surface(surface: Surface, first: FloatArray, second: FloatArray) -> float:
    """Integral of the product of two fields (b, c) at a surface's nodes, summed over their components c.

    Between two nodes L apart it is L / 6 (2 a_0 b_0 + a_0 b_1 + a_1 b_0 + 2 a_1 b_1), as two Gauss points
    give it.
    """
    arc, a, b = surface.ends, first, second
    if surface.curve.closed:
        a, b = np.concatenate([a, a[:1]]), np.concatenate([b, b[:1]])
    same = (a * b).sum(axis=1)
    across = (a[:-1] * b[1:] + a[1:] * b[:-1]).sum(axis=1)
    return float(np.diff(arc) @ (2.0 * same[:-1] + across + 2.0 * same[1:])) / 6.0


def gradients(cloud: Cloud) -> tuple[FloatArray, FloatArray]:
    """Areas (t,) of the triangles, and gradients (t, 3, 2) of the linear functions of their corners."""
    a, b, c = (cloud.points[cloud.triangles[:, corner]] for corner in range(3))
    opposite = np.stack([c - b, a - c, b - a], axis=1)
    twice = opposite[:, 2, 0] * opposite[:, 0, 1] - opposite[:, 2, 1] * opposite[:, 0, 0]
    slopes = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=2) / twice[:, None, None]
    return 0.5 * twice, slopes


def inner_work(cloud: Cloud, stress: FloatArray, virtual: FloatArray) -> float:
    """Integral of nodal ``stress`` (n, 3) times the strain of a ``virtual`` displacement (n, 2), both linear
    on the triangles."""
    areas, slopes = gradients(cloud)
    by = np.einsum("tki,tkc->tic", slopes, virtual[cloud.triangles])
    strain = np.stack([by[:, 0, 0], by[:, 1, 1], by[:, 0, 1] + by[:, 1, 0]], axis=1)
    return float(areas @ (stress[cloud.triangles].mean(axis=1) * strain).sum(axis=1))


def extended(cloud: Cloud, values: FloatArray, known: BoolArray) -> FloatArray:
    """A smooth nodal field (n, 2) with the ``known`` (n, 2) of the ``values`` (n, 2).

    It is nearly harmonic, by conjugate gradients on the triangles, and 0 in a component with nothing known.
    """
    areas, slopes = gradients(cloud)
    entries = areas[:, None, None] * np.einsum("tki,tli->tkl", slopes, slopes)
    rows, columns = np.repeat(cloud.triangles, 3, axis=1).ravel(), np.tile(cloud.triangles, 3).ravel()
    count = len(cloud.points)
    matrix = sparse.csr_array((entries.ravel(), (rows, columns)), shape=(count, count))
    result = np.where(known, values, 0.0)
    for component in (0, 1):
        free = ~known[:, component]
        if free.all():
            continue
        field = result[:, component]
        rest = -np.where(free, matrix @ field, 0.0)
        way, size = rest.copy(), float(rest @ rest)
        enough = EXTENSION_TOLERANCE**2 * size
        for _ in range(MAX_STEPS):
            if size <= enough:
                break
            image = np.where(free, matrix @ way, 0.0)
            step = size / float(way @ image)
            field += step * way
            rest -= step * image
            before, size = size, float(rest @ rest)
            way = rest + size / before * way
    return result


def twice_strain_energy(cloud: Cloud, material: PlaneMaterial, stress: FloatArray) -> float:
    """Integral of stress times elastic strain, per unit thickness, for nodal ``stress`` (n, 3)."""
    return over_body(cloud, stress, stress @ np.linalg.inv(material.stiffness))


def energy_at_tips(model: BodyModel, displacement: FloatArray, stress: FloatArray) -> float:
    """What twice the strain energy of a ``displacement`` (n, 2) with nodal ``stress`` (n, 3) is more than
    :func:`twice_strain_energy` says, by the triangles around sharp corners: stresses that grow without bound
    there are not linear between nodes.

    They are those of fits, at Gauss's points of triangles collapsed to the corner nearest to the tip, where
    energies per area times the distance are nearly constant.
    """
    if model.tips is None:
        return 0.0
    around, away = _at_tips(model)
    own = model.cloud.triangles[around]
    own = np.take_along_axis(own, (away[own].argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    shares, weights = [], []
    for out, weight in zip(*GAUSS_RULE, strict=True):
        for across, other_weight in zip(*GAUSS_RULE, strict=True):
            shares.append([1.0 - out, out * (1.0 - across), out * across])
            weights.append(2.0 * out * weight * other_weight)
    return _beyond_linear(model, displacement, stress, own, np.array(shares), np.array(weights))


def energy_between_nodes(model: BodyModel, displacement: FloatArray, stress: FloatArray) -> float:
    """The same by all other triangles, with the stress of fits between the nodes. Fits beside the surface are
    poorer at nodes than between them: with four nodes across, energies were up to 5 % off without."""
    if len(model.nodes) > len(displacement):
        return 0.0
    own = model.cloud.triangles[~_at_tips(model)[0]]
    return _beyond_linear(model, displacement, stress, own, TRIANGLE_POINTS, np.full(3, 1.0 / 3.0))


def _at_tips(model: BodyModel) -> tuple[BoolArray, FloatArray]:
    """Which triangles (t,) are around sharp corners, and the distance (n,) of the nodes from these."""
    cloud, tips = model.cloud, model.tips
    if tips is None:
        return np.zeros(len(cloud.triangles), dtype=bool), np.full(len(cloud.points), np.inf)
    near = cloud.tree.query(tips.place)[1]
    away = np.hypot(*(cloud.points[:, None] - tips.place).transpose(2, 0, 1))
    around = (away <= TIP_SPACINGS * cloud.spacing[near]).any(axis=1)
    return around[cloud.triangles].any(axis=1), away.min(axis=1)


def _beyond_linear(
    model: BodyModel,
    displacement: FloatArray,
    stress: FloatArray,
    own: IntArray,
    shares: FloatArray,
    weights: FloatArray,
) -> float:
    """Twice the strain energy of triangles ``own`` (t, 3) with the stress of fits, at points with the
    ``shares`` (g, 3) of their corners and ``weights`` (g,), less that with linear stress.

    What stress is not that of fits, as of heat, is linear.
    """
    cloud, c = model.cloud, model.material.stiffness
    if model.material.nearly_incompressible:
        c = c - model.material.bulk_part
    compliance = np.linalg.inv(model.material.stiffness)
    linear = stress - stress_of(model.stencils.derivatives(displacement), c)
    total, areas = 0.0, _areas(cloud, own)
    for share, weight in zip(shares, weights, strict=True):
        points = np.einsum("k,tkc->tc", share, cloud.points[own])
        fits = build_stencils(
            model.nodes, model.tree, points, 1, model.settings, cloud.sight, tips=model.tips
        )
        here = stress_of(fits.derivatives(displacement), c) + np.einsum("k,tkc->tc", share, linear[own])
        total += weight * float(areas @ ((here @ compliance) * here).sum(axis=1))
    values = stress[own]
    products, sums = (values @ compliance * values).sum(axis=(1, 2)), values.sum(axis=1)
    return total - float(areas @ (products + (sums @ compliance * sums).sum(axis=1))) / 12.0


def rigid_part(cloud: Cloud, displacement: FloatArray, levels: Sequence[FloatArray]) -> FloatArray:
    """The rigid motion (n, 2) of the nodes that is nearest to their ``displacement`` (n, 2).

    ``levels`` are weights (n, 2) of the nodes' components: a later one decides only what those before it
    leave open. The mean over the whole body decides the rest.
    """
    size = float(np.ptp(cloud.points, axis=0).max())
    middle = cloud.areas @ cloud.points / cloud.areas.sum()
    center = (float(middle[0]), float(middle[1]))
    patterns = np.stack([rigid_pattern(cloud.points, center, axis).ravel() for axis in range(3)], axis=1)
    patterns[:, 2] /= size
    chosen, free = np.zeros(3), np.eye(3)
    for one in [*levels, np.repeat(cloud.areas[:, None], 2, axis=1)]:
        weight = one.ravel() / max(float(one.sum()), np.finfo(float).tiny)
        motions, missing = patterns @ free, displacement.ravel() - patterns @ chosen
        size_of, axes = np.linalg.eigh(motions.T @ (weight[:, None] * motions))
        decided = size_of > MIN_MOTION
        found = (axes.T @ (motions.T @ (weight * missing)))[decided] / size_of[decided]
        chosen = chosen + free @ (axes[:, decided] @ found)
        free = free @ axes[:, ~decided]
    return np.asarray((patterns @ chosen).reshape(-1, 2))
