"""``--set KEY=VALUE``: changes to the content of a case file before validation."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Sequence
from typing import Any

from mlsanm_cli.case.limits import text_problem
from mlsanm_cli.case.report import MAX_KEY_PARTS, KeyPath, suggestion
from mlsanm_cli.errors import CaseProblem, RunError

SOURCE = "--set"
_PART = r"""\s*(?:"([^"]*)"|'([^']*)'|([^."'\s]+))\s*"""
_KEY = re.compile(rf"{_PART}(?:\.{_PART})*")
WILDCARD = "*"
"""Wildcard in a key for all items of a list, or all tables of a table like ``material``."""
_WORD = re.compile(r"[^\W\d][^\n\"'\[\]{}#=,]*|[./~][^\n\"'\[\]{}#=,]*[^\W\d][^\n\"'\[\]{}#=,]*")


def is_word(text: str) -> bool:
    """Whether a value that is not TOML is a text whose quotes the shell removed.

    >>> [is_word(text) for text in ("exact", "meshes/a.msh", "1e-", "[1", "")]
    [True, True, False, False, False]
    """
    return _WORD.fullmatch(text) is not None


def parsed_value(text: str) -> Any:
    """The value that TOML text describes. Raises ValueError."""
    try:
        content = tomllib.loads(f"value = {text}")
    except RecursionError as error:
        raise ValueError("lists are nested too deeply") from error
    if content.keys() != {"value"}:
        raise ValueError("more than one value")
    return content["value"]


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
            parts, new = _parts(key), _value(key.strip(), value)
            changed.update(_assign(content, parts, new))
        except RunError as bad:
            name = key.strip() or text
            problems.append(CaseProblem(name, bad.message, 0, SOURCE, bad.hint))
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


def _value(key: str, text: str) -> Any:
    _, problem = text_problem(text)
    if problem:
        raise RunError(f"the value has {problem}")
    word = text.strip()
    try:
        return parsed_value(text)
    except ValueError as error:
        if is_word(word):
            return word
        hint = f"""text needs quotes: --set '{key}="{word}"'""" if word and '"' not in word else ""
        raise RunError(f"the value {word or '(empty)'} is not TOML", hint) from error


def _assign(table: Any, parts: list[str], value: Any, at: int = 0) -> list[KeyPath]:
    """Sets a value at the keys below a table that the parts from number ``at`` on match; returns their
    paths."""
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
