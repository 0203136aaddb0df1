"""A polygon with everything, through check, run and plot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mlsanm_cli.app.check import check
from mlsanm_cli.app.results.fields import boundary_edges
from mlsanm_cli.app.results.plot import plot
from mlsanm_cli.app.run import run
from mlsanm_cli.cloud.sight import triangulate, visibility_criterion
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import Quiet
from tests.case_text import scene

BRACKET = (
    scene("stress")
    .body("bracket", "steel", 0.15)
    .table(
        "body.shape",
        kind="polygon",
        points=[[0.0, 0.0], [4.0, 0.0], [4.0, 0.98], [3.0, 1.0], [4.0, 1.02], [4.0, 2.0], [0.0, 2.0]],
        names=["bottom", "low", "slit_low", "slit_up", "high", "top", "wall"],
        rounding=[0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0],
    )
    .item("body.shape.holes", center=[1.0, 1.0], radius=0.3)
    .item("body.refine", at=[3.0, 1.0], spacing=0.05, radius=0.1)
    .item("body.refine", along="hole1", spacing=0.03, radius=0.0)
    .support("bracket.wall", ux=0.0)
    .pin("bracket", [0.0, 1.0], uy=0.0)
    .load("pull", "bracket.low", "traction", traction=[10.0, 0.0])
    .load("more", "bracket.high", "traction", traction=[10.0, 0.0])
    .table("mls", degree=4)
)


def test_a_polygon_with_slit_hole_and_rounding_from_check_to_picture(tmp_path: Path) -> None:
    case = tmp_path / "bracket.toml"
    case.write_text(BRACKET)
    found = check(case, write=tmp_path / "model.vtu", console=Quiet())
    assert (tmp_path / "model.vtu").is_file()
    summary = run(case, out=tmp_path / "run", console=Quiet())
    assert summary["status"] == "done"
    figures, solve_with_error = summary["quality"]["bodies"]["bracket"], found["bodies"]["bracket"]
    assert found["nodes"] == summary["nodes"]
    assert {key: figures[key] for key in ("stencils_enlarged", "worst_ratio", "closest")} == {
        key: solve_with_error[key] for key in ("stencils_enlarged", "worst_ratio", "closest")
    }
    assert figures["closest"] > 0.5
    assert any("sharp corner points into the material at (3, 1)" in text for text in summary["warnings"])
    # The pictures' triangles leave hole and slit open.
    body = read_run(tmp_path / "run").bodies["bracket"]
    edges = boundary_edges(body)
    a, b, c = body.points[
        triangulate(body.points, edges, visibility_criterion(body.points, edges))
    ].transpose(1, 0, 2)
    area = 0.5 * float(np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum())
    exact = 8.0 - (1.0 - 0.25 * np.pi) * 0.25 - 0.09 * np.pi - 0.02
    assert area == pytest.approx(exact, rel=2e-3)
    assert len(plot(tmp_path / "run")) == 2
