"""Dataclasses that cost little to define.

The standard decorator compiles six functions for every frozen class, and a hundred classes take longer than
importing numpy. Here all classes share these functions, and the constructor is compiled when the first object
is made. The objects are dataclasses for `replace`, `asdict` and `fields`, and behave as they do elsewhere.
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
        cls.__init__ = _first(cls)
        return cls

    return decorate


if not TYPE_CHECKING:
    dataclass = _define


def _first(cls: Any) -> Any:
    """A constructor that puts the compiled one in its place."""

    def __init__(self: Any, *arguments: Any, **named: Any) -> None:
        cls.__init__ = _constructor(cls)
        cls.__init__(self, *arguments, **named)

    return __init__


def _constructor(cls: Any) -> Any:
    """The constructor: the fields in their order, those with defaults optional, then ``__post_init__``."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_missing": dataclasses.MISSING}
    parameters, body = [], []
    for field in dataclasses.fields(cls):
        name, value = field.name, field.name
        if field.default_factory is not dataclasses.MISSING:
            known[f"_make_{name}"] = field.default_factory
            value = f"_make_{name}() if {name} is _missing else {name}" if field.init else f"_make_{name}()"
            parameters += [f"{name}=_missing"] if field.init else []
        elif not field.init:
            continue
        elif field.default is not dataclasses.MISSING:
            known[f"_default_{name}"] = field.default
            parameters.append(f"{name}=_default_{name}")
        else:
            parameters.append(name)
        body.append(f" _set(self, {name!r}, {value})")
    if hasattr(cls, "__post_init__"):
        body.append(" self.__post_init__()")
    source = "\n".join([f"def __init__(self, {', '.join(parameters)}):", *body, " return None"])
    exec(source, known)
    constructor = known["__init__"]
    constructor.__qualname__ = f"{cls.__qualname__}.__init__"
    return constructor


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
