"""JSON Schema (draft 7) of the case file, for editors, `mlsanm explain`, the case reference and error hints.
It is generated from the model and its docstrings."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from mlsanm_cli.case.model.case import Case
from mlsanm_cli.case.report import KeyPath

DIALECT = "http://json-schema.org/draft-07/schema#"
TITLE = "mlsanm case file"
Node = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """TOML has no null: optional keys are omitted."""

    schema_dialect = DIALECT

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        found = super().default_schema(schema)
        return {key: value for key, value in found.items() if key != "default" or value is not None}

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        found = super().tagged_union_schema(schema)
        return {key: value for key, value in found.items() if key != "discriminator"}


@cache
def json_schema() -> Node:
    raw = Case.model_json_schema(schema_generator=_Generator, ref_template="#/definitions/{model}")
    definitions = raw.pop("$defs")
    return {"$schema": DIALECT, "title": TITLE, **_plain({**raw, "definitions": definitions})}


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
    """Every dotted key below a ``table`` at a path, by default the whole file, with its node; once for each
    kind of table. Names of items are left out."""
    for key, node in (table or json_schema())["properties"].items():
        yield ".".join((*path, key)), node
        for inner in tables(node):
            yield from walk((*path, key), inner)


def heading(path: tuple[str, ...]) -> str:
    """The TOML heading of the table at a path: [model], [[body]], [material.NAME]."""
    if not path:
        return "the top of the file"
    node = follow(
        next(t["properties"][path[-1]] for t in tables_at(path[:-1]) if path[-1] in t["properties"])
    )
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
    renamed = {"prefixItems": "items"}
    return {
        key if keys_are_names else renamed.get(key, key): _plain(
            item, not keys_are_names and key in ("properties", "definitions", "patternProperties")
        )
        for key, item in value.items()
        if keys_are_names or key != "title"
    }
