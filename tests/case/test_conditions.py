"""Conditions on boundaries: which exclude each other, which hold a body, and which surfaces touch."""

from __future__ import annotations

import pytest

from mlsanm_cli.errors import CaseError, CaseProblem
from tests.app.scenes import prepared
from tests.case.scenes import CLAMP, HERTZ, PULL, SQUARE, only, parse

POINT = '[[support]]\nbody = "square"\nnear = [{}, {}]\n{} = 0\n'


def load(name: str, boundary: str, kind: str, keys: str) -> str:
    return f'[[load]]\nname = "{name}"\nboundary = "square.{boundary}"\nkind = "{kind}"\n{keys}\n'


def refusal(text: str, *overrides: str) -> CaseProblem:
    """The only problem of a scene that is refused before it is solved."""
    with pytest.raises(CaseError) as caught:
        prepared(text, *overrides)
    (problem,) = caught.value.problems
    return problem


def held(boundary: str, keys: str) -> str:
    return f'[[support]]\nboundary = "square.{boundary}"\n{keys}\n'


def platen(keys: str) -> str:
    return load("plate", "top", "platen", keys)


HEAT = '[[load]]\nname = "heat"\nbody = "square"\nkind = "temperature"\ntemperature = 3\n'
PAIRS = [
    ("traction", "traction = [1, 0]", "traction", "traction = [2, 0]", ""),
    ("traction", "traction = [1, 0]", "pressure", "pressure = 1", ""),
    ("traction", "traction = [1, 0]", "displacement", "displacement = [1, 0]", "load.b"),
    ("pressure", "pressure = 1", "platen", "ux = 1", "load.b"),
    ("pressure", "pressure = 1", "platen", "uy = 1", ""),
    ("platen", "force = [1, 0]", "platen", "force = [0, 1]", ""),
    ("platen", "ux = 1", "platen", "ux = 2", ""),
    ("platen", "ux = 1", "platen", "fy = 2", ""),
    ("platen", "ux = 1", "platen", "fx = 2", "load.b"),
    ("platen", "ux = 1", "platen", 'ux = 1\nrotation = "free"', ""),
    ("platen", 'ux = 1\nrotation = "fixed"', "platen", "ux = 1\nmoment = 1", "load.b.rotation"),
    ("platen", "ux = 1", "platen", "ux = 1\nhinge = [1, 2]\nrotation = 0.1", ""),
    ("displacement", "displacement = [1, 0]", "platen", "ux = 1", "load.b"),
    ("displacement", "displacement = [1, 0]", "displacement", "displacement = [0, 1]", ""),
]
FIXED = CLAMP + held("bottom", "uy = 0")
PULLED = CLAMP + PULL
SPRUNG = held("left", "spring = [1, 1]")
CONDITIONS = [
    *(
        (CLAMP + load("a", "right", one, keys) + load("b", "right", other, more), key, "")
        for one, keys, other, more, key in PAIRS
    ),
    (FIXED + load("a", "left", "traction", "traction = [1, 0]"), "load.a", "both act on"),
    (FIXED + load("a", "left", "displacement", "displacement = [1, 0]"), "load.a", "both act on"),
    (FIXED + load("a", "left", "platen", "uy = 1"), "load.a", "both act on"),
    (FIXED + load("a", "left", "pressure", "pressure = 1"), "load.a", "both act on"),
    (FIXED + load("a", "bottom", "pressure", "pressure = 1"), "load.a", "both act on"),
    (FIXED + load("a", "bottom", "traction", "traction = [1, 0]"), "", ""),
    (FIXED + load("a", "bottom", "traction", "traction = [0, 1]"), "load.a", "both act on"),
    (FIXED + load("a", "bottom", "platen", "fx = 1"), "", ""),
    (PULLED + POINT.format(1, 0, "uy"), "", ""),
    (PULLED + POINT.format(1, 0, "uy") + POINT.format(1, 0, "ux"), "", ""),
    (PULLED + 2 * POINT.format(1, 0, "uy"), "support.2", "already"),
    (PULL + held("right", "spring = [1, 1]"), "", ""),
    (PULL + SPRUNG + held("left", "spring = [1, 0]"), "support.1", "both act on square.left in x"),
    (PULL + platen("uy = 1") + held("top", "spring = [1, 1]"), "load.plate", "both act on square.top in y"),
    (PULLED + HEAT, "load.heat", "alpha"),
]
FREE = [
    ("", "translation in x and translation in y and rotation"),
    (held("left", "ux = 0"), "translation in y"),
    (held("bottom", "uy = 0"), "translation in x"),
    (held("left", "uy = 0"), "translation in x and rotation"),
    (held("left", "ux = 0") + POINT.format(0, 0, "uy"), ""),
    (held("left", "ux = 0") + held("bottom", "uy = 0"), ""),
    (POINT.format(0, 0, "ux") + POINT.format(0, 0, "uy"), "rotation about (0, 0)"),
    (POINT.format(0, 0, "ux") + POINT.format(0, 0, "uy") + POINT.format(1, 0, "uy"), ""),
    (POINT.format(0, 0, "ux") + POINT.format(0, 0, "uy") + POINT.format(1, 0, "ux"), "(0, 0)"),
    (platen("displacement = [0, 1]"), ""),
    (platen("uy = 1"), "translation in x"),
    (platen("ux = 1"), "translation in y and rotation"),
    (platen("uy = 1") + POINT.format(0, 0, "ux"), ""),
    (platen("fy = 1") + held("bottom", "uy = 0"), "translation in x"),
    (held("bottom", "spring = [1, 1]"), ""),
    (held("bottom", "spring = [0, 1]"), "translation in x"),
    (held("bottom", "spring = [1, 0]"), "translation in y and rotation"),
    (load("hold", "left", "displacement", "ux = 0"), "translation in y"),
    (load("hold", "left", "displacement", "ux = 0\nuy = 0"), ""),
]


@pytest.mark.parametrize(("conditions", "key", "words"), CONDITIONS)
def test_conditions_that_exclude_each_other(conditions: str, key: str, words: str) -> None:
    if not key:
        prepared(SQUARE + conditions)
        return
    problem = refusal(SQUARE + conditions)
    assert problem.key == key
    assert words in str(problem)


@pytest.mark.parametrize(
    ("side", "boundary", "words"),
    [
        ("master", "block.bottom", "support.0 acts on the contact"),
        ("slave", "cylinder.flat", "load.press acts"),
    ],
)
def test_conditions_on_contact_surfaces(side: str, boundary: str, words: str) -> None:
    problem = refusal(HERTZ, f"contact.0.{side}='{boundary}'")
    assert problem.key == f"contact.interface.{side}"
    assert words in problem.message


@pytest.mark.parametrize(("conditions", "free"), FREE)
def test_a_body_alone(conditions: str, free: str) -> None:
    if not free:
        prepared(SQUARE + PULL + conditions)
        return
    problem = refusal(SQUARE + PULL + conditions)
    assert problem.key == "body.square"
    assert free in problem.message
    assert ("x and" in problem.message) == ("x and" in free)
    assert "add a [[support]]" in problem.hint


def test_one_load_of_a_plate_turns_it() -> None:
    plate = load("a", "top", "platen", "ux = 0\nrotation = 1") + load("b", "top", "platen", "uy = 0")
    first, second = parse(SQUARE + plate).case.model_dump()["load"]
    assert (first["rotation"], second["rotation"]) == (1.0, 0.0)


@pytest.mark.parametrize("plate", ['displacement = [0, 1]\nrotation = "free"', "force = [0, 1]"])
def test_loads_of_a_plate_that_nothing_holds(plate: str) -> None:
    with pytest.raises(CaseError, match="nothing resists its force"):
        prepared(SQUARE + PULL + platen(plate))


CONTACT = '[[contact]]\nname = "{}"\nslave = "{}"\nmaster = "{}"\n'
THIRD = """[[body]]
name = "third"
material = "steel"
spacing = 4.0
shape = {kind = "rectangle", x = [-1, 1], y = [0, 5]}
[[support]]
boundary = "third.top"
ux = 0.0
uy = 0.0
"""


def test_boundaries_in_two_contacts() -> None:
    text = HERTZ + THIRD
    parse(text + CONTACT.format("second", "third.bottom", "block.top"))
    parse(text + CONTACT.format("second", "cylinder.arc", "third.bottom"))
    mirrored = only(text + CONTACT.format("second", "block.top", "cylinder.arc"))
    assert mirrored.key == "contact.second"
    mixed = CONTACT.format("second", "third.bottom", "block.top") + 'regularization.law = "exact"\n'
    eta = "contact.interface.regularization.eta=1e-5"
    assert only(text + mixed, (eta,)).key == "contact.second.regularization.law"


@pytest.mark.parametrize("law", ["exact", "hyperbolic"])
def test_methods_and_formulations_fit_the_contact_law(law: str) -> None:
    chosen = f"contact.interface.regularization.law={law}"
    fits = {"method=auto": True, "method=active-set": law == "exact"}
    fits |= dict.fromkeys(["method=anm", "method=newton", "formulation=monolithic"], law == "hyperbolic")
    for setting, accepted in fits.items():
        if accepted:
            parse(HERTZ, [chosen, f"solver.{setting}"])
        else:
            assert only(HERTZ, [chosen, f"solver.{setting}"]).key == f"solver.{setting.partition('=')[0]}"
