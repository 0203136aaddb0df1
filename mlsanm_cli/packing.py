"""Frozen values as bytes and back: what a run keeps of itself to go on from.

A value is made of numbers, texts, arrays, and of dataclasses, tuples and mappings of them. What it was made
of is not stored: who wants it back names the class, whose annotations tell the rest.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from types import UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

Value = TypeVar("Value")

_LENGTH = struct.Struct("<Q")


def packed(value: object) -> bytes:
    """The value as bytes, equal for equal ones. Raises TypeError for what cannot be packed."""
    arrays: list[bytes] = []
    head = json.dumps(_plain(value, arrays), separators=(",", ":")).encode()
    return b"".join([_LENGTH.pack(len(head)), head, *arrays])


def unpacked(kind: type[Value], content: bytes) -> Value:
    """The value of a class that was packed. Raises ValueError if ``content`` holds no such value."""
    try:
        (length,) = _LENGTH.unpack_from(content)
        end = _LENGTH.size + length
        made = _made(kind, json.loads(content[_LENGTH.size : end]), _Arrays(content, end))
    except (struct.error, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no {kind.__name__} is packed here") from error
    return cast(Value, made)


class _Arrays:
    """The arrays behind the head, in the order in which they were packed."""

    def __init__(self, content: bytes, at: int) -> None:
        self._content, self._at = content, at

    def take(self, kind: str, shape: list[int]) -> np.ndarray[Any, Any]:
        """The next array."""
        dtype = np.dtype(kind)
        count = int(np.prod(shape, dtype=np.int64))
        found = np.frombuffer(self._content, dtype, count, self._at).reshape(shape).copy()
        self._at += count * dtype.itemsize
        return found


def _plain(value: object, arrays: list[bytes]) -> Any:
    """What JSON can hold; arrays go to the list."""
    if isinstance(value, np.ndarray):
        arrays.append(value.tobytes())
        return [value.dtype.str, list(value.shape)]
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if is_dataclass(value):
        own: Any = type(value)
        return {name: _plain(getattr(value, name), arrays) for name in _names(own)}
    if isinstance(value, Mapping):
        return {name: _plain(inner, arrays) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner, arrays) for inner in value]
    raise TypeError(f"a {type(value).__name__} cannot be packed")


def _made(kind: Any, plain: Any, arrays: _Arrays) -> Any:
    """What JSON held as the value of a class."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        chosen = next(one for one in inner if one is not type(None))
        return None if plain is None else _made(chosen, plain, arrays)
    if origin is np.ndarray:
        return arrays.take(*plain)
    if isinstance(kind, type) and is_dataclass(kind):
        own: Any = kind
        hints = _hints(own)
        if plain.keys() != set(_names(own)):
            raise KeyError(own.__name__)
        return own(**{name: _made(hints[name], plain[name], arrays) for name in _names(own)})
    if origin is tuple:
        return tuple(_made(inner[0], part, arrays) for part in plain)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {name: _made(inner[1], part, arrays) for name, part in plain.items()}
    return plain


@lru_cache(maxsize=64)
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(one.name for one in fields(kind) if one.init)


@lru_cache(maxsize=64)
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)
