"""Turns pydantic's findings into problems in the user's words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.case import (
    Adapt,
    Body,
    Case,
    Contact,
    Mls,
    Model,
    Output,
    Probe,
    Reference,
    Refine,
    Regularization,
    Solver,
    Support,
)
from mlsanm_cli.case.model.loads import LOADS
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.obstacles import OBSTACLES
from mlsanm_cli.case.model.outline import OutlineSide
from mlsanm_cli.case.model.polygon import Hole
from mlsanm_cli.case.model.shapes import SHAPES
from mlsanm_cli.case.model.stop import Stop
from mlsanm_cli.case.model.units import Units
from mlsanm_cli.case.report import Report, suggestion

_TABLES: dict[tuple[str, ...], type[Any]] = {
    (): Case,
    ("model",): Model,
    ("material", "*"): Material,
    ("body", "*"): Body,
    ("body", "*", "refine", "*"): Refine,
    ("body", "*", "shape", "holes", "*"): Hole,
    ("body", "*", "shape", "sides", "*"): OutlineSide,
    ("support", "*"): Support,
    ("contact", "*"): Contact,
    ("contact", "*", "regularization"): Regularization,
    ("mls",): Mls,
    ("adapt",): Adapt,
    ("solver",): Solver,
    ("output",): Output,
    ("probe", "*"): Probe,
    ("stop", "*"): Stop,
    ("reference",): Reference,
    ("units",): Units,
}
# Tables whose keys depend on their "kind".
_KINDS: dict[tuple[str, ...], Mapping[str, type[Any]]] = {
    ("body", "*", "shape"): SHAPES,
    ("load", "*"): LOADS,
    ("contact", "*", "obstacle"): OBSTACLES,
}
_LISTS = {"body", "support", "load", "contact", "stage", "refine", "holes", "sides", "probe", "stop"}
_WORDS = {
    "float_type": "expected a number",
    "int_type": "expected a whole number",
    "bool_type": "expected true or false",
    "string_type": "expected a text in quotes",
    "finite_number": "nan and inf are no values here",
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


def report_schema_errors(report: Report, error: ValidationError, covered: frozenset[KeyPath]) -> None:
    """Adds every finding of pydantic to the report, except at or below the paths covered already."""
    for detail in error.errors(include_url=False):
        path = _path(detail["loc"])
        if not any(path[: len(cover)] == cover for cover in covered):
            _report(report, path, detail)


def _path(location: tuple[int | str, ...]) -> KeyPath:
    """pydantic's location without the names of union members and of keys as values."""
    path = location
    if len(path) > 2 and path[0] == "load" and path[2] in LOADS:
        path = (*path[:2], *path[3:])
    if len(path) > 3 and path[0] == "body" and path[2] == "shape" and path[3] in SHAPES:
        path = (*path[:3], *path[4:])
    if len(path) > 3 and path[0] == "contact" and path[2] == "obstacle" and path[3] in OBSTACLES:
        path = (*path[:3], *path[4:])
    return path[:-1] if path and path[-1] == "[key]" else path


def _keys(report: Report, path: KeyPath) -> tuple[str, ...]:
    """Valid keys of the table at the path."""
    pattern = tuple("*" if isinstance(step, int) else step for step in path)
    if len(pattern) == 2 and pattern[0] == "material":
        pattern = ("material", "*")
    table = _TABLES.get(pattern)
    if table is None and pattern in _KINDS:
        table = _KINDS[pattern].get(_at(report.data, (*path, "kind")))
    fields = table.model_fields.items() if table is not None else ()
    return tuple(field.alias or name for name, field in fields)


def _at(data: Any, path: KeyPath) -> Any:
    for step in path:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def _report(report: Report, path: KeyPath, detail: ErrorDetails) -> None:
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    if kind == "extra_forbidden":
        table = _at(report.data, path[:-1])
        report.add(path, "unknown key", _unknown_hint(report, path, table))
    elif kind == "missing":
        report.add(path, "missing, and it has no default", _missing_hint(path))
    elif kind == "literal_error":
        options = _literals(str(context["expected"]))
        report.add(path, f"{_show(value)} is not a valid value", suggestion(value, options))
    elif kind == "union_tag_invalid":
        tag = context["tag"]
        report.add((*path, "kind"), f'unknown kind "{tag}"', suggestion(tag, _kinds(path)))
    elif kind == "union_tag_not_found":
        _report_no_kind(report, path, value, _kinds(path))
    elif kind in _BOUNDS:
        limit, words = _BOUNDS[kind]
        report.add(path, f"{words} {context[limit]:g}, not {_show(value)}")
    elif kind == "tuple_type":
        hint = (
            f"write [[{'.'.join(str(p) for p in path if isinstance(p, str))}]]" if path[-1] in _LISTS else ""
        )
        report.add(path, "expected a list", hint)
    elif kind == "too_short":
        # pydantic counts sound items only: items that are wrong have been reported one by one.
        needed = context["min_length"]
        if not value:
            report.add(path, "the list is empty, it needs at least one item")
        elif len(value) < needed:
            report.add(path, f"the list has {len(value)} items, it needs at least {needed}")
    elif kind in ("model_type", "dict_type") and isinstance(value, tuple):
        report.add(path, "expected one table, not a list of tables", "write single brackets, as in [model]")
    else:
        report.add(path, _WORDS.get(kind, detail["msg"]), _type_hint(kind, value))


def _kinds(path: KeyPath) -> tuple[str, ...]:
    """Valid kinds of the table at the path."""
    return tuple(_KINDS[tuple("*" if isinstance(step, int) else step for step in path)])


def _report_no_kind(report: Report, path: KeyPath, value: Any, options: tuple[str, ...]) -> None:
    if not isinstance(value, Mapping):
        report.add(path, "expected a table")
    elif "kind" in value:
        report.add((*path, "kind"), "expected a text in quotes", suggestion("", options))
    else:
        report.add((*path, "kind"), "missing, and it has no default", suggestion("", options))


def _missing_hint(path: KeyPath) -> str:
    name = path[-1]
    if len(path) == 1:
        return {"format": "write format = 1", "model": 'write [model] with plane = "strain" or "stress"'}.get(
            str(name), f"add {'[[' + str(name) + ']]' if name in _LISTS else '[' + str(name) + '.<name>]'}"
        )
    return ""


def _unknown_hint(report: Report, path: KeyPath, table: Any) -> str:
    keys = _keys(report, path[:-1])
    if path[0] == "load" and len(path) == 3 and isinstance(table, Mapping):
        kind = table.get("kind")
        if path[-1] == "value" and kind in keys:
            return f'the value of this kind is called "{kind}"'
    return suggestion(path[-1], keys, "valid keys")


def _literals(expected: str) -> tuple[str, ...]:
    """The options in pydantic's text: ``'a', 'b' or 'c'``."""
    return tuple(part.strip().strip("'") for part in expected.replace(" or ", ",").split(","))


def _show(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _type_hint(kind: str, value: Any) -> str:
    if kind in ("float_type", "int_type", "bool_type") and isinstance(value, str):
        return f'without quotes: "{value}" is text'
    if kind == "int_type" and isinstance(value, float):
        return f"{value:g} has a decimal point"
    return ""
