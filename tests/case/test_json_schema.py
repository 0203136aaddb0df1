"""The JSON Schema of the case file: it takes what the model takes, and tells nothing that is refused."""

from __future__ import annotations

import contextlib
import tomllib
from pathlib import Path

import jsonschema
import pytest

from mlsanm_cli.case import parse_case, schema
from mlsanm_cli.case.explain import Explanation, explain
from mlsanm_cli.case.model.section import UNIT
from mlsanm_cli.case.reading.overrides import apply_overrides
from mlsanm_cli.case.schema import json_schema
from mlsanm_cli.case.starters import kinds, starter
from mlsanm_cli.errors import CaseError, RunError
from tests.case.scenes import HERTZ
from tests.case.test_faults import VALUES

CASES = sorted((Path(__file__).parents[2] / "cases").glob("*.toml"))
SCHEMA = schema.json_schema()


def takes(text: str, *overrides: str) -> bool:
    """Whether the schema takes a case with overrides."""
    content, _, problems = apply_overrides(tomllib.loads(text), overrides)
    assert not problems
    return bool(jsonschema.Draft7Validator(SCHEMA).is_valid(content))


def test_it_is_a_schema() -> None:
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert SCHEMA["title"]


TEXTS = {file.stem: file.read_text() for file in CASES} | {kind: starter(kind) for kind in kinds()}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_published_cases_and_starters_are_valid(text: str) -> None:
    jsonschema.Draft7Validator(SCHEMA).validate(tomllib.loads(text))


SETTINGS = [change for change, _, _ in VALUES if isinstance(change, str) and not change.startswith("[")]
# JSON has no nan, and 1.0 is a whole number there.
REFUSED = [setting for setting in SETTINGS if "nan" not in setting and not setting.endswith("seed=1.0")]
REFUSED += [
    "solver.ordre=3",
    "body.block.shape.radius=1.0",
    "body.0.refine=[{spacing=0.1}]",
    "support.0.ux=0.1",
]
ACCEPTED = (
    "mls.neighbors=20",
    "contact.interface.reach=2",
    "solver.pade=false",
    "output.at=[0.5, 1]",
    'probe=[{name="p", body="block", point=[0, -1]}]',
    "stage=[{press=0.5}, {press=1}]",
    "support.0.ux=0",
    "load=[{name='p', boundary='block.left', kind='pressure', table=[[0.0, 1.0], [1.0, 2.0]]}]",
)


@pytest.mark.parametrize("setting", [*REFUSED, *ACCEPTED])
def test_model_and_schema_agree(setting: str) -> None:
    refused = pytest.raises(CaseError) if setting in REFUSED else contextlib.nullcontext()
    with refused:
        parse_case(HERTZ, Path("case.toml"), [setting])
    assert takes(HERTZ, setting) == (setting in ACCEPTED)


def test_a_table_of_a_load_may_be_a_file() -> None:
    assert takes(HERTZ, "load=[{name='p', boundary='block.left', kind='pressure', table='push.csv'}]")


def test_every_key_is_described_and_numbers_have_units() -> None:
    for key, node in schema.walk():
        inner = schema.tables(node)
        assert "description" in node or all("description" in one for one in inner or ({},)), key
        numbers = [node, *node.get("anyOf", ())]
        items = node.get("items")
        numbers += items if isinstance(items, list) else [items] if isinstance(items, dict) else []
        assert UNIT in node or not any(one.get("type") == "number" for one in numbers), key


def only(key: str) -> Explanation:
    (found,) = explain(key)
    return found


@pytest.mark.parametrize("key", ["contact.regularization.eta", "contact.interface.regularization.eta"])
def test_a_key_with_and_without_the_name_of_its_item(key: str) -> None:
    found = only(key)
    assert found.key == "contact.regularization.eta"
    assert found.place == "[contact.regularization]"
    assert (found.type, found.unit, found.allowed) == ("number", "dimensionless", "above 0")
    assert (found.default, found.required) == ("0.0001", False)
    assert "hyperbolic" in found.meaning


def test_required_keys_have_an_example_from_a_starter() -> None:
    found = only("body.refine.spacing")
    assert (found.place, found.unit, found.required, found.default) == ("[[body.refine]]", "length", True, "")
    assert tomllib.loads(found.example)["spacing"] > 0.0


@pytest.mark.parametrize(
    ("key", "allowed", "kind"),
    [
        ("solver.order", "at least 2, at most 40", "whole number"),
        ("solver.method", '"auto", "anm", "active-set"', "one of the allowed values"),
        ("mls.neighbors", "above 0", '"auto" or whole number'),
        ("output.fields", 'each "displacement", "stress", "von_mises"', "list of the allowed values"),
        ("body.shape.points", "", "list of [number, number], 3 or more"),
        ("material.stiffness", "", f"[{', '.join(3 * ['[number, number, number]'])}]"),
    ],
)
def test_types_and_limits(key: str, allowed: str, kind: str) -> None:
    found = only(key)
    # Later versions allow more.
    assert set(allowed.split(", ")) <= set(found.allowed.split(", "))
    assert found.type == kind


def test_keys_that_only_some_kinds_have() -> None:
    assert only("body.shape.radius").kinds == ("disk", "half-disk")
    assert only("load.name").kinds == ()
    assert {one.kinds for one in explain("load.displacement")} == {("displacement",), ("platen", "obstacle")}


def test_kinds_are_told_with_what_they_are() -> None:
    found = only("load.kind")
    assert '"platen"' in found.allowed
    assert "rigid plate" in found.variants["platen"]
    assert only("load").variants == found.variants


def test_tables_list_their_keys() -> None:
    assert set(only("").keys) == set(json_schema()["properties"])
    found = only("solver")
    assert found.place == "[solver]"
    assert set(found.keys) == set(json_schema()["definitions"]["Solver"]["properties"])
    assert only("material").place == "[material.NAME]"


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("eta", "contact.regularization.eta"),
        ("materiel.E", "material.E"),
        ("mu", "contact.friction"),
        ("contact.mu", "contact.friction"),
        ("hole", "body.shape.holes"),
        ("solver.ordre", "solver.order"),
        ("xyzzy", "lists the tables"),
        ("solver.fast.order", "solver.order"),
        ("contact.one.two.friction", "contact.friction"),
        ("contact.frictoin", "contact.friction"),
    ],
)
def test_unknown_keys_get_the_nearest(key: str, words: str) -> None:
    with pytest.raises(RunError) as error:
        explain(key)
    assert words in error.value.hint
    assert error.value.exit_code == 2
