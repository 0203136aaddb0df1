"""The JSON Schema of the case file: it takes what the model takes, and tells nothing that is refused."""

from __future__ import annotations

import contextlib
import tomllib
from pathlib import Path

import jsonschema
import pytest

from mlsanm_cli.case import parse_case, schema
from mlsanm_cli.case.model.section import UNIT
from mlsanm_cli.case.reading.overrides import apply_overrides
from mlsanm_cli.case.starters import kinds, starter
from mlsanm_cli.errors import CaseError
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
