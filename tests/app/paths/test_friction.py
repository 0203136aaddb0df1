"""Runs with friction: what is stored, warned of and refused."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from mlsanm_cli.io.files import read_summary
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import EXACT_LAW, SHEARED, SMOOTH, done, solve
from tests.case_text import FLOOR, head, scene


@pytest.fixture(scope="module", params=["exact", "hyperbolic"])
def sheared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Press, shear, reverse."""
    directory = tmp_path_factory.mktemp("sheared") / str(request.param)
    done(SHEARED, directory, *(SMOOTH if request.param == "hyperbolic" else (EXACT_LAW,)))
    return directory


def test_histories_are_stored(sheared: Path) -> None:
    run = read_run(sheared)
    contact, path = run.contacts["interface"], run.path
    assert contact.dissipated_work.shape == (run.rows,)
    assert abs(contact.dissipated_work[0]) <= 1e-6 * contact.dissipated_work[-1]
    assert path.displacements.keys() == {"press", "shear"}
    moved = path.displacements["shear"]
    assert (moved == path.displacements["press"]).all()
    turned = np.flatnonzero(path.position == 2.0)[0]
    assert moved[turned, 0] > 0.0 > moved[-1, 0]
    assert moved[-1, 1] < 0.0
    assert {1, 2} <= set(contact.status[turned].tolist())
    summary = read_summary(sheared / "summary.json")
    figures = summary["contacts"]["interface"]
    assert figures["stick_nodes"] == (contact.status[-1] == 1).sum()
    assert figures["dissipated_work"] == pytest.approx(contact.dissipated_work[-1])
    assert figures["force"] == pytest.approx([50.0, 226.0], rel=1e-8)
    assert sheared.name == "hyperbolic" or figures["max_cone_ratio"] <= 1.0 + 1e-9
    with h5py.File(sheared / "run.h5", "r") as file:
        assert file["fields/position"][...].tolist() == [1.0, 1.5, 2.25, 3.0]
        if sheared.name == "hyperbolic":
            step, before = file[f"series/{run.rows // 2}"], contact.traction[run.rows // 2 - 1]
            assert step["traction"][0] == pytest.approx(before, abs=1e-6 * np.abs(before).max())
    table = np.genfromtxt(sheared / "interface.csv", delimiter=",", names=True)
    assert table["slip"] == pytest.approx(contact.slip[-1])
    assert table["traction"] == pytest.approx(contact.traction[-1])


def test_loads_of_zero_move_nothing(tmp_path: Path) -> None:
    # The nearest node had been closed by a plate that nothing moves.
    still = re.sub(r"force = \[.*\]|fx = .*", "force = [0.0, 0.0]", SHEARED)
    done(still, tmp_path / "run", EXACT_LAW)
    data = read_run(tmp_path / "run")
    assert not data.contacts["interface"].status.any()
    assert not data.path.displacements["press"].any()


@pytest.mark.parametrize(("depth", "swapped"), [(0.0, True), (1e-3, False)])
def test_overlaps_as_drawn_give_way_straight(tmp_path: Path, depth: float, swapped: bool) -> None:
    text = SHEARED.changed("center = [0.0, 1.0]", f"center = [0.0, {1.0 - depth!r}]")
    if swapped:
        text = text.changed('slave = "cylinder.arc"', 'slave = "block.top"')
        text = text.changed('master = "block.top"', 'master = "cylinder.arc"')
    # With the flat surface as slave, a node overlaps by a last bit even where the bodies just touch.
    done(text, tmp_path / "run", EXACT_LAW, "output.at=[1.0]")
    path = read_run(tmp_path / "run").path
    across, up = path.displacements["press"][0]
    assert across == pytest.approx(0.0, abs=1e-12)
    # Gaps are means over the places of the contact grid.
    assert up == pytest.approx(depth, abs=1e-5)


def test_sliding_as_a_whole_ends_the_run(tmp_path: Path) -> None:
    summary = solve(SHEARED, tmp_path / "run", EXACT_LAW, "load.shear.fx=180.0")
    assert summary["status"] == "failed"
    assert summary["stop_reason"].startswith("the contact slides as a whole at position ")
    # Shear tilts the surface a little.
    assert float(summary["stop_reason"].split()[-1]) == pytest.approx(1.5, rel=1e-3)
    assert "displacement" in summary["hint"]
    # The last state is the limit: all that friction can carry, to what the slope of the surface adds.
    assert summary["contacts"]["interface"]["force"][0] == pytest.approx(-0.4 * 226.0, rel=0.01)


WOOD = {"E1": 11.0, "E2": 1.0, "E3": 1.0, "G12": 1.3, "nu12": 0.3, "nu13": 0.3, "nu23": 0.3}
ALONG_THE_GRAIN = (
    head("stress")
    .material("wood", angle=10.0, **WOOD)
    .body("disk", "wood", half_disk=([0.0, 1.0], 1.0))
    .load("press", "disk.flat", "platen", fy=-0.01)
    .contact("joint", "disk.arc", obstacle=FLOOR, friction=0.5, accuracy=0.1, regularization={"law": "exact"})
)


def test_a_grain_along_the_surface_is_no_instability(tmp_path: Path) -> None:
    """Tractions had been judged by how much the material gives across its grain: 0.1, and refused."""
    assert solve(ALONG_THE_GRAIN, tmp_path / "run")["stability"] > 0.2


def test_a_block_held_at_a_corner_that_rubs_is_no_instability(tmp_path: Path) -> None:
    """Tractions next to the corner had moved the held node more than themselves: -500, and refused."""
    text = (
        scene("strain", "brick", E=1e4, nu=0.3)
        .body("block", "brick", 0.1, box=([0.0, 2.0], [0.0, 1.0]))
        .pin("block", [0.0, 0.0], ux=0.0)
        .contact("floor", "block.bottom", obstacle=FLOOR, friction=0.3, accuracy=0.1)
        .body_force("weight", "block", [0.0, -1.0])
    )
    summary = solve(text, tmp_path / "run")
    assert summary["stability"] > 0.2
    assert summary["contacts"]["floor"]["force"] == pytest.approx([0.0, 2.0], abs=0.15)
