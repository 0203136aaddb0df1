"""Bodies that nothing holds."""

from __future__ import annotations

import pytest

from tests.case.scenes import HERTZ, PULL, SQUARE, only, parse

ROLLER = '[[support]]\nboundary = "square.{}"\n{} = 0\n'
POINT = '[[support]]\nbody = "square"\nnear = [{}, {}]\n{} = 0\n'
PLATEN = '[[load]]\nname = "grip"\nboundary = "square.top"\nkind = "platen"\n{}\n'


@pytest.mark.parametrize(
    ("conditions", "free"),
    [
        ("", "translation in x and translation in y and rotation"),
        (ROLLER.format("left", "ux"), "translation in y"),
        (ROLLER.format("bottom", "uy"), "translation in x"),
        (ROLLER.format("left", "uy"), "translation in x and rotation"),
        (ROLLER.format("left", "ux") + POINT.format(0, 0, "uy"), ""),
        (ROLLER.format("left", "ux") + ROLLER.format("bottom", "uy"), ""),
        (POINT.format(0, 0, "ux") + POINT.format(0, 0, "uy"), "rotation about (0, 0)"),
        (POINT.format(0, 0, "ux") + POINT.format(0, 0, "uy") + POINT.format(1, 0, "uy"), ""),
        (POINT.format(0, 0, "ux") + POINT.format(0, 0, "uy") + POINT.format(1, 0, "ux"), "(0, 0)"),
        (PLATEN.format("displacement = [0, 1]"), ""),
        (PLATEN.format('displacement = [0, 1]\nrotation = "free"'), "rotation about (0.5, 1)"),
        (PLATEN.format("force = [0, 1]"), "translation in x and translation in y"),
        (PLATEN.format("uy = 1"), "translation in x"),
        (PLATEN.format("ux = 1"), "translation in y and rotation"),
        (PLATEN.format("uy = 1") + POINT.format(0, 0, "ux"), ""),
        (PLATEN.format("fy = 1") + ROLLER.format("bottom", "uy"), "translation in x"),
    ],
)
def test_a_body_alone(conditions: str, free: str) -> None:
    if not free:
        parse(SQUARE + PULL + conditions)
        return
    problem = only(SQUARE + PULL + conditions)
    assert (problem.key, problem.line) == ("body.square", 7)
    assert free in problem.message
    assert ("x and" in problem.message) == ("x and" in free)
    assert "add a [[support]]" in problem.hint


@pytest.mark.parametrize(
    "keys",
    [
        'kind="platen", force=[0.0, -1.0]',
        'kind="platen", force=[0.0, -1.0], rotation="free"',
        'kind="platen", ux=0.0, fy=-1.0',
        'kind="traction", traction=[0.0, -1.0]',
    ],
)
def test_contact_and_platens_may_hold_a_body(keys: str) -> None:
    parse(HERTZ, [f'load.press={{name="press", boundary="cylinder.flat", {keys}}}'])


def test_floating_bodies_are_not_reported_while_a_support_is_broken() -> None:
    assert only(HERTZ, ['support.0.boundary="block.botom"']).key == "support.0.boundary"
