"""Case texts for the tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from mlsanm_cli.app.scene.outlines import geometry_of
from mlsanm_cli.case import LoadedCase, parse_case
from mlsanm_cli.errors import CaseError, CaseProblem
from tests.case_text import body, box, head, item, load, material, support, table

HERTZ = """format = 1
title = "Half-cylinder on a block"

[model]
plane = "strain"

[material.steel]
E = 210e3
nu = 0.3

[[body]]
name = "cylinder"
material = "steel"
spacing = 4.0
[body.shape]
kind = "half-disk"
center = [0.0, 50.0]
radius = 50.0
side = "lower"
[[body.refine]]
at = [0.0, 0.0]
spacing = 0.02
radius = 1.0

[[body]]
name = "block"
material = "steel"
spacing = 4.0
[body.shape]
kind = "rectangle"
x = [-100.0, 100.0]
y = [-100.0, 0.0]
[[body.refine]]
along = "top"
spacing = 0.5
radius = 1.0

[[support]]
boundary = "block.bottom"
ux = 0.0
uy = 0.0

[[load]]
name = "press"
boundary = "cylinder.flat"
kind = "platen"
force = [0.0, -350.0]

[[contact]]
name = "interface"
slave = "cylinder.arc"
master = "block.top"
"""

# One square; tests add supports and loads.
SQUARE = """format = 1
[model]
plane = "stress"
[material.rubber]
E = 1
nu = 0.5
[[body]]
name = "square"
material = "rubber"
spacing = 0.1
shape = {kind = "rectangle", x = [0, 1], y = [0, 1]}
"""

PULL = '[[load]]\nname = "pull"\nboundary = "square.right"\nkind = "traction"\ntraction = [1, 0]\n'
CLAMP = '[[support]]\nboundary = "square.left"\nux = 0\nuy = 0\n'

PLATE = (
    head("stress")
    + material("m", E=1.0, nu=0.3)
    + body("plate", "m", 0.2)
    + table(
        "body.shape",
        kind="polygon",
        points=[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]],
        names=["bottom", "tip", "arm", "shank", "top", "left"],
        rounding=[0.0, 0.0, 0.3, 0.5, 0.0, 0.0],
    )
    + item("body.shape.holes", name="bolt", center=[1.0, 1.0], radius=0.4)
    + support("plate.left", ux=0.0, uy=0.0)
    + load("pull", "plate.tip", "traction", traction=[1.0, 0.0])
)
WAVY = (
    head("strain")
    + material("m", E=1.0, nu=0.3)
    + body("block", "m")
    + table("body.shape", kind="outline")
    + item(
        "body.shape.sides", name="top", points=[[0.0, 0.0], [1.0, 0.1], [2.0, 0.0], [3.0, 0.1], [4.0, 0.0]]
    )
    + item("body.shape.sides", name="right", to=[4.0, -1.0])
    + item("body.shape.sides", name="bottom", to=[0.0, -1.0])
    + item("body.shape.sides", name="left")
    + support(["block.bottom", "block.left"], ux=0.0, uy=0.0)
    + load("press", "block.top", "pressure", pressure=1.0, from_=[1.0, 0.1], to=[3.0, 0.1])
)
BLOCK = (
    head("strain", strain="finite")
    + material("rubber", E=2.6, nu=0.3, alpha=1e-4, law="neo-hookean")
    + body("block", "rubber", shape=box([0.0, 1.0], [0.0, 1.0]))
    + support("block.bottom", ux=0.0, uy=0.0)
    + load("press", "block.top", "pressure", pressure=0.5)
)


def parse(text: str, overrides: Sequence[str] = ()) -> LoadedCase:
    """The case of a text; problems name the file "case.toml"."""
    return parse_case(text, Path("case.toml"), overrides, geometry_of)


def problems(text: str, overrides: Sequence[str] = ()) -> tuple[CaseProblem, ...]:
    """Everything wrong with a case that must be wrong."""
    with pytest.raises(CaseError) as caught:
        parse(text, overrides)
    return caught.value.problems


def only(text: str, overrides: Sequence[str] = ()) -> CaseProblem:
    """The one problem of a case."""
    found = problems(text, overrides)
    assert len(found) == 1, "\n".join(map(str, found))
    return found[0]
