"""The parts of a case that are sound on their own, so that their relations can be checked in any case.

A case with a wrong number in one body still deserves to hear about a misspelt boundary in another:
the checks work on what is left, and know which names belong to parts that are broken.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.case import Adapt, Body, Case, Contact, Mls, Model, Output, Solver, Support
from mlsanm_cli.case.model.files import Geometry, Mesh, Points, Survey
from mlsanm_cli.case.model.loads import AnyLoad, Load
from mlsanm_cli.case.model.materials import Material
from mlsanm_cli.case.model.shapes import AnyShape, Shape
from mlsanm_cli.case.model.stop import Stop
from mlsanm_cli.case.report import Report
from mlsanm_cli.errors import GeometryError

_PARTS: Mapping[str, Any] = {
    "shape": Shape,
    "body": Body,
    "support": Support,
    "load": Load,
    "contact": Contact,
    "stage": dict[str, float],
    "stop": Stop,
    "material": Material,
    "model": Model,
    "mls": Mls,
    "solver": Solver,
    "output": Output,
    "adapt": Adapt,
}


@cache
def _adapter(part: str) -> TypeAdapter[Any]:
    # Made when it is needed, for making all of them takes as long as validating a hundred cases.
    return TypeAdapter(_PARTS[part])


@dataclass(frozen=True)
class Draft:
    """Sound items by their index in the file; ``data`` is the raw content with every name in it.

    ``geometries`` are those of the sound shapes, once files have been looked into also of those in files.
    """

    data: Mapping[str, Any]
    model: Model | None
    materials: dict[str, Material]
    bodies: dict[int, Body]
    shapes: dict[int, AnyShape]
    geometries: dict[int, Geometry]
    supports: dict[int, Support]
    loads: dict[int, AnyLoad]
    contacts: dict[int, Contact]
    stages: dict[int, dict[str, float]]
    stops: dict[int, Stop]
    mls: Mls | None
    solver: Solver | None
    output: Output | None
    adapt: Adapt | None

    def names(self, section: str) -> list[tuple[int, str]]:
        """Index and name of every named item of a list, broken ones included."""
        return self.texts(section, "name")

    def geometry(self, body: str) -> Geometry | None:
        """The geometry of the body of that name, if it is sound."""
        return next((self.geometries.get(index) for index, name in self.names("body") if name == body), None)

    def texts(self, section: str, key: str) -> list[tuple[int, str]]:
        """Index and value of a key in every item of a list that gives it as text."""
        items = self.data.get(section)
        rows = items if isinstance(items, tuple) else ()
        values = [row.get(key) if isinstance(row, Mapping) else None for row in rows]
        return [(index, value) for index, value in enumerate(values) if isinstance(value, str)]

    def boundaries(self, section: str, key: str) -> list[tuple[KeyPath, str]]:
        """Key paths and names of a key that names one boundary or several, in every item of a list."""
        found: list[tuple[KeyPath, str]] = [((section, i, key), name) for i, name in self.texts(section, key)]
        items = self.data.get(section)
        for index, row in enumerate(items if isinstance(items, tuple) else ()):
            several = row.get(key) if isinstance(row, Mapping) else None
            if isinstance(several, tuple):
                names = enumerate(several)
                found += [((section, index, key, k), name) for k, name in names if isinstance(name, str)]
        return found

    def count(self, section: str) -> int:
        """Items of a list in the file, broken ones included."""
        items = self.data.get(section)
        return len(items) if isinstance(items, tuple) else 0


def make_draft(data: Mapping[str, Any], case: Case | None) -> Draft:
    """Everything in ``case``, the validated ``data``; of data that are none, the parts sound on their own."""
    return _parts(data) if case is None else _whole(data, case)


def _whole(data: Mapping[str, Any], case: Case) -> Draft:
    shapes = {index: body.shape for index, body in enumerate(case.body)}
    # The case names stages that the file leaves out.
    stages = {
        index: {name: float(factor) for name, factor in stage.items()}
        for index, stage in enumerate(data.get("stage", ()))
    }
    return Draft(
        data=data,
        model=case.model,
        materials=dict(case.material),
        bodies=dict(enumerate(case.body)),
        shapes=shapes,
        geometries=_drawn(shapes),
        supports=dict(enumerate(case.support)),
        loads=dict(enumerate(case.load)),
        contacts=dict(enumerate(case.contact)),
        stages=stages,
        stops=dict(enumerate(case.stop)),
        mls=case.mls,
        solver=case.solver,
        output=case.output,
        adapt=case.adapt,
    )


def _parts(data: Mapping[str, Any]) -> Draft:
    materials = data.get("material")
    listed = data.get("body")
    bodies = listed if isinstance(listed, tuple) else ()
    sound = {
        name: _sound("material", value)
        for name, value in (materials.items() if isinstance(materials, Mapping) else ())
    }
    shapes = _list("shape", tuple(_get(body, "shape") for body in bodies))
    return Draft(
        data=data,
        model=_sound("model", data.get("model")),
        materials={name: material for name, material in sound.items() if material is not None},
        bodies=_list("body", bodies),
        shapes=shapes,
        geometries=_drawn(shapes),
        supports=_list("support", data.get("support")),
        loads=_list("load", data.get("load")),
        contacts=_list("contact", data.get("contact")),
        stages=_list("stage", data.get("stage")),
        stops=_list("stop", data.get("stop")),
        mls=_sound("mls", data.get("mls", {})),
        solver=_sound("solver", data.get("solver", {})),
        output=_sound("output", data.get("output", {})),
        adapt=_sound("adapt", data.get("adapt", {})),
    )


def _drawn(shapes: Mapping[int, AnyShape]) -> dict[int, Geometry]:
    return {index: shape for index, shape in shapes.items() if not isinstance(shape, Mesh | Points)}


def look_into_files(
    draft: Draft, inspect_geometry_file: Survey, report: Report
) -> tuple[Draft, dict[int, str]]:
    """The draft with the geometries of shapes in files, and the files' SHA-256 by body."""
    geometries, digests = dict(draft.geometries), {}
    for index, shape in draft.shapes.items():
        if isinstance(shape, Mesh | Points):
            try:
                found = inspect_geometry_file(shape)
            except GeometryError as error:
                report.add(("body", index, "shape", "file"), error.message, error.hint)
                continue
            geometries[index], digests[index] = found, found.digest
    return replace(draft, geometries=geometries), digests


def _sound(part: str, value: Any) -> Any:
    """The validated value; unknown keys, told to the user elsewhere, do not make it unsound."""
    adapter = _adapter(part)
    try:
        return adapter.validate_python(value, strict=True)
    except ValidationError as error:
        details = error.errors(include_url=False, include_input=False, include_context=False)
    if any(detail["type"] != "extra_forbidden" for detail in details):
        return None
    for detail in details:
        value = _without(value, detail["loc"])
    try:
        return adapter.validate_python(value, strict=True)
    except ValidationError:
        return None


def _without(value: Any, location: tuple[int | str, ...]) -> Any:
    """A copy without the key at the location, in which names of union members are skipped."""
    if not location:
        return value
    head, rest = location[0], location[1:]
    if isinstance(value, tuple) and isinstance(head, int):
        return (*value[:head], _without(value[head], rest), *value[head + 1 :])
    if not isinstance(value, Mapping):
        return value
    if not rest:
        return {key: item for key, item in value.items() if key != head}
    inner = value.get(head) if isinstance(head, str) else None
    if isinstance(inner, Mapping) or (isinstance(inner, tuple) and isinstance(rest[0], int)):
        return {**value, head: _without(inner, rest)}
    return _without(value, rest)


def _get(value: Any, key: str) -> Any:
    return value.get(key) if isinstance(value, Mapping) else None


def _list(part: str, values: Any) -> dict[int, Any]:
    if not isinstance(values, tuple):
        return {}
    items = {index: _sound(part, value) for index, value in enumerate(values)}
    return {index: item for index, item in items.items() if item is not None}
