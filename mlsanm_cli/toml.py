"""Values as TOML."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_value(value: Any) -> str:
    """A value, also a numpy scalar or array, as TOML on one line. Raises TypeError for other types.

    >>> toml_value({"at": [0, 0.5], "along": "top", "a b": True})
    '{ at = [0, 0.5], along = "top", "a b" = true }'
    """
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, bool):
        return str(plain).lower()
    if isinstance(plain, int | float):
        return repr(plain)
    if isinstance(plain, str | os.PathLike):
        return json.dumps(os.fspath(plain), ensure_ascii=False)
    if isinstance(plain, Mapping):
        keys = (key if _BARE.fullmatch(key) else json.dumps(key) for key in map(str, plain))
        pairs = (f"{key} = {toml_value(item)}" for key, item in zip(keys, plain.values(), strict=True))
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(plain, Sequence):
        return f"[{', '.join(map(toml_value, plain))}]"
    if hasattr(plain, "isoformat"):
        return str(plain.isoformat())
    raise TypeError(f"a case cannot hold {value!r}: give numbers, texts, lists and dicts")
