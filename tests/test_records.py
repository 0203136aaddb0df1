"""The project's `dataclass` behaves as the standard one."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from typing import Any

import pytest

from mlsanm_cli.records import dataclass


@dataclass(frozen=True)
class Point:
    x: float
    y: float = 0.0
    label: str = dataclasses.field(default="", compare=False, repr=False)


@dataclasses.dataclass(frozen=True)
class Standard:
    x: float
    y: float = 0.0
    label: str = dataclasses.field(default="", compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class Same:
    x: float


def behaviour(kind: Any) -> list[Any]:
    point = kind(1.0, label="a")
    moved = dataclasses.replace(point, y=2.0)
    return [
        repr(moved).partition("(")[2],
        point == kind(1.0, label="b"),
        point != moved,
        point == (1.0, 0.0, "a"),
        hash(point) == hash(kind(1.0)),
        dataclasses.asdict(moved),
        kind.__match_args__,
        [copy.deepcopy(moved) == moved, pickle.loads(pickle.dumps(moved)) == moved],
    ]


def test_fields_comparison_hash_and_copies_are_those_of_standard_dataclasses() -> None:
    assert behaviour(Point) == behaviour(Standard)


def test_frozen_fields_stay_and_instances_without_comparison_differ() -> None:
    point = Point(1.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        point.x = 2.0  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        del point.x
    assert point.x == 1.0
    same = Same(1.0)
    assert same == same
    assert same != Same(1.0)


@pytest.mark.parametrize(
    ("given", "named"),
    [((), {}), ((1.0, 2.0, "a", 3.0), {}), ((1.0,), {"x": 2.0}), ((1.0,), {"z": 2.0})],
    ids=["missing", "too many", "repeated", "unknown"],
)
def test_wrong_arguments_are_type_errors(given: tuple[Any, ...], named: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match="Point"):
        Point(*given, **named)
