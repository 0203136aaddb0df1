"""Conflicting boundary conditions: a component of a boundary is either fixed or loaded, and a contact surface
is not fixed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from mlsanm_cli.case.checks.valid_parts import ValidParts
from mlsanm_cli.case.lines import KeyPath
from mlsanm_cli.case.model.base import split_boundary
from mlsanm_cli.case.model.case import Support
from mlsanm_cli.case.model.loads import (
    BodyForce,
    Displacement,
    ObstacleMotion,
    Platen,
    Pressure,
    Temperature,
    Traction,
)
from mlsanm_cli.case.report import Report

Kind = Literal["support", "spring", "displacement", "traction", "platen force", "platen displacement"]

_ADDITIVE: frozenset[Kind] = frozenset({"displacement", "traction", "platen force", "platen displacement"})
"""Values of one of these kinds add up in a component, each with its own load factor."""


@dataclass(frozen=True)
class Condition:
    """A condition on one component (0: x, 1: y) of a boundary, or of a part of it (``partial``). Whether
    parts overlap is checked later, on the outlines."""

    boundary: str
    component: int
    kind: Kind
    path: KeyPath
    label: str
    partial: bool = False


def check_conditions(parts: ValidParts, report: Report) -> None:
    """Adds a problem for every pair of conditions that exclude each other."""
    conditions = [*_support_conditions(parts), *_load_conditions(parts)]
    taken: dict[tuple[str, int], list[Condition]] = {}
    reported: set[tuple[KeyPath, KeyPath]] = set()
    for condition in conditions:
        earlier = taken.setdefault((condition.boundary, condition.component), [])
        others = (one for one in earlier if not (condition.partial or one.partial))
        other = next((one for one in others if not compatible(one.kind, condition.kind)), None)
        earlier.append(condition)
        if other is not None and (other.path, condition.path) not in reported:
            reported.add((other.path, condition.path))
            where = f"on {condition.boundary} in {'xy'[condition.component]}"
            message = f"{condition.label} and {other.label} both act {where}"
            report.add(condition.path, message, "one condition per boundary and direction")
    _check_point_supports(parts, report)
    _check_rotations(parts, report)
    _check_obstacle_motions(parts, report)
    _check_contact_surfaces(parts, report, conditions)


def compatible(one: Kind, other: Kind) -> bool:
    """Whether two conditions may act on the same component: additive ones, or springs and tractions."""
    return (one == other and one in _ADDITIVE) or {one, other} == {"spring", "traction"}


def _support_conditions(parts: ValidParts) -> Iterator[Condition]:
    for index, support in parts.supports.items():
        if support.place is None:
            continue
        for boundary in support.place.boundaries:
            for component, kind in support_components(support):
                label, part = f"a {kind}", support.ends is not None
                yield Condition(boundary, component, kind, ("support", index), label, part)


def support_components(support: Support) -> Iterator[tuple[int, Kind]]:
    """The components in which a support fixes its boundary or has springs."""
    for component, value in enumerate((support.ux, support.uy)):
        if value is not None:
            yield component, "support"
    for component, spring in enumerate(support.spring or ()):
        if spring:
            yield component, "spring"


def _load_conditions(parts: ValidParts) -> Iterator[Condition]:
    for index, load in parts.loads.items():
        if isinstance(load, BodyForce | Temperature | ObstacleMotion):
            continue
        for boundary in [name for place in load.places for name in place.boundaries]:
            # A pressure on a boundary parallel to an axis has no component along that axis.
            name, edge = split_boundary(boundary)
            shape = parts.geometry(name)
            normal = shape.normals.get(edge) if shape is not None else None
            for component, kind in load_components(load, normal):
                label, part = f'load "{load.name}" ({kind})', load.ends is not None
                yield Condition(boundary, component, kind, ("load", index), label, part)


def load_components(
    load: Traction | Pressure | Displacement | Platen, normal: tuple[float, float] | None
) -> Iterator[tuple[int, Kind]]:
    """The components that a load prescribes; ``normal`` is that of a straight boundary, else None."""
    if isinstance(load, Platen):
        for direction, (control, _) in load.control.items():
            yield "xy".index(direction), "platen force" if control == "force" else "platen displacement"
    elif isinstance(load, Displacement):
        for component, value in enumerate(load.components):
            if value is not None:
                yield component, "displacement"
    elif isinstance(load, Pressure):
        for component in (0, 1):
            if normal is None or normal[component] != 0.0:
                yield component, "traction"
    else:
        for component in (0, 1):
            if load.traction is None or load.traction[component] != 0.0:
                yield component, "traction"


def _check_point_supports(parts: ValidParts, report: Report) -> None:
    seen: set[tuple[str, tuple[float, float], int]] = set()
    for index, support in parts.supports.items():
        if support.body is None or support.near is None:
            continue
        for component, value in enumerate((support.ux, support.uy)):
            if value is None:
                continue
            point = (support.body, support.near, component)
            if point in seen:
                message = f"another support fixes this point in {'xy'[component]} already"
                report.add(("support", index), message)
            seen.add(point)


def _check_rotations(parts: ValidParts, report: Report) -> None:
    first: dict[str, Platen] = {}
    for index, load in parts.loads.items():
        if not isinstance(load, Platen):
            continue
        other = first.setdefault(load.label, load)
        if other.turning != load.turning:
            message = f'"{load.turning}" here, "{other.turning}" in load "{other.name}" on the same platen'
            report.add(("load", index, "rotation"), message, "loads on one boundary act on one platen")
        elif other.hinge != load.hinge:
            message = f'differs from that of load "{other.name}" on the same platen'
            report.add(("load", index, "hinge"), message, "loads on one boundary act on one platen")


def _check_obstacle_motions(parts: ValidParts, report: Report) -> None:
    """Adds a problem where forces and displacements act on an obstacle in one direction."""
    first: dict[tuple[str, str], tuple[str, str]] = {}
    for index, load in parts.loads.items():
        if isinstance(load, ObstacleMotion):
            for direction, (control, _) in load.control.items():
                other, name = first.setdefault((load.obstacle, direction), (control, load.name))
                if other != control:
                    message = f'{control} here, {other} in load "{name}" on the same obstacle in {direction}'
                    report.add(("load", index), message, "use one of the two in each direction")


def _check_contact_surfaces(parts: ValidParts, report: Report, conditions: list[Condition]) -> None:
    for index, contact in parts.contacts.items():
        for key, side in zip(("slave", "master"), contact.sides, strict=False):
            path: KeyPath = ("contact", index, key)
            for condition in conditions:
                # Prescribed tractions and contact tractions add up.
                apart = condition.partial and side.ends is not None
                if condition.boundary in side.boundaries and condition.kind != "traction" and not apart:
                    message = f"{condition.label} acts on the contact surface {condition.boundary}"
                    hint = (
                        "only tractions and pressures may act on a contact surface: restrict both to "
                        "different parts of it with from and to"
                    )
                    report.add(path, message, hint)
                    break
