"""Plates that turn, and plates on several bodies, against closed formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.errors import CaseError
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet, solve

E = 1000.0
HEAD = f'format = 1\n[model]\nplane = "stress"\n[material.a]\nE = {E}\nnu = 0.3\n'
SOFT = "[material.b]\nE = 250.0\nnu = 0.3\n"
FOOT = '[[support]]\nbody = "{}"\nnear = [{}, {}]\nuy = 0.0\n'


def body(name: str, x: object, y: object, material: str = "a") -> str:
    shape = f'{{ kind = "rectangle", x = {x}, y = {y} }}'
    return f'[[body]]\nname = "{name}"\nmaterial = "{material}"\nspacing = 0.2\nshape = {shape}\n'


def held(boundary: str, what: str) -> str:
    return f'[[support]]\nboundary = "{boundary}"\n{what} = 0.0\n'


def plate(boundary: object, what: str) -> str:
    return f'[[load]]\nname = "plate"\nkind = "platen"\nboundary = {boundary}\n{what}\n'


BEAM = HEAD + body("beam", [0.0, 4.0], [-0.5, 0.5]) + held("beam.left", "ux") + FOOT.format("beam", 0.0, 0.0)


@pytest.mark.parametrize("scheme", ["least-squares", "ghost"])
@pytest.mark.parametrize("way", ["moment", "rotation"])
def test_pure_bending(way: str, scheme: str, tmp_path: Path) -> None:
    # M = E I kappa, I = 1/12; all of it is a polynomial of degree 2.
    moment = 2.0
    turn = moment * 12.0 / E * 4.0
    what = f"fx = 0.0\nmoment = {moment}" if way != "rotation" else f"fx = 0.0\nrotation = {turn}"
    text = BEAM + plate('"beam.right"', what)
    summary = solve(text, tmp_path / "run", f'mls.scheme="{scheme}"')
    assert summary["status"] == "done", summary
    assert summary["plates"]["beam.right"]["rotation"] == pytest.approx(turn, rel=1e-6)
    assert summary["plates"]["beam.right"]["moment"] == pytest.approx(moment, rel=1e-6)
    data = read_run(tmp_path / "run")
    points, fields = data.bodies["beam"].points, data.states[-1].bodies["beam"]
    np.testing.assert_allclose(fields["stress"][:, 0], -12.0 * moment * points[:, 1], atol=1e-5)
    np.testing.assert_allclose(fields["stress"][:, 1:], 0.0, atol=1e-5)
    assert summary["force_balance"] <= 1e-9
    assert abs(summary["energy_error"]) <= 0.02


def test_the_estimate_knows_what_turning_plates_carry(tmp_path: Path) -> None:
    # A plate that keeps its end from contracting makes singular corners, whose stress by other fits turned it
    # by a quarter of its angle; the displacement is right to 1e-4.
    text = BEAM.replace("[0.0, 4.0]", "[0.0, 20.0]") + plate(
        '"beam.right"', "force = [0.0, 0.0]\nmoment = 2.0"
    )
    summary = solve(text.replace("spacing = 0.2\n", ""), tmp_path / "run")
    assert summary["plates"]["beam.right"]["rotation"] == pytest.approx(0.48, rel=1e-3)
    assert summary["error_estimate"]["displacement"] <= 0.03


def test_loads_of_one_plate_add_up(tmp_path: Path) -> None:
    # A moment alone was told to need a direction, although another load gives it.
    turn = 'rotation = "free"'
    both = plate('"beam.right"', f"fx = -3.0\n{turn}") + plate('"beam.right"', "moment = 2.0").replace(
        '"plate"', '"turn"'
    )
    apart = solve(BEAM + both, tmp_path / "two")
    once = solve(BEAM + plate('"beam.right"', "fx = -3.0\nmoment = 2.0"), tmp_path / "one")
    for name in ("rotation", "moment"):
        assert apart["plates"]["beam.right"][name] == pytest.approx(once["plates"]["beam.right"][name])
    assert apart["forces"]["plate"] == pytest.approx([-3.0, 0.0])


def test_a_hinge_takes_an_eccentric_push(tmp_path: Path) -> None:
    # A block under a plate that is pushed next to its middle: compression and bending of a column.
    text = HEAD + body("block", [-0.5, 0.5], [0.0, 3.0]) + held("block.bottom", "uy")
    text += '[[support]]\nbody = "block"\nnear = [0.0, 0.0]\nux = 0.0\n'
    push, adjacent = -6.0, 0.1
    summary = solve(text + plate('"block.top"', f"fy = {push}\nhinge = [{adjacent}, 3.0]"), tmp_path / "run")
    assert summary["status"] == "done", summary
    data = read_run(tmp_path / "run")
    points, stress = data.bodies["block"].points, data.states[-1].bodies["block"]["stress"]
    expected = push * (1.0 + 12.0 * adjacent * points[:, 0])
    np.testing.assert_allclose(stress[:, 1], expected, atol=1e-5)
    turned = summary["plates"]["block.top"]
    assert turned["rotation"] == pytest.approx(push * adjacent * 12.0 / E * 3.0, rel=1e-6)
    assert turned["moment"] == pytest.approx(0.0, abs=1e-7)
    assert summary["forces"]["plate"] == pytest.approx([0.0, push])


def test_one_plate_on_two_bodies(tmp_path: Path) -> None:
    # Columns of unlike stiffness share a load by it under a plate that stays level, and under one on a hinge
    # each carries half whatever its stiffness.
    text = HEAD + SOFT + body("one", [-2.0, -1.0], [0.0, 2.0]) + body("two", [1.0, 2.0], [0.0, 2.0], "b")
    for name, x in (("one", -1.5), ("two", 1.5)):
        text += held(f"{name}.bottom", "uy")
        text += f'[[support]]\nbody = "{name}"\nnear = [{x}, 0.0]\nux = 0.0\n'
    both = '["one.top", "two.top"]'
    level = solve(text + plate(both, "fy = -5.0"), tmp_path / "level")
    assert level["status"] == "done", level
    assert level["forces"]["one.bottom"][1] == pytest.approx(4.0, rel=1e-6)
    assert level["forces"]["two.bottom"][1] == pytest.approx(1.0, rel=1e-6)
    assert level["forces"]["plate"] == pytest.approx([0.0, -5.0])
    moved = read_run(tmp_path / "level").path.displacements["plate"][-1]
    assert moved[1] == pytest.approx(-4.0 * 2.0 / E, rel=1e-6)
    assert level["force_balance"] <= 1e-9
    turned = solve(text + plate(both, "fy = -5.0\nhinge = [0.0, 2.0]"), tmp_path / "turned")
    assert turned["status"] == "done", turned
    # The tops turn with the plate, and so does what is below them; moments are small next to the forces' own.
    for name in ("one", "two"):
        assert turned["forces"][f"{name}.bottom"][1] == pytest.approx(2.5, rel=0.1)
    assert turned["plates"]["one.top and two.top"]["moment"] == pytest.approx(0.0, abs=1e-7)


def test_a_plate_on_two_bodies_over_contacts(tmp_path: Path) -> None:
    # Two feet that stand on a plane, one of them 0.001 above it: the plate alone holds them.
    text = HEAD + body("one", [-2.0, -1.0], [0.0, 2.0]) + body("two", [1.0, 2.0], [0.0, 2.0])
    text += plate('["one.top", "two.top"]', "fy = -5.0\nux = 0.0")
    for name, gap in (("one", 0.0), ("two", 0.001)):
        obstacle = 'obstacle = { kind = "plane", point = [0.0, 0.0], normal = [0.0, 1.0] }'
        text += f'[[contact]]\nname = "{name}"\nslave = "{name}.bottom"\n{obstacle}\ngap = {gap}\n'
    summary = solve(text, tmp_path / "run", "contact.*.regularization.law=exact")
    assert summary["status"] == "done", summary
    forces = [summary["contacts"][name]["force"][1] for name in ("one", "two")]
    assert sum(forces) == pytest.approx(5.0, rel=1e-9)
    # Each column's stiffness is about E / 2: a gap of 0.001 is worth 0.5 of force. The fixed tops stiffen it.
    assert forces[0] - forces[1] == pytest.approx(0.5, rel=0.06)


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ('fx = 0.0\nmoment = 1.0\nrotation = "fixed"', r"load\.\w+\.moment:"),
        ("fx = 0.0\nmoment = 1.0\nrotation = 0.1", r"load\.\w+\.moment:"),
        ('fx = 0.0\nhinge = [0.0, 0.0]\nrotation = "fixed"', r"load\.\w+\.hinge:"),
        ('fx = 0.0\nrotation = "loose"', r'rotation: expected "fixed", "free", or an angle'),
        ("moment = 1.0", r"needs a direction"),
    ],
)
def test_faults(what: str, words: str, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(BEAM + plate('"beam.right"', what))
    with pytest.raises(CaseError, match=words):
        check(case, console=Quiet())


def test_check_tells_of_both_bodies(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    text = HEAD + body("one", [-2.0, -1.0], [0.0, 2.0]) + body("two", [1.0, 2.0], [0.0, 2.0])
    text += plate('["one.top", "two.top"]', "fy = -5.0") + held("one.bottom", "uy") + held("two.bottom", "uy")
    text += '[[support]]\nbody = "one"\nnear = [-1.5, 0.0]\nux = 0.0\n'
    case.write_text(text)
    with pytest.raises(CaseError, match=r"two.*can move freely"):
        check(case, console=Quiet())
    case.write_text(text + '[[support]]\nbody = "two"\nnear = [1.5, 0.0]\nux = 0.0\n')
    assert check(case, console=Quiet())["boundaries"]["one.top and two.top"]["y"] == "force -5 (plate)"
