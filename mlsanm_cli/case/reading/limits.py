"""Limits on counts, depths and magnitudes, checked before anything else.

They are far beyond any scene that could be solved. Where the cost grows faster than the input, as in the
search for crossing sides, the limit keeps it below seconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from mlsanm_cli.case.lines import DEEPEST, KeyPath

MOST: Mapping[str, int] = {
    "material": 500,
    "body": 500,
    "refine": 500,
    "holes": 500,
    "sides": 2000,
    "support": 500,
    "load": 500,
    "contact": 500,
    "probe": 1000,
    "stage": 5000,
    "stop": 100,
    "points": 2000,
    "obstacle.points": 20_000,
    "at": 10_000,
}
"""Largest number of items by the key of their list or table, or by the last two keys."""
SMALLEST, LARGEST = 1e-60, 1e60
"""Magnitudes of numbers: products of a few of them must not overflow or underflow."""
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
LONG_KEY = re.compile(rf"""(?<![\w."'-])(?:{_PART}[ \t]*+\.[ \t]*+){{{DEEPEST}}}""")
MOST_TABLES, MOST_KEYS, MOST_VALUES = 20_000, 100_000, 1_000_000
MOST_IN_TABLE = 2000
TABLE = re.compile(r"""(?m)^[ \t]*\[\[?[ \t]*[A-Za-z"'_]""")

Problem = tuple[KeyPath, str, str]


def text_problem(text: str) -> tuple[int, str]:
    """Line and message of text that would keep the TOML parser busy for minutes; line 0 if there is none."""
    # A key needs two characters for each of its parts.
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) >= 2 * DEEPEST and LONG_KEY.search(line):
            return number, f"a key of {DEEPEST} or more parts"
    if sum(1 for _ in TABLE.finditer(text)) > MOST_TABLES:
        return 1, f"more than {MOST_TABLES} tables"
    for sign, most, what in (("=", MOST_KEYS, "keys"), (",", MOST_VALUES, "values")):
        if text.count(sign) > most:
            return 1, f"more than {most} {what}"
    return 0, ""


def size_problems(content: Mapping[str, Any]) -> list[Problem]:
    """Lists with too many items and tables nested too deeply; their content is not examined."""
    problems: list[Problem] = []
    waiting: list[tuple[KeyPath, Any]] = [((), content)]
    while waiting:
        path, value = waiting.pop()
        if len(path) > DEEPEST:
            return [(path[:1], f"is nested more than {DEEPEST} levels deep", "")]
        named, owner, *_ = [step for step in reversed(path) if isinstance(step, str)] + ["", ""]
        counted = isinstance(value, list | tuple) or path == ("material",)
        most = MOST.get(f"{owner}.{named}", MOST.get(named))
        if counted and path[-1:] == (named,) and most is not None and len(value) > most:
            problems.append((path, f"has {len(value)} items", f"{most} at most"))
            continue
        if isinstance(value, dict) and len(value) > MOST_IN_TABLE:
            problems.append((path, f"has {len(value)} keys", f"at most {MOST_IN_TABLE}"))
            continue
        waiting += [((*path, step), item) for step, item in _items(value) if isinstance(item, _NESTED)]
    return problems


def number_problems(content: Mapping[str, Any]) -> Iterator[Problem]:
    """Numbers too large or too small for floating-point arithmetic."""
    for path, value in _numbers((), content):
        # Coordinates and components may be 0 up to round-off.
        small = 0.0 < abs(value) < SMALLEST and not isinstance(path[-1], int)
        if small or LARGEST < abs(value) < float("inf"):
            size = "small" if small else "large"
            shown = f"{value:g}" if isinstance(value, float) else "a number"
            hint = f"allowed magnitudes: {SMALLEST:g} to {LARGEST:g}"
            yield path, f"{shown} is too {size} for floating-point arithmetic", hint


_NESTED = (dict, list, tuple)


def _items(value: Any) -> Sequence[tuple[str | int, Any]]:
    if isinstance(value, dict):
        return list(value.items())
    return list(enumerate(value)) if isinstance(value, list | tuple) else []


def _numbers(path: KeyPath, value: Any) -> Iterator[tuple[KeyPath, int | float]]:
    for step, item in _items(value):
        here = (*path, step)
        if isinstance(item, int | float):
            yield here, item
        else:
            yield from _numbers(here, item)
