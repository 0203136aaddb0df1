"""Wrong materials, loads and supports: each with its key, its line and what to write instead."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlsanm_cli.case import Material, Pressure, Traction, parse_case, resolved_mapping
from mlsanm_cli.errors import CaseError
from tests.case.scenes import CLAMP, PULL, SQUARE, only, parse, problems

ISOTROPIC = "E = 1\nnu = 0.5\n"
WOOD = "E1 = 10\nE2 = 1\nG12 = 0.5\nnu12 = 0.3\n"
THIRD = "E3 = 2\nnu13 = 0.3\nnu23 = 0.2\n"
FULL = "stiffness = [[3, 1, 0], [1, 2, 0], [0, 0, 1]]\n"
STRAIN = ('plane = "stress"', 'plane = "strain"')


def with_material(keys: str, strain: bool = False) -> str:
    text = SQUARE.replace(ISOTROPIC, keys) + CLAMP + PULL
    return text.replace(*STRAIN) if strain else text


@pytest.mark.parametrize("keys", [ISOTROPIC + "alpha = 1e-5\n", WOOD, WOOD + THIRD + "angle = 30\n", FULL])
def test_sound_materials(keys: str) -> None:
    case = parse(with_material(keys)).case
    again = resolved_mapping(parse(with_material(keys)).case)["material"]["rubber"]
    assert Material.model_validate(_tuples(again)) == case.material["rubber"]


def _tuples(value: dict[str, object]) -> dict[str, object]:
    def frozen(item: object) -> object:
        return tuple(map(frozen, item)) if isinstance(item, list) else item

    return {key: frozen(item) for key, item in value.items()}


@pytest.mark.parametrize(
    ("keys", "strain", "key", "line", "words"),
    [
        ("", False, "E", 4, "E, nu; or E1, E2, G12, nu12; or stiffness"),
        ("nu = 0.3\n", False, "E", 4, "missing"),
        ("E1 = 10\nE2 = 1\nG12 = 0.5\n", False, "nu12", 4, "missing"),
        (WOOD + "E = 1\n", False, "E", 9, "E1, E2, G12, nu12"),
        (WOOD + FULL, False, "E1", 5, "stiffness"),
        (ISOTROPIC + FULL, False, "nu", 6, "stiffness"),
        (ISOTROPIC + "angle = 3\n", False, "E", 5, "E1, E2, G12, nu12"),
        (WOOD, True, "E3", 4, "plane strain"),
        (WOOD.replace("0.3", "3.2"), False, "nu12", 8, "not between -3.16228 and 3.16228"),
        (WOOD.replace("0.3", "-3.2"), False, "nu12", 8, "E1/E2"),
        (WOOD + THIRD.replace("nu23 = 0.2", "nu23 = 0.8"), False, "nu23", 11, "E2/E3"),
        (WOOD.replace("0.3", "2.5") + THIRD.replace("0.3", "1.8"), True, "nu12", 8, "together"),
        (WOOD.replace("G12 = 0.5", "G12 = -1"), False, "G12", 7, "greater than 0"),
        (FULL.replace("[1, 2, 0]", "[1, -2, 0]"), False, "stiffness", 5, "positive definite"),
        (FULL.replace("[3, 1, 0], [1", "[3, 4, 0], [4"), False, "stiffness", 5, "positive definite"),
        (FULL.replace("[3, 1, 0]", "[3, 1, 2.5]").replace("[0, 0, 1]", "[2.5, 0, 1]"), False, "stiffness", 5,
         "positive definite"),
        (FULL.replace("[3, 1, 0]", "[3, 1.1, 0]"), False, "stiffness", 5, "not symmetric"),
        ("stiffness = [[3, 1], [1, 2]]\n", False, "stiffness", 5, "three rows of three numbers"),
        ("stiffness = [[3, 1, nan], [1, 2, 0], [0, 0, 1]]\n", False, "stiffness", 5, "nan and inf"),
        (ISOTROPIC + "alpha = [1, 2, 3]\n", False, "alpha", 7, "isotropic"),
        (WOOD + "alpha = [1, 2]\n", False, "alpha", 9, "a list of three"),
        (WOOD + 'alpha = "1e-5"\n', False, "alpha", 9, "expected a number"),
        (FULL + "alpha = 1e-5\n", True, "alpha", 6, "[xx, yy, 2xy]"),
    ],
)  # fmt: skip
def test_wrong_materials(keys: str, strain: bool, key: str, line: int, words: str) -> None:
    found = {problem.key: problem for problem in problems(with_material(keys, strain))}
    problem = found[f"material.rubber.{key}"]
    assert problem.line == line
    assert words in str(problem)


LOAD = '[[load]]\nname = "more"\n{}\n'
TOP = 'boundary = "square.top"\n'
BODY = 'body = "square"\n'


@pytest.mark.parametrize(
    ("keys", "key", "words"),
    [
        (TOP + 'kind = "traction"', "traction", 'give "traction" or "table"'),
        (TOP + 'kind = "pressure"', "pressure", "missing"),
        (TOP + 'kind = "pressure"\npressure = 1\ntable = [[0, 1], [1, 1]]', "table", "one of the two"),
        (TOP + 'kind = "pressure"\npressure = "os.remove(1)"', "pressure", '"os.remove" cannot be called'),
        (TOP + 'kind = "pressure"\npressure = "2*q"', "pressure", '"q" is not defined'),
        (TOP + 'kind = "pressure"\npressure = true', "pressure", "expression in x and y"),
        (TOP + 'kind = "pressure"\npressure = inf', "pressure", "nan and inf"),
        (TOP + 'kind = "traction"\ntraction = [1, "x +"]', "traction.1", "not an expression"),
        (TOP + 'kind = "pressure"\ntable = [[0, 1]]', "table", "two rows"),
        (TOP + 'kind = "pressure"\ntable = [[0, 1], [0, 2]]', "table", "row 2 has 0 after 0"),
        (TOP + 'kind = "pressure"\ntable = [[0, 1], [1, nan]]', "table.1.1", "nan and inf"),
        (TOP + 'kind = "pressure"\ntable = "none.csv"', "table", "there is no file"),
        (TOP + 'kind = "displacement"', "displacement", "ux or uy alone"),
        (TOP + 'kind = "displacement"\nux = 1\ndisplacement = [1, 1]', "ux", "gives both"),
        (TOP + 'kind = "displacement"\nux = 1\ntable = "a.csv"', "table", "unknown key"),
        (TOP + 'kind = "body-force"\nbody-force = [0, 1]', "body", "missing"),
        (BODY + 'kind = "body-force"', "body-force", "missing"),
        (BODY + 'kind = "body-force"\nbody_force = [0, 1]', "body_force", 'did you mean "body-force"'),
        ('body = "sqare"\nkind = "body-force"\nbody-force = [0, 1]', "body", 'did you mean "square"'),
        (BODY + 'kind = "temperature"', "temperature", "missing"),
        (BODY + 'kind = "temperature"\nvalue = 3', "value", 'is called "temperature"'),
        (BODY + 'kind = "temperature"\ntemperature = "hot"', "temperature", '"hot" is not defined'),
        (BODY + 'kind = "temperature"\ntemperature = [1]', "temperature", "expected a number"),
    ],
)
def test_wrong_loads(keys: str, key: str, words: str) -> None:
    found = {problem.key: problem for problem in problems(SQUARE + CLAMP + PULL + LOAD.format(keys))}
    problem = found[f"load.more.{key}"]
    assert problem.line >= 21
    assert words in str(problem)


def test_temperature_needs_alpha() -> None:
    heat = LOAD.format(BODY + 'kind = "temperature"\ntemperature = 3')
    problem = only(SQUARE + CLAMP + PULL + heat)
    assert problem.key == "load.more"
    assert "alpha in [material.rubber]" in problem.hint
    parse(SQUARE.replace(ISOTROPIC, ISOTROPIC + "alpha = 0\n") + CLAMP + PULL + heat)


@pytest.mark.parametrize(
    ("keys", "key", "words"),
    [
        ('boundary = "square.left"\nspring = [-1, 2]', "support.0.spring", "above 0"),
        ('boundary = "square.left"\nspring = 3', "support.0.spring", "two numbers"),
        (BODY + "near = [0, 0]\nspring = [1, 1]", "support.0.spring", "boundary"),
        ('boundary = "square.left"\nux = 0\nspring = [1, 1]', "support.0", "a spring and a support both act"),
        ('boundary = "square.left"\nuy = 0.1', "support.0.uy", "not supported yet"),
    ],
)
def test_wrong_springs(keys: str, key: str, words: str) -> None:
    found = problems(SQUARE + PULL + f"[[support]]\n{keys}\n")
    assert [problem for problem in found if problem.key == key and words in str(problem)], found


SPRING = '[[support]]\nboundary = "square.{}"\nspring = {}\n'


def test_springs_meet_tractions_but_nothing_else() -> None:
    parse(SQUARE + PULL + SPRING.format("right", "[1, 1]"))
    twice = SPRING.format("left", "[1, 1]") + SPRING.format("left", "[1, 0]")
    assert "both act on square.left in x" in only(SQUARE + PULL + twice).message
    plate = '[[load]]\nname = "plate"\nboundary = "square.top"\nkind = "platen"\nuy = 1\n'
    on_top = SQUARE + PULL + plate + SPRING.format("top", "[1, 1]")
    assert "both act on square.top in y" in only(on_top).message


HOLD = '[[load]]\nname = "hold"\nboundary = "square.left"\nkind = "displacement"\n{}\n'


@pytest.mark.parametrize(
    ("conditions", "free"),
    [
        (SPRING.format("bottom", "[1, 1]"), ""),
        (SPRING.format("bottom", "[0, 1]"), "translation in x"),
        (SPRING.format("bottom", "[1, 0]"), "translation in y and rotation"),
        (HOLD.format("ux = 0"), "translation in y"),
        (HOLD.format("ux = 0\nuy = 0"), ""),
    ],
)
def test_springs_and_displacements_hold_a_body(conditions: str, free: str) -> None:
    if free:
        assert free in only(SQUARE + PULL + conditions).message
    else:
        parse(SQUARE + PULL + conditions)


def with_table(tmp_path: Path, content: str | bytes, kind: str = "pressure") -> str:
    (tmp_path / "push.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    return SQUARE + CLAMP + PULL + LOAD.format(TOP + f'kind = "{kind}"\ntable = "push.csv"')


def test_a_table_becomes_part_of_the_case(tmp_path: Path) -> None:
    text = with_table(tmp_path, "\ufeffs , pressure\n0, 1\n\n0.5, -2.5\n1, 3e1\n")
    case = parse_case(text, tmp_path / "case.toml").case
    pressure = case.load[1]
    assert isinstance(pressure, Pressure)
    assert pressure.table == ((0.0, 1.0), (0.5, -2.5), (1.0, 30.0))
    assert resolved_mapping(case)["load"][1]["table"] == [[0.0, 1.0], [0.5, -2.5], [1.0, 30.0]]
    text = with_table(tmp_path, "s,tx,ty\n0,1,2\n1,3,4\n", "traction")
    traction = parse_case(text, tmp_path / "case.toml").case.load[1]
    assert isinstance(traction, Traction)
    assert traction.table == ((0.0, 1.0, 2.0), (1.0, 3.0, 4.0))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "must begin with the line s,pressure"),
        ("s,tx,ty\n0,1,2\n1,3,4\n", "must begin"),
        ("s,pressure\n0,1\n1\n", "line 3: 1 columns instead of 2"),
        ("s,pressure\n0,1\n1,high\n", 'line 3: "high" is not a number'),
        ("s,pressure\n0,1\n1,nan\n", "line 3: nan"),
        ("s,pressure\n1,1\n0,1\n", "row 2 has 0 after 1"),
        (b"s,pressure\n\xff\xfe,1\n", "CSV text"),
    ],
)
def test_wrong_tables(content: str | bytes, words: str, tmp_path: Path) -> None:
    with pytest.raises(CaseError) as caught:
        parse_case(with_table(tmp_path, content), tmp_path / "case.toml")
    (problem,) = caught.value.problems
    assert (problem.key, problem.line) == ("load.more.table", 25)
    assert words in str(problem)
