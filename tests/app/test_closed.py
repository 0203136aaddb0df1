"""Contacts that go all around, or up to corners next to walls, and the degree that is left to the program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.formulas.lame import LameRing, press_fit
from mlsanm_cli.app.scene.assemble import prepare
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import solve
from tests.case.scenes import parse

FIT = """
format = 1
[model]
plane = "stress"
[material.steel]
E = 210e3
nu = 0.3
[[body]]
name = "hub"
material = "steel"
shape = { kind = "annulus", center = [0.0, 0.0], radii = [10.0, 16.0] }
[[body]]
name = "shaft"
material = "steel"
shape = { kind = "annulus", center = [0.0, 0.0], radii = [4.0, 10.0] }
[[contact]]
name = "fit"
slave = "shaft.outer"
master = "hub.inner"
interference = 0.01
"""
WEDGE = """
format = 1
[model]
plane = "strain"
[material.steel]
E = 210e3
nu = 0.3
[[body]]
name = "wedge"
material = "steel"
[body.shape]
kind = "polygon"
points = [[-3.0, 0.0], [3.0, 0.0], [6.0, 8.0], [-6.0, 8.0]]
names = ["tip", "right", "top", "left"]
[[body]]
name = "one"
material = "steel"
[body.shape]
kind = "polygon"
points = [[-3.0, 0.0], [-16.0, 0.0], [-16.0, 8.0], [-6.0, 8.0]]
names = ["floor", "back", "top", "face"]
[[body]]
name = "other"
material = "steel"
[body.shape]
kind = "polygon"
points = [[3.0, 0.0], [16.0, 0.0], [16.0, 8.0], [6.0, 8.0]]
names = ["floor", "back", "top", "face"]
[[support]]
boundary = "one.back"
spring = [500.0, 0.0]
[[support]]
boundary = "other.back"
spring = [500.0, 0.0]
[[support]]
boundary = "one.floor"
uy = 0.0
[[support]]
boundary = "other.floor"
uy = 0.0
[[load]]
name = "drive"
boundary = "wedge.top"
kind = "platen"
fy = -200.0
[[contact]]
name = "left"
slave = "wedge.left"
master = "one.face"
friction = 0.1
[[contact]]
name = "right"
slave = "wedge.right"
master = "other.face"
friction = 0.1
"""


def test_a_fit_has_the_pressure_of_lame_all_around(tmp_path: Path) -> None:
    solve(FIT, tmp_path / "fit")
    fit = read_run(tmp_path / "fit").contacts["fit"]
    # A contact grid, not the nodes of a surface of 60 times their distance.
    assert len(fit.pressure[-1]) < 40
    shaft, hub = LameRing(4.0, 10.0, 1.0, 210e3, 0.3), LameRing(10.0, 16.0, 1.0, 210e3, 0.3)
    assert fit.pressure[-1] == pytest.approx(press_fit(shaft, hub, 0.01), rel=3e-3)


def test_a_fit_that_is_pulled_aside_may_open_anywhere(tmp_path: Path) -> None:
    """Where the range of a closed contact begins has no part in it: pulled down or aside is the same."""
    held = '[[support]]\nboundary = "shaft.inner"\nux = 0.0\nuy = 0.0\n'
    peaks: list[float] = []
    for way in ("[2.0, 0.0]", "[0.0, -2.0]"):
        pull = f'[[load]]\nname = "pull"\nbody = "hub"\nkind = "body-force"\nbody-force = {way}\n'
        summary = solve(FIT + held + pull, tmp_path / str(len(peaks)))
        assert summary["status"] == "done", summary["stop_reason"]
        peaks.append(summary["contacts"]["fit"]["peak_pressure"])
    assert peaks[1] == pytest.approx(peaks[0], rel=5e-3)


def test_a_wedge_between_blocks_that_slide(tmp_path: Path) -> None:
    """Corners next to a platen and next to walls, neither at a right angle: symmetric, and in equilibrium."""
    summary = solve(WEDGE, tmp_path / "wedge")
    assert summary["status"] == "done", summary["stop_reason"]
    left, right = (summary["contacts"][name]["force"] for name in ("left", "right"))
    assert left[1] == pytest.approx(100.0, rel=1e-6)
    assert [-left[0], left[1]] == pytest.approx(right, rel=1e-4)
    # Rigid friction wedges: the faces rise by 8 over 3.
    slope = np.arctan2(8.0, 3.0)
    across = 100.0 * np.tan(slope - np.arctan(0.1))
    assert abs(left[0]) == pytest.approx(across, rel=1e-3)


@pytest.mark.parametrize(
    ("setting", "degrees"),
    [
        ((), {"hub": 4, "shaft": 4}),
        (("mls.degree=3",), {"hub": 3, "shaft": 3}),
        (("mls.neighbors=18",), {"hub": 2, "shaft": 2}),
    ],
)
def test_the_degree_that_is_left_to_us(setting: tuple[str, ...], degrees: dict[str, int]) -> None:
    case = parse(FIT, setting).case
    models = prepare(case, clouds(case)).models
    assert {name: model.settings.degree for name, model in models.items()} == degrees


@pytest.mark.usefixtures("by_nodes")
def test_bodies_with_nodal_contacts_have_degree_2() -> None:
    case = parse(FIT).case
    models = prepare(case, clouds(case)).models
    assert {model.settings.degree for model in models.values()} == {2}
