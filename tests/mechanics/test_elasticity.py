"""Stress, traction and equilibrium rows on displacement fields with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import rectangle
from mlsanm_cli.cloud.spacing import Spacing, build_cloud
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.energy import (
    along_surface,
    energy_between_nodes,
    extended,
    inner_work,
    over_body,
    rigid_part,
    twice_strain_energy,
)
from mlsanm_cli.mechanics.material import PlaneMaterial, isotropic, orthotropic
from mlsanm_cli.operators.neighbors import MlsSettings

LENGTH, HEIGHT = 4.0, 1.0
STEEL = isotropic(200.0, 0.3, "stress")
WOOD = orthotropic((120.0, 9.0, 5.0), (0.4, 0.3, 0.45), 7.0, 0.5, "strain")


@pytest.fixture(scope="module")
def cloud() -> Cloud:
    return build_cloud(rectangle((0.0, LENGTH), (0.0, HEIGHT)), Spacing(0.25), 0)


@pytest.mark.parametrize("material", [STEEL, WOOD])
def test_uniform_stress(cloud: Cloud, material: PlaneMaterial) -> None:
    stress = np.array([3.0, -1.0, 0.5])
    expected = LENGTH * HEIGHT * stress @ np.linalg.solve(material.stiffness, stress)
    nodal = np.tile(stress, (len(cloud.points), 1))
    assert twice_strain_energy(cloud, material, nodal) == pytest.approx(expected, rel=1e-12)
    # A tenth more of stress is a fifth more of energy.
    assert twice_strain_energy(cloud, material, 1.1 * nodal) == pytest.approx(1.21 * expected, rel=1e-12)


def test_bending_stress(cloud: Cloud) -> None:
    # Five nodes across: sums over nodal areas are 14 % off. On straight edges linear stress is exact.
    stress = np.zeros((len(cloud.points), 3))
    stress[:, 0] = cloud.points[:, 1] - 0.5 * HEIGHT
    exact = LENGTH * HEIGHT**3 / 12.0 / 200.0
    assert twice_strain_energy(cloud, STEEL, stress) == pytest.approx(exact, rel=1e-12)
    strain = stress @ np.linalg.inv(STEEL.stiffness)
    assert abs(cloud.areas @ (stress * strain).sum(axis=1) / exact - 1.0) > 0.05


def test_energy_between_nodes(cloud: Cloud) -> None:
    # u = (x y^2, 0), which fits of degree 3 have as it is.
    model = BodyModel.build("body", cloud, STEEL, MlsSettings(3))
    (x, y), c = cloud.points.T, STEEL.stiffness
    u = np.stack([x * y**2, 0.0 * x], axis=1)
    stress = model.stress(u)
    exact = c[0, 0] * LENGTH * HEIGHT**5 / 5.0 + c[2, 2] * 4.0 * LENGTH**3 * HEIGHT**3 / 9.0
    linear = twice_strain_energy(cloud, STEEL, stress) - exact
    more = energy_between_nodes(model, u, stress)
    assert abs(linear) > 2e-3 * exact
    assert abs(linear + more) < 0.1 * abs(linear)


def test_products_of_linear_fields(cloud: Cloud) -> None:
    x, y = cloud.points.T
    first, second = np.stack([x, 1.0 - y], axis=1), np.stack([y, x + y], axis=1)
    # x y + (1 - y) (x + y) = x + y - y^2.
    exact = LENGTH * HEIGHT * (LENGTH / 2.0 + HEIGHT / 2.0 - HEIGHT**2 / 3.0)
    assert over_body(cloud, first, second) == pytest.approx(exact, rel=1e-12)
    top = cloud.surfaces["top"]
    along = x[top.index, None]
    assert along_surface(top, along, along) == pytest.approx(LENGTH**3 / 3.0, rel=1e-12)


def test_work_of_stress_on_a_linear_field_is_exact(cloud: Cloud) -> None:
    x, y = cloud.points.T
    stress = np.stack([1.0 + y, x, 2.0 - x], axis=1)
    virtual = np.stack([0.3 * x + 0.1 * y, 0.2 * x - 0.4 * y], axis=1)
    expected = LENGTH * HEIGHT * (0.3 * (1.0 + HEIGHT / 2.0) - 0.2 * LENGTH + 0.3 * (2.0 - LENGTH / 2.0))
    assert inner_work(cloud, stress, virtual) == pytest.approx(expected, rel=1e-12)


def test_a_rigid_motion_is_all_rigid(cloud: Cloud) -> None:
    x, y = cloud.points.T
    motion = np.stack([0.1 - 0.3 * y, -0.2 + 0.3 * x], axis=1)
    np.testing.assert_allclose(rigid_part(cloud, motion, []), motion, atol=1e-13)


def test_what_is_held_decides_a_rigid_motion_first(cloud: Cloud) -> None:
    x, _ = cloud.points.T
    bent = np.stack([np.zeros_like(x), x**2], axis=1)
    left = np.zeros_like(bent)
    left[cloud.surfaces["left"].index] = 1.0
    np.testing.assert_allclose(rigid_part(cloud, bent, [left]), 0.0, atol=1e-12)
    # A roller says nothing of motion along it: that is the body's own, on the whole.
    left[:, 1] = 0.0
    found = rigid_part(cloud, bent, [left])
    np.testing.assert_allclose(found[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(found[:, 1], (cloud.areas @ bent[:, 1]) / cloud.areas.sum(), atol=1e-12)


def test_an_extension_keeps_what_is_known(cloud: Cloud) -> None:
    known = np.zeros_like(cloud.points, dtype=bool)
    known[cloud.surfaces["left"].index] = known[cloud.surfaces["right"].index] = True
    values = np.stack([cloud.points[:, 0], np.full(len(cloud.points), 0.7)], axis=1)
    found = extended(cloud, values, known)
    np.testing.assert_array_equal(found[known], values[known])
    # Linear functions are harmonic, on any triangles.
    np.testing.assert_allclose(found, values, atol=1e-4)
