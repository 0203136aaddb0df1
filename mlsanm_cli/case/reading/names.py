"""Names in a case: declared once, and known where they are used."""

from __future__ import annotations

from collections.abc import Iterator

from mlsanm_cli.case.model.places import listed
from mlsanm_cli.case.model.section import Scope, split_boundary
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


def name_faults(scope: Scope) -> Iterator[Fault]:
    """Names declared twice, unknown ones, and materials of no body."""
    for section in PLURALS:
        names = scope.names(section)
        for number, name in enumerate(names[: len(getattr(scope.case, section))]):
            if name in names[:number]:
                yield Fault((section, number, "name"), f'another {section} is called "{name}" already')
    for section, key, target in REFERENCES:
        for path, name in _texts(scope, section, key):
            yield from _unknown(path, name, target, scope)
    used = [body.material for body in scope.case.body]
    for name in scope.case.material:
        if name not in used and not scope.missing("body"):
            hint = f'remove it, or write material = "{name}" in a body'
            yield Fault(("material", name), "no body uses this material", hint)
    for section, key in BOUNDARIES:
        for path, name in _texts(scope, section, key):
            yield from _unknown_boundary(path, name, scope)


def _unknown(path: KeyPath, name: str, section: str, scope: Scope, text: str = "") -> Iterator[Fault]:
    names = scope.names(section)
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
    return scope.geometries[body].boundaries if body in scope.geometries else ()


def _texts(scope: Scope, section: str, key: str) -> Iterator[tuple[KeyPath, str]]:
    """Path and text of a key of every item of a list that has it; of each text if it is a list of them."""
    for number, item in enumerate(getattr(scope.case, section)):
        value = getattr(item, key, None)
        path: KeyPath = (section, number, key)
        for place, text in enumerate(listed(value)):
            yield (*path, place) if isinstance(value, tuple) else path, text
