"""Translates pydantic's errors into problems of the case file, with path, message and hint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import reduce
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.expressions import NO_UNITS, with_unit
from mlsanm_cli.case.report import Report, child, suggestion

_WORDS = {
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "bool_type": "expected true or false",
    "string_type": "expected a text in quotes",
    "finite_number": "nan and inf are not allowed",
    "model_type": "expected a table",
    "dict_type": "expected a table",
    "model_attributes_type": "expected a table",
}
_BOUNDS = {
    "greater_than": ("gt", "must be greater than"),
    "greater_than_equal": ("ge", "must be at least"),
    "less_than": ("lt", "must be less than"),
    "less_than_equal": ("le", "must be at most"),
}
_MISSING = {"format": "write format = 1", "model": 'write [model] with plane = "strain" or "stress"'}

UNKNOWN_KEY = "extra_forbidden"
"""Pydantic's type of error for an unknown key."""
_REMOVED = {
    "polish": 'remove it; contact.regularization.law = "exact" gives states of the exact laws',
    "friction_law": "remove it; friction depends on its history",
    "ghost": '"least-squares", or "collocation" with the hyperbolic contact law',
}
"""Hints for keys and values that no longer exist."""
Finding = tuple[KeyPath, ErrorDetails]


def findings(data: Mapping[str, Any], error: ValidationError) -> Iterator[Finding]:
    """The errors of a validation of ``data``, each with its path."""
    for detail in error.errors(include_url=False):
        yield _path(data, detail["loc"]), detail


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


def report_finding(report: Report, path: KeyPath, detail: ErrorDetails) -> None:
    """Adds an error in the words of the case file."""
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    if kind == UNKNOWN_KEY:
        report.add(path, "unknown key", _REMOVED.get(str(path[-1])) or _unknown_hint(report.data, path))
    elif kind == "missing":
        hint = _MISSING.get(str(path[0]), f"add {_heading(path)}") if len(path) == 1 else ""
        report.add(path, "missing (required)", hint)
    elif kind == "literal_error":
        # Pydantic lists the options as text: 'a', 'b' or 'c'.
        options = [part.strip(" '") for part in str(context["expected"]).replace(" or ", ",").split(",")]
        hint = _REMOVED.get(str(value)) or suggestion(value, options)
        report.add(path, f"{_show(value)} is not a valid value", hint)
    elif kind == "union_tag_invalid":
        options = [part.strip(" '") for part in str(context["expected_tags"]).split(",")]
        report.add((*path, "kind"), f'unknown kind "{context["tag"]}"', suggestion(context["tag"], options))
    elif kind == "union_tag_not_found" and isinstance(value, Mapping):
        message = "expected a text in quotes" if "kind" in value else "missing (required)"
        report.add((*path, "kind"), message, suggestion("", _kinds(path)))
    elif kind == "union_tag_not_found":
        report.add(path, "expected a table")
    elif kind in _BOUNDS:
        limit, words = _BOUNDS[kind]
        report.add(path, f"{words} {context[limit]:g}, not {_show(value)}")
    elif kind == "tuple_type":
        heading = _heading(path)
        report.add(path, "expected a list", f"write {heading}" if heading.startswith("[[") else "")
    elif kind == "too_short":
        # Pydantic counts valid items only; invalid ones are reported one by one.
        needed = context["min_length"]
        if not value:
            report.add(path, "the list is empty, at least one item is required")
        elif len(value) < needed:
            report.add(path, f"the list has {len(value)} items, at least {needed} are required")
    elif kind in ("model_type", "dict_type") and isinstance(value, tuple):
        report.add(
            path, "expected a single table, not a list of tables", "write single brackets, as in [model]"
        )
    else:
        report.add(path, _WORDS.get(kind, detail["msg"]), _type_hint(kind, value))


def _heading(path: KeyPath) -> str:
    """The TOML heading of the table or list of tables at a path, "" if it is neither."""
    from mlsanm_cli.case.schema import heading, tables_at

    names = tuple(step for step in path if isinstance(step, str))
    return heading(names) if tables_at(names) else ""


def _kinds(path: KeyPath) -> list[str]:
    """Kinds of the table at a path, empty if it has only one."""
    from mlsanm_cli.case.schema import tables_at

    found = tables_at(path)
    return [table["properties"]["kind"]["const"] for table in found if len(found) > 1]


def _unknown_hint(data: Any, path: KeyPath) -> str:
    from mlsanm_cli.case.schema import tables_at, walk

    below = dict.fromkeys(key for key, _ in walk() if key.endswith(f".{path[-1]}"))
    if below and len(path) == 1:
        return f"did you mean {' or '.join(list(below)[:4])}?"
    found = tables_at(path[:-1])
    kind = reduce(child, (*path[:-1], "kind"), data)
    own = [table for table in found if table["properties"].get("kind", {}).get("const", kind) == kind]
    keys = [key for table in own for key in table["properties"]]
    if path[0] == "load" and path[-1] == "value" and kind in keys:
        return f'the value of this kind is called "{kind}"'
    return suggestion(path[-1], keys, "valid keys")


def _show(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _type_hint(kind: str, value: Any) -> str:
    if kind in ("float_type", "int_type") and isinstance(value, str) and with_unit(value):
        return NO_UNITS
    if kind in ("float_type", "int_type", "bool_type") and isinstance(value, str):
        return f'without quotes: "{value}" is text'
    if kind == "int_type" and isinstance(value, float):
        return f"{value:g} has a decimal point"
    return ""
