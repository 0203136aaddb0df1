"""Validates the content of a case file; whatever is invalid does not hide what else is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mlsanm_cli.case.model.case import Case
from mlsanm_cli.case.model.section import Scope
from mlsanm_cli.case.reading.names import declared_names
from mlsanm_cli.case.report import KeyPath, Report

LISTS = ("body", "support", "load", "contact", "stage", "stop", "probe")
BODY_KEYS = ("name", "material", "spacing", "seed", "refine")
"""Keys of a body without which it can be checked."""
UNNAMED = {"name": "unnamed", "material": "unnamed"}
REQUIRED: dict[str, Any] = {"format": 1, "material": {}, "body": (), "model": {"plane": "stress"}}
"""Valid content for required tables that are missing or invalid."""


def valid_part(data: Mapping[str, Any], folder: Path, report: Report) -> Scope:
    """The valid tables of the content of a file; files are relative to ``folder``. Adds all errors of single
    tables to the report, except where it has a problem already."""
    names = declared_names(data)
    numbers = {section: tuple(range(len(_items(data, section)))) for section in LISTS}
    try:
        return Scope(Case.model_validate(data, context=folder), names, frozenset(), numbers)
    except ValidationError as error:
        from mlsanm_cli.case.schema_errors import UNKNOWN_KEY, fault_of, findings

        found = list(findings(data, error))
    reported = report.paths
    new = [item for item in found if not any(item[0][: len(known)] == known for known in reported)]
    report.add(fault_of(data, path, detail) for path, detail in new)
    removed = {_removable(path, detail["type"] == UNKNOWN_KEY) for path, detail in found}
    numbers = {
        section: tuple(k for k in numbers[section] if (section, k) not in removed) for section in LISTS
    }
    incomplete = {str(path[0]) for path, detail in found if detail["type"] != UNKNOWN_KEY}
    rest = REQUIRED | _without(data, removed)
    rest["body"] = tuple(UNNAMED | body for body in rest["body"])
    return Scope(Case.model_validate(rest, context=folder), names, frozenset(incomplete), numbers)


def _items(data: Mapping[str, Any], section: str) -> tuple[Any, ...]:
    items = data.get(section)
    return items if isinstance(items, tuple) else ()


def _removable(path: KeyPath, unknown: bool) -> KeyPath:
    """The part that an error makes invalid: the unknown key, else the enclosing list item or table."""
    if unknown or (path[0] == "body" and path[2:3] and path[2] in BODY_KEYS):
        return path if unknown else path[:3]
    return path[:2] if path[0] in (*LISTS, "material") else path[:1]


def _without(value: Any, removed: set[KeyPath], path: KeyPath = ()) -> Any:
    """The content without the removed parts."""
    if isinstance(value, Mapping):
        keys = [key for key in value if (*path, key) not in removed]
        return {key: _without(value[key], removed, (*path, key)) for key in keys}
    if isinstance(value, tuple):
        numbers = [k for k in range(len(value)) if (*path, k) not in removed]
        return tuple(_without(value[k], removed, (*path, k)) for k in numbers)
    return value
