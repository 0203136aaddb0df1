"""Paths at finite strain, against finite elements, linear elasticity, Newton's method and Euler's loads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.app.comparison.compare import compare
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.results.probe import probe_named, probe_point
from mlsanm_cli.errors import CaseError, RunError
from tests.app.runs import warned
from tests.app.scenes import Quiet, done, solve
from tests.case_text import contact, head, load, rubber

BEAM = (
    head("strain", strain="finite")
    .material("steel", E=1200.0, nu=0.0, law="saint-venant-kirchhoff")
    .body("beam", "steel", 0.25, box=([0.0, 10.0], [0.0, 1.0]), clamped="left")
    .load("tip", "beam.right", "traction", traction=[0.0, "60 * y * (1 - y)"])
    .probe("end", "beam", [10.0, 0.5])
    .table("output", at=[0.1, 0.4, 1.0])
)

BLOCK = (
    rubber(2.6, 0.3)
    .body("block", "rubber", 0.05, box=([0.0, 1.0], [0.0, 1.0]), clamped="bottom")
    .load("press", "block.top", "displacement", displacement=[0.0, -0.4])
    .probe("side", "block", [1.0, 0.5])
)


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> tuple[Mapping[str, Any], Path]:
    directory = tmp_path_factory.mktemp("finite") / "beam"
    return solve(BEAM, directory), directory


def test_fields_are_stored_and_told_anywhere(beam: tuple[Mapping[str, Any], Path]) -> None:
    summary, directory = beam
    with h5py.File(directory / "run.h5", "r") as file:
        last = file["fields/2/beam"]
        assert set(last) == {"displacement", "stress", "von_mises", "stretch", "volume_ratio"}
        stretch, volume = last["stretch"][()], last["volume_ratio"][()]
        # nu = 0: the area is all that changes.
        np.testing.assert_allclose(stretch.prod(axis=1), volume, rtol=1e-12)
        assert file["path/position"][()].tolist()[0] == 0.0
        assert {0.1, 0.4, 1.0} <= set(file["path/position"][()].tolist())
    text = (directory / "fields_0000.vtu").read_text()
    assert all(name in text for name in ("stretch_1", "stretch_2", "volume_ratio"))
    (named,) = probe_named(directory, [0.4], "end")
    (point,) = probe_point(directory, [0.4], "beam", (10.0, 0.5))
    for key in ("ux", "uy", "xx", "yy", "xy", "von_mises"):
        assert abs(named[key] - point[key]) <= 1e-9 * max(abs(named["uy"]), 1.0)
    least = summary["finite_strain"]["least_stretch"]
    assert stretch.min() == pytest.approx(least)
    with pytest.raises(RunError, match=r"nothing is stored between"):
        probe_named(directory, [0.05], "end")
    with pytest.raises(RunError, match=r"saved at position"):
        probe_point(directory, [0.0], "beam", (10.0, 0.5))
    pictures = plot(directory)
    assert {file.name for file in pictures} == {"plot_force.png", "plot_bodies.png"}


def test_block_is_compressed_by_two_fifths(tmp_path: Path) -> None:
    low = solve(BLOCK, tmp_path / "low", "mls.degree=2")
    assert low["factorizations"] <= 4
    # 0.1278 with 1,478 nodes, 0.1273 with 1,039 of degree 4.
    assert low["probes"]["side"]["displacement"][0] == pytest.approx(0.1274, rel=0.03)
    summary = done(BLOCK, tmp_path / "run")
    assert summary["factorizations"] <= 5
    assert summary["probes"]["side"]["displacement"][0] == pytest.approx(0.1274, rel=0.005)
    assert summary["finite_strain"]["equations_renewed"] >= 1
    assert 0.2 <= summary["finite_strain"]["least_volume_ratio"] <= 0.5


def test_series_and_newton_go_the_same_way(tmp_path: Path) -> None:
    case = tmp_path / "beam.toml"
    case.write_text(BEAM.replace('"60 *', '"20 *'))
    wishes: dict[str, Any] = {"methods": ("newton",), "levels": 2, "picture": False}
    result = compare(case, **wishes, out=tmp_path / "out", console=Quiet())
    assert result["status"] == "agree"
    anm, newton = result["methods"]
    assert anm["sparse_factorizations"] <= 8 < newton["sparse_factorizations"]
    assert newton["difference"]["displacement"] <= newton["limit"] <= 1e-6
    assert json.loads((tmp_path / "out" / "comparison.json").read_text())["status"] == "agree"
    with pytest.raises(RunError, match=r"--active-set"):
        compare(case, methods=("active-set",), out=tmp_path / "out", force=True, console=Quiet())


def test_pressure_that_follows(tmp_path: Path) -> None:
    """A block under the same pressure all around shrinks evenly: nominal tractions need not be known."""
    text = BLOCK.replace("displacement = [0.0, -0.4]", "pressure = 0.5\nfollows = true")
    text = text.replace('boundary = "block.top"', 'boundary = ["block.top", "block.right"]')
    text = text.replace('kind = "displacement"', 'kind = "pressure"').replace("ux = 0.0\nuy", "uy")
    text += '[[support]]\nboundary = "block.left"\nux = 0.0\n'
    summary = solve(text, tmp_path / "run")
    stress = summary["probes"]["side"]["stress"]
    np.testing.assert_allclose(stress, [-0.5, -0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(summary["forces"]["press"][0], summary["forces"]["press"][1], rtol=1e-9)
    dead = solve(text.replace("follows = true", "follows = false"), tmp_path / "dead")
    assert dead["probes"]["side"]["stress"][0] < -0.54


def test_lost_ellipticity_is_refused_by_node(tmp_path: Path) -> None:
    text = BLOCK.replace("neo-hookean", "saint-venant-kirchhoff").replace("ux = 0.0\nuy", "uy")
    text = text.replace("displacement = [0.0, -0.4]", "uy = -0.4")
    text += '[[support]]\nboundary = ["block.left", "block.right"]\nux = 0.0\n'
    summary = solve(text, tmp_path / "run")
    assert summary["status"] == "failed"
    assert "ellipticity" in summary["stop_reason"]
    assert "body block, node" in summary["stop_reason"]
    # Even strain: it goes at a stretch of 0.703.
    assert summary["position"] < 0.297 / 0.4
    assert (tmp_path / "run" / "failure.vtu").is_file()


def test_bodies_that_can_move_freely_are_refused(tmp_path: Path) -> None:
    loose = BLOCK.replace('boundary = "block.bottom"\nux = 0.0\n', 'boundary = "block.bottom"\n')
    with pytest.raises(CaseError, match=r"can move freely"):
        solve(loose.replace("displacement = [0.0, -0.4]", "uy = -0.1"), tmp_path / "run")
    case = tmp_path / "block.toml"
    case.write_text(BLOCK)
    assert check(case, console=Quiet())["nodes"] > 100


def test_a_thick_ring_is_blown_up_to_twice_its_radius(tmp_path: Path) -> None:
    """Against the boundary value problem of a neo-Hookean tube along a radius, solved to 1e-9."""
    text = (
        rubber(3.0, 0.4)
        .body("ring", "rubber")
        .table("body.shape", kind="sector", center=[0.0, 0.0], radii=[1.0, 2.0], angles=[0.0, 90.0])
        .support("ring.start", uy=0.0)
        .support("ring.end", ux=0.0)
        .load("blow", "ring.inner", "pressure", pressure=0.6, follows=True)
        .probe("in", "ring", [1.0, 0.0])
        .probe("out", "ring", [2.0, 0.0])
    )
    for degree, limit in ((4, 2e-3), (2, 2e-2)):
        summary = solve(text, tmp_path / str(degree), f"mls.degree={degree}")
        inner, outer = (summary["probes"][name]["displacement"][0] for name in ("in", "out"))
        errors = inner / 0.99916251 - 1.0, outer / 0.68679359 - 1.0
        assert np.abs(errors).max() < limit
        told = summary["error_estimate"]["displacement"]
        assert 0.5 <= told / np.abs(errors).mean() <= 4.0
        assert told > np.abs(errors).max() / 3.0


COLUMN = (
    head("strain", strain="finite")
    .material("spring", E=1000.0, nu=0.0, law="saint-venant-kirchhoff")
    .body("column", "spring", 0.25, box=([0.0, 10.0], [0.0, 0.5]), clamped="left")
    .load("press", "column.right", "traction", traction=[-1.0, 4e-3])
    .probe("end", "column", [10.0, 0.25])
)


def test_a_column_buckles_beyond_a_right_angle(tmp_path: Path) -> None:
    """Its end turns by 122 degrees (elastica)."""
    summary = done(COLUMN, tmp_path / "run", "body.column.spacing=0.125")
    assert not summary["finite_strain"]["limit_points"]
    assert summary["probes"]["end"]["displacement"][1] == pytest.approx(8.004, rel=0.005)


LENGTH = 8.0
STRAIGHT = (
    head("strain", strain="finite")
    .material("steel", E=1000.0, nu=0.0, law="saint-venant-kirchhoff")
    .body("column", "steel", 0.25, box=([-0.5, 0.5], [0.0, LENGTH]), clamped="bottom")
    .probe("top", "column", [0.0, LENGTH])
)
FREE, GUIDED = 3.16779, 0.0123908
"""Critical force of the column with a free top, and critical strain with a top that moves without turning:
6 x 24 nine-node finite elements. Euler's load for the first is 3.213, without shear and shortening."""


@pytest.mark.parametrize("method", ["anm", "newton"])
def test_a_straight_column_buckles(tmp_path: Path, method: str) -> None:
    """It went on straight to any load, and so may a path whose equations know no other branch."""
    pressed = load("press", "column.top", "traction", traction=[0.0, -1.1 * FREE])
    summary = done(STRAIGHT + pressed, tmp_path / "run", f'solver.method="{method}"')
    (found,) = summary["finite_strain"]["bifurcations"]
    assert found["position"] * 1.1 == pytest.approx(1.0, rel=2e-3)
    assert abs(found["direction"][0]) > 0.99
    assert found["point"][1] == LENGTH
    assert warned(summary) == ["bifurcation"]
    assert abs(summary["probes"]["top"]["displacement"][0]) > 0.3 * LENGTH


def test_a_pulled_column_stays_straight(tmp_path: Path) -> None:
    pulled = load("pull", "column.top", "traction", traction=[0.0, 1.1 * FREE])
    summary = done(STRAIGHT + pulled, tmp_path / "run")
    assert not summary["finite_strain"]["bifurcations"]
    assert not warned(summary)


def test_a_column_buckles_against_walls(tmp_path: Path) -> None:
    """The end goes down by far more than Euler's shortening, without turning."""
    gap = 0.2
    text = STRAIGHT.load("press", "column.top", "displacement", uy=-0.2)
    for name, side in (("left", -1.0), ("right", 1.0)):
        wall = {"kind": "plane", "point": [side * (0.5 + gap), 0.0], "normal": [-side, 0.0]}
        text += contact(name, f"column.{name}", obstacle=wall)
    summary = done(text, tmp_path / "run")
    (found,) = summary["finite_strain"]["bifurcations"]
    assert found["position"] * 0.2 / LENGTH == pytest.approx(GUIDED, rel=2e-3)
    assert abs(summary["probes"]["top"]["displacement"][0]) == pytest.approx(gap, rel=0.01)
    assert "bifurcation" in warned(summary)
    assert "equilibrium" not in warned(summary)
