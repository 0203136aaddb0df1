"""Conflicting conditions on lists and parts of boundaries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.outlines import numbers_of
from mlsanm_cli.case import Case, Displacement, Place, Platen, Pressure, Traction
from mlsanm_cli.case.model.conditions import Kind, compatible
from mlsanm_cli.cloud.curves import Outline, Segment
from mlsanm_cli.errors import CaseError, CaseProblem


def refuse_conflicts(case: Case, boundaries: Boundaries) -> None:
    """Raises CaseError for conflicting conditions on lists and parts of boundaries."""
    taken: dict[tuple[str, str, int], list[tuple[Kind, str, str]]] = {}
    problems = []
    for key, kinds, place, owner in _conditions(case, boundaries.drawn):
        for surface in boundaries.names(place):
            for component, kind in kinds:
                others = taken.setdefault((place.body, surface, component), [])
                for other, name, label in others:
                    plates = kind.startswith("platen") and label != owner
                    if plates or not compatible(other, kind):
                        message = f"{key} and {name} both act on a part of {place.label} in {'xy'[component]}"
                        hint = "one condition per boundary and direction"
                        problems.append(CaseProblem(key, message, hint=hint))
                others.append((kind, key, owner))
    for contact in case.contact:
        side = contact.sides[0]
        if contact.ends is not None:
            there = [taken.get((side.body, s, c), []) for s in boundaries.names(side) for c in (0, 1)]
            for kind, key, _ in [one for some in there for one in some]:
                if kind != "traction":
                    message = f"{key} acts on a part of the contact surface {side.label}"
                    hint = "only tractions and pressures may act on a contact surface"
                    problems.append(CaseProblem(f"contact.{contact.name}.slave", message, hint=hint))
    if problems:
        raise CaseError(tuple(dict.fromkeys(problems)))


def _conditions(
    case: Case, outlines: Mapping[str, Outline]
) -> Iterator[tuple[str, list[tuple[int, Kind]], Place, str]]:
    """Key, components with kinds, place and name of the place of all conditions on boundaries; a plate on
    several boundaries has one name."""
    for index, support in enumerate(case.support):
        if support.place is not None:
            yield f"support.{index}", list(support.conditions()), support.place, support.place.label
    for load in case.load:
        if isinstance(load, Platen | Pressure | Traction | Displacement):
            for place in load.places:
                owner = load.label if isinstance(load, Platen) else place.label
                kinds = list(load.conditions(_normal(outlines[place.body], place)))
                yield f"load.{load.name}", kinds, place, owner


def _normal(outline: Outline, place: Place) -> tuple[float, float] | None:
    """The outward normal of a straight place, None for others."""
    curves = [outline.curves[k] for edge in place.edges for k in numbers_of(outline, edge)]
    if not all(isinstance(curve, Segment) for curve in curves):
        return None
    normals = {tuple(np.round(curve.normals(np.zeros(1))[0], 9).tolist()) for curve in curves}
    (x, y), *more = normals
    return None if more else (float(x), float(y))
