"""`mlsanm explain`: keys, tables, kinds, nearest names."""

from __future__ import annotations

import tomllib

import pytest

from mlsanm_cli.case.explain import Explanation, explain
from mlsanm_cli.case.schema import json_schema
from mlsanm_cli.errors import RunError


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
