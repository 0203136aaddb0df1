"""Plates that turn, and plates on several bodies, against closed formulas."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import EXACT_LAW, Quiet, done, solve
from tests.case_text import FLOOR, Scene, body, load, scene, support

E = 1000.0
HEAD = scene("stress", "a", E=E)


def block(name: str, x: list[float], y: list[float], of: str = "a", spacing: float | None = 0.2) -> Scene:
    return body(name, of, spacing, box=(x, y))


def plate(boundary: Any, **keys: Any) -> Scene:
    return load("plate", boundary, "platen", **keys)


def beam(length: float, spacing: float | None = 0.2) -> Scene:
    held = support("beam.left", ux=0.0).pin("beam", [0.0, 0.0], uy=0.0)
    return HEAD + block("beam", [0.0, length], [-0.5, 0.5], spacing=spacing) + held


BEAM = beam(4.0)


@pytest.mark.parametrize("way", ["moment", "rotation"])
def test_pure_bending(way: str, tmp_path: Path) -> None:
    # M = E I kappa, I = 1/12; all of it is a polynomial of degree 2.
    moment = 2.0
    turn = moment * 12.0 / E * 4.0
    what = {way: moment if way == "moment" else turn}
    summary = done(BEAM + plate("beam.right", fx=0.0, **what), tmp_path / "run")
    assert summary["plates"]["beam.right"]["rotation"] == pytest.approx(turn, rel=1e-6)
    assert summary["plates"]["beam.right"]["moment"] == pytest.approx(moment, rel=1e-6)
    data = read_run(tmp_path / "run")
    points, fields = data.bodies["beam"].points, data.states[-1].bodies["beam"]
    np.testing.assert_allclose(fields["stress"][:, 0], -12.0 * moment * points[:, 1], atol=1e-5)
    np.testing.assert_allclose(fields["stress"][:, 1:], 0.0, atol=1e-5)
    assert summary["force_balance"] <= 1e-9
    assert abs(summary["energy_error"]) <= 0.02


def test_the_estimate_knows_what_turning_plates_carry(tmp_path: Path) -> None:
    # A plate that keeps its end from contracting makes singular corners.
    text = beam(20.0, None) + plate("beam.right", force=[0.0, 0.0], moment=2.0)
    summary = solve(text, tmp_path / "run")
    assert summary["plates"]["beam.right"]["rotation"] == pytest.approx(0.48, rel=1e-3)
    assert summary["error_estimate"]["displacement"] <= 0.03


def test_loads_of_one_plate_add_up(tmp_path: Path) -> None:
    both = plate("beam.right", fx=-3.0, rotation="free").load("turn", "beam.right", "platen", moment=2.0)
    apart = solve(BEAM + both, tmp_path / "two")
    once = solve(BEAM + plate("beam.right", fx=-3.0, moment=2.0), tmp_path / "one")
    for name in ("rotation", "moment"):
        assert apart["plates"]["beam.right"][name] == pytest.approx(once["plates"]["beam.right"][name])
    assert apart["forces"]["plate"] == pytest.approx([-3.0, 0.0])


def test_a_hinge_takes_an_eccentric_push(tmp_path: Path) -> None:
    # A block under a plate that is pushed next to its middle: compression and bending of a column.
    text = HEAD + block("block", [-0.5, 0.5], [0.0, 3.0])
    text = text.support("block.bottom", uy=0.0).pin("block", [0.0, 0.0], ux=0.0)
    push, adjacent = -6.0, 0.1
    summary = done(text + plate("block.top", fy=push, hinge=[adjacent, 3.0]), tmp_path / "run")
    data = read_run(tmp_path / "run")
    points, stress = data.bodies["block"].points, data.states[-1].bodies["block"]["stress"]
    expected = push * (1.0 + 12.0 * adjacent * points[:, 0])
    np.testing.assert_allclose(stress[:, 1], expected, atol=1e-5)
    turned = summary["plates"]["block.top"]
    assert turned["rotation"] == pytest.approx(push * adjacent * 12.0 / E * 3.0, rel=1e-6)
    assert turned["moment"] == pytest.approx(0.0, abs=1e-7)
    assert summary["forces"]["plate"] == pytest.approx([0.0, push])


BOTH = ["one.top", "two.top"]


def two(of: str = "a") -> Scene:
    """Columns, the second one of some material."""
    return block("one", [-2.0, -1.0], [0.0, 2.0]) + block("two", [1.0, 2.0], [0.0, 2.0], of)


def test_one_plate_on_two_bodies(tmp_path: Path) -> None:
    # Columns of unlike stiffness share a load by it under a plate that stays level, and under one on a hinge
    # each carries half whatever its stiffness.
    text = HEAD.material("b", E=250.0, nu=0.3) + two("b")
    for name, x in (("one", -1.5), ("two", 1.5)):
        text = text.support(f"{name}.bottom", uy=0.0).pin(name, [x, 0.0], ux=0.0)
    level = done(text + plate(BOTH, fy=-5.0), tmp_path / "level")
    assert level["forces"]["one.bottom"][1] == pytest.approx(4.0, rel=1e-6)
    assert level["forces"]["two.bottom"][1] == pytest.approx(1.0, rel=1e-6)
    assert level["forces"]["plate"] == pytest.approx([0.0, -5.0])
    moved = read_run(tmp_path / "level").path.displacements["plate"][-1]
    assert moved[1] == pytest.approx(-4.0 * 2.0 / E, rel=1e-6)
    assert level["force_balance"] <= 1e-9
    turned = done(text + plate(BOTH, fy=-5.0, hinge=[0.0, 2.0]), tmp_path / "turned")
    # The tops turn with the plate, and so does what is below them; moments are small next to the forces' own.
    for name in ("one", "two"):
        assert turned["forces"][f"{name}.bottom"][1] == pytest.approx(2.5, rel=0.1)
    assert turned["plates"]["one.top and two.top"]["moment"] == pytest.approx(0.0, abs=1e-7)


def test_a_plate_on_two_bodies_over_contacts(tmp_path: Path) -> None:
    # Two feet that stand on a plane, one of them 0.001 above it: the plate alone holds them.
    text = HEAD + two() + plate(BOTH, fy=-5.0, ux=0.0)
    for name, gap in (("one", 0.0), ("two", 0.001)):
        text = text.contact(name, f"{name}.bottom", obstacle=FLOOR, gap=gap)
    summary = done(text, tmp_path / "run", EXACT_LAW)
    forces = [summary["contacts"][name]["force"][1] for name in ("one", "two")]
    assert sum(forces) == pytest.approx(5.0, rel=1e-9)
    # Each column's stiffness is about E / 2: a gap of 0.001 is worth 0.5 of force. The fixed tops stiffen it.
    assert forces[0] - forces[1] == pytest.approx(0.5, rel=0.06)


def test_check_tells_of_both_bodies(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    text = HEAD + two() + plate(BOTH, fy=-5.0)
    text = text.support("one.bottom", uy=0.0).support("two.bottom", uy=0.0).pin("one", [-1.5, 0.0], ux=0.0)
    case.write_text(text)
    with pytest.raises(CaseError, match=r"two.*can move freely"):
        check(case, console=Quiet())
    case.write_text(text.pin("two", [1.5, 0.0], ux=0.0))
    assert check(case, console=Quiet())["boundaries"]["one.top and two.top"]["y"] == "force -5 (plate)"
