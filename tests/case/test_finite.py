"""Finite strain in the case: what it needs, and what it cannot do yet is refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlsanm_cli.case import parse_case
from mlsanm_cli.errors import CaseError
from tests.case_text import body, box, head, load, material, support

BLOCK = (
    head("strain", strain="finite")
    + material("rubber", E=2.6, nu=0.3, alpha=1e-4, law="neo-hookean")
    + body("block", "rubber", shape=box([0.0, 1.0], [0.0, 1.0]))
    + support("block.bottom", ux=0.0, uy=0.0)
    + load("press", "block.top", "pressure", pressure=0.5)
)


def problems(text: str, *overrides: str) -> dict[str, str]:
    """Messages by key."""
    try:
        parse_case(text, Path("case.toml"), overrides)
    except CaseError as error:
        return {problem.key: problem.message for problem in error.problems}
    return {}


@pytest.mark.parametrize(
    ("overrides", "key", "word"),
    [
        (('material.rubber.law="linear"',), "material.rubber.law", "finite"),
        (("material.rubber.nu=0.49",), "material.rubber.nu", "incompressible"),
        (('model.plane="stress"', "load.press.follows=true"), "load.press.follows", "plane stress"),
        (("mls.degree=1",), "mls.degree", "degree 1"),
        (('mls.scheme="collocation"',), "mls.scheme", "collocation"),
        (("adapt.passes=1",), "adapt.passes", "refinement"),
        (('solver.method="active-set"',), "solver.method", "contact"),
        (('reference.solution="hertz-line"',), "reference", "analytical"),
    ],
)
def test_what_is_not_there_yet_is_refused_by_name(overrides: tuple[str, ...], key: str, word: str) -> None:
    assert word in problems(BLOCK, *overrides)[key]


PLATE = '[[load]]\nname = "plate"\nboundary = "block.left"\nkind = "platen"\n'
WARM = '[[load]]\nname = "warm"\nbody = "block"\nkind = "temperature"\ntemperature = 1.0\n'
OBSTACLE = '[contact.obstacle]\nkind = "plane"\npoint = [-0.1, 0.0]\nnormal = [1.0, 0.0]\n'
CONTACT = '[[contact]]\nname = "c"\nslave = "block.left"\n'
HYPERBOLIC = '[contact.regularization]\nlaw = "hyperbolic"\n'
EXACT = '[contact.regularization]\nlaw = "exact"\n'
SPRING = '[[support]]\nboundary = "block.left"\nspring = [1.0, 0.0]\n'


@pytest.mark.parametrize(
    ("more", "key", "word"),
    [
        (f'{PLATE}ux = 0.1\nrotation = "free"\n', "load.plate", "both directions"),
        (f"{PLATE}ux = 0.1\nrotation = 0.1\n", "load.plate", "both directions"),
        (f"{CONTACT}{OBSTACLE}{HYPERBOLIC}", "contact.c.regularization.law", "hyperbolic"),
        (f'{CONTACT}friction = "bonded"\n{OBSTACLE}{EXACT}', "contact.c.friction", "bonded"),
        (f"{CONTACT}gap = 0.1\n{OBSTACLE}{EXACT}", "contact.c.gap", "gap"),
        (f"{CONTACT}reach = 0.1\n{OBSTACLE}{EXACT}", "contact.c.reach", "slave"),
        (f'{CONTACT}master = "block.right"\n{EXACT}', "contact.c.master", "with itself"),
    ],
)
def test_parts_that_are_not_there_yet_are_refused_by_name(more: str, key: str, word: str) -> None:
    assert word in problems(BLOCK + more)[key]


# A wheel's axle is pressed by one load and moved by another.
PLATES = f"{PLATE}fy = 0.0\nmoment = 0.0\n" + f"{PLATE}ux = 0.1\nmoment = 0.0\n".replace('"plate"', '"other"')


@pytest.mark.parametrize("more", ["", SPRING, WARM, PLATES])
def test_blocks_are_accepted(more: str) -> None:
    assert not problems(BLOCK + more)
    assert not problems(BLOCK + more, "load.press.follows=true")


def test_keys_of_finite_strain_mean_nothing_at_small_ones() -> None:
    small = BLOCK.replace('strain = "finite"\n', "")
    found = problems(small, "load.press.follows=true")
    assert "finite strain" in found["material.rubber.law"]
    assert "finite strain" in found["load.press.follows"]


def test_laws_are_isotropic() -> None:
    wood = "E1 = 1.0\nE2 = 2.0\nE3 = 1.0\nG12 = 0.5\nnu12 = 0.1\nnu13 = 0.1\nnu23 = 0.1\n"
    found = problems(BLOCK.replace("E = 2.6\nnu = 0.3\n", wood))
    assert "isotropic" in found["material.rubber.law"]


def test_exact_contact_with_a_rigid_obstacle_is_accepted() -> None:
    """Also where no law is given: finite strain has no other."""
    assert (
        parse_case(BLOCK + CONTACT + OBSTACLE, Path("c.toml")).case.contact[0].regularization.law == "exact"
    )
    assert not problems(BLOCK + CONTACT + OBSTACLE + EXACT)
    assert not problems(BLOCK + CONTACT + OBSTACLE + EXACT, 'solver.method="active-set"')
    assert "anm" in problems(BLOCK + CONTACT + OBSTACLE + EXACT, 'solver.method="anm"')["solver.method"]


def test_obstacles_turn_about_a_point_at_finite_strain() -> None:
    turn = '[[load]]\nname = "turn"\nkind = "obstacle"\nobstacle = "c"\nrotation = 1.0\n'
    assert "pivot" in problems(BLOCK + CONTACT + OBSTACLE + turn)["load.turn.rotation"]
    assert not problems(BLOCK + CONTACT + OBSTACLE + turn + "pivot = [0.0, 0.0]\n")
    small = (BLOCK + CONTACT + OBSTACLE + turn).replace('strain = "finite"\n', "")
    assert "finite strain" in problems(small)["load.turn.rotation"]
