"""The reference of all tables and keys of a case file, generated from the JSON Schema."""

from __future__ import annotations

from collections.abc import Sequence

from mlsanm_cli.case.explain import Explanation, explain
from mlsanm_cli.case.schema import json_schema, tables, walk


def value_keys() -> list[str]:
    """All dotted keys that hold values; names of items are left out."""
    schema, found = json_schema(), dict[str, None]()
    walk(schema, lambda path, node, table: None if tables(schema, node) else found.setdefault(".".join(path)))
    return list(found)


def all_explanations() -> list[Explanation]:
    """The explanations of all tables and keys, tables before their keys, in the order of the schema."""
    schema, found = json_schema(), dict[str, None]()
    walk(schema, lambda path, node, table: found.setdefault(".".join(path)))
    explanations = [one for key in found for one in explain(key)]
    places = list(dict.fromkeys(["the top of the file", *(one.place for one in explanations)]))
    return sorted(explanations, key=lambda one: (places.index(one.place), not one.keys))


def markdown(explanations: Sequence[Explanation]) -> str:
    """The reference as a page of Markdown."""
    return f"# Keys of the case file\n\nMade by `mlsanm explain --all`.\n{sections(explanations, '##')}"


def sections(explanations: Sequence[Explanation], level: str) -> str:
    """The reference as Markdown: a section per table, headed by ``level`` ("##" or the like)."""
    lines: list[str] = []
    place = ""
    for one in explanations:
        if one.place != place:
            place = one.place
            title = f"`{place}`" if place.startswith("[") else place.capitalize()
            lines += ["", f"{level} {title}"]
            if one.variants:
                lines += ["", *(f"- `{kind}`: {meaning}" for kind, meaning in one.variants.items())]
            elif one.keys:
                lines += ["", one.meaning]
            lines += ["", "| key | meaning | value | default |", "|---|---|---|---|"]
        if one.keys:
            continue
        # A list of allowed values implies the type.
        kind = "" if one.type in (one.allowed, "one of the allowed values") else one.type
        value = ", ".join(filter(None, (kind, one.unit, one.allowed)))
        default = "required" if one.required else f"`{one.default}`" if one.default else ""
        kinds = f" (of {', '.join(one.kinds)})" if one.kinds else ""
        name = one.key.rpartition(".")[2]
        lines.append(f"| `{name}`{kinds} | {_cell(one.meaning)} | {_cell(value)} | {_cell(default)} |")
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
