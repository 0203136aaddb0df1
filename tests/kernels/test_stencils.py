"""Moving least-squares weights against a slow twin made of numpy's own least squares."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.kernels.radial import cubic_rows
from mlsanm_cli.kernels.stencils import mls_weights
from mlsanm_cli.mechanics.near_field import Isotropic, SurfaceForces, summed

SHARPNESS = 4.0
SIZES = {1: 9, 2: 16, 3: 24, 4: 34, 5: 46, 6: 60}
TOLERANCE = {1: 1e-12, 2: 1e-12, 3: 1e-11, 4: 1e-10, 5: 1e-9, 6: 1e-8}
KINDS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]


def nearest_of_lattice(size: int, jitter: float, seed: int) -> FloatArray:
    """The ``size`` nodes nearest to the origin of a lattice of spacing 1, each moved by up to ``jitter``."""
    side = np.arange(-6.0, 7.0)
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    points += np.random.default_rng(seed).uniform(-jitter, jitter, points.shape)
    return points[np.argsort(np.hypot(*points.T), kind="stable")[:size]]


def fast(
    points: FloatArray, center: FloatArray, target: FloatArray, degree: int, order: int
) -> tuple[FloatArray, float]:
    """Weights (k, kinds) and ratio from the kernel, the stencil being all ``points``."""
    weights, ratio = np.empty((len(points), (order + 1) * (order + 2) // 2)), np.empty(1)
    stencil = np.array([0, len(points)]), np.arange(len(points))
    radius = np.array([np.hypot(*(points - center).T).max()])
    at = center[None], target[None], radius
    mls_weights(points, *stencil, *at, degree, SHARPNESS, 0, order, weights, ratio)
    return weights, float(ratio[0])


def slow(points: FloatArray, center: FloatArray, target: FloatArray, degree: int, order: int) -> FloatArray:
    """The same from the definition: derivatives of the best-fitting polynomial, term by term."""
    radius = np.hypot(*(points - center).T).max()
    local, at = (points - center) / radius, (target - center) / radius
    gauss = np.exp(-SHARPNESS * (local**2).sum(axis=1))
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    basis = np.stack([local[:, 0] ** i * local[:, 1] ** j for i, j in powers], axis=1)
    fit = np.linalg.lstsq(gauss[:, None] * basis, np.diag(gauss), rcond=None)[0]
    columns = []
    for dx, dy in KINDS[: (order + 1) * (order + 2) // 2]:
        functional = [
            math.perm(i, dx) * math.perm(j, dy) * at[0] ** max(i - dx, 0) * at[1] ** max(j - dy, 0)
            for i, j in powers
        ]
        columns.append(np.array(functional) @ fit / radius ** (dx + dy))
    return np.stack(columns, axis=1)


@given(
    degree=st.integers(1, 6),
    order=st.integers(0, 2),
    jitter=st.floats(0.05, 0.4),
    seed=st.integers(0, 10_000),
    scale=st.sampled_from([1.0, 1e-3, 1e4]),
    off=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)
def test_weights_are_those_of_the_weighted_least_squares_fit(
    degree: int, order: int, jitter: float, seed: int, scale: float, off: tuple[float, float]
) -> None:
    points = scale * nearest_of_lattice(SIZES[degree], jitter, seed)
    center, target = np.zeros(2), scale * np.array(off)
    weights, ratio = fast(points, center, target, degree, order)
    expected = slow(points, center, target, degree, order)
    assert ratio > 10.0 ** -(degree + 2)
    # Second derivatives of a straight line are zero: weights and expected ones alike.
    size = np.maximum(np.abs(expected).max(axis=0), np.finfo(float).tiny)
    assert (np.abs(weights - expected).max(axis=0) / size).max() <= TOLERANCE[degree]


def test_several_targets_of_one_stencil_have_their_weights_beside_each_other() -> None:
    points = nearest_of_lattice(40, 0.3, 5)
    indptr, indices = np.array([0, 20, 40]), np.concatenate([np.arange(20), np.arange(5, 25)])
    centers = np.array([[0.0, 0.0], [0.3, -0.2]])
    targets = np.random.default_rng(1).uniform(-0.5, 0.5, (6, 2))
    radii, ratio = np.array([4.0, 5.0]), np.empty(2)
    together = np.empty((40, 6))
    mls_weights(points, indptr, indices, centers, targets, radii, 2, SHARPNESS, 1, 1, together, ratio)
    for number in range(3):
        alone, own = np.empty((40, 6)), np.empty(2)
        some = targets[number::3].copy()
        mls_weights(points, indptr, indices, centers, some, radii, 2, SHARPNESS, 0, 2, alone, own)
        # First derivatives only.
        found = together[:, 2 * number : 2 * number + 2]
        np.testing.assert_allclose(found, alone[:, 1:3], rtol=0.0, atol=1e-13)
        assert np.array_equal(ratio, own)


def test_sums_are_those_of_the_fields_of_all_forces() -> None:
    random = np.random.default_rng(0)
    place, z = (random.normal(size=n) + 1j * random.normal(size=n) for n in (7, 5))
    forces = SurfaceForces(Isotropic(1.3, 1.8), place, np.exp(1j * random.normal(size=7)), 0.3 + 0.1j)
    force = random.normal(size=(7, 2, 3))
    total = np.einsum("ekcd,kdm->ecm", forces.displacement(z), force)
    assert summed(forces.displacement, z, force) == pytest.approx(total, abs=1e-13)


def test_interpolation_is_the_polynomial_through_four_rows() -> None:
    table = np.random.default_rng(0).normal(size=(9, 3))
    at = np.array([1.0, 1.3, 2.0, 4.6, 5.999, 6.0])
    expected = [
        np.polynomial.Polynomial.fit(rows, column[rows], 3)(x)
        for x in at
        for rows in [np.arange(min(int(x), 5) - 1, min(int(x), 5) + 3)]
        for column in table.T
    ]
    assert cubic_rows(table, at).ravel() == pytest.approx(expected, abs=1e-12)
    ends = cubic_rows(table, np.array([-3.0, 0.5, 8.0, np.nan]))
    assert ends[:3] == pytest.approx(cubic_rows(table, np.array([1.0, 1.0, 6.0])))
    assert np.isnan(ends[3]).all()
