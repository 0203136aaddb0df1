"""Symmetric scenes have symmetric clouds and results; others ordinary clouds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.checks import refinement as adapt
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.app.scene.clouds import line_of
from mlsanm_cli.case import parse_case
from mlsanm_cli.cloud.cloud import SymmetryLine
from mlsanm_cli.io.run_reader import read_run
from tests.app.scene.test_floating_bodies import DISK
from tests.app.scenes import EXACT_LAW, NODAL, solve
from tests.case_text import EXACT, Scene, head, load, pushed, scene, support

pytestmark = pytest.mark.usefixtures("by_nodes")

BOX = ([-1.0, 1.0], [-1.0, 0.0])
HEAD = scene("strain", "stuff", E=200.0).body("block", "stuff", 0.2, box=BOX)
WOOD = {"E1": 120.0, "E2": 9.0, "G12": 7.0, "nu12": 0.4, "angle": 90.0}
WOODEN = head("stress").material("stuff", **WOOD).body("block", "stuff", 0.2, box=BOX)
HELD = support("block.bottom", ux=0.0, uy=0.0)
SPRINGS = support("block.bottom", spring=[40.0, 90.0])
UNDER = pushed("press", "under", fy=-4.0).contact(
    "under", "block.top", disk=([0.0, 3.0], 3.0), regularization=EXACT
)
RINGS = (
    scene("stress")
    .body("hub", "steel", 0.15, annulus=([0.0, 0.0], [1.0, 1.6]))
    .body("bush", "steel", 0.15, annulus=([0.0, 0.0], [0.6, 1.0]))
    .contact("fit", "bush.outer", "hub.inner", interference=0.001, regularization=EXACT)
)
POLES = ", ".join(f"{{at=[0.0, {y}], spacing=0.012, radius=0.06, growth=0.2}}" for y in (1.0, -1.0))
FINER = "body.block.refine=[{at=[0.0, 0.0], spacing=0.05, radius=0.3, growth=0.1}]"


def acts(side: str, *table: tuple[float, float]) -> Scene:
    return load(side, f"block.{side}", "pressure", table=table)


SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "platen and contact": (NODAL, (EXACT_LAW,)),
    "loose": (DISK, (f"body.disk.refine=[{POLES}]",)),
    "fit": (RINGS, ()),
    "degree 4": (HEAD + SPRINGS + UNDER, ("mls.degree=4", FINER)),
    "wood": (WOODEN + HELD + UNDER, ()),
}
CLOSE = 1e-3
"""Triangles, and faces of cells with them, may differ on the two sides of coarse clouds."""


@pytest.mark.parametrize("name", SCENES)
def test_results_of_symmetric_scenes_are_symmetric(name: str, tmp_path: Path) -> None:
    text, overrides = SCENES[name]
    line = SymmetryLine(0, 0.0)
    summary = solve(text, tmp_path, *overrides)
    assert (summary["status"], summary["symmetry"]) == ("done", str(line)), summary
    data = read_run(tmp_path)
    for of, shape in data.bodies.items():
        image = line.images(shape.points, np.full(len(shape.points), 1e-3))
        assert image is not None
        fields = data.states[-1].bodies[of]
        for found, signs in ((fields["displacement"], line.signs), (fields["stress"], np.array([1, 1, -1]))):
            assert np.abs(found[image] * signs - found).max() <= CLOSE * np.abs(found).max(), of
    for one in data.contacts.values():
        image = line.images(one.points, np.full(len(one.points), 1e-3))
        assert image is not None
        pressure = one.pressure[-1]
        assert np.abs(pressure[image] - pressure).max() <= CLOSE * pressure.max()


SLIDING = HEAD + HELD + UNDER
ORDINARY: dict[str, tuple[str, tuple[str, ...]]] = {
    "zone": (SLIDING, ("body.block.refine=[{at=[0.1, 0.0], spacing=0.1, radius=0.2, growth=0.2}]",)),
    "friction": (SLIDING, ("contact.under.friction=0.3",)),
}


@pytest.mark.parametrize("name", ORDINARY)
def test_others_have_ordinary_clouds(name: str) -> None:
    text, overrides = ORDINARY[name]
    assert line_of(Boundaries.of(parse_case(text, Path("case.toml"), overrides).case)) is None


def test_passes_in_the_bulk_keep_clouds_symmetric(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[SceneModel] = []

    def kept(*given: Any) -> SceneModel:
        made.append(place(*given))
        return made[-1]

    monkeypatch.setattr(adapt, "place", kept)
    pull = acts("top", (0, 0), (0.5, 0), (1, -4), (1.5, 0), (2, 0))
    solve(HEAD + HELD + pull, tmp_path / "run", "adapt.passes=2")
    assert made
    assert all(model.cloud.mirror is not None for prepared in made for model in prepared.models.values())
    sides = acts("top", (0, 0), (1, 0), (1.5, -4), (2, 0))
    solve(HEAD + HELD + sides, tmp_path / "sides", "adapt.passes=1")
    assert made[-1].models["block"].cloud.mirror is None
