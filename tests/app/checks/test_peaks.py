"""Error estimates of peak stresses against plates with holes, from meshes as users bring them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sparse

from benchmarks.formulas import AnisotropicHole, KirschHole
from mlsanm_cli.app.checks.peaks import along_over_across, traction_error
from mlsanm_cli.cloud.curves import Arc, Outline, rectangle
from mlsanm_cli.cloud.spacing import Spacing, Zone, build_cloud
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.mechanics.elasticity import von_mises
from mlsanm_cli.mechanics.material import orthotropic
from tests.app.runs import warned
from tests.app.scene.test_imported import polar_plate, pulled, write_gmsh
from tests.app.scenes import done
from tests.case_text import scene
from tests.mechanics.bodies import STEEL, boundary_values, build

EXACT = 302.1
"""Of cases/kirsch.toml with this width, degree 6 and 300 nodes around the hole."""


def holed(around: int, degree: int, directory: Path) -> Mapping[str, Any]:
    """The summary of a pulled plate with a hole, from a mesh with so many nodes around it."""
    write_gmsh(directory / "plate.msh", *polar_plate(around, 20.0))
    return done(pulled(left=-20.0), directory / "run", f"mls.degree={degree}")


@pytest.mark.parametrize(("around", "degree"), [(24, 2), (24, 4), (32, 4), (40, 2)])
def test_coarse_holes_of_a_mesh_are_warned_of(around: int, degree: int, tmp_path: Path) -> None:
    summary = holed(around, degree, tmp_path)
    told, state = summary["peak_stress"]["plate"], read_run(tmp_path / "run")
    assert np.hypot(*told["place"]) == pytest.approx(1.0)
    points, stress = state.bodies["plate"].points, state.states[-1].bodies["plate"]["stress"]
    rim = np.hypot(*points.T) < 1.0 + 1e-6
    # Of nearly equal peaks that with the larger error counts.
    largest = von_mises(stress[rim], np.zeros(rim.sum())).max()
    assert largest / (1.0 + told["error"]) <= told["stress"] <= (1.0 + 1e-9) * largest
    wrong = stress[rim, 0] - EXACT / 3.0 * KirschHole(1.0, 1.0).stress(points[rim])[:, 0]
    error = float(np.abs(wrong).max()) / told["stress"]
    assert error / 3.0 <= told["error"] <= 3.0 * error
    assert "peak_stress" in warned(summary)
    assert all("body.plate.shape.file" in warning for warning in summary["warnings"])


@pytest.mark.parametrize("degree", [2, 4])
def test_fine_holes_are_not(degree: int, tmp_path: Path) -> None:
    summary = holed(96, degree, tmp_path)
    assert not summary["warnings"]
    assert summary["peak_stress"]["plate"]["error"] < 0.01


def test_what_grows_towards_a_clamped_corner_is_no_peak(tmp_path: Path) -> None:
    bar = scene("stress").body("bar", "steel", 0.5, box=([0.0, 8.0], [0.0, 2.0]))
    text = bar.support("bar.left", ux=0.0, uy=0.0).load("push", "bar.top", "pressure", pressure=1.0)
    summary = done(text, tmp_path / "run")
    peak = summary["peak_stress"].get("bar")
    assert peak is None or peak["place"][0] > 0.25 * 2.0


def test_where_a_load_ends_no_stress_meets_both_sides(tmp_path: Path) -> None:
    text = (
        scene("strain")
        .body("beam", "steel", 0.4, box=([-10.0, 10.0], [0.0, 2.0]))
        .support(["beam.left", "beam.right"], ux=0.0, uy=0.0)
        .load("push", "beam.top", "pressure", pressure=20.0, from_=[-0.5, 2.0], to=[0.5, 2.0])
    )
    summary = done(text, tmp_path / "run")
    assert "peak_stress" not in warned(summary)
    assert summary["peak_stress"]["beam"]["error"] < 0.03


def test_peaks_on_planes_of_symmetry_count(tmp_path: Path) -> None:
    quarter = {"kind": "sector", "center": [0.0, 0.0], "radii": [1.0, 4.0], "angles": [0.0, 90.0]}
    text = scene("stress").body("plate", "steel", 0.3, quarter)
    text = text.support("plate.start", uy=0.0).support("plate.end", ux=0.0)
    text = text.load("pull", "plate.outer", "traction", traction=["x/4", 0.0])
    summary = done(text, tmp_path / "run")
    assert summary["peak_stress"]["plate"]["place"] == pytest.approx((0.0, 1.0), abs=1e-9)


@pytest.mark.parametrize("angle", [0.5, 0.5 * np.pi])
def test_errors_along_fibres_are_larger_than_those_of_tractions(angle: float) -> None:
    ply = orthotropic([140e3, 10e3, 10e3], [0.3, 0.3, 0.3], 5e3, angle, "stress")
    hole, exact = Arc((0.0, 0.0), 1.0, 0.5 * np.pi, -2.0 * np.pi), AnisotropicHole(ply.stiffness, 1.0, 1.0)
    plate = rectangle((-3.0, 3.0), (-3.0, 3.0))
    outline = Outline((*plate.names, "hole"), (*plate.curves, hole), (0, 4))
    cloud = build_cloud(outline, Spacing(0.3, (Zone(hole, 2.0 * np.pi / 180.0, 0.0, 0.2),)), 0)
    body_of = build(cloud, {}, 4, ply)
    source = boundary_values(body_of, lambda at: 0.0 * at, exact.stress)
    found = body_of.system.solve(sparse.csc_array(source[:, None])).reshape(-1, 2)
    rim, lack = cloud.surfaces["hole"].index, traction_error(body_of, found, source)
    wrong = body_of.model.stress(found)[rim] - exact.stress(cloud.points[rim])
    error = von_mises(wrong, np.zeros(len(rim))).max()
    told = (along_over_across(body_of) * lack)[rim].max()
    assert error / 3.0 <= told <= 3.0 * error
    assert lack[rim].max() <= error / 5.0
    even = build(cloud, {}, 2, STEEL)
    assert along_over_across(even)[rim] == pytest.approx(1.0)


def test_round_off_has_no_peak(tmp_path: Path) -> None:
    text = (
        scene("stress")
        .body("base", "steel", 0.5, box=([-3.0, 3.0], [-2.0, 0.0]), clamped="bottom")
        .body("left", "steel", 0.3, disk=([-1.5, 1.0], 1.0))
        .body("right", "steel", 0.3, disk=([1.5, 1.0], 1.0))
        .contact("pressed", "left.arc", "base.top")
        .contact("idle", "right.arc", "base.top")
        .body_force("weight", "left", [0.0, -1.0])
    )
    summary = done(text, tmp_path / "run")
    assert "right" not in summary["peak_stress"]
    hertz = np.sqrt(np.pi * 0.5 * 210e3 / np.pi)
    assert summary["contacts"]["pressed"]["peak_pressure"] == pytest.approx(hertz, rel=1e-3)
