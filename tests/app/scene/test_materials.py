"""Orthotropic and expanding materials in whole runs, against solutions in closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.results.probe import probe_named, probe_point
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from tests.app.blocks import CLAMP, HEAT, PINS, STEEL, WOOD, Result, block, traction
from tests.app.runs import warned
from tests.app.scenes import EXACT_LAW, Quiet
from tests.case_text import Scene, heat, pin, support


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
def test_free_expansion(plane: str, material: dict[str, Any], tmp_path: Path) -> None:
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
    assert abs(found.summary["energy_error"]) <= 1e-6
    assert found.summary["force_balance"] <= 1e-8


def test_a_heated_block_that_is_clamped(tmp_path: Path) -> None:
    # No force acts on it, and what the clamp exerts next to what would block all expansion is round-off.
    text = block(CLAMP, HEAT, plane="stress", spacing=0.1)
    assert Result(text, tmp_path / "one").summary["force_balance"] <= 1e-6
    between = Result(text.support("block.right", ux=0.0), tmp_path / "both")
    assert abs(between.summary["energy_error"]) <= 0.03


def test_a_plane_stiffness_in_plane_strain_leaves_von_mises_open(tmp_path: Path) -> None:
    full = {"stiffness": [[5.0, 1.2, 0.7], [1.2, 3.0, -0.4], [0.7, -0.4, 2.0]]}
    pulled = block(PINS, traction("top", 0.0, 4.0), traction("bottom", 0.0, -4.0), material=full)
    found = Result(pulled, tmp_path / "run")
    assert "plane_stiffness" in warned(found.summary)
    assert np.isnan(found.von_mises).all()
    assert np.abs(found.stress - [0.0, 4.0, 0.0]).max() <= 1e-9
    assert plot(tmp_path / "run")


def test_hertz_on_an_orthotropic_block(tmp_path: Path) -> None:
    wood = "{E1=300e3, E2=60e3, E3=100e3, G12=40e3, nu12=0.3, nu13=0.3, nu23=0.25, angle=30.0}"
    # E' by the roots of the characteristic equation (tests/mechanics/test_material.py); a = 0.05.
    together = 1.0 / (1.0 / 99489.2 + 0.91 / 210e3)
    force = 0.25 * np.pi * together * 0.05**2
    overrides = (
        f"material.wood={wood}",
        'body.block.material="wood"',
        EXACT_LAW,
        f"load.press.force=[0.0, {-force!r}]",
    )
    case = Path(__file__).parents[3] / "cases" / "hertz.toml"
    summary = run(case, overrides=overrides, out=tmp_path / "run", console=Quiet())
    contact = summary["contacts"]["interface"]
    assert contact["peak_pressure"] == pytest.approx(2.0 * force / (np.pi * 0.05), rel=0.003)
    # Nodes are 0.0005 apart.
    assert contact["half_width"] == pytest.approx(0.05, rel=0.007)
    assert contact["reference"]["pressure_error_l2"] <= 0.008
    assert contact["reference"]["half_width"] == pytest.approx(0.05, rel=1e-5)


E, NU, ALPHA = 200.0, 0.25, 1e-3
ROUND = pin("block", [1.0, 0.0], ux=0.0, uy=0.0).pin("block", [-1.0, 0.0], uy=0.0)


def field(temperature: str) -> Scene:
    return heat("heat", "block", temperature)


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_free_body_under_a_linear_field_bends_without_stress(degree: int, tmp_path: Path) -> None:
    text = block(PINS, field("3 + 10*x - 4*y"), plane="stress")
    found = Result(text, tmp_path / "run", f"mls.degree={degree}")
    assert found.summary["force_balance"] <= 1e-9
    if degree == 1:
        # Bending is no polynomial of degree 1.
        return
    assert np.abs(found.stress).max() <= 1e-7 * E * ALPHA * 23.0
    x, y = found.points.T
    u = 3.0 * x + 5.0 * x**2 - 4.0 * x * y - 5.0 * y**2
    v = 3.0 * y - 2.0 * y**2 + 10.0 * x * y + 2.0 * x**2
    # The pins hold both lower corners: a rotation lowers the right one.
    turn = -4.0
    expected = ALPHA * np.stack([u - turn * y, v + turn * x], axis=1)
    assert np.abs(found.displacement - expected).max() <= 1e-7 * np.abs(expected).max()


def test_walls_push_on_what_cannot_expand(tmp_path: Path) -> None:
    walls = support(["block.left", "block.right"], ux=0.0).pin("block", [0.0, 0.0], uy=0.0)
    text = block(walls, field("1 + 3*y"), plane="stress")
    found = Result(text, tmp_path / "run")
    y = found.points[:, 1]
    expected = -E * ALPHA * (1.0 + 3.0 * y)
    assert np.abs(found.stress[:, 0] - expected).max() <= 1e-7 * np.abs(expected).max()
    assert np.abs(found.stress[:, 1:]).max() <= 1e-7 * np.abs(expected).max()
    force = found.forces["block.left+right"]
    np.testing.assert_allclose(force, 0.0, atol=1e-9)
    assert found.summary["force_balance"] <= 1e-9
    assert found.summary["energy_error"] <= 1e-6


def disk(r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radial and hoop stress of a free disk with T = r^2 (Timoshenko and Goodier, Theory of Elasticity,
    article 150), plane stress."""
    return E * ALPHA * (1.0 - r**2) / 4.0, E * ALPHA * (1.0 - 3.0 * r**2) / 4.0


def ring(r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same of a ring of radii 1/2 and 1 with T = ln r."""

    def within(s: FloatArray) -> FloatArray:
        """Integral of T r from the inner radius on."""
        return np.asarray(0.5 * s**2 * np.log(s) - 0.25 * s**2 - (0.125 * np.log(0.5) - 0.0625))

    whole = within(np.ones(1))[0]
    inner = whole / 0.75
    radial = E * ALPHA / r**2 * ((r**2 - 0.25) * inner - within(r))
    hoop = E * ALPHA / r**2 * ((r**2 + 0.25) * inner + within(r) - r**2 * np.log(r))
    return radial, hoop


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize(("form", "close"), [("disk", 2e-3), ("ring", 8e-3)])
def test_round_bodies(form: str, close: float, plane: str, tmp_path: Path) -> None:
    solid = form == "disk"
    formula, hot = (disk, "x**2 + y**2") if solid else (ring, "log(hypot(x, y))")
    shape: dict[str, Any] = {"disk": ([0.0, 0.0], 1.0)} if solid else {"annulus": ([0.0, 0.0], [0.5, 1.0])}
    text = block(ROUND, field(hot), plane=plane, spacing=0.06, **shape).probe("p", "block", [0.3, 0.4])
    found = Result(text, tmp_path / "run", "mls.degree=4")
    x, y = found.points.T
    r = np.hypot(x, y)
    on = r > 1e-9
    radial, hoop = formula(np.where(on, r, 1.0))
    rise = 1.0 / (1.0 - NU) if plane == "strain" else 1.0
    c, s = np.where(on, x / np.where(on, r, 1.0), 1.0), np.where(on, y / np.where(on, r, 1.0), 0.0)
    xx, yy, xy = found.stress.T
    told = np.stack([c * c * xx + s * s * yy + 2 * c * s * xy, s * s * xx + c * c * yy - 2 * c * s * xy])
    expected = rise * np.stack([radial, hoop])
    assert np.abs(told - expected)[:, on].max() <= close * np.abs(expected).max()
    assert abs(found.summary["energy_error"]) <= 0.02
    # Probes see the stress of strains beyond the free ones as well, whoever asks.
    [seen] = probe_named(tmp_path / "run", (1.0,), "p")
    assert probe_point(tmp_path / "run", (1.0,), "block", (0.3, 0.4))[0]["xx"] == pytest.approx(
        seen["xx"], abs=1e-6 * np.abs(expected).max()
    )
    at = rise * np.array([one[0] for one in formula(np.array([0.5]))])
    assert seen["xx"] == pytest.approx(0.36 * at[0] + 0.64 * at[1], abs=close * np.abs(expected).max())
    if plane == "strain":
        rise_there = 0.25 if solid else np.log(0.5)
        across = NU * at.sum() - E * ALPHA * rise_there
        mises = np.sqrt(0.5 * ((at[0] - at[1]) ** 2 + (at[1] - across) ** 2 + (across - at[0]) ** 2))
        assert seen["von_mises"] == pytest.approx(mises, rel=2 * close)


def test_probes_under_a_contact_have_no_stress_of_free_expansion(tmp_path: Path) -> None:
    text = (
        block(field("2 + y"))
        .support("block.bottom", ux=0.0, uy=0.0)
        .probe("p", "block", [0.3, 0.4])
        .pushed("press", "under", fy=-1.0)
        .contact("under", "block.top", disk=([1.0, 3.0], 2.0), accuracy=0.02)
    )
    Result(text, tmp_path / "run")
    [seen], [point] = (
        probe_named(tmp_path / "run", (1.0,), "p"),
        probe_point(tmp_path / "run", (1.0,), "block", (0.3, 0.4)),
    )
    assert seen["yy"] == pytest.approx(point["yy"], abs=0.05)
