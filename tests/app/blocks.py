"""One block under loads, springs and heat, of several materials."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import done
from tests.case_text import Scene, body_force, head, heat, load, pin, support

STEEL: dict[str, Any] = {"E": 200.0, "nu": 0.25, "alpha": 1e-3}
# Axes turned by 30 degrees; the third axis counts in plane strain only.
WOOD: dict[str, Any] = {"E1": 120.0, "E2": 9.0, "E3": 5.0, "G12": 7.0, "nu12": 0.4}
WOOD |= {"nu13": 0.3, "nu23": 0.45, "angle": 30.0, "alpha": [1e-3, 4e-3, 6e-3]}
LEFT, BOTTOM = support("block.left", ux=0.0), support("block.bottom", uy=0.0)
CLAMP = support("block.left", ux=0.0, uy=0.0)
# Statically determinate: exact for every uniform stress.
PINS = pin("block", [0.0, 0.0], ux=0.0, uy=0.0).pin("block", [2.0, 0.0], uy=0.0)
WEIGHT = body_force("weight", "block", [0.0, -3.0])
HEAT = heat("heat", "block", 5.0)


def traction(side: str, x: object, y: object) -> Scene:
    return load(side, f"block.{side}", "traction", traction=[x, y])


def block(
    *parts: str,
    material: Mapping[str, Any] = STEEL,
    plane: str = "strain",
    spacing: float = 0.2,
    **shape: Any,
) -> Scene:
    text = head(plane).material("stuff", **material)
    return text.body("block", "stuff", spacing, **shape or {"box": ([0.0, 2.0], [0.0, 1.0])}).add(*parts)


class Result:
    """A finished run of one block."""

    def __init__(self, text: str, directory: Path, *overrides: str) -> None:
        self.summary: Mapping[str, Any] = done(text, directory, *overrides)
        data = read_run(directory)
        fields = data.states[-1].bodies["block"]
        self.points: FloatArray = data.bodies["block"].points
        self.displacement, self.stress = fields["displacement"], fields["stress"]
        self.von_mises = fields["von_mises"]
        self.forces = {name: np.array(force) for name, force in self.summary["forces"].items()}
