"""Rubber, heat and springs at finite strain, against closed formulas."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from mlsanm_cli.app.results.probe import probe_point
from mlsanm_cli.continuation.series import root
from tests.app.scenes import solve
from tests.case_text import Scene, contact, head, heat, item, pin, probe, support

KIRCHHOFF = 'law = "saint-venant-kirchhoff"'
KINDS = ("neo-hookean", "saint-venant-kirchhoff")
E, NU = 2.6, 0.3
LAM, MU = 1.5, 1.0
PROBE = probe("in", "block", [0.5, 0.5])


def block(law: str, across: str, spacing: float = 0.25) -> Scene:
    """A quarter of a block of length 2 with the coefficient of expansion 0.1."""
    return (
        head(across, strain="finite")
        .material("rubber", E=E, nu=NU, law=law, alpha=0.1)
        .body("block", "rubber", spacing, box=([0.0, 1.0], [0.0, 1.0]))
        .support("block.left", ux=0.0)
        .support("block.bottom", uy=0.0)
    )


def heated(temperature: float | str) -> Scene:
    return heat("heat", "block", temperature)


@pytest.mark.parametrize("law", KINDS)
def test_stretches_that_fit_together_leave_no_stress(law: str, tmp_path: Path) -> None:
    """Free stretches |f'| of a conformal map f turn and stretch a sheet by f: here z + z**2 / 5."""
    text = block(law, "stress", 0.1).replace(support("block.left", ux=0.0), "")
    text += pin("block", [0.0, 0.0], ux=0.0) + heated("10 * (hypot(1 + 0.4*x, 0.4*y) - 1)")
    solve(text, tmp_path / "run")
    with h5py.File(tmp_path / "run" / "run.h5", "r") as file:
        last, points = file["fields/0/block"], file["bodies/block/points"][()]
        z = points[:, 0] + 1j * points[:, 1]
        u = last["displacement"][()]
        np.testing.assert_allclose(u[:, 0] + 1j * u[:, 1], 0.2 * z**2, atol=2e-3)
        assert np.abs(last["stress"][()]).max() < 0.02 * E
    (seen,) = probe_point(tmp_path / "run", [1.0], "block", (0.5, 0.5))
    assert abs(seen["von_mises"]) < 5e-3 * E


@pytest.mark.parametrize("law", KINDS)
def test_a_long_body_that_is_warmed_is_pressed_along(law: str, tmp_path: Path) -> None:
    """Plane strain: free in the plane, held across it."""
    summary = solve(block(law, "strain") + heated(3.0) + PROBE, tmp_path / "run")
    w = 1.3
    if law == "neo-hookean":

        def across(stretch: float) -> float:
            return float(MU * stretch**2 + w**2 * (LAM * np.log(stretch**2 / w**3) - MU))

        stretch = root(across, 1.0, 2.0)
        volume = stretch**2 / w**3
        along = (LAM * np.log(volume) + MU * (w**-2 - 1.0)) / volume
    else:
        stretch = np.sqrt((w**2 * (1.5 * LAM + MU) - 0.5 * LAM) / (LAM + MU))
        trace = stretch**2 / w**2 - 1.0 + 0.5 * (w**-2 - 1.0)
        along = w / stretch**2 * (LAM * trace + MU * (w**-2 - 1.0))
    seen = summary["probes"]["in"]
    np.testing.assert_allclose(seen["displacement"], [0.5 * (stretch - 1.0)] * 2, rtol=1e-7)
    np.testing.assert_allclose(seen["von_mises"], abs(along), rtol=1e-7)


def test_a_warm_block_presses_what_keeps_it(tmp_path: Path) -> None:
    lid = contact("lid", "block.top", plane=([0.0, 1.0], [0.0, -1.0]))
    summary = solve(block("neo-hookean", "strain") + heated(2.0) + lid, tmp_path / "run")
    w = 1.2

    def across(stretch: float) -> float:
        return float(MU * stretch**2 + w**2 * (LAM * np.log(stretch / w**3) - MU))

    stretch = root(across, 1.0, 2.0)
    force = w * MU * (1.0 - stretch**2)
    np.testing.assert_allclose(summary["contacts"]["lid"]["force"], [0.0, force], rtol=1e-6, atol=1e-9)


def test_springs_pull_back_in_their_own_directions(tmp_path: Path) -> None:
    """A stiff bar on springs along both faces, pressed down at its right end: it turns by 49 degrees, until
    the moment about its deformed middle vanishes: tan(angle) = F L / (2 k I), I that of both faces."""
    length, half, spring, force = 4.0, 0.25, 0.5, 3.2
    text = (
        head("strain", strain="finite")
        .material("hard", E=1e6, nu=0.0, law="saint-venant-kirchhoff")
        .body("bar", "hard", 0.125, box=([0.0, length], [-half, half]))
        .item("support", boundary=["bar.bottom", "bar.top"], spring=[spring, spring])
        .load("push", "bar.right", "traction", traction=[0.0, -force / (2.0 * half)])
        .probe("end", "bar", [length, 0.0])
    )
    summary = solve(text, tmp_path / "run")
    second = 2.0 * length * (length**2 / 12.0 + half**2)
    angle = np.arctan(force * length / (2.0 * spring * second))
    sink = force / (2.0 * spring * length)
    end = [0.5 * length * (np.cos(angle) - 1.0), -sink - 0.5 * length * np.sin(angle)]
    np.testing.assert_allclose(summary["probes"]["end"]["displacement"], end, rtol=1e-3)
    np.testing.assert_allclose(summary["forces"]["bar.bottom+top"], [0.0, force], rtol=1e-6, atol=1e-6)


def test_springs_carry_a_pulled_block(tmp_path: Path) -> None:
    """The end moves by t / k, the body stretches alike."""
    spring, held = 0.2, support("block.bottom", uy=0.0)
    text = block("neo-hookean", "stress").load("pull", "block.top", "traction", traction=[0.0, 0.3]) + PROBE
    fixed = solve(text, tmp_path / "fixed")
    sprung = item("support", boundary="block.bottom", spring=[0.0, spring])
    summary = solve(text.replace(held, sprung), tmp_path / "run")
    shift = np.subtract(summary["probes"]["in"]["displacement"], fixed["probes"]["in"]["displacement"])
    np.testing.assert_allclose(shift, [0.0, 0.3 / spring], atol=1e-9)
    np.testing.assert_allclose(summary["forces"]["block.bottom"], [0.0, -0.3], atol=1e-8)


@pytest.mark.parametrize("poisson", [NU, 0.499])
def test_a_body_that_expands_freely_has_no_energy_to_be_checked(poisson: float, tmp_path: Path) -> None:
    text = block("neo-hookean", "strain").replace(f"nu = {NU}", f"nu = {poisson}") + heated(1.0) + PROBE
    summary = solve(text, tmp_path / "run")
    assert np.abs(summary["probes"]["in"]["stress"]).max() < 1e-8 * E


@pytest.mark.parametrize("across", ["strain", "stress"])
def test_small_loads_and_heat_on_anisotropic_bodies_are_those_of_small_strain(
    across: str, tmp_path: Path
) -> None:
    """A plank, grain at 25 degrees, heated and pulled a little: both strains agree to the strain itself."""
    constants = {"E1": 12.0, "E2": 1.0, "E3": 1.5, "G12": 0.8, "nu12": 0.4, "nu13": 0.3, "nu23": 0.25}
    text = (
        head(across)
        .material("wood", **constants, angle=25.0, alpha=[0.2, 1.0, 0.5])
        .body("block", "wood", 0.25, box=([0.0, 1.0], [0.0, 1.0]))
        .pin("block", [0.0, 0.0], ux=0.0, uy=0.0)
        .pin("block", [1.0, 0.0], uy=0.0)
        .load("pull", "block.top", "traction", traction=[0.0, 3e-6])
        .load("hold", "block.bottom", "traction", traction=[0.0, -3e-6])
        + heated("1e-6 * (1 + x)")
        + PROBE.item("mls", degree=4).replace("[[mls]]", "[mls]")
    )
    small = solve(text, tmp_path / "small")
    large = text.replace('plane = "', 'strain = "finite"\nplane = "').replace(
        "\nangle", f"\n{KIRCHHOFF}\nangle"
    )
    finite = solve(large, tmp_path / "finite")
    for key in ("displacement", "stress"):
        exact = np.array(small["probes"]["in"][key])
        np.testing.assert_allclose(finite["probes"]["in"][key], exact, atol=1e-5 * np.abs(exact).max())
