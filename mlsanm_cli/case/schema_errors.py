"""Translates pydantic's errors into faults of the case file, with path, message and hint. Imported only where
a case has errors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import reduce
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from mlsanm_cli.case.model.expressions import NO_UNITS, with_unit
from mlsanm_cli.case.report import KeyPath, child, suggestion
from mlsanm_cli.case.schema import heading, tables_at, walk
from mlsanm_cli.errors import Fault

UNKNOWN_KEY = "unknown key"
_WORDS = {
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "bool_type": "expected true or false",
    "string_type": "expected a text in quotes",
    "finite_number": "nan and inf are not allowed",
    "model_type": "expected a table",
    "dict_type": "expected a table",
    "model_attributes_type": "expected a table",
    "tuple_type": "expected a list",
}
_BOUNDS = {
    "greater_than": ("gt", "must be greater than"),
    "greater_than_equal": ("ge", "must be at least"),
    "less_than": ("lt", "must be less than"),
    "less_than_equal": ("le", "must be at most"),
}
_REMOVED = {
    "polish": 'remove it; contact.regularization.law = "exact" gives states of the exact laws',
    "friction_law": "remove it; friction depends on its history",
    "ghost": '"least-squares", or "collocation" with the hyperbolic contact law',
}
"""Hints for keys and values that no longer exist."""
_WEIGHT = 'a weight is a load of kind "body-force", force per volume'
_ELSEWHERE = {
    "thickness": "forces are per unit thickness",
    "density": _WEIGHT,
    "rho": _WEIGHT,
    "gravity": _WEIGHT,
}
"""Hints for keys that other programs have."""
_MISSING = {"format": "write format = 1", "model": 'write [model] with plane = "strain" or "stress"'}


def faults_of(data: Mapping[str, Any], error: ValidationError) -> Iterator[Fault]:
    """The errors of a validation of ``data`` in the words of the case file."""
    for detail in error.errors(include_url=False):
        yield _fault(data, _path(data, detail["loc"]), detail)


def _path(data: Any, location: tuple[int | str, ...]) -> KeyPath:
    """The path in the file; pydantic's locations also contain the kinds of tables and marks for keys."""
    path: KeyPath = ()
    tagged = False
    for step in location:
        if not tagged and isinstance(data, Mapping) and step == data.get("kind") and _kinds(path):
            tagged = True
        elif step != "[key]":
            path, tagged = (*path, step), False
            data = child(data, step)
    return path


def _fault(data: Mapping[str, Any], path: KeyPath, detail: ErrorDetails) -> Fault:
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    message, hint = _WORDS.get(kind, detail["msg"]), ""
    match kind:
        case "extra_forbidden":
            message, hint = UNKNOWN_KEY, _REMOVED.get(str(path[-1])) or _unknown_hint(data, path)
        case "missing":
            message = "missing (required)"
            if len(path) == 1:
                hint = _MISSING.get(str(path[0]), f"add {_heading(path)}")
        case "literal_error":
            # Pydantic lists the options as text: 'a', 'b' or 'c'.
            options = [part.strip("'") for part in re.split(", | or ", str(context["expected"]))]
            message = f"{_show(value)} is not a valid value"
            hint = _REMOVED.get(str(value)) or suggestion(value, options)
        case "union_tag_invalid":
            path, tag = (*path, "kind"), context["tag"]
            options = [part.strip("'") for part in str(context["expected_tags"]).split(", ")]
            message, hint = f'unknown kind "{tag}"', suggestion(tag, options)
        case "union_tag_not_found" if isinstance(value, Mapping):
            message = _WORDS["string_type"] if "kind" in value else "missing (required)"
            path, hint = (*path, "kind"), suggestion("", _kinds(path))
        case "union_tag_not_found":
            message = "expected a table"
            hint = f"write single brackets, as in {_heading(path)}" if isinstance(value, tuple) else ""
        case "model_type" if path[0] == "material" and not isinstance(value, tuple):
            hint = "write [material.NAME] above its keys"
        case "tuple_type" if _heading(path).startswith("[["):
            hint = f"write {_heading(path)}"
        case "too_short" if not value:
            message = "the list is empty, at least one item is required"
        case "too_short":
            message = f"the list has {len(value)} items, at least {context['min_length']} are required"
        case "model_type" | "dict_type" if isinstance(value, tuple):
            message = "expected a single table, not a list of tables"
            hint = "write single brackets, as in [model]"
        case "float_type" | "int_type" if isinstance(value, str) and with_unit(value):
            hint = NO_UNITS
        case "float_type" | "int_type" | "bool_type" if isinstance(value, str):
            hint = f'without quotes: "{value}" is text'
        case "int_type" if isinstance(value, float):
            hint = f"{value:g} has a decimal point"
        case bound if bound in _BOUNDS:
            limit, words = _BOUNDS[bound]
            message = f"{words} {context[limit]:g}, not {_show(value)}"
    return Fault(path, message, hint)


def _heading(path: KeyPath) -> str:
    names = tuple(step for step in path if isinstance(step, str))
    return heading(names) if tables_at(names) else ""


def _kinds(path: KeyPath) -> list[str]:
    """Kinds of the table at a path, empty if it has only one."""
    found = tables_at(path)
    return [table["properties"]["kind"]["const"] for table in found if len(found) > 1]


def _unknown_hint(data: Any, path: KeyPath) -> str:
    below = dict.fromkeys(key for key, _ in walk() if key.endswith(f".{path[-1]}"))
    if below and len(path) == 1:
        return f"did you mean {' or '.join(list(below)[:4])}?"
    kind = reduce(child, (*path[:-1], "kind"), data)
    properties = [table["properties"] for table in tables_at(path[:-1])]
    keys = [key for keys in properties if keys.get("kind", {}).get("const", kind) == kind for key in keys]
    if path[0] == "load" and path[-1] == "value" and kind in keys:
        return f'the value of this kind is called "{kind}"'
    return _ELSEWHERE.get(str(path[-1]), "") or suggestion(path[-1], keys, "valid keys")


def _show(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
