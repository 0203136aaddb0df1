"""Results that need not be found twice, told apart by the content of what they were made from.

A key is a digest of the numbers that go in, not of the case that they come from: whatever changes them gives
another key, and whatever does not, as a friction coefficient, finds what is there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sparse

Value = TypeVar("Value")
Arrays: TypeAlias = Mapping[str, np.ndarray[Any, Any]]


class Memo(Protocol):
    """Where results are kept: what ``make`` once returned for a ``kind`` and ``key`` stands for them."""

    def arrays(self, kind: str, key: str, make: Callable[[], Arrays]) -> Arrays:
        """Arrays that may be kept for other processes; nobody may write to them."""
        ...

    def value(self, kind: str, key: str, make: Callable[[], Value]) -> Value:
        """Any frozen value, kept in this process at most."""
        ...

    @property
    def figures(self) -> Mapping[str, int]:
        """How many arrays were ``found`` and how many were ``made``, nothing where none are kept."""
        ...


class NoCache:
    """Keeps nothing."""

    def arrays(self, kind: str, key: str, make: Callable[[], Arrays]) -> Arrays:
        """What ``make`` returns."""
        return make()

    def value(self, kind: str, key: str, make: Callable[[], Value]) -> Value:
        """What ``make`` returns."""
        return make()

    @property
    def figures(self) -> Mapping[str, int]:
        """Nothing."""
        return {}


NO_CACHE = NoCache()


def digest(*parts: object) -> str:
    """A digest of numbers, texts, arrays, sparse matrices, and sequences, mappings and dataclasses of them.

    Types and lengths count, so that no two different lists of parts are taken for one another. A dataclass
    that tells its ``content`` itself is taken at its word. Raises TypeError for anything else.
    """
    found = hashlib.blake2b(digest_size=20)
    for part in parts:
        _add(found, part)
    return found.hexdigest()


def _add(found: hashlib.blake2b, part: object) -> None:
    if isinstance(part, np.ndarray):
        found.update(f"array {part.dtype.str} {part.shape}".encode())
        found.update(np.ascontiguousarray(part).data)
    elif isinstance(part, sparse.csr_array | sparse.csc_array):
        found.update(f"{part.format} {part.shape}".encode())
        for inner in (part.indptr, part.indices, part.data):
            _add(found, inner)
    elif isinstance(part, Mapping):
        found.update(f"mapping {len(part)}".encode())
        for name, inner in part.items():
            _add(found, name)
            _add(found, inner)
    elif isinstance(part, list | tuple):
        found.update(f"sequence {len(part)}".encode())
        for inner in part:
            _add(found, inner)
    elif part is None or isinstance(part, str | bool | int | float | complex | np.generic):
        text = repr(part).encode()
        found.update(f"{type(part).__name__} {len(text)} ".encode() + text)
    elif is_dataclass(part) and not isinstance(part, type):
        found.update(f"dataclass {type(part).__qualname__} ".encode())
        told = getattr(part, "content", None)
        _add(found, told if isinstance(told, str) else [getattr(part, one.name) for one in fields(part)])
    else:
        raise TypeError(f"no digest of a {type(part).__name__}")
