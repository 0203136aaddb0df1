"""The parts of a case that are sound on their own, so that their relations can be checked in any case.

A case with a wrong number in one body still deserves to hear about a misspelt boundary in another:
the checks work on what is left, and know which names belong to parts that are broken.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from mlsanm_cli.case.loads import Displacement, Load, Platen, Pressure, Traction
from mlsanm_cli.case.model import Body, Contact, Material, Mls, Model, Output, Solver, Support

AnyLoad = Traction | Pressure | Displacement | Platen

_BODY: TypeAdapter[Body] = TypeAdapter(Body)
_SUPPORT: TypeAdapter[Support] = TypeAdapter(Support)
_LOAD: TypeAdapter[AnyLoad] = TypeAdapter(Load)
_CONTACT: TypeAdapter[Contact] = TypeAdapter(Contact)
_STAGE: TypeAdapter[dict[str, float]] = TypeAdapter(dict[str, float])
_MATERIAL: TypeAdapter[Material] = TypeAdapter(Material)
_MODEL: TypeAdapter[Model] = TypeAdapter(Model)
_MLS: TypeAdapter[Mls] = TypeAdapter(Mls)
_SOLVER: TypeAdapter[Solver] = TypeAdapter(Solver)
_OUTPUT: TypeAdapter[Output] = TypeAdapter(Output)


@dataclass(frozen=True)
class Draft:
    """Sound items by their index in the file; ``data`` is the raw content with every name in it."""

    data: Mapping[str, Any]
    model: Model | None
    materials: dict[str, Material]
    bodies: dict[int, Body]
    supports: dict[int, Support]
    loads: dict[int, AnyLoad]
    contacts: dict[int, Contact]
    stages: dict[int, dict[str, float]]
    mls: Mls | None
    solver: Solver | None
    output: Output | None

    def names(self, section: str) -> list[tuple[int, str]]:
        """Index and name of every named item of a list, broken ones included."""
        items = self.data.get(section)
        if not isinstance(items, tuple):
            return []
        return [
            (index, item["name"])
            for index, item in enumerate(items)
            if isinstance(item, Mapping) and isinstance(item.get("name"), str)
        ]

    def body(self, name: str) -> Body | None:
        """The sound body of that name."""
        return next((body for body in self.bodies.values() if body.name == name), None)

    def count(self, section: str) -> int:
        """Items of a list in the file, broken ones included."""
        items = self.data.get(section)
        return len(items) if isinstance(items, tuple) else 0


Item = TypeVar("Item")


def make_draft(data: Mapping[str, Any]) -> Draft:
    """Validates every part on its own; parts that fail are left out."""
    materials = data.get("material")
    sound = {
        name: _sound(_MATERIAL, value)
        for name, value in (materials.items() if isinstance(materials, Mapping) else ())
    }
    return Draft(
        data=data,
        model=_sound(_MODEL, data.get("model")),
        materials={name: material for name, material in sound.items() if material is not None},
        bodies=_list(_BODY, data.get("body")),
        supports=_list(_SUPPORT, data.get("support")),
        loads=_list(_LOAD, data.get("load")),
        contacts=_list(_CONTACT, data.get("contact")),
        stages=_list(_STAGE, data.get("stage")),
        mls=_sound(_MLS, data.get("mls", {})),
        solver=_sound(_SOLVER, data.get("solver", {})),
        output=_sound(_OUTPUT, data.get("output", {})),
    )


def _sound(adapter: TypeAdapter[Item], value: Any) -> Item | None:
    try:
        return adapter.validate_python(value, strict=True)
    except ValidationError:
        return None


def _list(adapter: TypeAdapter[Item], values: Any) -> dict[int, Item]:
    if not isinstance(values, tuple):
        return {}
    items = {index: _sound(adapter, value) for index, value in enumerate(values)}
    return {index: item for index, item in items.items() if item is not None}
