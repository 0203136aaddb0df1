"""The sides of a contact: extended by adjacent roundings; for bonds, the parts that face each other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mlsanm_cli.app.scene.conditions import conditions
from mlsanm_cli.app.scene.outlines import run_of
from mlsanm_cli.case import Case, Contact, Place, Pressure, Traction
from mlsanm_cli.cloud.curves import Arc, Outline, turn
from mlsanm_cli.cloud.joined import SMOOTH_ANGLE

COINCIDENCE = 1e-4
"""Largest distance of coincident surfaces, relative to their length."""


def sides_of(case: Case, outlines: Mapping[str, Outline], contact: Contact) -> tuple[Place, ...]:
    """The slave and, if there is one, the master of a contact, with the rounded corners at their ends; for
    bonds only the parts that face each other, at whose ends tractions may be singular."""
    sides = contact.sides
    if not contact.bonded or len(sides) < 2:
        return tuple(
            _with_roundings(case, outlines, contact, place, role)
            for role, place in zip(("slave", "master"), sides, strict=False)
        )
    return _facing_part(outlines, contact, 0), _facing_part(outlines, contact, 1)


def _with_roundings(
    case: Case, outlines: Mapping[str, Outline], contact: Contact, place: Place, role: str
) -> Place:
    """The side of a contact, extended by adjacent rounded corners: the contact zone of a face may extend into
    them. Roundings with conditions of their own, or between two sides in contact, are excluded.
    """
    if place.ends is not None:
        return place
    run = run_of(outlines, place, f"contact.{contact.name}.{role}")
    if run.around:
        return place
    outline, found = run.outline, list[tuple[str, int]]()
    for last, ahead in ((run.numbers[0], 0), (run.numbers[-1], 1)):
        adjacent = outline.neighbours(last)[ahead]
        beyond = outline.neighbours(adjacent)[ahead]
        curve = outline.curves[adjacent]
        if not isinstance(curve, Arc) or curve.sweep <= 0.0 or curve.closed:
            continue
        before, after = (outline.curves[last], curve)[:: 1 if ahead else -1]
        names = [f"{place.body}.{outline.names[k].partition('/')[0]}" for k in (adjacent, beyond)]
        if abs(turn(before, after)) < SMOOTH_ANGLE and _is_free(case, contact, place, *names):
            found.append((names[0], adjacent))
    # All arcs of a name are included, or none.
    taken = {number for _, number in found}
    more = {name for name, _ in found if {*outline.numbers(name.partition(".")[2])} <= taken}
    return Place((*place.boundaries, *sorted(more))) if more else place


def _is_free(case: Case, contact: Contact, place: Place, rounding: str, beyond: str) -> bool:
    """Whether a ``rounding`` has no conditions except tractions, and the side ``beyond`` no other contact."""
    acting = (
        place for _, condition, place in conditions(case) if not isinstance(condition, Pressure | Traction)
    )
    taken = [name for place in acting for name in place.boundaries]
    others = [name for other in case.contact if other is not contact for name in other.boundaries]
    apart = contact.boundaries if beyond not in place.boundaries else ()
    return rounding not in (*taken, *others, *contact.boundaries) and beyond not in (*others, *apart)


def _facing_part(outlines: Mapping[str, Outline], contact: Contact, which: int) -> Place:
    """The part of one side of a bond that coincides with the other side."""
    own, other = contact.sides[which], contact.sides[1 - which]
    if own.ends is not None:
        return own
    run = run_of(outlines, own, f"contact.{contact.name}")
    theirs = run_of(outlines, other, f"contact.{contact.name}").part
    if theirs.closed:
        return own
    whole = run.starts[-1]
    tips = theirs.points(np.array([0.0, 0.5, 1.0]) * theirs.length).tolist()
    (start, *_), (middle, _), (end, *_) = places = [run.nearest((x, y)) for x, y in tips]
    if places[1][1] > COINCIDENCE * whole:
        return own
    inside = [away <= COINCIDENCE * whole and run.continues(at) for at, away in places[::2]]
    if not any(inside):
        return own
    # Surfaces that face each other run in opposite directions; on a closed one the part contains the middle.
    low, high = sorted((start, end))
    if run.around:
        low, high = (low, high) if low < middle < high else (high, low)
    else:
        both = sorted(zip((start, end), inside, strict=True))
        low, high = (at if within else far for (at, within), far in zip(both, (0.0, whole), strict=True))
    (a, b), (c, d) = run.whole.points(np.array([low, high])).tolist()
    return Place(own.boundaries, ((a, b), (c, d)))
