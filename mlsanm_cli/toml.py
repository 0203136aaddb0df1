"""Values as TOML, and in the types of JSON."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def plain(value: Any) -> Any:
    """The value in JSON's types, with None for nan and inf. Raises TypeError for other types."""
    if value is None or isinstance(value, str | bool | int):
        return value
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in (value if isinstance(value, list | tuple) else sorted(value))]
    raise TypeError(f"no JSON form for a value of type {type(value).__name__}")


def toml_value(value: Any) -> str:
    """A value, also a numpy scalar or array, as TOML on one line. Raises TypeError for other types.

    >>> toml_value({"at": [0, 0.5], "along": "top", "a b": True})
    '{ at = [0, 0.5], along = "top", "a b" = true }'
    """
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | os.PathLike):
        return json.dumps(os.fspath(value), ensure_ascii=False)
    if isinstance(value, Mapping):
        keys = (key if _BARE.fullmatch(key) else json.dumps(key) for key in map(str, value))
        pairs = (f"{key} = {toml_value(item)}" for key, item in zip(keys, value.values(), strict=True))
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(value, Sequence):
        return f"[{', '.join(map(toml_value, value))}]"
    if hasattr(value, "isoformat"):
        return str(value.isoformat())
    raise TypeError(f"a case cannot hold {value!r}: give numbers, texts, lists and dicts")
