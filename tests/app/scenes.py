"""Small scenes: coarse enough that a run takes a fraction of a second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mlsanm_cli.app.run import run

HERTZ = """
format = 1
title = "Half-disk on a block, coarse"

[model]
plane = "strain"

[material.steel]
E = {E!r}
nu = 0.3

[[body]]
name = "cylinder"
material = "steel"
spacing = {far!r}
[body.shape]
kind = "half-disk"
center = [0.0, {R!r}]
radius = {R!r}
side = "lower"

[[body]]
name = "block"
material = "steel"
spacing = {far!r}
[body.shape]
kind = "rectangle"
x = [{left!r}, {right!r}]
y = [{left!r}, 0.0]

[[support]]
boundary = "block.bottom"
uy = 0.0

[[support]]
body = "block"
near = [0.0, {left!r}]
ux = 0.0

[[support]]
body = "cylinder"
near = [0.0, {R!r}]
ux = 0.0

[[load]]
name = "press"
boundary = "cylinder.flat"
kind = "platen"
fy = {fy!r}

[[contact]]
name = "interface"
slave = "cylinder.arc"
master = "block.top"
accuracy = 0.01

[reference]
solution = "hertz-line"
"""

NODAL = """
format = 1
title = "Half-disk on a block, by nodes"

[model]
plane = "strain"

[material.steel]
E = 210e3
nu = 0.3

[[body]]
name = "cylinder"
material = "steel"
spacing = 0.35
[body.shape]
kind = "half-disk"
center = [0.0, 1.0]
radius = 1.0
side = "lower"
[[body.refine]]
at = [0.0, 0.0]
spacing = 0.012
radius = 0.06
growth = 0.12

[[body]]
name = "block"
material = "steel"
spacing = 0.35
[body.shape]
kind = "polygon"
points = [[-2.0, 0.0], [-2.0, -2.0], [2.0, -2.0], [2.0, 0.0], [0.075, 0.0], [-0.075, 0.0]]
names = ["left", "bottom", "right", "beside", "top", "beyond"]
[[body.refine]]
at = [0.0, 0.0]
spacing = 0.012
radius = 0.06
growth = 0.12

[[support]]
boundary = "block.bottom"
uy = 0.0

[[support]]
body = "block"
near = [0.0, -2.0]
ux = 0.0

[[support]]
body = "cylinder"
near = [0.0, 1.0]
ux = 0.0

[[load]]
name = "press"
boundary = "cylinder.flat"
kind = "platen"
fy = -226.0

[[contact]]
name = "interface"
slave = "cylinder.arc"
master = "block.top"

[reference]
solution = "hertz-line"
"""

"""The top is cut so near the contact that this has no grid of its own: pressures are those of nodes."""

COARSE = tuple(
    f"body.{body}.{key}"
    for body in ("cylinder", "block")
    for key in ("refine=[{at=[0.0, 0.0], spacing=0.02, radius=0.06, growth=0.2}]", "spacing=0.35")
)
"""Makes of it a scene of some 400 nodes, for what solves all their equations in every step."""

PATCH = """
format = 1
[model]
plane = "strain"
[material.steel]
E = 210e3
nu = 0.3
[[body]]
name = "upper"
material = "steel"
spacing = 0.25
shape = { kind = "rectangle", x = [0.0, 2.0], y = [1.0, 2.0] }
[[body]]
name = "lower"
material = "steel"
spacing = 0.2
shape = { kind = "rectangle", x = [0.0, 2.0], y = [0.0, 1.0] }
[[support]]
boundary = "upper.left"
ux = 0.0
[[support]]
boundary = "lower.left"
ux = 0.0
[[support]]
boundary = "lower.bottom"
uy = 0.0
[[load]]
name = "press"
boundary = "upper.top"
kind = "platen"
fy = -200.0
[[contact]]
name = "interface"
slave = "upper.bottom"
master = "lower.top"
regularization = { law = "exact" }
[reference]
solution = "uniform-pressure"
"""

BAR = """
format = 1
[model]
plane = "stress"
[material.steel]
E = 200e3
nu = 0.25
[[body]]
name = "bar"
material = "steel"
spacing = 0.25
shape = { kind = "rectangle", x = [0.0, 2.0], y = [0.0, 1.0] }
[[support]]
boundary = "bar.left"
ux = 0.0
[[support]]
boundary = "bar.bottom"
uy = 0.0
[[load]]
name = "pull"
boundary = "bar.right"
kind = "traction"
traction = [30.0, 0.0]
[[load]]
name = "squeeze"
boundary = "bar.top"
kind = "pressure"
pressure = 40.0
[[stage]]
pull = 1.0
[[stage]]
squeeze = 1.0
[output]
at = [0.5, 1.25, 2.0]
"""

_PUNCH = """
[[body]]
name = "{name}"
material = "steel"
spacing = 0.15
[body.shape]
kind = "half-disk"
center = [{x!r}, 0.5]
radius = 0.5
side = "lower"

[[load]]
name = "{name}"
boundary = "{name}.flat"
kind = "platen"
uy = {depth!r}

[[support]]
body = "{name}"
near = [{x!r}, 0.5]
ux = 0.0

[[contact]]
name = "under-{name}"
slave = "{name}.arc"
master = "block.top"
accuracy = 0.01
"""

PUNCHES = """
format = 1
[model]
plane = "strain"
[material.steel]
E = 1.0
nu = 0.3
[[body]]
name = "block"
material = "steel"
spacing = 0.2
shape = { kind = "rectangle", x = [-2.0, 2.0], y = [-2.0, 0.0] }
[[support]]
boundary = "block.bottom"
uy = 0.0
[[support]]
body = "block"
near = [0.0, -2.0]
ux = 0.0
""" + "".join(
    _PUNCH.format(name=name, x=x, depth=depth)
    for name, x, depth in (("left", -0.7, -0.004), ("right", 0.7, -0.006))
)


def hertz(length: float = 1.0, stress: float = 1.0) -> str:
    """The coarse half-disk on a block, in units in which lengths and stresses have these factors.

    Its contact is on a grid of its own, of some 80 places.
    """
    return HERTZ.format(
        E=210e3 * stress,
        R=1.0 * length,
        far=0.25 * length,
        left=-2.0 * length,
        right=2.0 * length,
        fy=-226.0 * stress * length,
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
    """Write the case beside ``directory``, run it into it, return the summary."""
    case = directory.with_suffix(".toml")
    case.write_text(text)
    return run(case, overrides=overrides, out=directory, console=console or Quiet())


def stored(directory: Path) -> dict[str, Any]:
    """Every dataset of a run but its times."""
    found: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name not in ("path/seconds", "case/raw"):
            found[name] = item[()]

    with h5py.File(directory / "run.h5", "r") as root:
        root.visititems(keep)
    return found


def assert_same_bits(one: Path, other: Path) -> None:
    """Two runs hold the same numbers to the last bit."""
    first, second = stored(one), stored(other)
    assert first.keys() == second.keys()
    for name, values in first.items():
        np.testing.assert_array_equal(values, second[name], err_msg=name)
