"""Overlaps of deformed boundaries with bodies and rigid obstacles that no contact prevents.

Boundaries are checked along their exact curves; surfaces of the same contact are left to its law. The
position of a boundary has a second-order error, its rotation or strain times its displacement, and smaller
overlaps are ignored, as are those next to a corner of a surface in contact, which slides along the other one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.deformed import (
    DeformedOutline,
    Overlap,
    between_bodies,
    deepest,
    distances,
    label,
    outline_of,
    overlap_check,
)
from mlsanm_cli.app.scene.contact_pairs import profile_of, shape_of
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross, inside_polygon
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import platen_displacements
from mlsanm_cli.solve.state import State

CORNER_ANGLE = 0.1
"""Angle (radian) above which surfaces meet in a corner."""
SLIDE_FACTOR = 4.0
"""Overlaps at corners in contact are ignored within this multiple of the sliding distance."""


def overlaps(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[Check]:
    """Boundaries inside another body, an obstacle, or their own body, in a state with the ``displacements``
    (n, 2) of all bodies at the points of ``clouds``."""
    outlines = {name: outline_of(clouds[name], values) for name, values in displacements.items()}
    # Largest given gap or interference of the surfaces of every body.
    given = dict.fromkeys(built.scene.bodies, 0.0)
    profiles = {contact.name: profile_of(contact) for contact in built.case.contact}
    for pairing in built.condensed.pairings:
        if (profile := profiles[pairing.name]) is not None:
            largest = float(np.abs(profile.at(pairing.points)).max())
            given |= {body: max(given[body], largest) for body in pairing.bodies}

    def in_contact(one: str, other: str, near: IntArray, facing: IntArray) -> BoolArray:
        """Mask (e,) of points ``near`` that a contact keeps off ``facing`` ones, or at a corner of it."""
        own, there = outlines[one], outlines[other]
        spared = np.zeros(len(near), dtype=bool)
        along = np.hypot(*(own.moved[near] - there.moved[facing]).T)
        for pairing in built.condensed.reported:
            if {one, other} == set(pairing.bodies):
                mine, theirs = _members(pairing, one, own), _members(pairing, other, there)
                spared |= mine[own.surface[near]] & theirs[there.surface[facing]]
                spared |= _at_corners(own.points[near], along, own, mine)
                spared |= _at_corners(own.points[near], along, there, theirs)
        return spared

    found = list(between_bodies(outlines, given, in_contact))
    found += list(_with_obstacles(built, state, outlines, given))
    yield overlap_check(found, state.position, partial(_hint, built))
    yield from _self_overlaps(state.position, outlines)


def _self_overlaps(position: float, outlines: Mapping[str, DeformedOutline]) -> Iterator[Check]:
    for name, own in outlines.items():
        step = own.uncertainty[:, None] * own.normal
        within = np.flatnonzero(inside_polygon(own.edges, own.points + step))
        # Next to a re-entrant corner the outward step crosses the other side.
        corners = own.points[own.ends.ravel()]
        apart = np.hypot(*(own.points[within][:, None] - corners).transpose(2, 0, 1))
        apart = apart.min(axis=1, initial=np.inf)
        within = within[apart > SLIDE_FACTOR * np.hypot(*step[within].T)]
        before = np.hstack([own.drawn[own.chords[:, 0]], own.drawn[own.chords[:, 1]]])
        within = within[~inside_polygon(before, (own.drawn + step)[within])] if len(within) else within
        near = ""
        if len(within):
            depth, _ = distances(own.points[within] + step[within], own.edges)
            x, y = own.points[within[int(np.argmax(depth))]].tolist()
            near = f"near ({x:.6g}, {y:.6g}) "
        message = (
            f"body {name} overlaps itself {near}from position {position:.6g} on: self-contact is not "
            f"supported, and results beyond that position are invalid"
        )
        yield Check("self_overlap", len(within), message, place=f"body {name}")


def _with_obstacles(
    built: CondensedScene, state: State, outlines: Mapping[str, DeformedOutline], given: Mapping[str, float]
) -> Iterator[Overlap]:
    """Overlaps of boundaries with the rigid obstacles of contacts, deeper than the gaps ``given``. A body
    without a contact with an obstacle that lies inside it initially is not checked against it."""
    moved, slack = platen_displacements(built, state), COARSE_ROUND_OFF
    obstacles = [one for one in built.scene.rigid_constraints if not one.bodies]
    shifts = {one.name: moved[built.scene.loads[one.loads[0]]] for one in obstacles}
    pairings = {pairing.name: pairing for pairing in built.condensed.reported}
    shapes = {one.name: shape_of(one.obstacle) for one in built.case.contact if one.obstacle is not None}
    for contact, shape in shapes.items():
        shift, pairing = shifts.get(contact, np.zeros(2)), pairings[contact]
        for body, own in outlines.items():
            partner, normal = shape.closest(own.points - shift, own.normal)
            away = own.points - shift - partner
            depth, adjacent = -(away * normal).sum(axis=1), np.abs(cross(away, normal))
            deep = depth > given[body] + own.uncertainty
            deep &= adjacent <= slack * own.size + 1e-3 * depth
            # Several contacts may have the same plane: points next to it on their surfaces are theirs.
            for other in shapes.keys() - {contact}:
                if pairings[other].slave_body == body:
                    at = shifts.get(other, np.zeros(2))
                    there = shapes[other].closest(own.points - at, own.normal)[0] + at
                    same = np.hypot(*(there - partner - shift).T) <= depth
                    deep &= ~(same & _members(pairings[other], body, own)[own.surface])
            if not deep.any():
                continue
            if body == pairing.slave_body:
                mine = _members(pairing, body, own)
                deep &= ~mine[own.surface]
                deep &= ~_at_corners(own.points, np.hypot(*(own.moved - shift).T), own, mine)
            else:
                closest, outward = shape.closest(own.drawn, own.normal)
                if (((own.drawn - closest) * outward).sum(axis=1) < -slack * own.size).any():
                    continue
            # At a corner of the body report the side that faces the obstacle.
            found = np.flatnonzero(deep)
            found = found[np.argsort((own.normal[found] * normal[found]).sum(axis=1), kind="stable")]
            yield from deepest(own, found, depth[found], body, [_obstacle(contact)] * len(found))


def _members(pairing: Pairing, body: str, outline: DeformedOutline) -> BoolArray:
    """Mask (s,) of the surfaces of a body that belong to a contact."""
    surfaces = [pairing.slave] if body == pairing.slave_body else []
    if body == pairing.master_body and pairing.master is not None:
        surfaces.append(pairing.master)
    names = {part.name for surface in surfaces for part, _ in surface.members}
    return np.array([name in names for name in outline.names])


def _at_corners(
    points: FloatArray, along: FloatArray, outline: DeformedOutline, chosen: BoolArray
) -> BoolArray:
    """Mask (e,) of ``points`` (e, 2) within the sliding distance ``along`` (e,) of corners at the ends of the
    ``chosen`` surfaces (s,)."""
    found = np.zeros(len(points), dtype=bool)
    for number in np.flatnonzero(chosen):
        for end in outline.ends[number]:
            met = (outline.drawn[outline.ends] == outline.drawn[end]).all(axis=2)
            met[number] = False
            if (outline.normal[outline.ends[met]] @ outline.normal[end] < np.cos(CORNER_ANGLE)).any():
                found |= np.hypot(*(points - outline.points[end]).T) <= SLIDE_FACTOR * along
    return found


def _hint(built: CondensedScene, worst: Overlap, found: Sequence[Overlap]) -> str:
    changes, meant, ends = [], False, dict[str, set[int]]()
    for body, elastic in built.scene.bodies.items():
        for name, surface in elastic.model.cloud.surfaces.items():
            tips = () if surface.curve.closed else surface.index[[0, -1]].tolist()
            ends.setdefault(f"{body}.{label(name)}", set()).update(tips)
    for contact in built.case.contact:
        pair = [side.body for side in contact.sides]
        pair += [_obstacle(contact.name)] if contact.obstacle is not None else []
        between = [one for one in found if one.owners == set(pair)]
        for role, side in zip(("slave", "master"), contact.sides, strict=False):
            names = [name for one in between for name in (one.boundary, one.other)]
            names = [name for name in names if name.startswith(f"{side.body}.")]
            known = set().union(*(ends.get(name, set()) for name in side.boundaries))
            more = [name for name in names if name not in side.boundaries and ends.get(name, set()) & known]
            if more:
                listed = ", ".join(f'"{name}"' for name in dict.fromkeys((*side.boundaries, *more)))
                changes.append(f"contact.{contact.name}.{role} = [{listed}]")
                meant |= any(name in more for name in (worst.boundary, worst.other))
    for contact in built.case.contact:
        two, both = {worst.boundary, worst.other}, {*contact.boundaries, _obstacle(contact.name)}
        if contact.ends is not None and two & set(contact.sides[0].boundaries) and two <= both:
            return f"contact.{contact.name}.from and to exclude it: remove them, or move them farther apart"
    if meant:
        return f"add it to the contact, as in {' and '.join(changes)}, or draw it farther apart"
    whom = "that obstacle" if worst.other.startswith("the ") else f'master = "{worst.other}"'
    sides = f'slave = "{worst.boundary}" and {whom}'
    return f"give it a [[contact]] of its own with {sides}, or draw it farther apart"


def _obstacle(contact: str) -> str:
    return f"the obstacle of contact {contact}"
