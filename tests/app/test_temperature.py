"""Temperatures that vary over a body, against closed formulas."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.results.probe import probe_named, probe_point
from mlsanm_cli.app.run import run
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.errors import CaseError
from tests.app.blocks import PINS, Result, block
from tests.app.scenes import Quiet
from tests.case_text import contact, pin, pushed, support

E, NU, ALPHA = 200.0, 0.25, 1e-3
HEAT = '[[load]]\nname = "heat"\nbody = "block"\nkind = "temperature"\ntemperature = "{}"\n'
WALLS = '[[support]]\nboundary = ["block.left", "block.right"]\nux = 0.0\n'
FOOT = '[[support]]\nbody = "block"\nnear = [0.0, 0.0]\nuy = 0.0\n'
ROUND = pin("block", [1.0, 0.0], ux=0.0, uy=0.0) + pin("block", [-1.0, 0.0], uy=0.0)
PROBE = '[[probe]]\nname = "p"\nbody = "block"\npoint = [0.3, 0.4]\n'
DISK = '{ kind = "disk", center = [0.0, 0.0], radius = 1.0 }'
RING = '{ kind = "annulus", center = [0.0, 0.0], radii = [0.5, 1.0] }'
RECTANGLE = '{ kind = "rectangle", x = [0.0, 2.0], y = [0.0, 1.0] }'


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_free_body_under_a_linear_field_bends_without_stress(degree: int, tmp_path: Path) -> None:
    text = block(PINS, HEAT.format("3 + 10*x - 4*y"), plane="stress")
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


@pytest.mark.parametrize("scheme", ["least-squares", "ghost"])
def test_walls_push_on_what_cannot_expand(scheme: str, tmp_path: Path) -> None:
    text = block(WALLS, FOOT, HEAT.format("1 + 3*y"), plane="stress")
    found = Result(text, tmp_path / "run", f'mls.scheme="{scheme}"')
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
@pytest.mark.parametrize(
    ("shape", "field", "formula", "close"),
    [(DISK, "x**2 + y**2", disk, 2e-3), (RING, "log(hypot(x, y))", ring, 8e-3)],
    ids=["disk", "ring"],
)
def test_round_bodies(
    shape: str,
    field: str,
    formula: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    close: float,
    plane: str,
    tmp_path: Path,
) -> None:
    text = block(ROUND, HEAT.format(field), PROBE, plane=plane).replace(RECTANGLE, shape)
    text = text.replace("spacing = 0.2", "spacing = 0.06")
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
        heat = 0.25 if shape == DISK else np.log(0.5)
        across = NU * at.sum() - E * ALPHA * heat
        mises = np.sqrt(0.5 * ((at[0] - at[1]) ** 2 + (at[1] - across) ** 2 + (across - at[0]) ** 2))
        assert seen["von_mises"] == pytest.approx(mises, rel=2 * close)


def test_probes_under_a_contact_have_no_stress_of_free_expansion(tmp_path: Path) -> None:
    """It was subtracted again whenever the grid was refined; without contact there is nothing to refine."""
    roll = {"kind": "disk", "center": [1.0, 3.0], "radius": 2.0}
    pressing = contact("under", "block.top", obstacle=roll, accuracy=0.02)
    feet, force = support("block.bottom", ux=0.0, uy=0.0), pushed("press", "under", fy=-1.0)
    Result(block(feet, HEAT.format("2 + y"), PROBE, force, pressing), tmp_path / "run")
    [seen], [point] = (
        probe_named(tmp_path / "run", (1.0,), "p"),
        probe_point(tmp_path / "run", (1.0,), "block", (0.3, 0.4)),
    )
    assert seen["yy"] == pytest.approx(point["yy"], abs=0.05)


def test_an_expression_without_a_value_is_told_by_its_key(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(block(PINS, HEAT.format("log(x - 1)")))
    with pytest.raises(CaseError, match=r"heat.temperature.*has no value"):
        run(case, out=tmp_path / "run", console=Quiet())
