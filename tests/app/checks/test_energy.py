"""The energy check of runs: small where results are right, and in the way of those that are not."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.results.info import info
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.mechanics import pieces
from mlsanm_cli.mechanics.body_model import BodyModel
from tests.app.blocks import BOTTOM, CLAMP, LEFT, WEIGHT, block, traction
from tests.app.runs import summary_of, warned
from tests.app.scenes import FAST, PATCH, done, hertz, solve
from tests.case_text import FLOOR, Scene, head, load, material, polygon, scene, support

CLAMPED = support("beam.left", ux=0.0, uy=0.0)


def beam(spacing: float, length: float = 20.0) -> Scene:
    return (
        scene("stress", E=1000.0)
        .body("beam", "steel", spacing, box=([0.0, length], [0.0, 1.0]))
        .load("press", "beam.top", "pressure", pressure=0.001)
    )


@pytest.mark.parametrize(
    ("parts", "largest"),
    [
        ([LEFT, BOTTOM, traction("right", 3.0, 0.0)], 1e-9),
        ([support("block.left", spring=[20.0, 30.0]), traction("right", 0.0, -1.0)], 0.03),
        ([support("block.left", spring=[2e4, 3e4]), traction("right", 0.0, -1.0)], 0.03),
        ([CLAMP, WEIGHT], 0.03),
        ([CLAMP, load("low", "block.right", "platen", fy=-1.0)], 0.03),
        ([CLAMP, load("shear", "block.right", "platen", ux=0.0, uy=0.01)], 0.03),
    ],
    ids=["bar", "soft", "stiff", "weight", "lowered", "sheared"],
)
def test_blocks(parts: list[str], largest: float, tmp_path: Path) -> None:
    """Those that heat loads are in test_materials.py."""
    summary = done(block(*parts, plane="stress", spacing=0.1), tmp_path / "run")
    assert abs(summary["energy_error"]) <= largest
    assert summary["energy_error_bodies"] == {"block": summary["energy_error"]}


def test_contacts(patch_run: Path, hertz_run: Path) -> None:
    for directory, largest in ((patch_run, 1e-9), (hertz_run, 0.03)):
        summary = summary_of(directory)
        bodies = summary["energy_error_bodies"]
        assert len(bodies) == 2
        assert max(map(abs, bodies.values())) == abs(summary["energy_error"]) <= largest
        assert info(directory)["energy_error"] == summary["energy_error"]


def test_fields_that_are_not_saved_are_solved_for(tmp_path: Path) -> None:
    whole = solve(hertz(), tmp_path / "whole", FAST)
    for fields in ('["stress"]', "[]"):
        other = solve(hertz(), tmp_path / "other", FAST, f"output.fields={fields}", "output.vtu=false")
        assert other["energy_error"] == pytest.approx(whole["energy_error"], rel=1e-6)
        shutil.rmtree(tmp_path / "other")


def deflection(directory: Path) -> float:
    """How far the free end of a beam 20 long has moved over what it should (Timoshenko)."""
    data = read_run(directory)
    right = data.bodies["beam"].points[:, 0] > 20.0 - 1e-9
    found = data.states[-1].bodies["beam"]["displacement"][right, 1].mean()
    return float(-found / (0.001 * (20.0**4 / 8.0 * 12.0 + 20.0**2 / 2.0 * 1.2 * 2.6) / 1000.0))


def weaken(strength: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the equilibrium of pieces count so little, and that of the whole body no more, that beams lose part
    of their force on the way to the support; with less than 10 they bend the other way."""
    proper = pieces.Pieces.sums
    monkeypatch.setattr(pieces.Pieces, "sums", lambda *given: proper(*given)[:0])
    monkeypatch.setattr(pieces, "EQUILIBRIUM_WEIGHT", strength)


@pytest.mark.parametrize("strength", [30.0, 100.0])
def test_the_error_is_that_of_the_deflection_of_a_beam(
    strength: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weaken(strength, monkeypatch)
    summary = solve(beam(0.2) + CLAMPED, tmp_path / "run", "mls.degree=2")
    assert summary["status"] == ("failed" if strength == 30.0 else "done"), summary
    assert summary["energy_error"] == pytest.approx(deflection(tmp_path / "run") - 1.0, abs=0.02)


def test_estimates_know_what_clamped_ends_cost_at_high_degrees(tmp_path: Path) -> None:
    # Fits of the next degree alone said a tenth to a third of it.
    done(beam(0.04, 3.0) + CLAMPED, tmp_path / "fine", "mls.degree=2")
    summary = done(beam(0.14, 3.0) + CLAMPED, tmp_path / "run", "mls.degree=4")
    tips = []
    for name in ("fine", "run"):
        data = read_run(tmp_path / name)
        right = data.bodies["beam"].points[:, 0] > 3.0 - 1e-9
        tips.append(float(data.states[-1].bodies["beam"]["displacement"][right, 1].mean()))
    error = abs(tips[1] / tips[0] - 1.0)
    assert error > 0.005
    assert error / 3.0 <= summary["error_estimate"]["displacement"] <= 3.0 * error


def test_frames_with_three_nodes_across_have_degree_2_and_say_how_many_they_want(tmp_path: Path) -> None:
    # At degree 4, which fits passed, the frame was useless.
    corners = [[0, 0], [1, 0], [1, 9], [9, 9], [9, 0], [10, 0], [10, 10], [0, 10]]
    shape = {"kind": "polygon", "points": corners, "rounding": [0, 0, 0.5, 0.5, 0, 0, 0, 0]}
    frame = scene("stress", E=1000.0).body("frame", "steel", 0.5, shape)
    frame = frame.support("frame.side1", ux=0.0, uy=0.0).support("frame.side5", ux=0.0, uy=0.0)
    frame = frame.load("push", "frame.side7", "traction", traction=[1e-5, -1e-4])
    summary = done(frame, tmp_path / "run")
    assert summary["quality"]["bodies"]["frame"]["degree"] == 2
    (warning,) = [text for text in summary["warnings"] if "strain energy" in text]
    assert "3 nodes across: parts in bending need 5 or more, a spacing of 0.25" in warning
    finer = solve(frame, tmp_path / "finer", "body.frame.spacing=0.25")
    assert finer["quality"]["bodies"]["frame"]["degree"] == 4
    assert not any("nodes across" in text for text in finer["warnings"])


def test_a_beam_whose_forces_are_not_looked_at_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pieces, "EQUILIBRIUM_WEIGHT", 10.0)
    on_nodes = beam(0.1, 8.0).pin("beam", [0.0, 0.0], ux=0.0, uy=0.0).pin("beam", [8.0, 0.0], uy=0.0)
    summary = solve(on_nodes, tmp_path / "run")
    assert (summary["status"], summary["force_balance"]) == ("failed", 0.0)
    assert "energy of body beam is" in summary["stop_reason"]
    assert "body.beam.spacing" in summary["hint"]


@pytest.mark.usefixtures("by_nodes")
def test_wrong_stresses_are_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = BodyModel.stress

    def stress(self: BodyModel, displacement: Any) -> Any:
        return (1.1 if self.name == "lower" else 1.0) * kept(self, displacement)

    monkeypatch.setattr(BodyModel, "stress", stress)
    summary = solve(PATCH, tmp_path / "run")
    assert summary["status"] == "failed"
    assert "energy of body lower is 21 % above" in summary["stop_reason"]
    assert summary["energy_error_bodies"] == pytest.approx({"upper": 0.0, "lower": 0.21}, abs=1e-9)


def test_a_scene_without_loads_has_no_error(tmp_path: Path) -> None:
    text = block(LEFT, BOTTOM, traction("right", 3.0, 0.0)).stages("right", "right=0")
    assert done(text, tmp_path / "run")["energy_error"] == 0.0


@pytest.mark.parametrize("law", ["exact", "hyperbolic"])
def test_a_contact_that_is_unloaded_again(law: str, tmp_path: Path) -> None:
    # The smooth law leaves a ten-thousandth of the pressure, on a node or two, whose energy is 17 % off.
    text, override = hertz().stages("press", "press=0"), f"contact.interface.regularization.law={law}"
    summary = done(text, tmp_path / "run", override)
    assert abs(summary["energy_error"]) <= 0.03


def test_estimates_that_are_missing_are_told(tmp_path: Path) -> None:
    text = (
        scene("strain", E=100.0)
        .body("bar", "steel", 0.25, box=([0.0, 4.0], [0.0, 0.5]))
        .support("bar.left", ux=0.0)
        .contact("foot", "bar.bottom", obstacle=FLOOR, accuracy=0.05)
        .load("press", "bar.top", "pressure", pressure="0.01*x")
    )
    for friction in (0.0, 0.1):
        summary = solve(text, tmp_path / f"run{friction}", f"contact.foot.friction={friction}")
        assert summary["error_estimate"]["displacement"] is None
        assert any(one.startswith("errors are not estimated") for one in summary["warnings"])
    assert summary["status"] == "done"


def test_forces_of_prescribed_displacements_are_as_wrong_as_the_stiffness(tmp_path: Path) -> None:
    # A block of wood whose held side ends on smooth arcs of three nodes; 0.015436 with automatic spacings.
    corners = polygon([[-3.0, 0.0], [3.0, 0.0], [3.0, 4.8], [-3.0, 4.8]], "foot right head left")
    arcs = {"rounding": 1.0, "corners": ["foot", "foot", "head", "head"]}
    wood = material("wood", E1=4.09, E2=0.377, E3=0.377, G12=0.497, nu12=0.3, nu13=0.3, nu23=0.3, angle=34.5)
    text = head("strain").add(wood).body("block", "wood", 0.31, corners | arcs, seed=2)
    text = text.contact("foot", "block.foot", obstacle=FLOOR)
    summary = solve(text.load("press", "block.head", "platen", displacement=[0.0, -0.02]), tmp_path / "run")
    error = abs(summary["contacts"]["foot"]["force"][1] / 0.015436 - 1.0)
    assert 0.005 <= error <= 0.02
    assert error / 3.0 <= summary["error_estimate"]["force"]["foot"] <= 3.0 * error
    assert "force_error" in warned(summary)


def test_errors_at_clamped_ends_are_estimated(tmp_path: Path) -> None:
    text = (
        scene("strain", E=1000.0)
        .body("block", "steel", 5.0, box=([-45.0, 45.0], [-50.0, 0.0]), clamped="bottom")
        .contact("foot", "block.top", disk=([6.0, 30.0], 30.0))
        .pushed("press", "foot", ux=0.0, fy=-20.0)
        .probe("right", "block", [25.0, 0.0])
        .probe("left", "block", [-30.0, -10.0])
    )
    # With a spacing of 1.3.
    truth = {"right": (-0.00112551, -0.00743850), "left": (-0.00057113, -0.00166291)}
    summary = solve(text, tmp_path / "run")
    for name, moved in truth.items():
        away = np.hypot(*np.subtract(summary["probes"][name]["displacement"], moved)) / np.hypot(*moved)
        assert 0.005 <= away <= 0.01
        assert away / 3.0 <= summary["error_estimate"]["probes"][name] <= 3.0 * away
