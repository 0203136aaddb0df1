"""``--set KEY=VALUE``: changes to the content of a case file before validation; ``--vary KEY=VALUES`` of a
sweep: values separated by commas, or evenly spaced ones as START:STOP:COUNT."""

from __future__ import annotations

import copy
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from mlsanm_cli.case.report import MAX_KEY_PARTS, KeyPath, suggestion, text_problem
from mlsanm_cli.errors import CaseProblem, RunError
from mlsanm_cli.toml import toml_value

_PART = r"""\s*(?:"([^"]*)"|'([^']*)'|([^."'\s]+))\s*"""
_KEY = re.compile(rf"{_PART}(?:\.{_PART})*")
WILDCARD = "*"
"""Wildcard in a key for all items of a list, or all tables of a table like ``material``."""
# A text whose quotes the shell removed.
_WORD = re.compile(r"[^\W\d][^\n\"'\[\]{}#=,]*|[./~][^\n\"'\[\]{}#=,]*[^\W\d][^\n\"'\[\]{}#=,]*")


def apply_overrides(
    data: dict[str, Any], overrides: Sequence[str]
) -> tuple[dict[str, Any], frozenset[KeyPath], tuple[CaseProblem, ...]]:
    """The content with all overrides applied in order, the paths they changed, and their problems."""
    content = copy.deepcopy(data) if overrides else data
    changed: set[KeyPath] = set()
    problems: list[CaseProblem] = []
    for text in overrides:
        key, sign, value = text.partition("=")
        try:
            if not sign:
                raise RunError("expected KEY=VALUE", "as in --set solver.order=15")
            changed.update(_assign(content, _parts(key), _value(key.strip(), value)))
        except RunError as bad:
            name = key.strip() or text
            problems.append(CaseProblem(name, bad.message, 0, "--set", bad.hint))
    return content, frozenset(changed), tuple(problems)


def key_path(content: dict[str, Any], key: str) -> KeyPath:
    """The path of a dotted key with list items by name, as far as it exists in the content.

    >>> key_path({"load": [{"name": "press"}]}, "load.press.force")
    ('load', 0, 'force')
    """
    path: KeyPath = ()
    table: Any = content
    parts = _parts(key)
    for position, part in enumerate(parts):
        try:
            step = _step(table, part, parts[:position])
            path = (*path, step)
            table = table[step]
        except (RunError, KeyError):
            break
    return path


def _parts(key: str) -> list[str]:
    if not _KEY.fullmatch(key):
        raise RunError("is not a dotted key", "as in contact.interface.reach or body.0.spacing")
    parts = ["".join(part) for part in re.findall(rf"{_PART}(?:\.|$)", key)]
    if len(parts) > MAX_KEY_PARTS:
        raise RunError(f"is a key of {MAX_KEY_PARTS} or more parts")
    return parts


def _parsed(text: str) -> Any:
    """The value that TOML text describes. Raises ValueError."""
    try:
        content = tomllib.loads(f"value = {text}")
    except RecursionError as error:
        raise ValueError("lists are nested too deeply") from error
    if content.keys() != {"value"}:
        raise ValueError("more than one value")
    return content["value"]


def _value(key: str, text: str) -> Any:
    _, problem = text_problem(text)
    if problem:
        raise RunError(f"the value has {problem}")
    word = text.strip()
    try:
        return _parsed(text)
    except ValueError as error:
        if _WORD.fullmatch(word):
            return word
        hint = f"""text needs quotes: --set '{key}="{word}"'""" if word and '"' not in word else ""
        raise RunError(f"the value {word or '(empty)'} is not TOML", hint) from error


def _assign(table: Any, parts: list[str], value: Any, at: int = 0) -> list[KeyPath]:
    """Sets a value at the keys that the parts from number ``at`` on match; returns their paths."""
    part, rest, where = parts[at], parts[at + 1 :], ".".join(parts[:at])
    if part == WILDCARD:
        names = list(table) if isinstance(table, dict) else list(map(str, range(len(table))))
        if not names or not rest:
            raise _no_match(where)
        found = [_assign(table, [*parts[:at], name, *rest], value, at) for name in names]
        return [path for paths in found for path in paths]
    step = _step(table, part, parts[:at])
    if not rest:
        table[step] = copy.deepcopy(value)
        return [(step,)]
    if isinstance(table, dict) and step not in table:
        here = ".".join(parts[: at + 1])
        if rest[0] == WILDCARD:
            raise _no_match(here)
        if rest[0].isdecimal():
            raise RunError(f'"{part}" has no items', f"the case file has no {here}")
        table[step] = {}
    return [(step, *path) for path in _assign(table[step], parts, value, at + 1)]


def _no_match(where: str) -> RunError:
    return RunError(f'"{where}.*" matches nothing', "as in contact.*.friction=0.3")


def _step(table: Any, part: str, before: list[str]) -> str | int:
    """The key or index of one part of a dotted key in a table or list."""
    where = ".".join(before)
    if isinstance(table, dict):
        return part
    if not isinstance(table, list):
        raise RunError(f'"{where}" is a single value without keys')
    names = [item.get("name") if isinstance(item, dict) else None for item in table]
    if part in names:
        return names.index(part)
    if part.isdecimal() and int(part) < len(table):
        return int(part)
    known = [name for name in names if isinstance(name, str)]
    if part.isdecimal() or not known:
        count = f"it has {len(table)} item{'' if len(table) == 1 else 's'}, counted from 0"
        raise RunError(f'"{where}" has no item {part}', count)
    raise RunError(f'"{where}" has no item named "{part}"', suggestion(part, known))


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
    evenly, words = _RANGE.fullmatch(listed), [part.strip() for part in listed.split(",")]
    try:
        if evenly:
            values = _even(*map(_parsed, evenly.groups()))
        elif all(map(_WORD.fullmatch, words)) and not {"true", "false", "inf", "nan"} & set(words):
            values = tuple(map(toml_value, words))
        else:
            values = tuple(map(toml_value, _parsed(f"[{listed}]")))
    except RunError as error:
        raise RunError(f"--vary {text}: {error.message}", error.hint) from error
    except ValueError as error:
        hint = """text needs quotes, as in --vary 'solver.method="anm","newton"'"""
        raise RunError(f"--vary {text}: the values are not TOML", hint) from error
    if len(set(values)) < len(values):
        raise RunError(f"--vary {text}: a value is given twice")
    return Vary(key, values)


def points(varied: Sequence[Vary]) -> list[tuple[str, ...]]:
    """All ``KEY=VALUE`` texts, the last key changing fastest. Raises RunError, also for too many points."""
    if len({vary.key for vary in varied}) < len(varied):
        raise RunError("a key is varied twice", "give all its values in one --vary")
    count = math.prod(len(vary.values) for vary in varied)
    if count > MAX_POINTS:
        raise RunError(f"the sweep has {count} points", f"at most {MAX_POINTS}")
    return list(product(*([f"{vary.key}={value}" for value in vary.values] for vary in varied)))


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
