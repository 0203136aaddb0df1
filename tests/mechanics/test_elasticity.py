"""Stress, traction and equilibrium rows on displacement fields with known answers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import XX, XY, YY, equilibrium_rows, stress_rows, traction_rows
from mlsanm_cli.mechanics.material import anisotropic
from mlsanm_cli.operators.settings import MlsSettings
from mlsanm_cli.operators.stencils import build_stencils
from tests.mechanics.bodies import STEEL, jittered_square

CLOUD = jittered_square(9, 0.4)
POINTS = CLOUD.points
MODEL = BodyModel.build("body", CLOUD, STEEL, MlsSettings(2))
FULL = np.array([[5.0, 1.2, 0.7], [1.2, 3.0, -0.4], [0.7, -0.4, 2.0]])
"""A stiffness with every entry at work."""

small = st.floats(-2.0, 2.0)


@given(a=small, b=small, angle=small)
def test_rigid_motions_give_no_stress(a: float, b: float, angle: float) -> None:
    u = np.stack([a - angle * POINTS[:, 1], b + angle * POINTS[:, 0]], axis=1)
    assert np.abs(MODEL.stress(u)).max() <= 1e-10


@settings(max_examples=20)
@given(gradient=st.lists(small, min_size=4, max_size=4), degree=st.integers(1, 6))
def test_uniform_stress_is_exact(gradient: list[float], degree: int) -> None:
    g = np.array(gradient).reshape(2, 2)
    model = BodyModel.build("body", CLOUD, anisotropic(FULL, "stress"), MlsSettings(degree))
    expected = FULL @ np.array([g[0, 0], g[1, 1], g[0, 1] + g[1, 0]])
    assert np.abs(model.stress(POINTS @ g.T) - expected).max() <= 1e-10


@given(normal=st.floats(0.0, 6.3), gradient=st.lists(small, min_size=4, max_size=4))
def test_tractions_are_the_stress_on_the_normal(normal: float, gradient: list[float]) -> None:
    n = np.array([np.cos(normal), np.sin(normal)])
    u = (POINTS @ np.array(gradient).reshape(2, 2)).ravel()
    xx, yy, xy = (stress_rows(MODEL.stencils, FULL, a) @ u for a in (XX, YY, XY))
    normals = np.tile(n, (len(POINTS), 1))
    t_x, t_y = (traction_rows(MODEL.stencils, FULL, normals, c) @ u for c in (0, 1))
    assert t_x == pytest.approx(xx * n[0] + xy * n[1], abs=1e-10)
    assert t_y == pytest.approx(xy * n[0] + yy * n[1], abs=1e-10)


@given(coefficients=st.lists(small, min_size=6, max_size=6))
def test_equilibrium_rows_are_the_divergence_of_the_stress(coefficients: list[float]) -> None:
    # u_i = c_i0 x^2 + c_i1 x y + c_i2 y^2 has strains linear in x and y, with these gradients.
    c = np.array(coefficients).reshape(2, 3)
    x, y = POINTS.T
    u = (np.stack([x**2, x * y, y**2], axis=1) @ c.T).ravel()
    strain_x = np.array([2.0 * c[0, 0], c[1, 1], c[0, 1] + 2.0 * c[1, 0]])
    strain_y = np.array([c[0, 1], 2.0 * c[1, 2], 2.0 * c[0, 2] + c[1, 1]])
    stress_x, stress_y = FULL @ strain_x, FULL @ strain_y
    expected = (stress_x[XX] + stress_y[XY], stress_x[XY] + stress_y[YY])
    for component in (0, 1):
        rows = equilibrium_rows(MODEL.stencils, FULL, component)
        assert rows @ u == pytest.approx(expected[component], abs=1e-9)


def test_values_between_the_nodes() -> None:
    targets = np.random.default_rng(0).uniform(0.0, 1.0, (40, 2))
    u = np.stack([POINTS[:, 0] ** 2 - POINTS[:, 1], POINTS[:, 0] * POINTS[:, 1]], axis=1)
    on_x, on_y = (MODEL.values_along(targets, np.tile(axis, (len(targets), 1))) for axis in np.eye(2))
    assert on_x @ u.ravel() == pytest.approx(targets[:, 0] ** 2 - targets[:, 1], abs=1e-12)
    assert on_y @ u.ravel() == pytest.approx(targets[:, 0] * targets[:, 1], abs=1e-12)


def test_first_order_stencils_are_enough_for_stresses() -> None:
    stencils = build_stencils(POINTS, cKDTree(POINTS), POINTS, 1, MlsSettings(2))
    for a in (XX, YY, XY):
        difference = stress_rows(stencils, FULL, a) - stress_rows(MODEL.stencils, FULL, a)
        assert abs(difference).max() == 0.0
