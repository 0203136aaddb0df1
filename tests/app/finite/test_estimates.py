"""What runs at finite strain say of their own errors, and what their results must not depend on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app.finite import scene
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.mechanics.finite.body import FiniteBody
from mlsanm_cli.mechanics.finite.projector import weights_of
from tests.app.finite.finite_scenes import neo_hookean, rubber
from tests.app.runs import warned
from tests.app.scenes import solve
from tests.case_text import body, box, contact, disk, head, load, material, plane, pushed, support

CRUSHED = 1.515
"""Force on a block 2 x 1, nu = 0.44, 30 % down between bonded plates: nine-node finite elements,
extrapolated from 24 x 24 and 40 x 40 (1.5475, 1.5266), good to 1 %."""


def block(spacing: float | None) -> str:
    return (
        rubber(1.0, 0.44)
        + body("pad", "rubber", spacing, box([0.0, 2.0], [0.0, 1.0]))
        + support("pad.bottom", ux=0.0, uy=0.0)
        + load("press", "pad.top", "displacement", displacement=[0.0, -0.3])
    )


def test_crushed_corners_that_are_not_resolved_are_told(tmp_path: Path) -> None:
    """Even nodes, the same at degree 2: a tenth too stiff, without a word."""
    summary = solve(block(0.1), tmp_path / "even")
    error = -summary["forces"]["press"][1] / CRUSHED - 1.0
    estimate = summary["error_estimate"]["energy"]
    assert 0.03 <= error <= 3.0 * estimate <= 9.0 * error
    (warning,) = [one for one in summary["warnings"] if "estimated error of the energy" in one]
    assert any(f"at = [{x}, {y}]" in warning for x in (0, 2) for y in (0, 1))


def ring(spacing: float) -> str:
    """A quarter of a thin ring between plates."""
    shape = {"kind": "sector", "center": [0.0, 0.0], "radii": [0.85, 1.0], "angles": [0.0, 90.0]}
    return (
        head("strain", strain="finite")
        + neo_hookean("steel", 1000.0, 0.3)
        + body("ring", "steel", spacing, shape)
        + support("ring.start", uy=0.0)
        + support("ring.end", ux=0.0)
        + contact("lid", "ring.outer", obstacle=plane([0.0, 1.0], [0.0, -1.0]))
        + pushed("close", "lid", uy=-0.4)
    )


def test_bodies_too_thin_for_their_nodes_are_told(tmp_path: Path) -> None:
    """With two spacings across it is 9 % too stiff. The force is that with automatic nodes (663)."""
    exact = 0.7846
    summary = solve(ring(0.075), tmp_path / "coarse")
    assert -summary["forces"]["close"][1] > 1.05 * exact
    assert {"energy_estimate", "finite_force_error"} <= set(warned(summary))
    summary = solve(ring(0.037), tmp_path / "finer")
    assert summary["energy_error"] < 0.01
    assert set(warned(summary)) <= {"rough_pressure_error"}
    assert -summary["forces"]["close"][1] == pytest.approx(exact, rel=0.005)


def seal(length: float, modulus: float) -> str:
    """An O-ring in a groove of unlike walls, in some units."""
    groove = [[1.4, 1.0], [1.2, 0.0], [-1.1, 0.0], [-1.4, 1.0]]
    walls = {"kind": "polyline", "points": [[length * x, length * y] for x, y in groove]}
    lid = plane([0.0, 2.0 * length], [0.0, -1.0])
    return (
        head("strain", strain="finite")
        + material("rubber", E=modulus, nu=0.4, law="neo-hookean")
        + body("ring", "rubber", 0.15 * length, disk([0.0, length], length))
        + contact("groove", "ring.arc", obstacle=walls, friction=0.2)
        + contact("lid", "ring.arc", obstacle=lid, friction=0.2)
        + pushed("close", "lid", uy=-0.3 * length)
    )


def figures(summary: Mapping[str, Any], length: float, modulus: float) -> list[float]:
    found = [one / (length * modulus) for one in summary["forces"]["close"]]
    return found + [one["peak_pressure"] / modulus for one in summary["contacts"].values()]


def test_units_do_not_matter(tmp_path: Path) -> None:
    """Pins were nodes that lay equally far, by their last digits: forces differed by 0.5 %."""
    units = ((1.0, 1.0), (0.007, 3e5))
    one, other = [figures(solve(seal(*some), tmp_path / str(k)), *some) for k, some in enumerate(units)]
    assert other == pytest.approx(one, rel=1e-5, abs=1e-6)


def test_pieces_with_pins_are_in_balance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pins of a loose body take no force: pieces around them had no equations of force and moment."""
    found = list[FloatArray]()

    def kept(body: FiniteBody, left_out: IntArray) -> FloatArray:
        weights = weights_of(body, left_out)
        found.append(weights[body.node_rows :])
        return weights

    monkeypatch.setattr(scene, "weights_of", kept)
    solve(seal(1.0, 1.0), tmp_path / "run")
    assert found
    assert all((one > 0.0).all() for one in found)
