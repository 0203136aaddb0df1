"""Our frozen dataclasses against those of the standard library, member by member."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import pytest

from mlsanm_cli import values


def classes(decorate: Callable[..., Any]) -> tuple[Any, Any, Any]:
    """The same three classes, made by a decorator."""

    class Base:
        a: int
        b: float = 2.0

        def __post_init__(self) -> None:
            object.__setattr__(self, "seen", [self.a])

    Base = decorate(frozen=True)(Base)  # type: ignore[misc]

    class Child(Base):
        c: list[int] = dataclasses.field(default_factory=list)
        d: float = dataclasses.field(init=False, repr=False, compare=False, default=4.0)

    class Identity:
        e: Any
        f: Any = dataclasses.field(init=False, repr=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "f", self.e + 1)

    return Base, decorate(frozen=True)(Child), decorate(frozen=True, eq=False)(Identity)


OURS, STANDARD = classes(values.dataclass), classes(dataclasses.dataclass)


@pytest.mark.parametrize(
    ("number", "arguments", "named"),
    [
        (0, (1,), {}),
        (0, (1, 3.0), {}),
        (0, (), {"b": 1.0, "a": 2}),
        (1, (1,), {}),
        (1, (1, 2.0, [3]), {}),
        (1, (1,), {"c": [5]}),
        (2, (1,), {}),
    ],
)
def test_objects_are_as_those_of_the_standard_library(
    number: int, arguments: tuple[Any, ...], named: dict[str, Any]
) -> None:
    mine, other = OURS[number](*arguments, **named), STANDARD[number](*arguments, **named)
    assert vars(mine) == vars(other)
    assert repr(mine) == repr(other)
    assert dataclasses.asdict(mine) == dataclasses.asdict(other)
    again = OURS[number](*arguments, **named)
    assert (mine == again) is (number < 2)
    assert mine == copy.copy(mine) or number == 2
    assert mine != other


@pytest.mark.parametrize("number", [0, 1, 2])
def test_they_do_not_change(number: int) -> None:
    made = OURS[number](1)
    for name in ("a", "e", "anything"):
        with pytest.raises(dataclasses.FrozenInstanceError, match=name):
            setattr(made, name, 2)
        with pytest.raises(dataclasses.FrozenInstanceError, match=name):
            delattr(made, name)


def test_replace_makes_another() -> None:
    first = OURS[0](1)
    second = dataclasses.replace(first, b=5.0)
    assert (second.a, second.b, first.b) == (1, 5.0, 2.0)
    assert first != second
    assert hash(first) == hash(OURS[0](1))
    assert hash(first) != hash(second)
    with pytest.raises(TypeError, match="unhashable"):
        hash(OURS[1](1))


@pytest.mark.parametrize("arguments", [(), (1, 2, 3, 4)])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_wrong_arguments_are_refused(number: int, arguments: tuple[int, ...]) -> None:
    with pytest.raises(TypeError, match="argument"):
        OURS[number](*arguments)
    with pytest.raises(TypeError, match="unexpected keyword"):
        OURS[number](1, none=1)


def test_fields_that_do_not_count_are_not_compared() -> None:
    first, second = OURS[1](1), OURS[1](1)
    object.__setattr__(second, "d", 7.0)
    assert first == second
    object.__setattr__(second, "b", 7.0)
    assert first != second


def test_defaults_of_lists_are_not_shared() -> None:
    first, second = OURS[1](1), OURS[1](1)
    first.c.append(7)
    assert second.c == []


@values.dataclass(frozen=True)
class Plain:
    """Importable, so that it can be pickled."""

    a: int
    b: tuple[int, ...] = ()


def test_they_travel_between_processes() -> None:
    assert pickle.loads(pickle.dumps(Plain(1, (2, 3)))) == Plain(1, (2, 3))


def test_classes_that_change_are_left_to_the_standard_library() -> None:
    with pytest.raises(TypeError, match="frozen"):
        values.dataclass(frozen=False)
