"""One block under loads, springs and heat, of several materials."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.io.run_reader import read_run
from tests.app.scenes import solve
from tests.case_text import pin

BLOCK = """
format = 1
[model]
plane = "{plane}"
[material.stuff]
{material}
[[body]]
name = "block"
material = "stuff"
spacing = 0.2
shape = {{ kind = "rectangle", x = [0.0, 2.0], y = [0.0, 1.0] }}
"""
STEEL = "E = 200.0\nnu = 0.25\nalpha = 1e-3"
# Axes turned by 30 degrees; the third axis counts in plane strain only.
WOOD = """E1 = 120.0
E2 = 9.0
G12 = 7.0
nu12 = 0.4
angle = 30.0
E3 = 5.0
nu13 = 0.3
nu23 = 0.45
alpha = [1e-3, 4e-3, 6e-3]"""
LEFT = '[[support]]\nboundary = "block.left"\nux = 0.0\n'
BOTTOM = '[[support]]\nboundary = "block.bottom"\nuy = 0.0\n'
# Statically determinate: exact for every uniform stress.
PINS = pin("block", [0.0, 0.0], ux=0.0, uy=0.0) + pin("block", [2.0, 0.0], uy=0.0)
WEIGHT = '[[load]]\nname = "weight"\nbody = "block"\nkind = "body-force"\nbody-force = [0.0, -3.0]\n'
HEAT = '[[load]]\nname = "heat"\nbody = "block"\nkind = "temperature"\ntemperature = 5.0\n'


def traction(side: str, x: object, y: object) -> str:
    place = f'[[load]]\nname = "{side}"\nboundary = "block.{side}"\nkind = "traction"\n'
    return f"{place}traction = [{x}, {y}]\n"


def block(*parts: str, material: str = STEEL, plane: str = "strain") -> str:
    return BLOCK.format(plane=plane, material=material) + "".join(parts)


class Result:
    """A finished run of one block."""

    def __init__(self, text: str, directory: Path, *overrides: str) -> None:
        self.summary: Mapping[str, Any] = solve(text, directory, *overrides)
        assert self.summary["status"] == "done", self.summary
        data = read_run(directory)
        fields = data.states[-1].bodies["block"]
        self.points: FloatArray = data.bodies["block"].points
        self.displacement, self.stress = fields["displacement"], fields["stress"]
        self.von_mises = fields["von_mises"]
        self.forces = {name: np.array(force) for name, force in self.summary["forces"].items()}


CLAMP = '[[support]]\nboundary = "block.left"\nux = 0.0\nuy = 0.0\n'
