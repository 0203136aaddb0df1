"""Pairs of a case's contacts on given clouds, and what is said of them before anything is solved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.scene.causes import no_opposite_surface_hint
from mlsanm_cli.app.scene.contact_sides import sides_of
from mlsanm_cli.app.scene.fields import AmountField
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.app.scene.surfaces import surface_at
from mlsanm_cli.case import AnyObstacle, Case, Contact, DiskObstacle, Place, PlaneObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.contact.geometry.obstacles import Chain, Plane, Round, Shape
from mlsanm_cli.contact.geometry.pairing import Pairing, pair_obstacle, pair_surfaces
from mlsanm_cli.errors import CaseError, CaseProblem

IN_PLACE = 0.05
"""Bonded surfaces are drawn in one place where they are apart by less than this part of the spacing: curves
through points, and polygons, are no nearer to each other."""
ALIKE = 1e-6
"""Bodies whose compliances differ by less than this part are equally stiff."""
TOUCHING = 1e-3
"""Surfaces of a fit are drawn touching where they are apart by less than this part of the spacing."""


def pair(case: Case, clouds: Mapping[str, Cloud]) -> list[Pairing]:
    """Slave nodes and virtual nodes of every contact, the reach applied where the case gives one.

    Raises CaseError.
    """
    pairings, problems = [], []
    for contact in case.contact:
        pairing, key = _facing(case, contact, clouds), f"contact.{contact.name}"
        if not len(pairing.position):
            slave, other = (*contact.names, "the obstacle")[:2]
            hint = no_opposite_surface_hint(case, contact, clouds)
            problems.append(CaseProblem(key, f"no node of {slave} faces {other}", hint=hint))
            continue
        if contact.bonded:
            try:
                pairings.append(_bonded(pairing))
            except CaseError as error:
                problems += error.problems
            continue
        profile = profile_of(contact)
        if profile is not None:
            try:
                pairing = replace(pairing, gap=pairing.gap + profile.at(pairing.points))
            except CaseError as error:
                problems += error.problems
                continue
        if contact.interference is not None:
            try:
                pairing = _fitted(pairing, contact.interference)
            except CaseError as error:
                problems += error.problems
                continue
        reach = contact.reach if isinstance(contact.reach, float) else pairing.first_reach()
        pairing = pairing.with_reach(reach)
        if not pairing.candidate.any():
            problems.append(
                CaseProblem(
                    f"{key}.reach",
                    f"no initial gap is below {reach:g}; the smallest is {pairing.gap.min():g}",
                )
            )
        pairings.append(pairing)
    if problems:
        raise CaseError(tuple(problems))
    return pairings


def profile_of(contact: Contact) -> AmountField | None:
    """What is added to the gap of a contact as drawn; None where nothing is."""
    return AmountField(f"contact.{contact.name}.gap", contact.gap) if contact.gap else None


def _facing(case: Case, contact: Contact, clouds: Mapping[str, Cloud]) -> Pairing:
    places = list(zip(sides_of(case, contact), ("slave", "master"), strict=False))
    exchanged = case.model.strain == "finite" and _stiff_slave(case, [place for place, _ in places])
    if exchanged:
        places.reverse()
    (body, slave), *others = [
        (place.body, surface_at(case, clouds[place.body], place, f"contact.{contact.name}.{key}"))
        for place, key in places
    ]
    if contact.obstacle is not None:
        shape = shape_of(contact.obstacle)
        return pair_obstacle(contact.name, body, clouds[body], slave, shape, contact.coefficient)
    ((other, master),) = others
    found = pair_surfaces(
        contact.name, body, clouds[body], slave, other, clouds[other], master, contact.coefficient
    )
    return replace(found, exchanged=exchanged)


def _stiff_slave(case: Case, places: Sequence[Place]) -> bool:
    """Whether the slave is the stiffer body of a contact at finite strain: pressures are nodal values of the
    softer one, which would not resist pressures of shorter waves than its spacing."""
    stiffness = materials(case)
    names = [next(one.material for one in case.body if one.name == place.body) for place in places]
    slave, *masters = (float(stiffness[name].contact_compliance(np.array([[0.0, 1.0]]))[0]) for name in names)
    return any(slave < (1.0 - ALIKE) * master for master in masters)


def shape_of(obstacle: AnyObstacle) -> Shape:
    """An obstacle's shape."""
    if isinstance(obstacle, PlaneObstacle):
        size = math.hypot(*obstacle.normal)
        return Plane(obstacle.point, (obstacle.normal[0] / size, obstacle.normal[1] / size))
    if isinstance(obstacle, DiskObstacle):
        return Round(obstacle.center, obstacle.radius, obstacle.inside)
    return Chain(np.array(obstacle.points))


def _bonded(pairing: Pairing) -> Pairing:
    """The pairs with those as candidates that are drawn in one place. Raises CaseError where none is."""
    drawn = np.abs(pairing.gap)
    candidate = drawn <= IN_PLACE * pairing.spacing
    if candidate.any():
        return replace(pairing, candidate=candidate)
    nearest = int(np.argmin(drawn))
    x, y = pairing.partner[nearest]
    message = f"bonded surfaces are drawn {drawn[nearest]:g} apart at least, near ({x:g}, {y:g})"
    hint = "draw them so that they coincide"
    raise CaseError((CaseProblem(f"contact.{pairing.name}.friction", message, hint=hint),))


def _fitted(pairing: Pairing, interference: float) -> Pairing:
    """The pairs as if the surfaces were drawn just touching; their load takes ``interference`` from the gaps.

    Raises CaseError where they are drawn apart, or overlap by more.
    """
    deepest = int(np.argmin(pairing.gap))
    gap = float(pairing.gap[deepest])
    slack = TOUCHING * float(pairing.spacing[deepest])
    x, y = pairing.partner[deepest]
    if gap > slack:
        message = f"the surfaces of a press fit are drawn {gap:g} apart at least, near ({x:g}, {y:g})"
        hint = "draw them touching, or overlapping by at most the interference"
    elif gap < -interference - slack:
        message = f"the surfaces overlap by {-gap:g} near ({x:g}, {y:g}), more than the interference"
        hint = "the interference is the largest overlap, including any that is drawn"
    else:
        return replace(pairing, gap=pairing.gap - gap, interference=interference, closed_by=gap)
    raise CaseError((CaseProblem(f"contact.{pairing.name}.interference", message, hint=hint),))


def refuse_overlap(pairings: tuple[Pairing, ...]) -> None:
    """Raise CaseError for surfaces that overlap as drawn by more than the node spacing."""
    problems = []
    for pairing in pairings:
        deepest = int(np.argmin(pairing.gap + pairing.spacing))
        if pairing.gap[deepest] < -pairing.spacing[deepest]:
            x, y = pairing.partner[deepest]
            problems.append(
                CaseProblem(
                    f"contact.{pairing.name}",
                    f"the surfaces overlap by {-pairing.gap[deepest]:g} near ({x:g}, {y:g}), "
                    f"more than the node spacing",
                    hint="move one body so that the surfaces at most touch, or declare it with interference",
                )
            )
    if problems:
        raise CaseError(tuple(problems))
