"""Values of a sweep."""

from __future__ import annotations

import pytest

from mlsanm_cli.case.vary import flat, parse_vary, points
from mlsanm_cli.errors import RunError


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0.1", ("0.1",)),
        ("a.b = 1, 2.5 ,3e-4", ("1", "2.5", "0.0003")),
        ('a="anm","newton"', ('"anm"', '"newton"')),
        ("a=anm, newton", ('"anm"', '"newton"')),
        ("a=true,false", ("true", "false")),
        ("a=[1.0, 2.0],[3.0, 4.0]", ("[1.0, 2.0]", "[3.0, 4.0]")),
        ('a={kind = "disk", radius = 1.0}', ('{ kind = "disk", radius = 1.0 }',)),
        ("a=0.0:0.5:3", ("0.0", "0.25", "0.5")),
        ("a=0:1:3", ("0.0", "0.5", "1.0")),
        ("a=10:20:3", ("10", "15", "20")),
        ("a=20:10:3", ("20", "15", "10")),
        ("a=0.3:0.7:1", ("0.3",)),
        ("a=0.1:0.7:4", ("0.1", "0.3", "0.5", "0.7")),
    ],
)
def test_values(text: str, values: tuple[str, ...]) -> None:
    assert parse_vary(text).values == values


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a", "expected KEY=VALUES"),
        ("a=", "expected KEY=VALUES"),
        ("a=[anm", "not TOML"),
        ("a=1\nb=2", "not TOML"),
        ("a=1,1.0,1", "twice"),
        ("a=0:1:0", "number of values"),
        ("a=0:1:10000000", "number of values"),
        ("a=0:x:3", "not TOML"),
        ("a=0:true:3", "not a number"),
    ],
)
def test_what_cannot_be_read_is_told(text: str, told: str) -> None:
    with pytest.raises(RunError, match=told):
        parse_vary(text)


def test_every_combination_is_a_point() -> None:
    found = points([parse_vary("a=1,2"), parse_vary("b=3:5:3")])
    assert len(found) == len(set(found)) == 6
    assert found[:2] == [("a=1", "b=3"), ("a=1", "b=4")]


def test_absurd_sweeps_are_refused() -> None:
    with pytest.raises(RunError, match="varied twice"):
        points([parse_vary("a=1"), parse_vary("a=2")])
    with pytest.raises(RunError, match="1000000 points"):
        points([parse_vary(f"{name}=1:1000:1000") for name in "ab"])


def test_flat_keys_are_those_of_set() -> None:
    content = {"contact": [{"name": "c", "law": {"eta": 1.0}}], "stage": [{"p": 1.0}], "at": [1.0, 2.0]}
    assert flat(content) == {
        "contact.c.name": "c",
        "contact.c.law.eta": 1.0,
        "stage.0.p": 1.0,
        "at": [1.0, 2.0],
    }
