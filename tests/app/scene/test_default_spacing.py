"""Bodies whose spacing is left to the program: where it is finer, and what stresses come of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import done
from tests.case.scenes import parse
from tests.case_text import FLOOR, head, polygon, scene

ANGLE = np.linspace(0.0, 2.0 * np.pi, 61)
AROUND = np.round(20.0 * np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=1), 9).tolist()
ECCENTRIC = (
    scene("stress")
    .body("ring", "steel")
    .table("body.shape", kind="outline", sides=[{"name": "around", "points": AROUND}])
    .item("body.shape.holes", center=[6.0, 0.0], radius=11.0, name="bore")
    .pin("ring", [-20.0, 0.0], ux=0.0, uy=0.0)
    .pin("ring", [20.0, 0.0], uy=0.0)
    .load("push", "ring.bore", "pressure", pressure=20.0)
    .probe("inside", "ring", [17.0, 0.0])
    .probe("outside", "ring", [20.0, 0.0])
)
"""Three thick where the hole is nearest to the edge, eleven where it is farthest."""

PLATE = polygon([[-40.0, -30.0], [40.0, -30.0], [40.0, 30.0], [-40.0, 30.0]], "b r t l")
PLATE |= {"holes": [{"center": [5.0, 3.0], "radius": 8.0, "name": "hole"}]}
PLY = (
    head("stress")
    .material("ply", E1=140e3, E2=9e3, G12=5e3, nu12=0.3, angle=67.0)
    .body("plate", "ply", shape=PLATE, clamped="l")
    .load("pull", "plate.r", "traction", traction=[50.0, 0.0])
    .probe("above", "plate", [5.0, 11.0])
    .probe("below", "plate", [5.0, -5.0])
)

OUTSIDE = [[0.0, -30.0], [30.0, -30.0], [30.0, 30.0], [0.0, 30.0]]
NARROW = [[0.0, 0.1], [10.0, 0.1], [10.0, -0.1], [0.0, -0.1]]
SLIT = (
    scene("stress")
    .body("plate", "steel", polygon=(OUTSIDE + NARROW, "bottom right top upper face1 root face2 lower"))
    .support("plate.bottom", ux=0.0, uy=0.0)
    .load("pull", "plate.top", "traction", traction=[0.0, 50.0])
    .probe("above", "plate", [0.0, 0.1])
    .probe("below", "plate", [0.0, -0.1])
)


def stresses(summary: Mapping[str, Any]) -> Mapping[str, list[float]]:
    return {name: probe["stress"] for name, probe in summary["probes"].items()}


def test_narrow_parts_have_nodes_across(tmp_path: Path) -> None:
    # Quadratic finite elements, 0.4 %.
    found = stresses(done(ECCENTRIC, tmp_path / "run"))
    assert found["inside"][1] == pytest.approx(77.67, rel=0.01)
    assert found["outside"][1] == pytest.approx(89.80, rel=0.01)


def test_stresses_round_a_hole_in_an_orthotropic_plate(tmp_path: Path) -> None:
    # Quadratic finite elements, 0.02 %.
    summary = done(PLY, tmp_path / "run")
    found = stresses(summary)
    assert found["above"][0] == pytest.approx(141.76, rel=0.01)
    assert found["below"][0] == pytest.approx(137.77, rel=0.01)
    # The largest one is elsewhere, where stresses change over a small part of the radius.
    assert summary["peak_stress"]["plate"]["stress"] == pytest.approx(259.3, rel=0.02)


@pytest.mark.parametrize("degree", [2, 4])
def test_a_thin_slit_opens_as_it_should(tmp_path: Path, degree: int) -> None:
    # Quadratic finite elements, 0.03 %.
    summary = done(SLIT, tmp_path / "run", f"mls.degree={degree}")
    above, below = (summary["probes"][name]["displacement"][1] for name in ("above", "below"))
    assert above - below == pytest.approx(0.02487, rel=0.01)


def test_surfaces_in_contact_have_finer_nodes_at_finite_strain() -> None:
    """Their pressures are nodal."""
    counts = []
    for strain, law in (("small", "linear"), ("finite", "neo-hookean")):
        text = (
            head("strain", strain=strain)
            .material("rubber", E=1.0, nu=0.3, law=law)
            .body("pad", "rubber", box=([0.0, 2.0], [0.0, 1.0]), clamped="bottom")
            .contact("c", "pad.top", disk=([1.0, 2.0], 1.0))
            .pushed("p", "c", uy=-0.1)
        )
        counts.append(len(clouds(Boundaries.of(parse(text).case))["pad"].surfaces["top"].index))
    small, finite = counts
    assert finite == pytest.approx(1.5 * small, abs=2)


def test_a_post_pushed_aside_leans_as_it_is_clamped(tmp_path: Path) -> None:
    """Bodies in contact have finer nodes where they are clamped, too, if they stand out from there."""
    text = (
        scene("strain")
        .body("post", "steel", box=([-15.0, 15.0], [-45.0, 0.0]), clamped="bottom")
        .contact("c", "post.right", disk=([35.0, -8.0], 20.0))
        .pushed("side", "c", fx=-1000.0, uy=0.0)
        .probe("top", "post", [-15.0, 0.0])
    )
    summary = done(text, tmp_path / "run")
    # 1,218 nodes of degree 4, 0.02 apart at both corners; 1,797 of degree 2 have 0.05957.
    assert summary["probes"]["top"]["displacement"][0] == pytest.approx(-0.05952, rel=3e-3)


def test_pressures_beside_an_oblique_corner_on_a_plane(tmp_path: Path) -> None:
    corners = [[6.937, 0.0], [40.0, 0.0], [40.0, 50.0], [17.565, 50.0]]
    text = (
        scene("strain")
        .body("jaw", "steel", None, polygon(corners, "foot wall top face"))
        .support("jaw.wall", ux=0.0)
        .contact("floor", "jaw.foot", obstacle=FLOOR)
        .load("press", "jaw.top", "pressure", pressure=20.0, from_=[17.565, 50.0], to=[28.0, 50.0])
    )
    done(text, tmp_path / "run")
    floor = read_run(tmp_path / "run").contacts["floor"]
    found = np.interp([7.437, 8.0, 9.0, 10.0, 12.0], floor.points[:, 0], floor.pressure[-1])
    # With nodes 0.01 apart at the corner, whose field is not known: beside it the cloud decides.
    assert found[0] == pytest.approx(2.04, rel=0.08)
    assert found[1:] == pytest.approx(np.array([3.046, 3.91, 4.39, 5.13]), rel=0.03)
