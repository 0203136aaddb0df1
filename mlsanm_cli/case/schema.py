"""JSON Schema (draft 7) of the case file, from the model and its docstrings; pydantic's errors as faults.
Imported only where it is needed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache, reduce
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import ErrorDetails, core_schema

from mlsanm_cli.case.model.case import Case
from mlsanm_cli.case.model.expressions import NO_UNITS, with_unit
from mlsanm_cli.case.report import KeyPath, child, suggestion
from mlsanm_cli.errors import Fault

DIALECT = "http://json-schema.org/draft-07/schema#"
Node = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """TOML has no null: optional keys are omitted."""

    schema_dialect = DIALECT

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        found = super().default_schema(schema)
        return {key: value for key, value in found.items() if key != "default" or value is not None}


@cache
def json_schema() -> Node:
    raw = Case.model_json_schema(schema_generator=_Generator, ref_template="#/definitions/{model}")
    definitions = raw.pop("$defs")
    return {"$schema": DIALECT, "title": "mlsanm case file", **_plain({**raw, "definitions": definitions})}


def follow(node: Node) -> Node:
    """The node, with a reference to a definition resolved."""
    name = str(node.get("$ref", "")).rpartition("/")[2]
    found: Node = json_schema()["definitions"][name] if name else node
    return found


def tables(node: Node) -> tuple[Node, ...]:
    """The tables that a node allows: none, one, or one per kind; for lists and tables by name, the items."""
    node = follow(node)
    if "properties" in node:
        return (node,)
    inner = [node[key] for key in ("items", "additionalProperties") if isinstance(node.get(key), dict)]
    inner += node.get("oneOf", [])
    inner += node.get("patternProperties", {}).values()
    return tuple(table for one in inner for table in tables(one))


def tables_at(path: KeyPath) -> tuple[Node, ...]:
    """The tables allowed at a path of keys and names or numbers of items, as in `tables`."""
    found: tuple[Node, ...] = (json_schema(),)
    for step in path:
        inner = [table["properties"][step] for table in found if step in table["properties"]]
        # A step that is not a key is the name or number of an item.
        found = tuple(table for node in inner for table in tables(node)) if inner else found
    return found


def walk(path: tuple[str, ...] = (), table: Node | None = None) -> Iterator[tuple[str, Node]]:
    """Every dotted key below a ``table``, without names of items, by kind of table, and its node."""
    for key, node in (table or json_schema())["properties"].items():
        yield ".".join((*path, key)), node
        for inner in tables(node):
            yield from walk((*path, key), inner)


def heading(path: tuple[str, ...]) -> str:
    """The TOML heading of the table at a path: [model], [[body]], [material.NAME]."""
    if not path:
        return "the top of the file"
    properties = (table["properties"] for table in tables_at(path[:-1]))
    node = follow(next(keys[path[-1]] for keys in properties if path[-1] in keys))
    name = ".".join(path)
    if node.get("type") == "array":
        return f"[[{name}]]"
    return f"[{name}.NAME]" if "patternProperties" in node else f"[{name}]"


def _plain(value: Any, keys_are_names: bool = False) -> Any:
    """Removes pydantic's titles, rewrites tuples for draft 7 and joins the lines of texts."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return " ".join(value.split()).replace("``", "`")
    if not isinstance(value, dict):
        return value
    if keys_are_names:
        return {key: _plain(item) for key, item in value.items()}
    renamed, named = {"prefixItems": "items"}, ("properties", "definitions", "patternProperties")
    kept = {key: item for key, item in value.items() if key not in ("title", "discriminator")}
    return {renamed.get(key, key): _plain(item, key in named) for key, item in kept.items()}


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


def fault_of(data: Mapping[str, Any], detail: ErrorDetails) -> Fault:
    """An error of a validation of ``data`` in the words of the case file."""
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    # Pydantic's locations also contain the kinds of tables and marks for keys.
    path: KeyPath = ()
    tagged = False
    at: Any = data
    for step in detail["loc"]:
        if not tagged and isinstance(at, Mapping) and step == at.get("kind") and _kinds(path):
            tagged = True
        elif step != "[key]":
            path, tagged, at = (*path, step), False, child(at, step)
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
