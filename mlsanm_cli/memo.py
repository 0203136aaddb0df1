"""Memoised results, by the content of their inputs. A key is a digest of the numbers that a result depends
on, not of the case: changes of other quantities, for instance a friction coefficient, do not invalidate
it."""

from __future__ import annotations

import hashlib
from array import array
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sparse

Value = TypeVar("Value")
Arrays: TypeAlias = Mapping[str, np.ndarray[Any, Any]]


class Memo:
    """The latest results of this process, at most ``most`` of each kind; they must not be modified."""

    def __init__(self, most: int = 0) -> None:
        self._most = most
        self._values: defaultdict[str, dict[str, Any]] = defaultdict(dict)
        self._found = self._made = 0

    def value(self, kind: str, content: object, make: Callable[[], Value]) -> Value:
        """The result of ``make``, of a ``kind``, which depends on ``content``, kept or computed now."""
        if not self._most:
            return make()
        key, values = digest(content), self._values[kind]
        known = key in values
        kept: Value = values.pop(key) if known else make()
        self._found, self._made = self._found + known, self._made + (not known)
        values[key] = kept
        if len(values) > self._most:
            del values[next(iter(values))]
        return kept

    @property
    def figures(self) -> Mapping[str, int]:
        return {"found": self._found, "made": self._made} if self._most else {}


NO_CACHE = Memo()
"""Keeps no results."""
SCALARS = (str, bool, int, float, complex, np.generic)


def digest(*parts: object) -> str:
    """A digest of numbers, texts, arrays, sparse matrices, and sequences, mappings and dataclasses of them,
    with their types and lengths. A dataclass with an attribute ``content`` is represented by that."""
    found = hashlib.blake2b(digest_size=20)
    for part in parts:
        _add(found, part)
    return found.hexdigest()


def _add(found: hashlib.blake2b, part: object) -> None:
    if part is None or isinstance(part, SCALARS):
        text = repr(part)
        found.update(f"{type(part).__name__} {len(text)} {text}".encode())
    elif isinstance(part, list | tuple):
        if set(map(type, part)) == {float}:
            found.update(f"floats {len(part)}".encode())
            found.update(array("d", part))
            return
        found.update(f"sequence {len(part)}".encode())
        for inner in part:
            _add(found, inner)
    elif isinstance(part, np.ndarray):
        found.update(f"array {part.dtype.str} {part.shape}".encode())
        found.update(np.ascontiguousarray(part).data)
    elif is_dataclass(part) and not isinstance(part, type):
        found.update(f"dataclass {type(part).__qualname__} ".encode())
        content = getattr(part, "content", None)
        _add(
            found, content if isinstance(content, str) else [getattr(part, one.name) for one in fields(part)]
        )
    elif isinstance(part, sparse.csr_array | sparse.csc_array):
        found.update(f"{part.format} {part.shape}".encode())
        for inner in (part.indptr, part.indices, part.data):
            _add(found, inner)
    elif isinstance(part, Mapping):
        found.update(f"mapping {len(part)}".encode())
        for name, inner in part.items():
            _add(found, name)
            _add(found, inner)
    else:
        raise TypeError(f"no digest of a {type(part).__name__}")
