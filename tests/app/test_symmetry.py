"""Symmetric scenes have symmetric clouds and results; others ordinary clouds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.assessment import refinement as adapt
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.app.scene.symmetry import line_of
from mlsanm_cli.case import parse_case
from mlsanm_cli.cloud.mirror import SymmetryLine
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import NODAL, solve
from tests.app.test_loose import DISK, SMOOTH
from tests.case_text import EXACT, annulus, body, box, contact, disk, head, material, pushed

pytestmark = pytest.mark.usefixtures("by_nodes")

HEAD = (
    head("strain")
    + material("stuff", E=200.0, nu=0.3)
    + body("block", "stuff", 0.2, box([-1.0, 1.0], [-1.0, 0.0]))
)
HELD = '[[support]]\nboundary = "block.bottom"\nux = 0.0\nuy = 0.0\n'
ROLLING = '[[support]]\nboundary = "block.bottom"\nuy = 0.0\n'
MIDDLE = '[[support]]\nbody = "block"\nnear = [0.0, -1.0]\nux = 0.0\n'
SPRINGS = '[[support]]\nboundary = "block.bottom"\nspring = [40.0, 90.0]\n'
WEIGHT = '[[load]]\nname = "weight"\nbody = "block"\nkind = "body-force"\nbody-force = [0.0, -3.0]\n'
UNDER = pushed("press", "under", fy=-4.0) + contact(
    "under", "block.top", obstacle=disk([0.0, 3.0], 3.0), regularization=EXACT
)
RINGS = (
    head("stress")
    + material("steel", E=210e3, nu=0.3)
    + body("hub", "steel", 0.15, annulus([0.0, 0.0], [1.0, 1.6]))
    + body("bush", "steel", 0.15, annulus([0.0, 0.0], [0.6, 1.0]))
    + contact("fit", "bush.outer", "hub.inner", interference=0.001, regularization=EXACT)
)
FREE_PLATEN = (
    '[[load]]\nname = "press"\nboundary = "block.top"\nkind = "platen"\nfy = -4.0\nrotation = "free"\n'
)
EXACT_LAW = 'contact.interface.regularization.law="exact"'
PUNCH = '{kind="polyline", points=[[-0.4, 1.0], [-0.4, 0.0], [0.4, 0.0], [0.4, 1.0]]}'
POLES = ", ".join(f"{{at=[0.0, {y}], spacing=0.012, radius=0.06, growth=0.2}}" for y in (1.0, -1.0))
POLES = f"body.disk.refine=[{POLES}]"
FINER = "body.block.refine=[{at=[0.0, 0.0], spacing=0.05, radius=0.3, growth=0.1}]"


def acts(name: str, boundary: str, kind: str, value: str) -> str:
    return f'[[load]]\nname = "{name}"\nboundary = "block.{boundary}"\nkind = "{kind}"\n{value}\n'


def squeezed(left: str = "table = [[0, 3], [1, 1]]", right: str = "table = [[0, 1], [1, 3]]") -> str:
    """Pressures on two sides, of which the left one runs downward, as two loads."""
    return acts("left", "left", "pressure", left) + acts("right", "right", "pressure", right)


BOTH = "[[stage]]\nleft = 0.5\nright = 0.5\n[[stage]]\nleft = 1.0\nright = 1.0\n[output]\nat = [0.4, 2.0]\n"
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "platen and contact": (NODAL, (EXACT_LAW,)),
    "platen that may turn and shift": (HEAD + HELD + FREE_PLATEN, ("load.press.fx=0.0",)),
    "polyline": (HEAD + HELD + UNDER, (f"contact.under.obstacle={PUNCH}",)),
    "loose and smooth": (DISK, (*SMOOTH, POLES, "solver.tolerance=1e-11")),
    "fit": (RINGS, ()),
    "tables on two sides": (HEAD + HELD + squeezed() + BOTH, ()),
    "held node": (HEAD + ROLLING + MIDDLE + WEIGHT + squeezed(), ()),
    "degree 4": (HEAD + SPRINGS + UNDER, ("mls.degree=4", FINER)),
    "wood": (
        HEAD.replace(
            "E = 200.0\nnu = 0.3", "E1 = 120.0\nE2 = 9.0\nG12 = 7.0\nnu12 = 0.4\nangle = 90.0"
        ).replace("strain", "stress")
        + HELD
        + UNDER,
        (),
    ),
}
CLOSE = 1e-3
"""Triangles, and faces of cells with them, may differ on the two sides of coarse clouds."""


def line_found(text: str, overrides: tuple[str, ...]) -> SymmetryLine | None:
    return line_of(parse_case(text, Path("case.toml"), overrides).case)


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
    "collocation": (SLIDING, ('mls.scheme="collocation"', "body.block.spacing=0.1")),
    "ghosts": (SLIDING, ('mls.scheme="ghost"', "body.block.spacing=0.1")),
}


@pytest.mark.parametrize("name", ORDINARY)
def test_others_have_ordinary_clouds(name: str) -> None:
    assert line_found(*ORDINARY[name]) is None


def test_passes_in_the_bulk_keep_clouds_symmetric(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[SceneModel] = []

    def kept(*given: Any) -> SceneModel:
        made.append(place(*given))
        return made[-1]

    monkeypatch.setattr(adapt, "place", kept)
    pull = acts("pull", "top", "pressure", "table = [[0, 0], [0.5, 0], [1, -4], [1.5, 0], [2, 0]]")
    solve(HEAD + HELD + pull, tmp_path / "run", "adapt.passes=2")
    assert made
    assert all(model.cloud.mirror is not None for prepared in made for model in prepared.models.values())
    sides = acts("pull", "top", "pressure", "table = [[0, 0], [1, 0], [1.5, -4], [2, 0]]")
    solve(HEAD + HELD + sides, tmp_path / "sides", "adapt.passes=1")
    assert made[-1].models["block"].cloud.mirror is None
