"""Refinement at the contact found, from coarse cases that do not say where it is."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from benchmarks.formulas import LameRing
from mlsanm_cli.app.checks import refinement as adapt
from mlsanm_cli.app.checks.refinement import LOW_DEGREE_RULE
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import BAR, EXACT_LAW, NODAL, PATCH, done, solve
from tests.case_text import scene, support

pytestmark = pytest.mark.usefixtures("by_nodes")

QUARTER = {"kind": "sector", "center": [0.0, 0.0], "radii": [1.0, 4.0], "angles": [0.0, 90.0]}
RING = (
    scene("strain")
    .body("ring", "steel", 0.4, QUARTER)
    .support("ring.start", uy=0.0)
    .support("ring.end", ux=0.0)
    .load("inside", "ring.inner", "pressure", pressure=100.0)
)


def test_a_coarse_hertz_case_becomes_accurate(tmp_path: Path) -> None:
    coarse = solve(NODAL, tmp_path / "coarse", EXACT_LAW)
    fine = done(NODAL, tmp_path / "fine", "adapt.passes=2", EXACT_LAW)
    errors = [run["contacts"]["interface"]["reference"]["pressure_error_l2"] for run in (coarse, fine)]
    assert errors[0] >= 0.015
    assert errors[1] <= 0.004
    passes = fine["adapt"]
    assert 2 <= len(passes) <= 3
    assert passes[0]["nodes"] == coarse["nodes"]
    assert passes[-1]["nodes"] == fine["nodes"] <= 9000
    assert passes[0]["change"] is None
    assert passes[-1]["change"] < passes[1]["change"]
    # The clouds stored are the last ones: about 20 spacings over the half-width, 256 at its edges.
    data = read_run(tmp_path / "fine").contacts["interface"]
    closed = data.weight[data.status[-1] > 0]
    width = fine["contacts"]["interface"]["half_width"]
    assert closed.max() <= 1.2 * width / LOW_DEGREE_RULE.across
    assert closed.min() <= 2.0 * width / LOW_DEGREE_RULE.at_edge
    assert fine["quality"]["spacing_ratio"]["interface"] < 1.3


def test_a_pass_that_fails_leaves_the_result_of_the_one_before(
    tmp_path: Path, afterwards: pytest.MonkeyPatch
) -> None:
    def failing(*given: object) -> None:
        raise NumericalError("does not resist pressures")

    afterwards.setattr(adapt, "place", failing)
    settings = (EXACT_LAW, "mls.degree=4")
    plain = solve(NODAL, tmp_path / "plain", *settings)
    kept = done(NODAL, tmp_path / "kept", "adapt.passes=2", *settings)
    assert kept["nodes"] == plain["nodes"]
    assert kept["contacts"] == plain["contacts"]
    (warning,) = set(kept["warnings"]) - set(plain["warnings"])
    assert warning.startswith("pass 1 of [adapt] failed")
    assert "does not resist pressures" in warning


def test_nothing_to_refine(tmp_path: Path) -> None:
    plain = solve(PATCH, tmp_path / "plain")
    again = solve(PATCH, tmp_path / "again", "adapt.passes=2")
    assert "adapt" not in again
    assert again["nodes"] == plain["nodes"]
    # A uniform stress: nothing left to improve.
    bar = solve(BAR, tmp_path / "bar", "adapt.passes=2")
    assert "adapt" not in bar
    assert bar["error_estimate"]["displacement"] <= 1e-11


def ring_error(directory: Path, *settings: str) -> tuple[int, float]:
    """Nodes, and the relative error of the displacements of a thick ring under inner pressure."""
    summary = done(RING, directory, *settings)
    data = read_run(directory)
    points = data.bodies["ring"].points
    found = data.states[-1].bodies["ring"]["displacement"]
    r = np.hypot(points[:, 0], points[:, 1])
    ring = LameRing(1.0, 4.0, 100.0, 210e3 / (1.0 - 0.3**2), 0.3 / 0.7)
    expected = points * (ring.displacement(r) / r)[:, None]
    return summary["nodes"], float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def test_without_contact_nodes_go_where_the_fits_are_poor(tmp_path: Path) -> None:
    nodes, error = ring_error(tmp_path / "adapted", "adapt.passes=3")
    even_nodes, even_error = ring_error(tmp_path / "even", "body.ring.spacing=0.07")
    assert nodes <= 0.6 * even_nodes
    assert error <= even_error


def test_singular_corners_do_not_eat_the_nodes(tmp_path: Path) -> None:
    clamped = BAR.changed("ux = 0.0", "ux = 0.0\nuy = 0.0", 1).changed(support("bar.bottom", uy=0.0), "")
    passes = solve(clamped, tmp_path / "bar", "body.bar.spacing=0.1", "adapt.passes=3")["adapt"]
    assert len(passes) == 4
    for before, after in itertools.pairwise(passes):
        assert after["nodes"] <= 2.7 * before["nodes"]
        assert after["change"] is not None
    assert passes[-1]["error_estimate"]["displacement"] < passes[0]["error_estimate"]["displacement"]


def test_an_overlap_is_judged_by_the_spacing_of_the_case(tmp_path: Path) -> None:
    # Half a spacing deep: fine as drawn, and many of the spacings that refinement puts there.
    overlap = "body.cylinder.shape.center=[0.0, 0.995]"
    settings = (EXACT_LAW, overlap, "adapt.passes=1")
    summary = done(NODAL, tmp_path / "overlap", *settings)
    assert len(summary["adapt"]) == 2
