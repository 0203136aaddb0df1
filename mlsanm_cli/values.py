"""Dataclasses that cost little to define.

The standard decorator compiles six functions for every frozen class, and a hundred classes take longer than
importing numpy. Here nothing is compiled: all classes share these functions, and constructors go by a list of
fields. The objects are dataclasses for `replace`, `asdict` and `fields`, and behave as they do elsewhere.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from dataclasses import dataclass

__all__ = ["dataclass"]


def _define(*, frozen: bool, eq: bool = True) -> Any:
    """As ``dataclasses.dataclass`` for frozen classes; without ``eq`` an object equals itself only."""
    if not frozen:
        raise TypeError("for frozen classes only")

    def decorate(cls: Any) -> Any:
        shared: dict[str, Any] = {
            "__repr__": _repr,
            "__setattr__": _refuse_set,
            "__delattr__": _refuse_delete,
        }
        if eq:
            shared |= {"__eq__": _equal, "__hash__": _hash}
        for name, function in shared.items():
            if name not in vars(cls):
                setattr(cls, name, function)
        if cls.__doc__ is None:
            # The standard decorator would work a signature out, and parse Python for that.
            cls.__doc__ = cls.__name__
        dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
        cls.__init__ = _constructor(cls)
        return cls

    return decorate


if not TYPE_CHECKING:
    dataclass = _define


def _constructor(cls: Any) -> Any:
    """The constructor of a class whose fields are known: in their order, those with defaults optional, then
    ``__post_init__``."""
    fields = dataclasses.fields(cls)
    order = [field.name for field in fields if field.init]
    defaults = {
        field.name: field.default
        for field in fields
        if field.init and field.default is not dataclasses.MISSING
    }
    makers = {
        field.name: field.default_factory
        for field in fields
        if field.default_factory is not dataclasses.MISSING
    }
    known = frozenset(order)
    needed = known - defaults.keys() - makers.keys()
    finishes = hasattr(cls, "__post_init__")

    def __init__(self: Any, /, *arguments: Any, **named: Any) -> None:
        given = dict(zip(order, arguments, strict=False)) | named
        # All are counted: none too many, none twice, none unknown, none missing.
        if len(given) != len(arguments) + len(named) or not needed <= given.keys() <= known:
            _refuse(cls, order, needed, arguments, named)
        for name, make in makers.items():
            if name not in given:
                given[name] = make()
        vars(self).update(defaults | given)
        if finishes:
            self.__post_init__()

    __init__.__qualname__ = f"{cls.__qualname__}.__init__"
    return __init__


def _refuse(
    cls: Any, order: list[str], needed: frozenset[str], arguments: tuple[Any, ...], named: dict[str, Any]
) -> NoReturn:
    """Raise the TypeError that tells what is wrong with arguments."""
    what = f"{cls.__qualname__}.__init__()"
    if len(arguments) > len(order):
        raise TypeError(f"{what} takes {len(order)} arguments but {len(arguments)} were given")
    for name in named:
        if name not in order:
            raise TypeError(f"{what} got an unexpected keyword argument {name!r}")
        if name in order[: len(arguments)]:
            raise TypeError(f"{what} got multiple values for argument {name!r}")
    missing = [name for name in order[len(arguments) :] if name in needed and name not in named]
    raise TypeError(f"{what} misses the arguments {', '.join(missing)}")


def _repr(self: Any) -> str:
    shown = (f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _compared(value: Any) -> tuple[Any, ...]:
    return tuple(getattr(value, f.name) for f in dataclasses.fields(value) if f.compare)


def _equal(self: Any, other: object) -> Any:
    return _compared(self) == _compared(other) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_compared(self))


def _refuse_set(self: Any, name: str, value: Any) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_delete(self: Any, name: str) -> NoReturn:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
