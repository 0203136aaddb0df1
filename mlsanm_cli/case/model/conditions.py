"""Conflicting boundary conditions: a component of a boundary is either fixed or loaded, and a contact surface
is not fixed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.fields import split_boundary
from mlsanm_cli.case.model.section import Scope
from mlsanm_cli.errors import Fault

Kind = Literal["support", "spring", "displacement", "traction", "platen force", "platen displacement"]


class _Condition(NamedTuple):
    """A condition on one component (0: x, 1: y) of a boundary, or of a part of it (``partial``). Whether
    parts overlap is checked later, on the outlines."""

    boundary: str
    component: int
    kind: Kind
    path: KeyPath
    label: str
    partial: bool


def condition_faults(scope: Scope) -> Iterator[Fault]:
    """A fault for every pair of conditions that exclude each other, and for every condition on a contact
    surface."""
    conditions = [*_on_supports(scope), *_on_loads(scope)]
    taken: dict[tuple[str, int], list[_Condition]] = {}
    reported: set[tuple[KeyPath, KeyPath]] = set()
    for condition in conditions:
        earlier = taken.setdefault((condition.boundary, condition.component), [])
        whole = [other for other in earlier if not (condition.partial or other.partial)]
        other = next((other for other in whole if not compatible(other.kind, condition.kind)), None)
        earlier.append(condition)
        if other is not None and (other.path, condition.path) not in reported:
            reported.add((other.path, condition.path))
            where = f"on {condition.boundary} in {'xy'[condition.component]}"
            message = f"{condition.label} and {other.label} both act {where}"
            yield Fault(condition.path, message, "one condition per boundary and direction")
    hint = (
        "only tractions and pressures may act on a contact surface: restrict both to different parts of it "
        "with from and to"
    )
    for index, contact in enumerate(scope.case.contact):
        for key, side in zip(("slave", "master"), contact.sides, strict=False):
            for condition in conditions:
                apart = condition.partial and side.ends is not None
                # Prescribed tractions and contact tractions add up.
                if condition.boundary in side.boundaries and condition.kind != "traction" and not apart:
                    message = f"{condition.label} acts on the contact surface {condition.boundary}"
                    yield Fault(("contact", index, key), message, hint)
                    break


def compatible(one: Kind, other: Kind) -> bool:
    """Whether two conditions may act on the same component: values of one kind that add up, each with its
    load factor, or springs and tractions."""
    additive = one == other and one not in ("support", "spring")
    return additive or {one, other} == {"spring", "traction"}


def _on_supports(scope: Scope) -> Iterator[_Condition]:
    for index, support in enumerate(scope.case.support):
        partial = support.ends is not None
        for boundary in support.place.boundaries if support.place is not None else ():
            for component, kind in support.conditions():
                yield _Condition(boundary, component, kind, ("support", index), f"a {kind}", partial)


def _on_loads(scope: Scope) -> Iterator[_Condition]:
    for index, load in enumerate(scope.case.load):
        for place, boundary in [(part, name) for part in load.places for name in part.boundaries]:
            geometry = scope.geometries.get(place.body)
            normal = geometry.normals.get(split_boundary(boundary)[1]) if geometry is not None else None
            for component, kind in load.conditions(normal):
                label, partial = f'load "{load.name}" ({kind})', place.ends is not None
                yield _Condition(boundary, component, kind, ("load", index), label, partial)
