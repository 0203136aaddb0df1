"""Symmetric scenes solved by half of their equations, where that could go wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.assessment import refinement as adapt
from mlsanm_cli.app.clock import Clock
from mlsanm_cli.app.comparison.compare import CompareOptions, compare
from mlsanm_cli.app.scene import assemble as scene
from mlsanm_cli.app.scene.assemble import SceneModel
from mlsanm_cli.app.scene.build import build_scene, place
from mlsanm_cli.case import load_case
from mlsanm_cli.io.run_reader import read_run
from mlsanm_cli.operators.folded import Folded
from mlsanm_cli.solve.coercivity import BULK_LIMIT, HALF_LIMIT
from tests.app.scenes import COARSE, NODAL, Quiet, solve

pytestmark = pytest.mark.usefixtures("by_nodes")

SOFT = """
format = 1
[model]
plane = "stress"
[material.steel]
E = 1000.0
nu = 0.3
"""
# Nodes on concentric circles: many are equally far from the virtual ones on the other ring.
RINGS = (
    SOFT
    + """[[body]]
name = "out"
material = "steel"
spacing = 0.1
shape = { kind = "annulus", center = [0.0, 0.0], radii = [0.7, 1.2] }
[[body]]
name = "in"
material = "steel"
spacing = 0.1
shape = { kind = "annulus", center = [0.0, 0.0], radii = [0.3, 0.7] }
[[contact]]
name = "fit"
slave = "in.outer"
master = "out.inner"
interference = 1e-3
"""
)
COLUMN = """
[[body]]
name = "column"
material = "steel"
spacing = 0.4
shape = { kind = "rectangle", x = [-1.0, 1.0], y = [20.0, 23.0] }
[[support]]
boundary = "column.bottom"
ux = 0.0
uy = 0.0
[[load]]
name = "pull"
boundary = "column.top"
kind = "traction"
traction = [0.0, 10.0]
"""
# A plate on soft springs: what it yields to most, tilting, is not symmetric.
PLATE = """
format = 1
[model]
plane = "strain"
[material.wood]
E1 = 62231.7
E2 = 34544.5
G12 = 28925.8
nu12 = 0.232
E3 = 34760.9
nu13 = 0.255
nu23 = 0.241
[[body]]
name = "plate"
material = "wood"
spacing = 0.137
[body.shape]
kind = "polygon"
points = [[-1.33, -0.59], [1.33, -0.59], [1.78, 0.0], [-1.78, 0.0]]
names = ["bottom", "right", "top", "left"]
[[body.refine]]
along = "top"
spacing = 0.055
radius = 0.0
growth = 0.25
[[support]]
boundary = "plate.bottom"
spring = [22100.0, 43100.0]
[[load]]
name = "press"
boundary = "plate.top"
kind = "pressure"
pressure = 6.5
[mls]
degree = 4
"""
# One-sided forces shift the outside, which symmetric ones only squeeze.
RING = (
    SOFT
    + """[[body]]
name = "ring"
material = "steel"
spacing = 0.08
seed = 1
shape = { kind = "annulus", center = [0.0, 0.54], radii = [0.22, 0.54] }
[[body.refine]]
along = "outer"
spacing = 0.032
radius = 0.0
growth = 0.25
[[support]]
boundary = "ring.inner"
ux = 0.0
uy = 0.0
[[load]]
name = "press"
boundary = "ring.outer"
kind = "displacement"
uy = -1e-3
[mls]
degree = 4
"""
)


def pressed() -> str:
    """The coarse Hertz scene by nodes, held symmetrically by conditions on whole boundaries."""
    text, _, rest = NODAL.partition('[[support]]\nbody = "block"')
    held = text.replace("uy = 0.0", "ux = 0.0\nuy = 0.0")
    return held + rest[rest.index("[[load]]") :].replace('kind = "platen"', 'kind = "platen"\nux = 0.0')


def whole(*_: Any) -> None:
    """No scene is symmetric."""


def test_pressures_of_a_fit_are_symmetric(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A virtual node and its image have other nodes in their stencils where some are equally far."""
    found = solve(RINGS, tmp_path / "even")
    assert found["status"] == "done"
    assert found["linear_residual"] <= 1e-9
    fit = read_run(tmp_path / "even").contacts["fit"]
    x, y = fit.points.T
    first, second = (np.lexsort((np.round(y, 9), np.round(side, 9))) for side in (x, -x))
    assert fit.pressure[-1][first] == pytest.approx(fit.pressure[-1][second], rel=1e-9)
    monkeypatch.setattr(scene, "even_scene", whole)
    other = solve(RINGS, tmp_path / "whole")
    peaks = [run["contacts"]["fit"]["peak_pressure"] for run in (found, other)]
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-3)


def test_monolithic_methods_take_whole_equations(tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(pressed())
    wishes = CompareOptions(("monolithic",), levels=1, picture=False)
    found = compare(case, wishes, overrides=COARSE, out=tmp_path / "out", console=Quiet())
    assert found["status"] == "agree"


def test_passes_keep_a_scene_symmetric(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[SceneModel] = []

    def kept(*given: Any) -> SceneModel:
        made.append(place(*given))
        return made[-1]

    monkeypatch.setattr(adapt, "place", kept)
    assert len(solve(pressed(), tmp_path / "run", "adapt.passes=2")["adapt"]) == 3
    assert len(made) == 2
    assert all(prepared.line is not None for prepared in made)


def test_halves_of_bodies_are_of_no_use_to_a_scene_that_is_not_symmetric(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pass that finds unlike zones leaves bodies far from them as they are."""
    text = pressed() + COLUMN
    path = tmp_path / "case.toml"
    path.write_text(text)
    case, clock = load_case(path, ("adapt.passes=1",)), Clock()
    prepared = build_scene(case, clock, Quiet())
    assert prepared.line is not None

    def unlike(*given: Any) -> SceneModel:
        monkeypatch.setattr(scene, "even_scene", whole)
        return place(*given)

    monkeypatch.setattr(adapt, "place", unlike)
    built = adapt.adapt(case.case, prepared, clock, Quiet()).built
    column = built.scene.bodies["column"]
    assert column.model is prepared.models["column"]
    assert not isinstance(column.system, Folded)


def test_smooth_answers_of_halves_are_enough_for_the_certificate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Symmetric forces that are linear over both halves bend a plate as one-sided ones tilt it: a half has
    two thirds of the stability of the whole, and a limit of half the whole's."""
    even = solve(PLATE, tmp_path / "even")["stability"]
    monkeypatch.setattr(scene, "even_scene", whole)
    whole_of_it = solve(PLATE, tmp_path / "whole")["stability"]
    assert HALF_LIMIT / BULK_LIMIT < even / whole_of_it < 1.3


def test_halves_pass_where_whole_bodies_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    even = solve(RING, tmp_path / "even")
    monkeypatch.setattr(scene, "even_scene", whole)
    other = solve(RING, tmp_path / "whole")
    assert even["status"] == other["status"] == "done"
    assert even["stability"] < BULK_LIMIT < other["stability"]
    assert even["forces"]["press"][1] == pytest.approx(other["forces"]["press"][1], rel=1e-3)
