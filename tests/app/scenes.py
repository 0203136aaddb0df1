"""Small scenes: coarse enough that a run takes a fraction of a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mlsanm_cli.app.context import Clock, RunContext
from mlsanm_cli.app.run import run
from mlsanm_cli.app.scene.build import build_scene, condense_scene
from mlsanm_cli.case import load_case
from mlsanm_cli.solve.condensed_scene import CondensedScene
from tests.case_text import EXACT, body, box, contact, head, item, load, material, pin, support, table

NODAL = (
    'title = "Half-disk on a block, by nodes"\n'
    + head("strain")
    + material("steel", E=210e3, nu=0.3)
    + body("cylinder", "steel", 0.35)
    + table("body.shape", kind="half-disk", center=[0.0, 1.0], radius=1.0, side="lower")
    + item("body.refine", at=[0.0, 0.0], spacing=0.012, radius=0.06, growth=0.12)
    + body("block", "steel", 0.35)
    + table(
        "body.shape",
        kind="polygon",
        # Of corners so blunt no fields are known.
        points=[[-2.0, -0.2], [-2.0, -2.0], [2.0, -2.0], [2.0, -0.2], [0.075, 0.0], [-0.075, 0.0]],
        names=["left", "bottom", "right", "beside", "top", "beyond"],
    )
    + item("body.refine", at=[0.0, 0.0], spacing=0.012, radius=0.06, growth=0.12)
    + support("block.bottom", uy=0.0)
    + pin("block", [0.0, -2.0], ux=0.0)
    + pin("cylinder", [0.0, 1.0], ux=0.0)
    + load("press", "cylinder.flat", "platen", fy=-226.0)
    + contact("interface", "cylinder.arc", "block.top")
    + table("reference", solution="hertz-line")
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

ANM = 'solver.method="anm"'
AS_SERIES = (ANM, "solver.polish=false")
"""The regularised law as it is, by power series."""

PATCH = (
    head("strain")
    + material("steel", E=210e3, nu=0.3)
    + body("upper", "steel", 0.25, box([0.0, 2.0], [1.0, 2.0]))
    + body("lower", "steel", 0.2, box([0.0, 2.0], [0.0, 1.0]))
    + support("upper.left", ux=0.0)
    + support("lower.left", ux=0.0)
    + support("lower.bottom", uy=0.0)
    + load("press", "upper.top", "platen", fy=-200.0)
    + contact("interface", "upper.bottom", "lower.top", regularization=EXACT)
    + table("reference", solution="uniform-pressure")
)

BAR = (
    head("stress")
    + material("steel", E=200e3, nu=0.25)
    + body("bar", "steel", 0.25, box([0.0, 2.0], [0.0, 1.0]))
    + support("bar.left", ux=0.0)
    + support("bar.bottom", uy=0.0)
    + load("pull", "bar.right", "traction", traction=[30.0, 0.0])
    + load("squeeze", "bar.top", "pressure", pressure=40.0)
    + item("stage", pull=1.0)
    + item("stage", squeeze=1.0)
    + table("output", at=[0.5, 1.25, 2.0])
)


def _punch(name: str, x: float, depth: float) -> str:
    return (
        body(name, "steel", 0.15)
        + table("body.shape", kind="half-disk", center=[x, 0.5], radius=0.5, side="lower")
        + load(name, f"{name}.flat", "platen", uy=depth)
        + pin(name, [x, 0.5], ux=0.0)
        + contact(f"under-{name}", f"{name}.arc", "block.top", accuracy=0.01)
    )


PUNCHES = (
    head("strain")
    + material("steel", E=1.0, nu=0.3)
    + body("block", "steel", 0.2, box([-2.0, 2.0], [-2.0, 0.0]))
    + support("block.bottom", uy=0.0)
    + pin("block", [0.0, -2.0], ux=0.0)
    + _punch("left", -0.7, -0.004)
    + _punch("right", 0.7, -0.006)
)


def hertz(length: float = 1.0, stress: float = 1.0) -> str:
    """The coarse half-disk on a block, in units in which lengths and stresses have these factors.

    Its contact is on a grid of its own, of some 80 places.
    """
    edge = 2.0 * length
    return (
        'title = "Half-disk on a block, coarse"\n'
        + head("strain")
        + f"[material.steel]\nE = {210e3 * stress!r}\nnu = 0.3\n"
        + body("cylinder", "steel", 0.25 * length)
        + table("body.shape", kind="half-disk", center=[0.0, length], radius=length, side="lower")
        + body("block", "steel", 0.25 * length)
        + table("body.shape", kind="rectangle", x=[-edge, edge], y=[-edge, 0.0])
        + support("block.bottom", uy=0.0)
        + pin("block", [0.0, -edge], ux=0.0)
        + pin("cylinder", [0.0, length], ux=0.0)
        + load("press", "cylinder.flat", "platen", fy=-226.0 * stress * length)
        + contact("interface", "cylinder.arc", "block.top", accuracy=0.01)
        + table("reference", solution="hertz-line")
    )


class Quiet:
    """A console that keeps what it is told."""

    def __init__(self) -> None:
        self.phases: list[str] = []
        self.steps: list[float] = []
        self.notes: list[str] = []
        self.warnings: list[str] = []

    def phase(self, text: str) -> None:
        """Keep the phase."""
        self.phases.append(text)

    def step(self, index: int, position: float, residual: float, text: str) -> None:
        """Keep the position."""
        self.steps.append(position)

    def note(self, text: str) -> None:
        """Keep the note."""
        self.notes.append(text)

    def warning(self, text: str) -> None:
        """Keep the warning."""
        self.warnings.append(text)

    def table(self, title: str, rows: Sequence[tuple[str, str]]) -> None:
        """Tables are not looked at."""


def solve(text: str, directory: Path, *overrides: str, console: Quiet | None = None) -> Mapping[str, Any]:
    """Write the case next to ``directory``, run it into it, return the summary."""
    case = directory.with_suffix(".toml")
    case.write_text(text)
    return run(case, overrides=overrides, out=directory, console=console or Quiet())


def built_of(case: Path, *settings: str) -> CondensedScene:
    """The condensed scene of a case file."""
    loaded, context = load_case(case, settings), RunContext(Clock(), Quiet())
    return condense_scene(loaded.case, build_scene(loaded, context), context)


def stored(directory: Path) -> dict[str, Any]:
    """Every dataset of a run but its times."""
    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name not in ("path/seconds", "case/raw"):
            found[name] = item[()]

    with h5py.File(directory / "run.h5", "r") as root:
        root.visititems(keep)
    return found


def assert_same_results(one: Path, other: Path) -> None:
    """Two runs hold the same numbers, but for round-off."""
    first, second = stored(one), stored(other)
    assert first.keys() == second.keys()
    for name, values in first.items():
        if np.asarray(values).dtype.kind == "f":
            size = float(np.abs(values).max(initial=0.0, where=np.isfinite(values)))
            np.testing.assert_allclose(second[name], values, rtol=0.0, atol=1e-9 * size, err_msg=name)
        else:
            np.testing.assert_array_equal(second[name], values, err_msg=name)
