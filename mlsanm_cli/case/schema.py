"""JSON Schema of the case file, for editors; `mlsanm explain` reads it too.

Draft 7, which editors of TOML understand. Types, limits and defaults come from the model, descriptions from
the docstrings below its keys, and what this version refuses by name is left out.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from mlsanm_cli.case.model.base import Section
from mlsanm_cli.case.model.case import Case
from mlsanm_cli.case.reading.unsupported import PLANNED, Planned

DIALECT = "http://json-schema.org/draft-07/schema#"
TITLE = "mlsanm case file"
Node = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """TOML has no null: an optional key is one that may be left out."""

    schema_dialect = DIALECT

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        found = super().default_schema(schema)
        return {key: value for key, value in found.items() if key != "default" or value is not None}

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        found = super().tagged_union_schema(schema)
        return {key: value for key, value in found.items() if key != "discriminator"}


def json_schema() -> Node:
    """The schema of a whole case file."""
    raw = Case.model_json_schema(schema_generator=_Generator, ref_template="#/definitions/{model}")
    definitions = raw.pop("$defs")
    for section in _sections(Section):
        node = raw if section is Case else definitions.get(section.__name__)
        if node is not None:
            node["description"] = inspect.cleandoc(section.__doc__ or "").replace("``", "`")
            for name, text in descriptions(section).items():
                key = section.model_fields[name].alias or name
                node["properties"][key]["description"] = text
    schema = _plain({**raw, "definitions": definitions})
    schema = {"$schema": DIALECT, "title": TITLE, **schema}
    for planned in PLANNED:
        for holder, key in _places(schema, planned.path):
            _leave_out(holder, key, planned)
    return schema


def descriptions(section: type[Section]) -> dict[str, str]:
    """What the docstrings below the keys of a table say, inherited ones included, each in one line."""
    found: dict[str, str] = {}
    for base in reversed(section.__mro__):
        if issubclass(base, Section):
            found |= _docstrings(base.__module__).get(base.__name__, {})
    return found


@cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """By class and key the docstrings below the keys in a module's source."""
    found: dict[str, dict[str, str]] = {}
    for section in ast.parse(inspect.getsource(sys.modules[module])).body:
        if isinstance(section, ast.ClassDef):
            pairs = zip(section.body[:-1], section.body[1:], strict=True)
            found[section.name] = {
                key.target.id: " ".join(_text_of(following).split())
                for key, following in pairs
                if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name) and _text_of(following)
            }
    return found


def _text_of(statement: ast.stmt) -> str:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return str(statement.value.value)
    return ""


def follow(schema: Node, node: Node) -> Node:
    """The node, or the definition that it refers to."""
    name = str(node.get("$ref", "")).rpartition("/")[2]
    found: Node = schema["definitions"][name] if name else node
    return found


def tables(schema: Node, node: Node) -> tuple[Node, ...]:
    """The tables that a node allows: one, several that differ by their kind, or none.

    Items of lists of tables and values of tables by name count as the tables.
    """
    node = follow(schema, node)
    if "properties" in node:
        return (node,)
    inner = [node[key] for key in ("items", "additionalProperties") if isinstance(node.get(key), dict)]
    inner += node.get("oneOf", [])
    inner += node.get("patternProperties", {}).values()
    return tuple(table for one in inner for table in tables(schema, one))


def _sections(base: type[Section]) -> Iterator[type[Section]]:
    for section in base.__subclasses__():
        yield section
        yield from _sections(section)


def _plain(value: Any, keys_are_names: bool = False) -> Any:
    """Without the titles that pydantic makes of names, and with the tuples of draft 7."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if not isinstance(value, dict):
        return value
    renamed = {"prefixItems": "items"}
    return {
        key if keys_are_names else renamed.get(key, key): _plain(
            item, not keys_are_names and key in ("properties", "definitions", "patternProperties")
        )
        for key, item in value.items()
        if keys_are_names or key != "title"
    }


def _places(schema: Node, path: tuple[str, ...]) -> Iterator[tuple[Node, str]]:
    """Tables of the schema that hold the last key of a path, and that key; "*" is any name or number."""
    *before, last = [step for step in path if step != "*"]
    found: tuple[Node, ...] = (schema,)
    for step in before:
        inner = [table["properties"][step] for table in found if step in table["properties"]]
        found = tuple(table for node in inner for table in tables(schema, node))
    for table in found:
        if last in table["properties"]:
            yield table["properties"], last


def _leave_out(holder: Node, key: str, planned: Planned) -> None:
    """Keep what of the key's values this version takes."""
    node = holder[key]
    options = _options(node)
    kept = [value for value in options if not planned.applies(value)]
    if len(kept) == len(options):
        return
    if not kept:
        del holder[key]
        return
    described = {name: node[name] for name in ("description", "default", "x-unit") if name in node}
    holder[key] = {"enum": kept, **described}


def _options(node: Node) -> list[Any]:
    """Values that stand for all that a node allows."""
    if "const" in node:
        return [node["const"]]
    if "enum" in node:
        return list(node["enum"])
    samples: dict[str, list[Any]] = {"boolean": [False, True], "number": [0.0, 1.0, -1.0]}
    return samples.get(node.get("type", ""), [None])


Visit = Callable[[tuple[str, ...], Node, Node], None]


def walk(schema: Node, visit: Visit) -> None:
    """Call ``visit`` with the path of every key, its node and the table that holds it; names are left out."""

    def below(path: tuple[str, ...], table: Node) -> None:
        for key, node in table["properties"].items():
            visit((*path, key), node, table)
            for inner in tables(schema, node):
                below((*path, key), inner)

    below((), schema)
