"""``--vary KEY=VALUES`` of a sweep: values separated by commas, or evenly spaced ones as START:STOP:COUNT."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from mlsanm_cli.case.reading.overrides import is_word, parsed_value
from mlsanm_cli.errors import RunError
from mlsanm_cli.toml import toml_value

MAX_POINTS = 100_000
"""Largest number of points of a sweep."""
_RANGE = re.compile(r"([^:,\[\]\"']+):([^:,\[\]\"']+):([^:,\[\]\"']+)")


class Vary(NamedTuple):
    """A dotted key as for ``--set``, and its values as TOML."""

    key: str
    values: tuple[str, ...]


def parse_vary(text: str) -> Vary:
    """A key and its values. Raises RunError if they cannot be read.

    >>> parse_vary("contact.c.friction=0.1,0.2").values
    ('0.1', '0.2')
    >>> parse_vary("solver.order=10:20:3").values
    ('10', '15', '20')
    """
    key, sign, listed = (part.strip() for part in text.partition("="))
    if not key or not sign or not listed:
        raise RunError(f"--vary {text}: expected KEY=VALUES", "as in --vary solver.order=10,15,20")
    evenly = _RANGE.fullmatch(listed)
    try:
        values = _even(*map(parsed_value, evenly.groups())) if evenly else _listed(listed)
    except RunError as error:
        raise RunError(f"--vary {text}: {error.message}", error.hint) from error
    except ValueError as error:
        hint = """text needs quotes, as in --vary 'solver.method="anm","newton"'"""
        raise RunError(f"--vary {text}: the values are not TOML", hint) from error
    if len(set(values)) < len(values):
        raise RunError(f"--vary {text}: a value is given twice")
    return Vary(key, values)


def points(varied: Sequence[Vary]) -> list[tuple[str, ...]]:
    """Every combination of values as ``KEY=VALUE`` texts, the last key changing fastest. Raises RunError for
    a key that is varied twice, and for too many points."""
    keys = [vary.key for vary in varied]
    if len(set(keys)) < len(keys):
        raise RunError("a key is varied twice", "give all its values in one --vary")
    count = math.prod(len(vary.values) for vary in varied)
    if count > MAX_POINTS:
        raise RunError(f"the sweep has {count} points", f"at most {MAX_POINTS}")
    return [
        tuple(f"{key}={value}" for key, value in zip(keys, values, strict=True))
        for values in product(*(vary.values for vary in varied))
    ]


def flat(content: Any, key: str = "") -> dict[str, Any]:
    """The content of a case by dotted keys as for ``--set``: list items by name or number.

    >>> flat({"body": [{"name": "a", "seed": 1}], "mls": {"degree": 2}})
    {'body.a.name': 'a', 'body.a.seed': 1, 'mls.degree': 2}
    """
    if isinstance(content, list | tuple) and content and all(isinstance(item, Mapping) for item in content):
        content = {item.get("name", number): item for number, item in enumerate(content)}
    if not isinstance(content, Mapping):
        return {key: content}
    tables = [flat(item, f"{key}.{name}" if key else str(name)) for name, item in content.items()]
    return {name: value for table in tables for name, value in table.items()}


def _even(start: Any, stop: Any, count: Any) -> tuple[str, ...]:
    """Evenly spaced values, whole numbers if all of them are."""
    for value in (start, stop, count):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RunError(f"{toml_value(value)} is not a number", "as in 0.0:0.5:11")
    if not isinstance(count, int) or not 1 <= count <= MAX_POINTS:
        raise RunError(f"{count} is not a number of values", "as in 0.0:0.5:11")
    steps = max(count - 1, 1)
    if isinstance(start, int) and isinstance(stop, int) and (stop - start) % steps == 0:
        return tuple(str(start + (stop - start) // steps * i) for i in range(count))
    # Rounded, because directories are named after the values: 0.15, not 0.15000000000000002.
    between = [float(f"{start + (stop - start) * i / steps:.12g}") for i in range(1, count - 1)]
    return tuple(map(repr, [float(start), *between, float(stop)][:count]))


def _listed(listed: str) -> tuple[str, ...]:
    words = [part.strip() for part in listed.split(",")]
    if all(map(is_word, words)) and not {"true", "false", "inf", "nan"} & set(words):
        return tuple(map(toml_value, words))
    return tuple(map(toml_value, parsed_value(f"[{listed}]")))
