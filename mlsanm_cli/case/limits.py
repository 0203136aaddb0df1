"""Limits on counts, depths and magnitudes, far beyond any scene, which bound the time of all other checks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from mlsanm_cli.case.report import MAX_KEY_PARTS, KeyPath
from mlsanm_cli.errors import Fault

MAX_ITEMS: Mapping[str, int] = {
    **dict.fromkeys(("material", "body", "refine", "holes", "support", "load", "contact"), 500),
    "sides": 2000,
    "points": 2000,
    "obstacle.points": 20_000,
    "probe": 1000,
    "stage": 5000,
    "stop": 100,
    "at": 10_000,
    "table": 100_000,
}
"""Largest number of items by the key of their list or table, or by the last two keys."""
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-60, 1e60
"""Products of a few numbers of these magnitudes neither overflow nor underflow."""
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
LONG_KEY = re.compile(rf"""(?<![\w."'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MAX_KEY_PARTS}}}""")
MAX_TABLES, MAX_KEYS, MAX_VALUES = 20_000, 100_000, 1_000_000
MAX_KEYS_OF_TABLE = 2000
TABLE = re.compile(r"""(?m)^[ \t]*\[\[?[ \t]*[A-Za-z"'_]""")


def text_problem(text: str) -> tuple[int, str]:
    """Line and message for text that would keep the TOML parser busy for minutes; line 0 if there is none."""
    # Each part of a key takes at least two characters.
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) >= 2 * MAX_KEY_PARTS and LONG_KEY.search(line):
            return number, f"a key of {MAX_KEY_PARTS} or more parts"
    if sum(1 for _ in TABLE.finditer(text)) > MAX_TABLES:
        return 1, f"more than {MAX_TABLES} tables"
    for sign, most, what in (("=", MAX_KEYS, "keys"), (",", MAX_VALUES, "values")):
        if text.count(sign) > most:
            return 1, f"more than {most} {what}"
    return 0, ""


def size_faults(content: Mapping[str, Any]) -> list[Fault]:
    """Lists and tables with too many items, whose content is not examined, and too deep nesting."""
    faults: list[Fault] = []
    waiting: list[tuple[KeyPath, Any]] = [((), content)]
    while waiting:
        path, value = waiting.pop()
        if len(path) > MAX_KEY_PARTS:
            return [Fault(path[:1], f"is nested more than {MAX_KEY_PARTS} levels deep")]
        named, owner, *_ = [step for step in reversed(path) if isinstance(step, str)] + ["", ""]
        counted = isinstance(value, list | tuple) or path == ("material",)
        most = MAX_ITEMS.get(f"{owner}.{named}", MAX_ITEMS.get(named))
        if counted and path[-1:] == (named,) and most is not None and len(value) > most:
            faults.append(Fault(path, f"has {len(value)} items", f"at most {most}"))
        elif isinstance(value, dict) and len(value) > MAX_KEYS_OF_TABLE:
            faults.append(Fault(path, f"has {len(value)} keys", f"at most {MAX_KEYS_OF_TABLE}"))
        else:
            items = [((*path, step), item) for step, item in items_of(value)]
            waiting += [entry for entry in items if isinstance(entry[1], dict | list | tuple)]
    return faults


def number_faults(value: Any, path: KeyPath = ()) -> Iterator[Fault]:
    """Numbers too large or too small for floating-point arithmetic."""
    for step, item in items_of(value):
        if not isinstance(item, int | float):
            yield from number_faults(item, (*path, step))
        elif problem := magnitude_problem(item, coordinate=isinstance(step, int)):
            hint = f"allowed magnitudes: {MIN_MAGNITUDE:g} to {MAX_MAGNITUDE:g}"
            yield Fault((*path, step), problem, hint)


def magnitude_problem(value: int | float, coordinate: bool = True) -> str:
    """What makes a number unfit for floating point, ""; coordinates may be 0 up to round-off."""
    small = 0.0 < abs(value) < MIN_MAGNITUDE and not coordinate
    if not small and not MAX_MAGNITUDE < abs(value) < float("inf"):
        return ""
    shown = f"{value:g}" if isinstance(value, float) else "a number"
    return f"{shown} is too {'small' if small else 'large'} for floating-point arithmetic"


def items_of(value: Any) -> Iterable[tuple[str | int, Any]]:
    """Keys or numbers and items of a table or list."""
    if isinstance(value, dict):
        return value.items()
    return enumerate(value) if isinstance(value, list | tuple) else ()
