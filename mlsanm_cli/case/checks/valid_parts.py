"""The valid parts of a case: their relations are checked even if other parts have errors. The case layer does
no geometry and reads no geometry files: the caller passes in a `GeometryInspector`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from pydantic import ValidationError

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import Point
from mlsanm_cli.case.model.case import Body, Case, Contact, Model, Support
from mlsanm_cli.case.model.loads import AnyLoad
from mlsanm_cli.case.model.shapes import AnyShape, edge_names
from mlsanm_cli.case.model.stop import Stop
from mlsanm_cli.case.report import Report
from mlsanm_cli.case.schema_errors import UNKNOWN_KEY, findings, report_findings
from mlsanm_cli.errors import Fault


@dataclass(frozen=True)
class Geometry:
    """The geometry of a shape: the outward ``normals`` of its boundaries by name (None if curved), the centre
    and the larger side of its bounding box, and the SHA-256 of its file, if any."""

    normals: Mapping[str, Point | None]
    centre: Point
    size: float
    digest: str = ""


@dataclass(frozen=True)
class GeometryInspector:
    """Functions that examine the geometry of a case. ``geometry`` raises GeometryError for a shape that is
    not a valid body; ``floating`` returns a fault for every body without contact that can move freely, with
    its key in the case."""

    geometry: Callable[[AnyShape], Geometry]
    floating: Callable[[Case], Iterable[Fault]]


LISTS = ("body", "support", "load", "contact", "stage", "stop", "probe")
REMOVABLE = ("name", "material", "spacing", "seed", "refine")
"""Keys of a body that can be removed or replaced so that its other keys can be checked."""
UNNAMED = {"name": "unnamed", "material": "unnamed"}
PLACEHOLDERS: Mapping[str, Any] = {"format": 1, "material": {}, "body": (), "model": {"plane": "stress"}}
"""Replacements of required tables; plane stress has the fewest restrictions on materials."""
MAX_ROUNDS = 10


@dataclass(frozen=True)
class ValidParts:
    """The valid part of the content ``data`` of a file as a ``case``. ``places`` are the numbers of the list
    items in the file, ``incomplete`` the tables and lists from which something was removed, ``geometries``
    those of valid shapes by the number of the body."""

    case: Case
    data: Mapping[str, Any]
    places: Mapping[str, tuple[int, ...]]
    incomplete: frozenset[str]
    geometries: Mapping[int, Geometry] = field(default_factory=dict)

    @property
    def model(self) -> Model | None:
        """The model, None if it has errors."""
        return None if "model" in self.incomplete else self.case.model

    @cached_property
    def bodies(self) -> dict[int, Body]:
        """Bodies by their number in the file."""
        return dict(zip(self.places["body"], self.case.body, strict=True))

    @cached_property
    def supports(self) -> dict[int, Support]:
        """Supports by their number in the file."""
        return dict(zip(self.places["support"], self.case.support, strict=True))

    @cached_property
    def loads(self) -> dict[int, AnyLoad]:
        """Loads by their number in the file."""
        return dict(zip(self.places["load"], self.case.load, strict=True))

    @cached_property
    def contacts(self) -> dict[int, Contact]:
        """Contacts by their number in the file."""
        return dict(zip(self.places["contact"], self.case.contact, strict=True))

    @cached_property
    def stages(self) -> dict[int, Mapping[str, float]]:
        """Stages by their number, as written in the file."""
        return {number: self.data["stage"][number] for number in self.places["stage"]}

    @cached_property
    def stops(self) -> dict[int, Stop]:
        """Stop conditions by their number in the file."""
        return dict(zip(self.places["stop"], self.case.stop, strict=True))

    def names(self, section: str) -> list[tuple[int, str]]:
        """Number and name of every named item of a list, also of invalid ones."""
        return self.texts(section, "name")

    def texts(self, section: str, key: str) -> list[tuple[int, str]]:
        """Number and value of a key in all items of a list where it is a text."""
        values = [(number, row.get(key)) for number, row in self._rows(section)]
        return [(number, value) for number, value in values if isinstance(value, str)]

    def boundaries(self, section: str, key: str) -> list[tuple[KeyPath, str]]:
        """Path and name of every boundary named by a key, in all items of a list."""
        found: list[tuple[KeyPath, Any]] = []
        for number, row in self._rows(section):
            value, path = row.get(key), (section, number, key)
            if isinstance(value, tuple):
                found += [((*path, k), name) for k, name in enumerate(value)]
            else:
                found.append((path, value))
        return [(path, name) for path, name in found if isinstance(name, str)]

    def count(self, section: str) -> int:
        """Number of items of a list in the file, invalid ones included."""
        items = self.data.get(section)
        return len(items) if isinstance(items, tuple) else 0

    def geometry(self, body: str) -> Geometry | None:
        """The geometry of the body of that name, if it is valid."""
        return self.geometries.get(self._number(body))

    def edges(self, body: str) -> tuple[str, ...]:
        """Names of the boundaries of a body, empty if they are unknown."""
        geometry, number = self.geometry(body), self._number(body)
        if geometry is not None:
            return tuple(geometry.normals)
        return edge_names(self.bodies[number].shape) if number in self.bodies else ()

    def _number(self, body: str) -> int:
        return next((number for number, name in self.names("body") if name == body), -1)

    def _rows(self, section: str) -> list[tuple[int, Mapping[str, Any]]]:
        items = self.data.get(section)
        rows: tuple[Any, ...] = items if isinstance(items, tuple) else ()
        return [(number, row) for number, row in enumerate(rows) if isinstance(row, Mapping)]


def validate(data: Mapping[str, Any], report: Report, covered: frozenset[KeyPath]) -> ValidParts | None:
    """The valid parts of the content of a file; None if no case can be made of them. Adds all validation
    errors to the report, except at or below ``covered`` paths, which have been reported."""
    places = {section: tuple(range(len(_items(data, section)))) for section in LISTS}
    incomplete: set[str] = set()
    rest = dict(data)
    for round_ in range(MAX_ROUNDS):
        try:
            return ValidParts(Case.model_validate(rest), data, places, frozenset(incomplete))
        except ValidationError as error:
            found = list(findings(rest, error))
        if round_ == 0:
            report_findings(report, found, covered)
        incomplete |= {str(path[0]) for path, detail in found if detail["type"] != UNKNOWN_KEY}
        covers = {_cover(path, detail["type"] == UNKNOWN_KEY) for path, detail in found}
        # In descending order, so that the numbers of remaining items stay valid.
        for cover in sorted(covers, key=lambda path: [str(step).zfill(9) for step in path], reverse=True):
            if len(cover) == 2 and cover[0] in places and isinstance(cover[1], int):
                section, at = str(cover[0]), cover[1]
                places[section] = (*places[section][:at], *places[section][at + 1 :])
            rest = _without(rest, cover)
        rest |= {key: value for key, value in PLACEHOLDERS.items() if key not in rest}
        rest["body"] = tuple(UNNAMED | dict(one) if isinstance(one, Mapping) else one for one in rest["body"])
    return None


def _items(data: Mapping[str, Any], section: str) -> tuple[Any, ...]:
    items = data.get(section)
    return items if isinstance(items, tuple) else ()


def _cover(path: KeyPath, unknown: bool) -> KeyPath:
    """The part to remove for an error: the unknown key, else the enclosing list item or table."""
    if unknown:
        return path
    if path[:1] == ("body",) and path[2:3] and path[2] in REMOVABLE:
        return path[:3]
    return path[:2] if path[:1] == ("material",) or path[0] in LISTS else path[:1]


def _without(value: Any, path: KeyPath) -> Any:
    """A copy of nested tables and lists without the item at a path."""
    head, rest = path[0], path[1:]
    if isinstance(value, tuple) and isinstance(head, int) and head < len(value):
        return (*value[:head], *((_without(value[head], rest),) if rest else ()), *value[head + 1 :])
    if isinstance(value, Mapping) and head in value:
        others = {key: item for key, item in value.items() if key != head}
        return {**others, head: _without(value[head], rest)} if rest else others
    return value
