"""What runs at finite strain say of their own errors; knots of contacts, which a coarse path places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.finite import grids
from mlsanm_cli.app.finite.contact_path import contact_path
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.state import PathStep
from tests.app.runs import warned
from tests.app.scenes import solve
from tests.case_text import Scene, body, head, neo_hookean, plane, rubber

CRUSHED = 1.515
"""Force on a block 2 x 1, nu = 0.44, 30 % down between bonded plates: nine-node finite elements,
extrapolated from 24 x 24 and 40 x 40 (1.5475, 1.5266), good to 1 %."""


def block(spacing: float | None) -> Scene:
    return (
        rubber(1.0, 0.44)
        .body("pad", "rubber", spacing, box=([0.0, 2.0], [0.0, 1.0]), clamped="bottom")
        .load("press", "pad.top", "displacement", displacement=[0.0, -0.3])
    )


def test_crushed_corners_that_are_not_resolved_are_told(tmp_path: Path) -> None:
    """Even nodes, the same at degree 2: a tenth too stiff, without a word."""
    summary = solve(block(0.1), tmp_path / "even")
    error = -summary["forces"]["press"][1] / CRUSHED - 1.0
    estimate = summary["error_estimate"]["energy"]
    assert 0.03 <= error <= 3.0 * estimate <= 9.0 * error
    (warning,) = [one for one in summary["warnings"] if "estimated error of the energy" in one]
    assert any(f"at = [{x}, {y}]" in warning for x in (0, 2) for y in (0, 1))


def ring(spacing: float) -> Scene:
    """A quarter of a thin ring between plates."""
    shape = {"kind": "sector", "center": [0.0, 0.0], "radii": [0.85, 1.0], "angles": [0.0, 90.0]}
    return head("strain", strain="finite") + neo_hookean("steel", 1000.0, 0.3).body(
        "ring", "steel", spacing, shape
    ).support("ring.start", uy=0.0).support("ring.end", ux=0.0).contact(
        "lid", "ring.outer", plane=([0.0, 1.0], [0.0, -1.0])
    ).pushed("close", "lid", uy=-0.4)


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


def seal(length: float, modulus: float) -> Scene:
    """An O-ring in a groove of unlike walls, in some units."""
    groove = [[1.4, 1.0], [1.2, 0.0], [-1.1, 0.0], [-1.4, 1.0]]
    walls = {"kind": "polyline", "points": [[length * x, length * y] for x, y in groove]}
    lid = plane([0.0, 2.0 * length], [0.0, -1.0])
    return (
        head("strain", strain="finite")
        .material("rubber", E=modulus, nu=0.4, law="neo-hookean")
        .body("ring", "rubber", 0.15 * length, disk=([0.0, length], length))
        .contact("groove", "ring.arc", obstacle=walls, friction=0.2)
        .contact("lid", "ring.arc", obstacle=lid, friction=0.2)
        .pushed("close", "lid", uy=-0.3 * length)
    )


def figures(summary: Mapping[str, Any], length: float, modulus: float) -> list[float]:
    found = [one / (length * modulus) for one in summary["forces"]["close"]]
    return found + [one["peak_pressure"] / modulus for one in summary["contacts"].values()]


def test_units_do_not_matter(tmp_path: Path) -> None:
    """Pins were nodes that lay equally far, by their last digits: forces differed by 0.5 %."""
    units = ((1.0, 1.0), (0.007, 3e5))
    one, other = [figures(solve(seal(*some), tmp_path / str(k)), *some) for k, some in enumerate(units)]
    assert other == pytest.approx(one, rel=1e-5, abs=1e-6)


def pressed(spacing: float | None = None, depth: float = 0.01) -> Scene:
    """A block on which a small disk is pressed, beside its nodes."""
    obstacle = {"kind": "disk", "center": [0.031, 1.2], "radius": 0.2}
    return (
        rubber(2.6, 0.3)
        .body("pad", "rubber", spacing, box=([-0.7, 0.7], [0.3, 1.0]), clamped="bottom")
        .table("mls", degree=2)
        .contact("c", "pad.top", obstacle=obstacle)
        .pushed("press", "c", uy=-depth)
    )


@pytest.mark.parametrize("depth", [0.01, 1e-5])
def test_a_disk_beside_the_nodes_presses_upright(depth: float, tmp_path: Path) -> None:
    """Also where the contact is a hundred times narrower than the spacing."""
    summary = solve(pressed(0.1, depth), tmp_path / "run")
    x, y = summary["forces"]["press"]
    assert y < 0.0
    assert abs(x / y) < 2e-3
    assert summary["contacts"]["c"]["closed_nodes"] >= 20


def test_contacts_that_a_coarse_path_does_not_reach(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their pressures are as coarse as the nodes, which a warning tells."""

    def stopped(*args: Any, **more: Any) -> Iterator[PathStep]:
        yield next(contact_path(*args, **more))
        raise NumericalError("no step")

    monkeypatch.setattr(grids, "contact_path", stopped)
    summary = solve(pressed(0.15), tmp_path / "run")
    assert any("located up to position 0 only" in warning for warning in summary["warnings"])


RUBBER = neo_hookean("rubber", 3.0, 0.4)
SMALL = {
    "bush": (
        body("part", "rubber", None, annulus=([0.0, 0.0], [1.0, 2.0]))
        .support("part.outer", ux=0.0, uy=0.0)
        .load("press", "part.inner", "platen", displacement=[0.0, -1e-4])
    ),
    "disk on a block": (
        body("part", "rubber", 0.15, box=([-1.0, 1.0], [-1.0, 0.0]))
        .item("body.refine", at=[0.0, 0.0], spacing=0.002, radius=0.02, growth=0.2)
        .support("part.bottom", ux=0.0, uy=0.0)
        .contact("c", "part.top", disk=([0.0, 0.5], 0.5))
        .pushed("press", "c", uy=-1e-3)
    ),
}


@pytest.mark.parametrize("case", SMALL)
def test_small_loads_have_the_forces_of_small_strain(case: str, tmp_path: Path) -> None:
    """To a thousandth; the disk is pressed by two thousandths of its radius."""
    scene, linear = SMALL[case], RUBBER.replace('law = "neo-hookean"\n', "")
    found = solve(head("strain", strain="finite") + RUBBER + scene, tmp_path / "finite")
    expected = solve(head("strain") + linear + scene, tmp_path / "small")
    force = expected["forces"]["press"][1]
    assert found["forces"]["press"] == pytest.approx([0.0, force], abs=1e-3 * abs(force))
    for name, figures in expected["contacts"].items():
        own = found["contacts"][name]
        assert own["half_width"] == pytest.approx(figures["half_width"], rel=0.01)


def test_half_disk_dragged_by_less_than_it_slips(tmp_path: Path) -> None:
    """As at small strain, by not many more nodes; the contact is a twentieth of their spacing wide."""
    scene = (
        body("disk", "steel", None, half_disk=([0.0, 1.0], 1.0))
        .body("block", "steel", None, box=([-2.0, 2.0], [-2.0, 0.0]), clamped="bottom")
        .load("press", "disk.flat", "displacement", displacement=[0.0, -4e-4])
        .load("shear", "disk.flat", "displacement", displacement=[1.2e-4, 0.0])
        .contact("c", "disk.arc", "block.top", friction=0.3)
        .stages("press", "shear", "shear=-1.0")
    )
    steel = neo_hookean("steel", 210e3, 0.3)
    found = solve(head("strain", strain="finite") + steel + scene, tmp_path / "finite")
    linear = steel.replace('law = "neo-hookean"\n', "")
    expected = solve(head("strain") + linear + scene, tmp_path / "small")
    assert found["nodes"] <= 1.5 * expected["nodes"]
    assert not found["warnings"]
    one, other = (summary["contacts"]["c"] for summary in (found, expected))
    np.testing.assert_allclose(one["force"], other["force"], atol=3e-3 * np.hypot(*other["force"]))
    for key, accuracy in (("peak_pressure", 5e-3), ("half_width", 0.01), ("dissipated_work", 0.01)):
        assert one[key] == pytest.approx(other[key], rel=accuracy), key
