"""Names in the content of a case file: declared once, and known where they are used. Other faults of an item
hide none of these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mlsanm_cli.case.model.section import BOUNDARY_PATTERN, Scope, split_boundary
from mlsanm_cli.case.model.shapes import edge_names
from mlsanm_cli.case.report import KeyPath, suggestion
from mlsanm_cli.errors import Fault

PLURALS = {
    "material": "materials",
    "body": "bodies",
    "load": "loads",
    "contact": "contacts",
    "probe": "probes",
}
"""Sections whose items have names."""
REFERENCES = (
    ("body", "material", "material"),
    ("support", "body", "body"),
    ("load", "body", "body"),
    ("probe", "body", "body"),
)
"""Section and key of a name, and the section of the item that it names."""
BOUNDARIES = (("support", "boundary"), ("load", "boundary"), ("contact", "slave"), ("contact", "master"))
"""Section and key of names of boundaries."""


def declared_names(data: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """The names of all items of each section, also of invalid items."""
    materials = data.get("material")
    names = tuple(materials) if isinstance(materials, Mapping) else ()
    lists = {section: [name for _, name in _texts(data, section, "name")] for section in PLURALS}
    return {section: tuple(found) for section, found in lists.items()} | {"material": names}


def name_faults(data: Mapping[str, Any], scope: Scope) -> Iterator[Fault]:
    """Names declared twice, unknown ones, and materials of no body."""
    for section in PLURALS:
        texts = _texts(data, section, "name")
        for number, (path, name) in enumerate(texts):
            if name in [earlier for _, earlier in texts[:number]]:
                yield Fault(path, f'another {section} is called "{name}" already')
    for section, key, target in REFERENCES:
        for path, name in _texts(data, section, key):
            yield from _unknown(path, name, target, scope)
    used = [name for _, name in _texts(data, "body", "material")]
    for name in scope.names["material"]:
        if name not in used:
            hint = f'remove it, or write material = "{name}" in a body'
            yield Fault(("material", name), "no body uses this material", hint)
    for section, key in BOUNDARIES:
        for path, name in _texts(data, section, key):
            if BOUNDARY_PATTERN.fullmatch(name):
                yield from _unknown_boundary(path, name, scope)


def _unknown(path: KeyPath, name: str, section: str, scope: Scope, text: str = "") -> Iterator[Fault]:
    names = scope.names[section]
    if name not in names:
        yield Fault(path, f'{text}there is no {section} "{name}"', suggestion(name, names, PLURALS[section]))


def _unknown_boundary(path: KeyPath, boundary: str, scope: Scope) -> Iterator[Fault]:
    body, edge = split_boundary(boundary)
    yield from _unknown(path, body, "body", scope, f'"{boundary}": ')
    edges = _edges(body, scope)
    if edges and edge not in edges:
        hint = suggestion(boundary, [f"{body}.{valid}" for valid in edges], "boundaries")
        yield Fault(path, f'body "{body}" has no boundary "{edge}"', hint)


def _edges(body: str, scope: Scope) -> tuple[str, ...]:
    """Names of the boundaries of a body, empty if they are unknown."""
    if body in scope.geometries:
        return tuple(scope.geometries[body].normals)
    return next((edge_names(one.shape) for one in scope.case.body if one.name == body), ())


def _texts(data: Mapping[str, Any], section: str, key: str) -> list[tuple[KeyPath, str]]:
    """Path and text of a key in every item of a list; of each text if it is a list of them."""
    found: list[tuple[KeyPath, Any]] = []
    items = data.get(section)
    for number, item in enumerate(items if isinstance(items, tuple) else ()):
        value = item.get(key) if isinstance(item, Mapping) else None
        if isinstance(value, tuple):
            found += [((section, number, key, place), text) for place, text in enumerate(value)]
        else:
            found.append(((section, number, key), value))
    return [(path, text) for path, text in found if isinstance(text, str)]
