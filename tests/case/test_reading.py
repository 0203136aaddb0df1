"""Reading of case files: defaults, syntax, files, tables, and what a resolved case keeps."""

from __future__ import annotations

import copy
import io
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from mlsanm_cli.case import Case, Pressure, Traction, load_case, parse_case, resolved_mapping
from mlsanm_cli.errors import CaseError, CaseProblem, RunError
from tests.case.scenes import CLAMP, HERTZ, PULL, SQUARE, only, parse

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
        (('contact.interface.regularization={law="exact", eta=1e-5}',), "exact"),
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
        ("nu = 0,3 # Poisson\n", "write a decimal point: 0.3"),
        ('name = "pin\n', "a quote is missing"),
        ("radius 5.98\n", "write KEY = VALUE"),
        ('{"format": 1}\n', "not JSON"),
        ("a = " + "[" * 20_000 + "]" * 20_000, "nested"),
    ],
)
def test_hints_on_syntax(text: str, words: str) -> None:
    assert words in str(only(text))


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no case file"):
        load_case(tmp_path / "missing.toml")
    with pytest.raises(RunError, match="cannot read"):
        load_case(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"format = 1\n\xff\xfe")
    with pytest.raises(RunError, match=r"UTF-8 text \(line 2, "):
        load_case(binary)
    folder = tmp_path / "\udcff"
    folder.mkdir()
    (folder / "case.toml").write_text(HERTZ)
    with pytest.raises(RunError, match="not UTF-8 text"):
        load_case(folder / "case.toml")


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


@pytest.mark.parametrize(("given", "kept"), [(1e-30, 0.0), (1e-12, 0.0), (1e-6, 1e-6), (0.3, 0.3)])
def test_friction_that_is_round_off_is_none(given: float, kept: float) -> None:
    assert parse(HERTZ, [f"contact.interface.friction={given}"]).case.contact[0].friction == kept


def test_the_standard_input_is_a_case(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(HERTZ.encode())))
    loaded = load_case(Path("-"))
    assert (loaded.path, loaded.case_hash) == (Path("stdin"), parse(HERTZ).case_hash)


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


LOAD = '[[load]]\nname = "more"\nboundary = "square.top"\nkind = "{}"\ntable = "push.csv"\n'


def with_table(tmp_path: Path, content: str | bytes, kind: str = "pressure") -> str:
    (tmp_path / "push.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    return SQUARE + CLAMP + PULL + LOAD.format(kind)


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
