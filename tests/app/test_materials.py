"""Orthotropic and expanding materials in whole runs, against solutions that the method reproduces exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.blocks import BOTTOM, CLAMP, HEAT, LEFT, PINS, STEEL, WOOD, Result, block, traction
from tests.app.scenes import Quiet


def compliance_in_space() -> FloatArray:
    """Of the wood, in the order 11, 22, 33, 12 along its own axes."""
    e1, e2, e3, g = 120.0, 9.0, 5.0, 7.0
    a, b, c = -0.4 / e1, -0.3 / e1, -0.45 / e2
    return np.array([[1 / e1, a, b, 0], [a, 1 / e2, c, 0], [b, c, 1 / e3, 0], [0, 0, 0, 1 / g]])


def strain_of_wood(stress: tuple[float, float, float], plane: str) -> tuple[FloatArray, float]:
    """Strain tensor (2, 2) in x and y under a plane stress xx, yy, xy, and sigma_zz, by turning tensors."""
    angle = np.radians(30.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    xx, yy, xy = stress
    own = turn.T @ np.array([[xx, xy], [xy, yy]]) @ turn
    s = compliance_in_space()
    vector = np.array([own[0, 0], own[1, 1], 0.0, own[0, 1]])
    if plane == "strain":
        vector[2] = -(s[2, :2] @ vector[:2]) / s[2, 2]
    e = s @ vector
    strain = np.array([[e[0], 0.5 * e[3]], [0.5 * e[3], e[1]]])
    return turn @ strain @ turn.T, float(vector[2])


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("stress", [(10.0, 0.0, 0.0), (0.0, 0.0, 4.0), (3.0, -2.0, 1.0)])
def test_orthotropic_block_under_even_stress(
    plane: str, stress: tuple[float, float, float], tmp_path: Path
) -> None:
    xx, yy, xy = stress
    sides = {"right": (xx, xy), "left": (-xx, -xy), "top": (xy, yy), "bottom": (-xy, -yy)}
    loads = "".join(traction(side, *value) for side, value in sides.items())
    found = Result(block(PINS, loads, material=WOOD, plane=plane), tmp_path / "run")
    strain, zz = strain_of_wood(stress, plane)
    # The pins leave the rotation that keeps (2, 0) at its height.
    gradient = strain + strain[0, 1] * np.array([[0.0, 1.0], [-1.0, 0.0]])
    expected = found.points @ gradient.T
    assert np.abs(found.displacement - expected).max() <= 1e-9 * np.abs(expected).max()
    assert np.abs(found.stress - stress).max() <= 1e-9 * np.abs(stress).max()
    tensor = np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, zz]])
    deviator = tensor - np.trace(tensor) / 3.0 * np.eye(3)
    np.testing.assert_allclose(found.von_mises, np.sqrt(1.5 * (deviator**2).sum()), rtol=1e-9)


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize("material", [STEEL, WOOD])
def test_free_expansion(plane: str, material: str, tmp_path: Path) -> None:
    found = Result(block(PINS, HEAT, material=material, plane=plane), tmp_path / "run")
    if material == STEEL:
        strain = 5e-3 * np.eye(2) * (1.25 if plane == "strain" else 1.0)
    else:
        # Stress across the plane that alone keeps the third axis from expanding.
        s = compliance_in_space()
        own = 5.0 * np.array([1e-3, 4e-3, 6e-3])
        if plane == "strain":
            own = own - own[2] / s[2, 2] * s[2, :3]
        turn = np.array([[np.sqrt(0.75), -0.5], [0.5, np.sqrt(0.75)]])
        strain = turn @ np.diag(own[:2]) @ turn.T
    gradient = strain + strain[0, 1] * np.array([[0.0, 1.0], [-1.0, 0.0]])
    expected = found.points @ gradient.T
    assert np.abs(found.displacement - expected).max() <= 1e-8 * np.abs(expected).max()
    assert np.abs(found.stress).max() <= 1e-8 * 200.0 * 5e-3
    across = {"stress": 0.0, "strain": 200.0 * 5e-3 if material == STEEL else 5.0 * 5.0 * 6e-3}[plane]
    np.testing.assert_allclose(found.von_mises, across, atol=1e-8)
    assert found.summary["force_balance"] <= 1e-8


@pytest.mark.parametrize("scheme", ["least-squares", "ghost"])
def test_a_clamped_bar_that_is_heated(scheme: str, tmp_path: Path) -> None:
    right = '[[support]]\nboundary = "block.right"\nux = 0.0\n'
    found = Result(
        block(LEFT, right, BOTTOM, HEAT, plane="stress"), tmp_path / "run", f'mls.scheme="{scheme}"'
    )
    # E alpha dT = 1.
    assert np.abs(found.stress - [-1.0, 0.0, 0.0]).max() <= 1e-8
    np.testing.assert_allclose(found.forces["block.left"], [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.forces["block.right"], [-1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.forces["heat"], [0.0, 0.0], atol=0.0)
    assert found.summary["force_balance"] <= 1e-9


def test_a_heated_block_that_is_clamped_on_one_side(tmp_path: Path) -> None:
    # No force acts on it, and what the clamp exerts next to what would block all expansion is round-off.
    found = Result(block(CLAMP, HEAT, plane="stress"), tmp_path / "run", "body.block.spacing=0.1")
    assert found.summary["force_balance"] <= 1e-6


def test_a_plane_stiffness_in_plane_strain_leaves_von_mises_open(tmp_path: Path) -> None:
    full = "stiffness = [[5.0, 1.2, 0.7], [1.2, 3.0, -0.4], [0.7, -0.4, 2.0]]"
    case, console = tmp_path / "run.toml", Quiet()
    case.write_text(block(PINS, traction("top", 0.0, 4.0), traction("bottom", 0.0, -4.0), material=full))
    run(case, out=tmp_path / "run", console=console)
    assert any("von Mises stresses are nan" in warning for warning in console.warnings)
    fields = read_run(tmp_path / "run").states[-1].bodies["block"]
    assert np.isnan(fields["von_mises"]).all()
    assert np.abs(fields["stress"] - [0.0, 4.0, 0.0]).max() <= 1e-9
    assert plot(tmp_path / "run")


def test_hertz_on_an_orthotropic_block(tmp_path: Path) -> None:
    wood = "{E1=300e3, E2=60e3, E3=100e3, G12=40e3, nu12=0.3, nu13=0.3, nu23=0.25, angle=30.0}"
    # E' by the roots of the characteristic equation (tests/mechanics/test_half_plane.py); a = 0.05.
    together = 1.0 / (1.0 / 99489.2 + 0.91 / 210e3)
    force = 0.25 * np.pi * together * 0.05**2
    overrides = (
        f"material.wood={wood}",
        'body.block.material="wood"',
        'contact.interface.regularization.law="exact"',
        f"load.press.force=[0.0, {-force!r}]",
    )
    case = Path(__file__).parents[2] / "cases" / "hertz.toml"
    summary = run(case, overrides=overrides, out=tmp_path / "run", console=Quiet())
    contact = summary["contacts"]["interface"]
    assert contact["peak_pressure"] == pytest.approx(2.0 * force / (np.pi * 0.05), rel=0.003)
    # Nodes are 0.0005 apart.
    assert contact["half_width"] == pytest.approx(0.05, rel=0.007)
    assert contact["reference"]["pressure_error_l2"] <= 0.008
    assert contact["reference"]["half_width"] == pytest.approx(0.05, rel=1e-5)
