"""``mlsanm explain``: keys of the case file, from the JSON Schema and the starters, and their reference."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from mlsanm_cli.case.model.section import UNIT
from mlsanm_cli.case.reading.overrides import flat
from mlsanm_cli.case.report import SYNONYMS
from mlsanm_cli.case.schema import Node, follow, heading, json_schema, tables, tables_at, walk
from mlsanm_cli.case.starters import kinds, starter
from mlsanm_cli.errors import RunError
from mlsanm_cli.toml import toml_value

_BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at least",
    "exclusiveMaximum": "below",
    "maximum": "at most",
}
_TYPES = {"number": "number", "integer": "whole number", "boolean": "true or false", "string": "text"}


class Explanation(NamedTuple):
    """A key, or a table with the meanings of its keys. ``place`` is the heading of the table that holds the
    key, ``kinds`` are those of it with the key (empty: all), ``variants`` describes every kind of a table."""

    key: str
    place: str
    meaning: str
    type: str = ""
    unit: str = ""
    allowed: str = ""
    default: str = ""
    required: bool = False
    kinds: tuple[str, ...] = ()
    example: str = ""
    keys: Mapping[str, str] = {}
    variants: Mapping[str, str] = {}


def explain(key: str = "") -> tuple[Explanation, ...]:
    """Explains a dotted key, with or without names of items; "" lists the tables. There are several
    explanations if the meaning depends on the kind of the table. Raises RunError for an unknown key."""
    parts = [part for part in key.split(".") if part]
    # Every table with the key, with the node of the key; and the key without names of items.
    nodes: list[tuple[Node, Node]] = [(json_schema(), json_schema())]
    path: tuple[str, ...] = ()
    named = False
    for part in parts:
        inner = [table for _, node in nodes for table in tables(node)]
        matches = [(table, table["properties"][part]) for table in inner if part in table["properties"]]
        if not matches and (not path or named or _table_type(nodes[0][1]) == "table"):
            raise RunError(f'there is no key "{key}"', _nearest(key))
        named = not matches
        nodes, path = (matches, (*path, part)) if matches else (nodes, path)
    # The last part may be the name of an item, unless it looks like one of its keys, misspelt or as others
    # call it.
    keys = {name for table in tables_at(path) for name in table["properties"]}
    if named and (
        SYNONYMS.get(parts[-1].lower()) in keys or difflib.get_close_matches(parts[-1], keys, n=1, cutoff=0.8)
    ):
        raise RunError(f'there is no key "{key}"', _nearest(key))
    if path and path[-1] == "kind":
        # The key that distinguishes the kinds of a table.
        options = ", ".join(toml_value(node["const"]) for _, node in nodes)
        variants, first = _variants([table for table, _ in nodes]), _explain(path, *nodes[0])
        return (first._replace(type=_TYPES["string"], kinds=(), allowed=options, variants=variants),)
    groups: dict[tuple[Any, ...], Explanation] = {}
    for table, node in nodes:
        new = _explain(path, table, node)
        same = (new.meaning, new.type, new.allowed, new.unit, new.default, *sorted(new.keys))
        before = groups.get(same, new)
        kinds = tuple(dict.fromkeys([*before.kinds, *new.kinds]))
        groups[same] = before._replace(kinds=kinds, required=new.required and before.required)
    everywhere = len(groups) == 1 and len(nodes) == len(tables_at(path[:-1]))
    return tuple(new._replace(kinds=() if everywhere else new.kinds) for new in groups.values())


def _explain(path: tuple[str, ...], table: Node, node: Node) -> Explanation:
    inner, target = tables(node), follow(node)
    kinds = tuple(filter(None, [table["properties"].get("kind", {}).get("const")]))
    default = toml_value(node["default"]) if "default" in node and not inner else ""
    below = {name: node for one in reversed(inner) for name, node in one["properties"].items()}
    keys = {name: _meaning(below[name]) for one in inner for name in one["properties"]}
    return Explanation(
        ".".join(path),
        heading(path if inner else path[:-1]),
        _meaning(node),
        _table_type(target) if inner else _type(target),
        node.get(UNIT, ""),
        "" if inner else _allowed(target),
        default,
        bool(path) and path[-1] in table.get("required", ()),
        kinds,
        "" if inner else _example(path, default, kinds),
        keys,
        _variants(inner),
    )


def _meaning(node: Node) -> str:
    inner = () if "description" in node else tables(node)
    return f"One of {len(inner)} kinds." if len(inner) > 1 else str((*inner, node)[0]["description"])


def _variants(inner: Sequence[Node]) -> dict[str, str]:
    return {one["properties"]["kind"]["const"]: one["description"] for one in inner if len(inner) > 1}


def _table_type(node: Node) -> str:
    node = follow(node)
    if node.get("type") == "array":
        return "list of tables"
    return "tables by name" if "patternProperties" in node else "table"


def _type(node: Node) -> str:
    if "anyOf" in node:
        return " or ".join(map(_type, node["anyOf"]))
    if "const" in node:
        return toml_value(node["const"])
    if "enum" in node:
        return "one of the allowed values" if len(node["enum"]) > 1 else toml_value(node["enum"][0])
    if node.get("type") == "array":
        items, least = node["items"], node.get("minItems")
        if least is not None and least == node.get("maxItems") and not isinstance(items, list):
            items = least * [items]
        if isinstance(items, list):
            return f"[{', '.join(_type(item) for item in items)}]"
        kind = "the allowed values" if "enum" in items else _type(items)
        return f"list of {kind}" + ("" if least is None else f", {least} or more")
    if node.get("type") == "object":
        return "tables of numbers by name"
    return _TYPES.get(node.get("type", ""), "value")


def _allowed(node: Node) -> str:
    for inner in node.get("anyOf", ()):
        if _allowed(inner) and "const" not in inner:
            return _allowed(inner)
    if "enum" in node or "const" in node:
        return ", ".join(toml_value(value) for value in node.get("enum", [node.get("const")]))
    if isinstance(node.get("items"), dict) and ("enum" in node["items"] or _allowed(node["items"])):
        return f"each {_allowed(node['items'])}"
    # Seeds may have 63 bits: no limit that anyone needs to know.
    return ", ".join(f"{word} {node[key]:g}" for key, word in _BOUNDS.items() if node.get(key, 2**63) < 2**63)


def _example(path: tuple[str, ...], default: str, kinds_of: tuple[str, ...]) -> str:
    # Names and numbers of items are parts of the keys.
    key_of_item = re.compile(r"(?:\.[^.]+)?\.".join(path))
    for content in _starters():
        for key, value in content.items():
            kind = content.get(f"{key.rpartition('.')[0]}.kind")
            if key_of_item.fullmatch(key) and (not kinds_of or kind in kinds_of):
                return f"{path[-1]} = {toml_value(value)}"
    return f"{path[-1]} = {default}" if default else ""


@cache
def _starters() -> tuple[dict[str, Any], ...]:
    """Values of the starters by dotted keys; also lists and tables at the top by their names."""
    contents = [tomllib.loads(starter(kind)) for kind in kinds()]
    return tuple({**content, **flat(content)} for content in contents)


def _nearest(key: str) -> str:
    endings = {name: name.rpartition(".")[2] for name, _ in walk()}
    last = key.rpartition(".")[2]
    last = SYNONYMS.get(last.lower(), last)
    similar = [name for name, ending in endings.items() if ending == last]
    if not similar and "." in key:
        similar = difflib.get_close_matches(key, endings, n=3)
    if not similar:
        near = difflib.get_close_matches(last, endings.values(), n=1)
        similar = [name for name, ending in endings.items() if ending in near]
    return f"did you mean {' or '.join(similar[:4])}?" if similar else '"mlsanm explain" lists the tables'


def value_keys() -> list[str]:
    """All dotted keys that hold values; names of items are left out."""
    return list(dict.fromkeys(key for key, node in walk() if not tables(node)))


def all_explanations() -> list[Explanation]:
    """The explanations of all tables and keys, tables before their keys, in the order of the schema."""
    explanations = [entry for key in dict(walk()) for entry in explain(key)]
    places = list(dict.fromkeys(["the top of the file", *(entry.place for entry in explanations)]))
    return sorted(explanations, key=lambda entry: (places.index(entry.place), not entry.keys))


def sections(explanations: Sequence[Explanation], level: str) -> str:
    """The reference as Markdown: a section per table, headed by ``level`` ("##" or the like)."""
    lines: list[str] = []
    place = ""
    for entry in explanations:
        if entry.place != place:
            place = entry.place
            title = f"`{place}`" if place.startswith("[") else place.capitalize()
            lines += ["", f"{level} {title}"]
            if entry.variants:
                lines += ["", *(f"- `{kind}`: {meaning}" for kind, meaning in entry.variants.items())]
            elif entry.keys:
                lines += ["", entry.meaning]
            lines += ["", "| key | meaning | value | default |", "|---|---|---|---|"]
        if entry.keys:
            continue
        # A list of allowed values implies the type.
        kind = "" if entry.type in (entry.allowed, "one of the allowed values") else entry.type
        value = ", ".join(filter(None, (kind, entry.unit, entry.allowed)))
        default = "required" if entry.required else f"`{entry.default}`" if entry.default else ""
        kinds = f" (of {', '.join(entry.kinds)})" if entry.kinds else ""
        cells = f"`{entry.key.rpartition('.')[2]}`{kinds}", entry.meaning, value, default
        lines.append(" | ".join(("", *(cell.replace("|", r"\|") for cell in cells), "")).strip())
    return "\n".join(lines)
