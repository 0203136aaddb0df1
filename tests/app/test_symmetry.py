"""Symmetric scenes have symmetric clouds and results; others ordinary clouds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.assessment import refinement as adapt
from mlsanm_cli.app.scene import build
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import place
from mlsanm_cli.cloud.mirror import Line
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import NODAL, assert_same_bits, solve
from tests.app.test_loose import DISK, SMOOTH

pytestmark = pytest.mark.usefixtures("by_nodes")

HEAD = """
format = 1
[model]
plane = "strain"
[material.stuff]
E = 200.0
nu = 0.3
[[body]]
name = "block"
material = "stuff"
spacing = 0.2
shape = { kind = "rectangle", x = [-1.0, 1.0], y = [-1.0, 0.0] }
"""
HELD = '[[support]]\nboundary = "block.bottom"\nux = 0.0\nuy = 0.0\n'
ROLLING = '[[support]]\nboundary = "block.bottom"\nuy = 0.0\n'
MIDDLE = '[[support]]\nbody = "block"\nnear = [0.0, -1.0]\nux = 0.0\n'
SPRINGS = '[[support]]\nboundary = "block.bottom"\nspring = [40.0, 90.0]\n'
SIDES = '[[support]]\nboundary = "block.{}"\nspring = [{}, 3.0]\n'
WEIGHT = '[[load]]\nname = "weight"\nbody = "block"\nkind = "body-force"\nbody-force = [0.0, -3.0]\n'
PROBES = '[[probe]]\nname = "{0}"\nbody = "block"\npoint = [{1}, -0.37]\n'
BESIDE = PROBES.format("one", 0.43) + PROBES.format("other", -0.43)
UNDER = """
[[load]]
name = "press"
kind = "obstacle"
obstacle = "under"
fy = -4.0
[[contact]]
name = "under"
slave = "block.top"
obstacle = { kind = "disk", center = [0.0, 3.0], radius = 3.0 }
regularization = { law = "exact" }
"""
RINGS = """
format = 1
[model]
plane = "stress"
[material.steel]
E = 210e3
nu = 0.3
[[body]]
name = "hub"
material = "steel"
spacing = 0.15
shape = { kind = "annulus", center = [0.0, 0.0], radii = [1.0, 1.6] }
[[body]]
name = "bush"
material = "steel"
spacing = 0.15
shape = { kind = "annulus", center = [0.0, 0.0], radii = [0.6, 1.0] }
[[contact]]
name = "fit"
slave = "bush.outer"
master = "hub.inner"
interference = 0.001
regularization = { law = "exact" }
"""
FREE_PLATEN = (
    '[[load]]\nname = "press"\nboundary = "block.top"\nkind = "platen"\nfy = -4.0\nrotation = "free"\n'
)
EXACT = 'contact.interface.regularization.law="exact"'
PUNCH = '{kind="polyline", points=[[-0.4, 1.0], [-0.4, 0.0], [0.4, 0.0], [0.4, 1.0]]}'
HALF = "body.block.spacing=0.1"
"""Where with the spacing of the others strain energy differs from work by more than a run may pass with."""
FINER = "body.block.refine=[{at=[0.0, 0.0], spacing=0.05, radius=0.3, growth=0.1}]"
LEVEL = "body.block.refine=[{at=[-0.6, -0.5], spacing=0.1, radius=0.2, growth=0.2}]"


def load(name: str, boundary: str, kind: str, value: str) -> str:
    return f'[[load]]\nname = "{name}"\nboundary = "block.{boundary}"\nkind = "{kind}"\n{value}\n'


def squeezed(left: str = "table = [[0, 3], [1, 1]]", right: str = "table = [[0, 1], [1, 3]]") -> str:
    """Pressures on two sides, of which the left one runs downward, as two loads."""
    return load("left", "left", "pressure", left) + load("right", "right", "pressure", right)


BOTH = "[[stage]]\nleft = 0.5\nright = 0.5\n[[stage]]\nleft = 1.0\nright = 1.0\n[output]\nat = [0.4, 2.0]\n"
SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "platen and contact": (NODAL, (EXACT,)),
    "smooth contact": (NODAL, ("output.at=[0.4, 1.0]", "solver.tolerance=1e-11")),
    "platen moved": (NODAL.replace("fy = -226.0", "uy = -0.002"), (EXACT,)),
    "platen that may turn and shift": (HEAD + HELD + FREE_PLATEN, ("load.press.fx=0.0",)),
    "obstacle": (HEAD + HELD + UNDER + BESIDE, (HALF,)),
    "polyline": (HEAD + HELD + UNDER, (f"contact.under.obstacle={PUNCH}",)),
    "loose": (DISK, ()),
    "loose and smooth": (DISK, (*SMOOTH, "solver.tolerance=1e-11")),
    "fit": (RINGS, ()),
    "body force": (HEAD + HELD + WEIGHT + BESIDE, ()),
    "tables on two sides": (HEAD + HELD + squeezed() + BOTH, ()),
    "expressions on two sides": (HEAD + HELD + squeezed(*["pressure = '1 + y*y + x*x'"] * 2), (HALF,)),
    "tractions that are shared": (
        HEAD
        + HELD
        + load("a", "top", "traction", "traction = ['1 + x', '-2 + x']")
        + load("b", "top", "traction", "traction = [-1.0, '-x']"),
        (),
    ),
    "springs": (HEAD + SPRINGS + WEIGHT, ()),
    "springs on two sides": (
        HEAD + ROLLING + SIDES.format("left", 5) + SIDES.format("right", 5) + WEIGHT,
        (),
    ),
    "held node": (HEAD + ROLLING + MIDDLE + WEIGHT + squeezed(), ()),
    "level": (
        HEAD + HELD.replace("bottom", "left") + load("pull", "right", "traction", "traction = [2.0, 0.0]"),
        (LEVEL,),
    ),
    "displacement": (HEAD + HELD + load("pull", "top", "displacement", "ux = 0.0\nuy = '0.01*x*x'"), ()),
    "heat": (
        HEAD.replace("nu = 0.3", "nu = 0.3\nalpha = 1e-3")
        + HELD
        + '[[load]]\nname = "heat"\nbody = "block"\nkind = "temperature"\ntemperature = 5.0\n',
        ("body.block.spacing=0.05",),
    ),
    "uneven heat": (
        HEAD.replace("nu = 0.3", "nu = 0.3\nalpha = 1e-3")
        + HELD
        + '[[load]]\nname = "heat"\nbody = "block"\nkind = "temperature"\ntemperature = "5 + 9*x**2"\n',
        ("body.block.spacing=0.05",),
    ),
    **{f"degree {p}": (HEAD + SPRINGS + UNDER, (f"mls.degree={p}", FINER)) for p in (1, 2, 4)},
    # Contacts of this degree resist hardly any pressures that change from node to node.
    "degree 6": (HEAD + SPRINGS + WEIGHT + squeezed(), ("mls.degree=6",)),
    "nearly incompressible": (HEAD + HELD + UNDER, ("material.stuff.nu=0.4999", "body.block.spacing=0.05")),
    "wood": (
        HEAD.replace(
            "E = 200.0\nnu = 0.3", "E1 = 120.0\nE2 = 9.0\nG12 = 7.0\nnu12 = 0.4\nangle = 90.0"
        ).replace("strain", "stress")
        + HELD
        + UNDER,
        (),
    ),
}
LINES = {"level": Line(1, -0.5)}
CLOSE = 1e-3
"""Triangles, and faces of cells with them, may differ on the two sides of coarse clouds."""


@pytest.mark.parametrize("name", SCENES)
def test_results_of_symmetric_scenes_are_symmetric(name: str, tmp_path: Path) -> None:
    text, overrides = SCENES[name]
    line = LINES.get(name, Line(0, 0.0))
    summary = solve(text, tmp_path, *overrides)
    assert (summary["status"], summary["symmetry"]) == ("done", str(line)), summary
    data = read_run(tmp_path)
    for body, shape in data.bodies.items():
        image = line.images(shape.points, np.full(len(shape.points), 1e-3))
        assert image is not None
        fields = data.states[-1].bodies[body]
        for found, signs in ((fields["displacement"], line.signs), (fields["stress"], np.array([1, 1, -1]))):
            assert np.abs(found[image] * signs - found).max() <= CLOSE * np.abs(found).max(), body
    for contact in data.contacts.values():
        image = line.images(contact.points, np.full(len(contact.points), 1e-3))
        assert image is not None
        pressure = contact.pressure[-1]
        assert np.abs(pressure[image] - pressure).max() <= CLOSE * pressure.max()


@pytest.mark.parametrize("spacing", [0.1, 0.05, 0.04])
def test_an_even_stress_is_exact(spacing: float, tmp_path: Path) -> None:
    pull = load("pull", "top", "traction", "traction = [0.0, 4.0]")
    summary = solve(HEAD + ROLLING + MIDDLE + pull, tmp_path / "run", f"body.block.spacing={spacing}")
    assert summary["symmetry"] == "x = 0"
    stress = read_run(tmp_path / "run").states[-1].bodies["block"]["stress"]
    assert np.abs(stress - [0.0, 4.0, 0.0]).max() <= 1e-9


TRAPEZOID = (
    'kind = "rectangle", x = [-1.0, 1.0], y = [-1.0, 0.0]',
    'kind = "polygon", points = [[-1, -1], [1.1, -1], [1, 0], [-1, 0]], '
    'names = ["bottom", "right", "top", "left"]',
)
SLIDING = HEAD + HELD + UNDER
ORDINARY: dict[str, tuple[str, tuple[str, ...]]] = {
    "outline": (HEAD.replace(*TRAPEZOID) + HELD + UNDER, (HALF,)),
    "zone": (SLIDING, ("body.block.refine=[{at=[0.1, 0.0], spacing=0.1, radius=0.2, growth=0.2}]",)),
    "friction": (SLIDING, ("contact.under.friction=0.3",)),
    "collocation": (SLIDING, ('mls.scheme="collocation"', "body.block.spacing=0.1")),
    "ghosts": (SLIDING, ('mls.scheme="ghost"', "body.block.spacing=0.1")),
}


@pytest.mark.parametrize("name", ORDINARY)
def test_others_have_ordinary_clouds(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, overrides = ORDINARY[name]
    summary = solve(text, tmp_path / "run", *overrides)
    assert (summary["status"], summary["symmetry"]) == ("done", None), summary
    monkeypatch.setattr(build, "line_of", lambda case: None)
    solve(text, tmp_path / "ordinary", *overrides)
    assert_same_bits(tmp_path / "run", tmp_path / "ordinary")


def test_passes_in_the_bulk_keep_clouds_symmetric(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[SceneModel] = []

    def kept(*given: Any) -> SceneModel:
        made.append(place(*given))
        return made[-1]

    monkeypatch.setattr(adapt, "place", kept)
    pull = load("pull", "top", "pressure", "table = [[0, 0], [0.5, 0], [1, -4], [1.5, 0], [2, 0]]")
    solve(HEAD + HELD + pull, tmp_path / "run", "adapt.passes=2")
    assert made
    assert all(model.cloud.mirror is not None for prepared in made for model in prepared.models.values())
    sides = load("pull", "top", "pressure", "table = [[0, 0], [1, 0], [1.5, -4], [2, 0]]")
    solve(HEAD + HELD + sides, tmp_path / "sides", "adapt.passes=1")
    assert made[-1].models["block"].cloud.mirror is None
