"""Symmetric scenes are solved by half of their equations, others by all of them; the results are the same."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlsanm_cli.app.scene import assemble as scene
from mlsanm_cli.app.scene import build, symmetry
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cli import main
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import COARSE, NODAL, Quiet, assert_same_bits, solve
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
SAME = 1e-8
FEWER_DIGITS = {
    # Here triangles, and what the stencils at Gauss's points are made of, are not alike on both sides.
    "platen and contact": 2e-4,
    "smooth contact": 2e-4,
    "platen moved": 2e-4,
    "obstacle": 5e-6,
    "loose": 2e-4,
    "loose and smooth": 2e-4,
    "expressions on two sides": 2e-6,
    "level": 5e-6,
    "heat": 5e-5,
    "uneven heat": 5e-5,
    "degree 1": 5e-4,
    "degree 2": 2e-5,
    "degree 4": 5e-6,
    "nearly incompressible": 1e-3,
    # Nodes lie on nodes: of those equally far a stencil of one surface at the other's takes some, not the
    # same on both sides.
    "fit": 1e-3,
}
"""Largest differences, relative to the largest value."""


def solve_whole(
    monkeypatch: pytest.MonkeyPatch, text: str, directory: Path, *overrides: str
) -> Mapping[str, Any]:
    """A run that knows of no symmetry but that of its cloud."""
    with monkeypatch.context() as patch:
        patch.setattr(scene, "even_scene", lambda *given: None)
        return solve(text, directory, *overrides)


def results(directory: Path) -> dict[str, FloatArray]:
    """All that a run found, by name."""
    data, summary = read_run(directory), json.loads((directory / "summary.json").read_text())
    found = {
        f"{number} {name} {key}": values
        for number, state in enumerate(data.states)
        for name, fields in state.bodies.items()
        for key, values in fields.items()
    }
    found |= {f"{name} pressure": contact.pressure[-1] for name, contact in data.contacts.items()}
    found |= {f"{name} gap": contact.gap[-1] for name, contact in data.contacts.items()}
    found |= {f"{name} moves": moved[-1] for name, moved in data.path.displacements.items()}
    for name, probe in data.probes.items():
        found |= {f"{name} shift": probe.displacement[-1], f"{name} stress": probe.stress[-1]}
    sizes = [np.abs(force) for force in summary["forces"].values()]
    found["forces"] = np.array(list(summary["forces"].values()))
    assert np.max(sizes, initial=0.0) > 0.0 or data.contacts
    return found


@pytest.mark.parametrize("name", SCENES)
def test_half_of_the_equations_is_enough(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, overrides = SCENES[name]
    summary = solve_whole(monkeypatch, text, tmp_path / "whole", *overrides)
    assert (summary["status"], summary["symmetry"]) == ("done", None), summary
    halved = solve(text, tmp_path / "half", *overrides)
    assert (halved["status"], halved["symmetry"]) == ("done", "y = -0.5" if name == "level" else "x = 0"), (
        halved
    )
    expected, found = results(tmp_path / "whole"), results(tmp_path / "half")
    assert expected.keys() == found.keys()
    for key, values in expected.items():
        # What symmetry makes zero is so next to what it does not.
        size = np.abs(values).max(initial=0.0)
        if key == "forces":
            # Those that only round-off makes: of reactions where nothing pushes.
            size = max(size, *(1e-9 * np.abs(v).max() for k, v in expected.items() if k.endswith("stress")))
        if key.endswith(("moves", "shift")):
            size = max(np.abs(v).max() for k, v in expected.items() if k.endswith("displacement"))
        assert np.abs(found[key] - values).max(initial=0.0) <= FEWER_DIGITS.get(name, SAME) * size, key
    for key in ("force_balance", "linear_residual", "stability"):
        assert (halved[key] is None) == (summary[key] is None)
    one, other = halved["error_estimate"], summary["error_estimate"]
    if other["displacement"] is None:
        assert one == other
        return
    assert one["displacement"] == pytest.approx(other["displacement"], rel=1e-2)
    # Of every second node pressures are not symmetric: a half takes those of one side for both.
    assert one["pressure"] == pytest.approx(other["pressure"], rel=0.15)


@pytest.mark.parametrize("spacing", [0.1, 0.05, 0.04])
def test_an_even_stress_is_exact_in_halves(spacing: float, tmp_path: Path) -> None:
    pull = load("pull", "top", "traction", "traction = [0.0, 4.0]")
    summary = solve(HEAD + ROLLING + MIDDLE + pull, tmp_path / "run", f"body.block.spacing={spacing}")
    assert summary["symmetry"] == "x = 0"
    stress = read_run(tmp_path / "run").states[-1].bodies["block"]["stress"]
    assert np.abs(stress - [0.0, 4.0, 0.0]).max() <= 1e-9


BESIDE_PLATEN = '[[load]]\nname = "press"\nboundary = "block.left"\nkind = "platen"\nux = 0.01\n'
TRAPEZOID = (
    'kind = "rectangle", x = [-1.0, 1.0], y = [-1.0, 0.0]',
    'kind = "polygon", points = [[-1, -1], [1.1, -1], [1, 0], [-1, 0]], '
    'names = ["bottom", "right", "top", "left"]',
)
SLIDING = HEAD + HELD + UNDER
SQUEEZED = HEAD + ROLLING + MIDDLE + squeezed()
WHOLE: dict[str, tuple[str, tuple[str, ...]]] = {
    "loads apart": (HEAD + HELD + squeezed(right="table = [[0, 1], [1, 3.00001]]"), ()),
    "factors apart": (SQUEEZED + "[[stage]]\nleft = 1.0\nright = 1.0\n[[stage]]\nleft = 0.5\n", ()),
    "one after the other": (SQUEEZED + "[[stage]]\nleft = 1.0\n[[stage]]\nright = 1.0\n", ()),
    "one side only": (HEAD + HELD + load("left", "left", "pressure", "pressure = 2.0"), ()),
    "shear": (HEAD + HELD + load("shear", "top", "traction", "traction = [1.0, 0.0]"), ()),
    "sideways body force": (HEAD + HELD + WEIGHT, ("load.weight.body-force=[1e-6, -3.0]",)),
    "displacement": (
        HEAD + HELD + load("pull", "top", "displacement", "ux = 0.0\nuy = '0.01*(1 + x)'"),
        ("body.block.spacing=0.1",),
    ),
    "support on one side": (HEAD + HELD.replace("bottom", "left") + WEIGHT, ()),
    "support of one side": (HEAD + ROLLING + '[[support]]\nboundary = "block.left"\nux = 0.0\n' + WEIGHT, ()),
    "springs apart": (HEAD + ROLLING + SIDES.format("left", 5) + SIDES.format("right", 5.001) + WEIGHT, ()),
    "held node off the line": (HEAD + ROLLING + MIDDLE.replace("0.0, -1", "0.2, -1") + WEIGHT, ()),
    "oblique wood": (SCENES["wood"][0], ("material.stuff.angle=80.0",)),
    "platen moved across": (HEAD + HELD + FREE_PLATEN, ("load.press.fx=0.1",)),
    "platen beside": (
        HEAD + HELD + BESIDE_PLATEN,
        ("body.block.spacing=0.1",),
    ),
    "obstacle beside": (SLIDING, ("contact.under.obstacle.center=[0.01, 3.0]", HALF)),
    "monolithic": (
        NODAL,
        (*COARSE, "contact.interface.regularization.eta=0.1", 'solver.formulation="monolithic"'),
    ),
    "outline": (HEAD.replace(*TRAPEZOID) + HELD + UNDER, (HALF,)),
    "zone": (SLIDING, ("body.block.refine=[{at=[0.1, 0.0], spacing=0.1, radius=0.2, growth=0.2}]",)),
    "friction": (SLIDING, ("contact.under.friction=0.3",)),
    "collocation": (SLIDING, ('mls.scheme="collocation"', "body.block.spacing=0.1")),
    "ghosts": (SLIDING, ('mls.scheme="ghost"', "body.block.spacing=0.1")),
}
ORDINARY = {"outline", "zone", "friction", "collocation", "ghosts"}
"""Scenes whose clouds are not symmetric either."""


@pytest.mark.parametrize("name", WHOLE)
def test_others_are_solved_whole(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, overrides = WHOLE[name]
    summary = solve(text, tmp_path / "run", *overrides)
    assert (summary["status"], summary["symmetry"]) == ("done", None), summary
    solve_whole(monkeypatch, text, tmp_path / "whole", *overrides)
    assert_same_bits(tmp_path / "run", tmp_path / "whole")
    if name in ORDINARY:
        monkeypatch.setattr(build, "line_of", lambda case: None)
        solve(text, tmp_path / "ordinary", *overrides)
        assert_same_bits(tmp_path / "run", tmp_path / "ordinary")


def test_factors_that_stay_together_are_symmetric(tmp_path: Path) -> None:
    together = SQUEEZED + "[[stage]]\nleft = 1.0\nright = 1.0\n[[stage]]\nleft = 0.5\nright = 0.5\n"
    assert solve(together, tmp_path / "run")["symmetry"] == "x = 0"


@pytest.mark.parametrize("name", ["loads apart", "one side only", "shear", "factors apart"])
def test_loads_wrongly_taken_for_symmetric_end_the_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(symmetry, "_even_loads", lambda *given: True)
    text, overrides = WHOLE[name]
    (tmp_path / "case.toml").write_text(text)
    settings = [word for override in overrides for word in ("--set", override)]
    assert main(["run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run"), *settings]) == 3
    assert "the elastic systems are solved to" in capsys.readouterr().err


def test_runs_tell_that_they_are_symmetric(tmp_path: Path) -> None:
    console = Quiet()
    solve(SLIDING, tmp_path / "run", console=console)
    assert "its own mirror image about x = 0" in " ".join(console.notes)
    console = Quiet()
    solve(WHOLE["shear"][0], tmp_path / "whole", console=console)
    assert not [note for note in console.notes if "mirror" in note]
