"""Small scenes: coarse enough that a run takes a fraction of a second."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from mlsanm_cli.app.checks.references import read_case
from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.run import run
from mlsanm_cli.app.scene.assemble import SceneModel, prepare
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.build import build_scene
from mlsanm_cli.app.scene.clouds import clouds
from mlsanm_cli.app.scene.condense import condense_scene
from mlsanm_cli.case import parse_case
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.solve.condensed_scene import CondensedScene
from tests.case_text import EXACT, Scene, pin, scene

FINE = {"at": [0.0, 0.0], "spacing": 0.012, "radius": 0.06, "growth": 0.12}
NODAL = (
    Scene('title = "Half-disk on a block, by nodes"\n')
    .add(scene("strain"))
    .body("cylinder", "steel", 0.35, half_disk=([0.0, 1.0], 1.0))
    .item("body.refine", **FINE)
    .body("block", "steel", 0.35)
    .table(
        "body.shape",
        kind="polygon",
        # Of corners so blunt no fields are known.
        points=[[-2.0, -0.2], [-2.0, -2.0], [2.0, -2.0], [2.0, -0.2], [0.075, 0.0], [-0.075, 0.0]],
        names=["left", "bottom", "right", "beside", "top", "beyond"],
    )
    .item("body.refine", **FINE)
    .support("block.bottom", uy=0.0)
    .pin("block", [0.0, -2.0], ux=0.0)
    .pin("cylinder", [0.0, 1.0], ux=0.0)
    .load("press", "cylinder.flat", "platen", fy=-226.0)
    .contact("interface", "cylinder.arc", "block.top")
    .table("reference", solution="hertz-line")
)
"""The top is cut so near the contact that this has no grid of its own: pressures are those of nodes."""

COARSE = tuple(
    f"body.{body}.{key}"
    for body in ("cylinder", "block")
    for key in ("refine=[{at=[0.0, 0.0], spacing=0.02, radius=0.06, growth=0.2}]", "spacing=0.35")
)
"""Makes of it a scene of some 400 nodes, for what solves all their equations in every step."""

FAST = "contact.interface.accuracy=0.1"
"""Makes of ``hertz()`` a scene of 30 places, for what does not look at how good its pressures are."""

ANM, NEWTON = "solver.method=anm", "solver.method=newton"
EXACT_LAW = "contact.*.regularization.law=exact"
SMOOTH = (
    *COARSE,
    ANM,
    "solver.increments=4",
    "contact.interface.regularization.eta=1e-2",
    "contact.interface.regularization.stick=1e-3",
)
"""The regularised law by power series, soft and on nodes that the contact of ``hertz()`` needs."""

PATCH = (
    scene("strain")
    .body("upper", "steel", 0.25, box=([0.0, 2.0], [1.0, 2.0]))
    .body("lower", "steel", 0.2, box=([0.0, 2.0], [0.0, 1.0]))
    .support("upper.left", ux=0.0)
    .support("lower.left", ux=0.0)
    .support("lower.bottom", uy=0.0)
    .load("press", "upper.top", "platen", fy=-200.0)
    .contact("interface", "upper.bottom", "lower.top", regularization=EXACT)
    .table("reference", solution="uniform-pressure")
)

BAR = (
    scene("stress", E=200e3, nu=0.25)
    .body("bar", "steel", 0.25, box=([0.0, 2.0], [0.0, 1.0]))
    .support("bar.left", ux=0.0)
    .support("bar.bottom", uy=0.0)
    .load("pull", "bar.right", "traction", traction=[30.0, 0.0])
    .load("squeeze", "bar.top", "pressure", pressure=40.0)
    .stages("pull", "squeeze")
    .table("output", at=[0.5, 1.25, 2.0])
)


def _punch(name: str, x: float, depth: float) -> Scene:
    return (
        Scene()
        .body(name, "steel", 0.15, half_disk=([x, 0.5], 0.5))
        .load(name, f"{name}.flat", "platen", uy=depth)
        .pin(name, [x, 0.5], ux=0.0)
        .contact(f"under-{name}", f"{name}.arc", "block.top", accuracy=0.01)
    )


PUNCHES = (
    scene("strain", E=1.0)
    .body("block", "steel", 0.2, box=([-2.0, 2.0], [-2.0, 0.0]))
    .support("block.bottom", uy=0.0)
    .pin("block", [0.0, -2.0], ux=0.0)
    .add(_punch("left", -0.7, -0.004), _punch("right", 0.7, -0.006))
)


def hertz(length: float = 1.0, stress: float = 1.0) -> Scene:
    """The coarse half-disk on a block, in units in which lengths and stresses have these factors.

    Its contact is on a grid of its own, of some 80 places.
    """
    edge = 2.0 * length
    return (
        Scene('title = "Half-disk on a block, coarse"\n')
        .add(scene("strain", E=210e3 * stress))
        .body("cylinder", "steel", 0.25 * length, half_disk=([0.0, length], length))
        .body("block", "steel", 0.25 * length, box=([-edge, edge], [-edge, 0.0]))
        .support("block.bottom", uy=0.0)
        .pin("block", [0.0, -edge], ux=0.0)
        .pin("cylinder", [0.0, length], ux=0.0)
        .load("press", "cylinder.flat", "platen", fy=-226.0 * stress * length)
        .contact("interface", "cylinder.arc", "block.top", accuracy=0.01)
        .table("reference", solution="hertz-line")
    )


SHEARED = (
    hertz()
    .changed(pin("cylinder", [0.0, 1.0], ux=0.0), "")
    .changed("fy = -226.0", "force = [0.0, -226.0]")
    .changed("accuracy = 0.01", "friction = 0.4\naccuracy = 0.1")
    .changed('[reference]\nsolution = "hertz-line"\n', "")
    .load("shear", "cylinder.flat", "platen", fx=50.0)
    .stages("press", "shear", "shear=-1")
    .table("output", at=[1.0, 1.5, 2.25, 3.0])
)
"""With friction: pressed, sheared and sheared back."""


class Quiet:
    """A console that keeps what it is told."""

    def __init__(self) -> None:
        self.phases: list[str] = []
        self.steps: list[float] = []
        self.notes: list[str] = []
        self.warnings: list[str] = []
        self.errors: list[tuple[str, str]] = []

    def phase(self, text: str) -> None:
        self.phases.append(text)

    def note(self, text: str) -> None:
        self.notes.append(text)

    def warning(self, text: str) -> None:
        self.warnings.append(text)

    def error(self, message: str, hint: str) -> None:
        self.errors.append((message, hint))

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        self.steps.append(position)


def solve(text: str, directory: Path, *overrides: str, console: Quiet | None = None) -> Mapping[str, Any]:
    """Write the case next to ``directory``, run it into it, return the summary."""
    case = directory.with_suffix(".toml")
    case.write_text(text)
    return run(case, overrides=overrides, out=directory, console=console or Quiet())


def done(text: str, directory: Path, *overrides: str, console: Quiet | None = None) -> Mapping[str, Any]:
    """The summary of a run that is done."""
    summary = solve(text, directory, *overrides, console=console)
    assert summary["status"] == "done", summary["stop_reason"]
    return summary


def refused(text: str, directory: Path, key: str, words: str, *overrides: str) -> CaseProblem:
    """What is wrong with a case at a key, as its message or hint says in these words."""
    with pytest.raises(CaseError) as caught:
        solve(text, directory, *overrides)
    problems = caught.value.problems
    found = [one for one in problems if one.key == key and words in f"{one.message} {one.hint}"]
    assert found, problems
    return found[0]


def prepared(text: str, *overrides: str) -> SceneModel:
    """The bodies and contacts of a case, before anything is solved."""
    case = parse_case(text, Path("case.toml"), overrides).case
    boundaries = Boundaries.of(case)
    return prepare(boundaries, clouds(boundaries))


def built(text: str, directory: Path, *overrides: str) -> CondensedScene:
    """A condensed scene, ready for its path."""
    case = directory / "case.toml"
    case.write_text(text)
    loaded, context = read_case(case, overrides), RunContext(Clock(), Quiet())
    return condense_scene(loaded.case, build_scene(loaded, context), context)
