"""Stencils reproduce polynomials on every cloud they accept, and say so where they cannot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.operators.neighbors import MlsSettings
from mlsanm_cli.operators.stencil_weights import Stencils
from mlsanm_cli.operators.stencils import build_stencils
from tests.mechanics.bodies import STEEL

KINDS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
# Twenty times what was measured; a Cholesky factorisation of the moments would leave 1e-8 at degree 6.
TOLERANCE = {1: 1e-13, 2: 5e-13, 3: 2e-12, 4: 5e-12, 5: 2e-11, 6: 5e-11}


def lattice(side: int, jitter: float = 0.0) -> FloatArray:
    """A lattice of ``side`` x ``side`` nodes in the unit square, moved by up to ``jitter`` spacings."""
    x = np.linspace(0.0, 1.0, side)
    points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    move = np.random.default_rng(0).uniform(-jitter, jitter, points.shape) / (side - 1)
    return points + move


def graded() -> FloatArray:
    """A cloud whose spacing grows from 0.002 to 0.2."""
    spacing = Spacing(0.2, (Zone.around((0.3, 1.0), 0.002, 0.01, 0.12),))
    return build_cloud(rectangle((-1.5, 1.5), (-1.0, 1.0)), spacing, 0).points


CLOUDS = {
    "lattice": lattice(17),
    "jitter 0.2": lattice(17, 0.2),
    "jitter 0.4": lattice(17, 0.4),
    "1:100": graded(),
}


def largest_error(points: FloatArray, targets: FloatArray, stencils: Stencils, degree: int) -> float:
    """Largest error of the derivatives of all monomials about a target, in units of its radius."""
    owner = np.repeat(np.arange(len(targets)), np.diff(stencils.indptr))
    local = points[stencils.indices] - targets[owner]
    radius = np.maximum.reduceat(np.hypot(*local.T), stencils.indptr[:-1])
    local /= radius[owner][:, None]
    worst = 0.0
    for column, (dx, dy) in enumerate(KINDS):
        weights = stencils.weights[:, column] * radius[owner] ** (dx + dy)
        for i in range(degree + 1):
            for j in range(degree + 1 - i):
                terms = weights * local[:, 0] ** i * local[:, 1] ** j
                got = np.add.reduceat(terms, stencils.indptr[:-1])
                exact = math.factorial(i) * math.factorial(j) if (i, j) == (dx, dy) else 0.0
                worst = max(worst, float(np.abs(got - exact).max()))
    return worst


@pytest.mark.parametrize("degree", range(1, 7))
@pytest.mark.parametrize("cloud", CLOUDS)
def test_polynomials_and_their_derivatives_are_exact(cloud: str, degree: int) -> None:
    points = CLOUDS[cloud]
    settings = MlsSettings(degree)
    stencils = build_stencils(points, cKDTree(points), points, 2, settings)
    assert largest_error(points, points, stencils, degree) <= TOLERANCE[degree]
    assert stencils.worst_ratio >= settings.rank_tolerance
    # The degree is no higher than asked for: the next monomial is not reproduced.
    assert degree == 6 or largest_error(points, points, stencils, degree + 1) > 1e-3


def test_rank_check_enlarges_the_stencils_of_an_exact_lattice() -> None:
    points = CLOUDS["lattice"]
    tree = cKDTree(points)
    assert build_stencils(points, tree, points, 2, MlsSettings(6)).enlarged > 0
    stencils = build_stencils(points, tree, points, 2, MlsSettings(6, neighbors=30))
    assert stencils.enlarged > 0
    sizes = np.diff(stencils.indptr)
    assert sizes.min() >= 30
    assert sizes.max() > 30
    assert largest_error(points, points, stencils, 6) <= 5e-11
    jittered = CLOUDS["jitter 0.4"]
    plain = build_stencils(jittered, cKDTree(jittered), jittered, 2, MlsSettings(2))
    assert plain.enlarged == 0
    assert (np.diff(plain.indptr) == 16).all()


def test_enlarged_stencils_stay_with_their_targets() -> None:
    # A lattice on the left, a jittered cloud on the right: only some stencils grow.
    left, right = lattice(14), lattice(14, 0.4) + np.array([1.2, 0.0])
    points = np.concatenate([left, right])
    stencils = build_stencils(points, cKDTree(points), points, 2, MlsSettings(6, neighbors=34))
    sizes = np.diff(stencils.indptr)
    assert 0 < stencils.enlarged < len(points)
    assert (sizes > 34).sum() == stencils.enlarged
    assert largest_error(points, points, stencils, 6) <= 1e-9


def test_a_place_that_cannot_carry_the_degree_is_named() -> None:
    side = np.linspace(0.0, 1.0, 60)
    strip = np.stack(np.meshgrid(side, [0.0, 0.01, 0.02]), axis=-1).reshape(-1, 2)
    settings = MlsSettings(4)
    target = np.array([[0.25, 0.01]])
    with pytest.raises(NumericalError, match=r"around \(0\.25, 0\.01\) .* degree 4"):
        build_stencils(strip, cKDTree(strip), target, 2, settings)
    assert build_stencils(strip, cKDTree(strip), target, 2, MlsSettings(2)).worst_ratio > 0.0


def test_a_body_of_too_few_nodes_is_refused() -> None:
    points = lattice(3)
    with pytest.raises(NumericalError, match="body of 9 nodes"):
        build_stencils(points, cKDTree(points), points, 2, MlsSettings(4))


@pytest.mark.parametrize("count", [80, 82])
def test_fields_of_other_nodes_are_refused(count: int) -> None:
    points = lattice(9)
    stencils = build_stencils(points, cKDTree(points), points[:3], 1, MlsSettings())
    with pytest.raises(ValueError, match=f"a field of {count} nodes for stencils of 81"):
        stencils.derivatives(np.zeros((count, 2)))


@pytest.mark.parametrize("scale", [0.0, 1e-310])
def test_nodes_that_no_radius_separates_are_refused(scale: float) -> None:
    points = scale * lattice(9)
    with pytest.raises(NumericalError, match=r"the nodes around \(0, 0\)"):
        build_stencils(points, cKDTree(points), points[:1], 1, MlsSettings())


@pytest.mark.parametrize("degree", [1, 2, 4])
@pytest.mark.parametrize("line", [SymmetryLine(0, 0.0), SymmetryLine(1, 0.0)])
def test_stencils_are_their_own_images_and_reproduce_polynomials(line: SymmetryLine, degree: int) -> None:
    cloud = build_cloud(rectangle((-1.0, 1.0), (-0.5, 0.5)), Spacing(0.12), 0, line=line)
    model, mirror = BodyModel.build("body", cloud, STEEL, MlsSettings(degree)), cloud.mirror
    assert mirror is not None
    field = np.random.default_rng(0).normal(size=(len(cloud.points), 1))
    found = model.stencils.derivatives(field)
    reflected = model.stencils.derivatives(field[mirror.image])[mirror.image, :, 0]
    np.testing.assert_allclose(
        reflected * mirror.derivative_signs(found.shape[1]), found[:, :, 0], atol=1e-8 * np.abs(found).max()
    )
    x, y = cloud.points.T
    for p, q in [(p, total - p) for total in range(degree + 1) for p in range(total + 1)]:
        values = model.stencils.derivatives((x**p * y**q)[:, None])[:, :3, 0]
        dx, dy = p * x ** max(p - 1, 0) * y**q, q * x**p * y ** max(q - 1, 0)
        assert np.abs(values - np.stack([x**p * y**q, dx, dy], axis=1)).max() <= 1e-9
