"""What a case file may say, its defaults, and what a wrong one is told."""

from __future__ import annotations

import copy
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.case import Case, Platen, load_case, resolved_mapping
from mlsanm_cli.errors import CaseError, CaseProblem, RunError
from tests.case.scenes import CLAMP, HERTZ, SQUARE, only, parse, problems

RUBS = "contact.interface.friction=0.3"
ROLLER = """
[[body]]
name = "roller"
material = "steel"
shape = {kind = "disk", center = [0.0, 5.0], radius = 1.0}
[[contact]]
name = "rolling"
slave = "roller.arc"
master = "block.top"
"""


@pytest.mark.parametrize(
    ("chosen", "law"),
    [
        ((), "exact"),
        ((RUBS,), "exact"),
        (('contact.interface.regularization.law="hyperbolic"',), "hyperbolic"),
        (("contact.interface.regularization.eta=1e-5",), "hyperbolic"),
        ((RUBS, "contact.interface.regularization.stick=1e-5"), "hyperbolic"),
        (('solver.method="anm"',), "hyperbolic"),
        ((RUBS, 'solver.method="newton"'), "hyperbolic"),
        ((RUBS, 'solver.formulation="monolithic"'), "hyperbolic"),
    ],
)
def test_contacts_are_exact_unless_the_regularised_law_is_chosen(chosen: tuple[str, ...], law: str) -> None:
    assert [one.regularization.law for one in parse(HERTZ + ROLLER, chosen).case.contact] == [law, law]


def test_a_contact_that_names_the_exact_law_asks_for_no_other() -> None:
    named = 'contact.interface.regularization={law="exact", eta=1e-5}'
    assert {one.regularization.law for one in parse(HERTZ + ROLLER, (named,)).case.contact} == {"exact"}


@pytest.mark.parametrize(
    ("keys", "control"),
    [
        ("force = [1, -2]", {"x": ("force", 1.0), "y": ("force", -2.0)}),
        ("displacement = [0, -1]", {"x": ("displacement", 0.0), "y": ("displacement", -1.0)}),
        ("ux = 0.0\nfy = -3", {"x": ("displacement", 0.0), "y": ("force", -3.0)}),
        ("uy = 2.0", {"y": ("displacement", 2.0)}),
    ],
)
def test_platen_control(keys: str, control: object) -> None:
    text = SQUARE + CLAMP + f'[[load]]\nname = "p"\nboundary = "square.right"\nkind = "platen"\n{keys}\n'
    load = parse(text).case.load[0]
    assert isinstance(load, Platen)
    assert load.control == control
    assert load.rotation == "fixed"


@pytest.mark.parametrize(
    ("change", "key", "line", "words"),
    [
        (("spacing = 4.0", "spacign = 4.0"), "body.cylinder.spacign", 14, 'did you mean "spacing"'),
        (("spacing = 4.0", "h = 4.0"), "body.cylinder.h", 14, 'did you mean "spacing"'),
        (("spacing = 4.0", "spacing = -4.0"), "body.cylinder.spacing", 14, "a number above 0"),
        (("spacing = 4.0", "spacing = true"), "body.cylinder.spacing", 14, "a number above 0"),
        (("spacing = 4.0", "spacing = nan"), "body.cylinder.spacing", 14, "nan and inf"),
        (("spacing = 4.0", "spacing = 4.0\nseed = 1.0"), "body.cylinder.seed", 15, "whole number"),
        (("E = 210e3", "E = 0"), "material.steel.E", 8, "greater than 0"),
        (("E = 210e3\n", ""), "material.steel.E", 7, "missing"),
        (('plane = "strain"', 'plane = "strian"'), "model.plane", 5, 'did you mean "strain"'),
        (('kind = "half-disk"', 'kind = "half_disc"'), "body.cylinder.shape.kind", 16, '"half-disk"'),
        (('kind = "half-disk"\n', ""), "body.cylinder.shape.kind", 15, "missing"),
        (('kind = "platen"', 'kind = "platten"'), "load.press.kind", 46, 'did you mean "platen"'),
        (("force = [0.0, -350.0]", "force = [0.0]"), "load.press.force", 47, "two numbers"),
        (("force = [0.0, -350.0]", "force = [0.0, nan]"), "load.press.force.1", 47, "nan and inf"),
        (("radius = 50.0", "radius = -50.0"), "body.cylinder.shape.radius", 18, "greater than 0"),
        (("[[support]]", "[support]"), "support", 38, "write [[support]]"),
        (("[model]", "[[model]]"), "model", 4, "single brackets"),
        (("format = 1", "format = 3"), "format", 1, "not a valid value"),
        (("format = 1\n", ""), "format", 1, "write format = 1"),
        (('name = "block"', 'name = "my.block"'), "body.my.block.name", 26, "letters, digits"),
    ],
)
def test_wrong_schema(change: tuple[str, str], key: str, line: int, words: str) -> None:
    text = HERTZ.replace(*change, 1)
    assert text != HERTZ
    found = {problem.key: problem for problem in problems(text)}
    assert key in found, found
    assert found[key].line == line
    assert found[key].source == "case.toml"
    assert words in str(found[key])


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("solver.order=1", "at least 2"),
        ("solver.tolerance=0.0", "greater than 0"),
        ("solver.tolerance=1.0", "less than 1"),
        ("mls.degree=7", "from 1 to 6"),
        ("mls.neighbors=0", "whole number above 0"),
        ("contact.interface.reach=0", "number above 0"),
        ("contact.interface.regularization.eta=-1e-4", "greater than 0"),
        ("contact.interface.friction=-0.1", "at least 0"),
        ("solver.pade=1", "true or false"),
        ('output.fields=["stres"]', 'did you mean "stress"'),
        ('reference.solution="hertz"', 'did you mean "hertz-line"'),
    ],
)
def test_values_out_of_range(setting: str, words: str) -> None:
    problem = only(HERTZ, [setting])
    assert problem.source == "--set"
    assert words in str(problem)


def test_all_problems_at_once_in_the_order_of_the_file() -> None:
    text = (
        HERTZ.replace('plane = "strain"', 'plane = "strains"')
        .replace("nu = 0.3", "nu = 0.7")
        .replace('material = "steel"', 'material = "stele"', 1)
        .replace("radius = 50.0", "radius = 0")
        .replace('"block.bottom"', '"block.botom"')
        .replace("force = ", "forse = ")
        .replace('"block.top"', '"blok.top"')
    )
    found = problems(text, ["solver.order=1"])
    assert [problem.key for problem in found] == [
        "model.plane",
        "material.steel.nu",
        "body.cylinder.material",
        "body.cylinder.shape.radius",
        "support.0.boundary",
        "load.press",
        "load.press.forse",
        "contact.interface.master",
        "solver.order",
    ]
    lines = [problem.line for problem in found[:-1]]
    assert lines == sorted(lines)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (("radius = 1.0", 'radius = 1.0\nradios = 2.0\nalong = "arc"'), "body.cylinder.refine.0"),
        (("y = [-100.0, 0.0]", "y = [-100.0, 0.0]\nz = 0\n"), "support.0.boundary"),
        (("uy = 0.0", "uy = 0.0\nuz = 0.0\nnear = [0, 0]"), "support.0"),
        (("force = [", "mass = 1.0\nux = 1.0\nforce = ["), "load.press.ux"),
        (("friction = 0.0", "frictoin = 1\nregularization = {lw = 1, law = 'exact'}"), "solver.method"),
    ],
)
def test_an_unknown_key_hides_no_other_fault(change: tuple[str, str], key: str) -> None:
    text = (HERTZ + 'friction = 0.0\n[solver]\nmethod = "anm"\n').replace(*change, 1)
    changes = ['support.0.boundary="block.tp"'] if key.endswith("boundary") else []
    found = problems(text, changes)
    assert "unknown key" in [problem.message for problem in found]
    assert key in [problem.key for problem in found]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("body.0.shape=3", "body.cylinder.shape: expected a table"),
        ("load.0=3", "load.0: expected a table"),
        ("body.0.shape={kind=3}", 'unknown kind "3"'),
        ("body=[]", "body: the list is empty"),
        ("body.0.name=3", "letters, digits"),
        ('body.0.name=""', "body.0.name: a name"),
        ('body.0.refine.0.spacing="4"', 'without quotes: "4" is text'),
        ("model.plane=true", "true is not a valid value"),
        ('model.plane="shell"', "valid: strain, stress"),
        ("contact.0.master=7", '"<body>.<boundary>"'),
    ],
)
def test_wrong_types(setting: str, words: str) -> None:
    assert words in "\n".join(str(problem) for problem in problems(HERTZ, [setting]))


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 3),
    st.integers(10**400, 10**401),
    st.floats(),
    st.text(max_size=3),
    st.sampled_from(["platen", "annulus", "block.top", "auto", "strain", "press"]),
    st.lists(st.floats(), max_size=3),
    st.just({}),
    st.just([{}]),
    st.dictionaries(st.sampled_from(["kind", "name", "x", "law", "at"]), st.integers(-1, 1), max_size=2),
)


def outcome(text: str) -> tuple[tuple[CaseProblem, ...], Case | None]:
    """The problems of a case, or the case."""
    try:
        return (), parse(text).case
    except CaseError as error:
        return error.problems, None


@given(st.data())
def test_any_content_is_a_case_or_a_list_of_problems(data: st.DataObject) -> None:
    content: dict[str, Any] = tomllib.loads(HERTZ)
    for _ in range(data.draw(st.integers(1, 4))):
        table: Any = content
        while True:
            keys = list(table) if isinstance(table, dict) else list(range(len(table)))
            key = data.draw(st.sampled_from([*keys, "extra"] if isinstance(table, dict) else keys))
            value = table.get(key) if isinstance(table, dict) else table[key]
            if not isinstance(value, dict | list) or not value or data.draw(st.booleans()):
                break
            table = value
        junk = copy.deepcopy(data.draw(JUNK))
        if junk is not None:
            table[key] = junk
        elif isinstance(table, dict):
            table.pop(key, None)
    text = tomli_w.dumps(content)
    found, again = outcome(text)
    for problem in found:
        assert (problem.source, problem.line >= 1) == ("case.toml", True)
        assert problem.key
        assert problem.message
    if again is not None:
        assert outcome(tomli_w.dumps(resolved_mapping(again))) == ((), again)
    else:
        assert found


@pytest.mark.parametrize(
    ("text", "line"),
    [("format = 1\ntitle = half\n", 2), ("a = 1\n\na = 2\n", 3), ('t = """\nnever\nclosed', 3), ("[x\n", 1)],
)
def test_syntax_errors_have_their_line(text: str, line: int) -> None:
    problem = only(text)
    assert (problem.line, problem.key) == (line, "(syntax)")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[load]\n[load]\n", "[load] is declared twice (write [[load]] above each one)"),
        ("[shape]\n[shape]\n", "[shape] is declared twice ([body.shape] belongs to the item above)"),
        ("[material.a]\n[material.a]\n", "[material.a] is declared twice"),
        ("title = “half”\n", 'write straight quotes: "'),
        ("a = 1\na = 2\n", "the key is defined twice"),
        ("a = " + "[" * 20_000 + "]" * 20_000, "nested"),
        (HERTZ.replace("E = 210e3", 'E = "210 GPa"'), "numbers have no units"),
        (HERTZ.replace("force = [0.0, -350.0]", "fy = '-350 N'"), "no units"),
        (HERTZ.replace("format = 1", "format = 1\nfriction = 0.2"), "did you mean contact.friction?"),
    ],
)
def test_hints(text: str, words: str) -> None:
    assert words in str(only(text))


@pytest.mark.parametrize("text", ["", "body = 1\n", "body = []\n"])
def test_missing_bodies_are_told_once(text: str) -> None:
    found, _ = outcome(f'format = 1\n{text}[model]\nplane = "strain"\n')
    assert len([problem for problem in found if problem.key == "body"]) == 1


def test_a_bad_modulus_hides_no_bad_ratio() -> None:
    found, _ = outcome(HERTZ.replace("E = 210e3", "E = -1.0").replace("nu = 0.3", "nu = 0.6"))
    assert [problem.key for problem in found] == ["material.steel.E", "material.steel.nu"]


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no case file"):
        load_case(tmp_path / "missing.toml")
    with pytest.raises(RunError, match="cannot read"):
        load_case(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"format = 1\n\xff\xfe")
    with pytest.raises(RunError, match="UTF-8"):
        load_case(binary)


def test_load_case_reads_the_file_and_keeps_its_text(tmp_path: Path) -> None:
    path = tmp_path / "hertz.toml"
    path.write_bytes(b"\xef\xbb\xbf" + HERTZ.encode())
    loaded = load_case(path, ["solver.order=15"])
    assert (loaded.path, loaded.raw, loaded.overrides) == (path, HERTZ, ("solver.order=15",))
    assert loaded.case.solver.order == 15
    path.write_text("format = 2")
    with pytest.raises(CaseError, match=r"hertz\.toml:1: format"):
        load_case(path)


@given(
    title=st.text(),
    spacing=st.floats(1e-6, 0.9),
    force=st.floats(-1e60, 1e60),
    at=st.lists(st.floats(0.0, 1.0), max_size=3),
    seed=st.integers(0, 2**63 - 1),
)
def test_resolved_case_keeps_every_bit(
    title: str, spacing: float, force: float, at: list[float], seed: int
) -> None:
    changes = {"body.block.refine.0.spacing": spacing, "load.press.force.1": force, "output.at": at}
    overrides = [f"{key}={value!r}" for key, value in changes.items()]
    text = tomli_w.dumps({**tomllib.loads(HERTZ), "title": title})
    loaded = parse(text, [*overrides, f"body.block.seed={seed}"])
    assert loaded.case.title == title
    assert loaded.case.output.at == tuple(at)
    again = parse(tomli_w.dumps(resolved_mapping(loaded.case)))
    assert again.case == loaded.case
    assert again.case_hash == loaded.case_hash


def test_hash_depends_on_content_only() -> None:
    plain = parse(HERTZ).case_hash
    assert parse("# a comment\n" + HERTZ.replace("210e3", "210_000.0")).case_hash == plain
    assert parse(HERTZ, ["solver.order=20"]).case_hash == plain
    assert parse(HERTZ, ["solver.order=21"]).case_hash != plain
    assert parse(HERTZ, ['title="other"']).case_hash != plain
    assert parse(HERTZ, ["output.vtu=false"]).case_hash != plain


def test_a_key_without_end_is_shown_in_part() -> None:
    found = only(HERTZ + "\n[output]\n" + "k" * 100_000 + " = 1\n")
    assert found.key.startswith("output.kkk")
    assert len(str(found)) < 300


def test_a_directory_whose_name_is_no_text(tmp_path: Path) -> None:
    folder = tmp_path / "\udcff"
    folder.mkdir()
    (folder / "case.toml").write_text(HERTZ)
    with pytest.raises(RunError, match="not UTF-8 text"):
        load_case(folder / "case.toml")


def test_a_case_that_is_not_there_gets_the_nearest(tmp_path: Path) -> None:
    for name in ("hertz.toml", "ring.toml"):
        (tmp_path / name).write_text(HERTZ)
    for name, hint in {
        "hertz": "did you mean .*hertz.toml",
        "herz.toml": "did you mean .*hertz.toml",
        "zzzz": "cases: .*hertz.toml, .*ring.toml",
        "no/hertz.toml": "mlsanm new",
    }.items():
        with pytest.raises(RunError, match="there is no case file") as caught:
            load_case(tmp_path / name)
        assert re.search(hint, caught.value.hint)
