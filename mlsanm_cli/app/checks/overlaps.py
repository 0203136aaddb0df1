"""Overlaps of deformed boundaries with bodies and rigid obstacles that no contact prevents.

Boundaries are checked along their exact curves; surfaces of the same contact are left to its law. The
position of a boundary has a second-order error, its rotation or strain times its displacement, and smaller
overlaps are ignored, as are those next to a corner of a surface in contact, which slides along the other one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import permutations
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.scene.contact_pairs import profile_of, shape_of
from mlsanm_cli.arrays import BoolArray, FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import cross, inside_polygon
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import platen_displacements
from mlsanm_cli.solve.state import State

MAX_CHORD_TURN = 0.02
"""Largest turning angle between chords of curves."""
MIN_CHORDS, MAX_CHORDS = 4, 64
"""Chords between two nodes: tips of two bodies may cross between the nodes of straight sides."""
SECOND_ORDER_FACTOR = 0.6
"""Overlaps below this multiple of the square of a body's largest displacement over its size are ignored: the
end of a cantilever approaches its root by that."""
DISPLACEMENT_ERROR = 0.01
"""Displacements below this part of those of a body are discretisation errors."""
SPACING_SHARE = 0.5
"""Part of the spacing to which surfaces are known between nodes at finite strain."""
CORNER_ANGLE = 0.1
"""Angle (radian) above which surfaces meet in a corner."""
SLIDE_FACTOR = 4.0
"""Overlaps at corners in contact are ignored within this multiple of the sliding distance."""


@dataclass(frozen=True)
class DeformedOutline:
    """Deformed outline of a body: ``points`` (n, 2), ``moved`` from where they are ``drawn``, with outward
    normals, the numbers ``surface`` (n,) of their surfaces and the ``uncertainty`` (n,) of their positions.
    ``chords`` (c, 2) are pairs of adjacent points, ``names`` (s) and ``ends`` (s, 2) those of surfaces."""

    points: FloatArray
    moved: FloatArray
    drawn: FloatArray
    normal: FloatArray
    surface: IntArray
    uncertainty: FloatArray
    chords: IntArray
    names: tuple[str, ...]
    ends: IntArray

    @property
    def edges(self) -> FloatArray:
        """Ends (c, 4) of the chords."""
        return np.hstack([self.points[self.chords[:, 0]], self.points[self.chords[:, 1]]])


def outline_of(cloud: Cloud, displacement: FloatArray, exact: bool = False) -> DeformedOutline:
    """Deformed outline of a body with the nodal ``displacement`` (n, 2), which at small strain has errors of
    second order; ``exact`` ones are known up to a part of the spacing, as surfaces between nodes are."""
    columns, surface, chords, ends, count = [], [], [], [], 0
    for number, one in enumerate(cloud.surfaces.values()):
        s, u, n = one.arc_length, displacement[one.index], one.normal
        if one.curve.closed:
            s, u, n = np.append(s, one.curve.length), np.vstack([u, u[:1]]), np.vstack([n, n[:1]])
        turn = np.arccos(np.clip((n[1:] * n[:-1]).sum(axis=1), -1.0, 1.0))
        pieces = np.clip(np.ceil(turn / MAX_CHORD_TURN), MIN_CHORDS, MAX_CHORDS).astype(np.int64)
        first = np.repeat(np.arange(len(pieces)), pieces)
        start = np.cumsum(pieces) - pieces
        share = (np.arange(pieces.sum()) - start[first]) / pieces[first]
        fine = np.append(s[first] + share * (s[1:] - s[:-1])[first], s[-1])
        at = np.minimum(fine, one.curve.length)
        moved = np.vstack([u[first] + share[:, None] * np.diff(u, axis=0)[first], u[-1:]])
        unknown = SPACING_SHARE * np.append(cloud.spacing[one.index], cloud.spacing[one.index[:1]])[: len(s)]
        if not exact:
            # The error of linear interpolation of displacements.
            unknown = np.zeros(len(s))
            if len(s) > 2:
                part = ((s[1:-1] - s[:-2]) / (s[2:] - s[:-2]))[:, None]
                unknown[1:-1] = 0.15 * np.hypot(*(u[1:-1] - (1.0 - part) * u[:-2] - part * u[2:]).T)
                unknown[[0, -1]] = unknown[[1, -2]]
        slack = np.append(np.maximum(unknown[:-1], unknown[1:])[first], unknown[-1])
        columns.append(np.column_stack([one.curve.points(at), moved, one.curve.normals(at), slack]))
        surface.append(np.full(len(fine), number))
        own = count + np.arange(len(fine))
        chords.append(np.stack([own[:-1], own[1:]], axis=1))
        ends.append(own[[0, -1]])
        count += len(fine)
    table, size = np.concatenate(columns), np.ptp(cloud.points, axis=0).max()
    places, shifts, normals = table[:, :2], table[:, 2:4], table[:, 4:6]
    apart = 0.0 if exact else float(np.hypot(*np.ptp(shifts, axis=0)))
    whole = SECOND_ORDER_FACTOR * apart**2 / size + DISPLACEMENT_ERROR * apart + COARSE_ROUND_OFF * size
    return DeformedOutline(
        *(places + shifts, shifts, places, normals, np.concatenate(surface), table[:, 6] + whole),
        *(np.concatenate(chords), tuple(cloud.surfaces), np.array(ends)),
    )


def distances(points: FloatArray, edges: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distance (e,) of ``points`` (e, 2) from the nearest of ``edges`` (c, 4), and its number (e,)."""
    start, way = edges[:, :2], edges[:, 2:] - edges[:, :2]
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    distance, nearest = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    # Not more pairs at once than the memory bears.
    step = max(1, 2**18 // len(edges))
    for first in range(0, len(points), step):
        away = points[first : first + step, None] - start
        share = np.clip((away * way).sum(axis=2) / square, 0.0, 1.0)
        squares = ((away - share[:, :, None] * way) ** 2).sum(axis=2)
        nearest[first : first + step] = squares.argmin(axis=1)
        distance[first : first + step] = np.sqrt(squares.min(axis=1))
    return distance, nearest


class Overlap(NamedTuple):
    """A boundary inside another body or an obstacle, with the largest ``depth`` and its ``place``."""

    depth: float
    place: tuple[float, float]
    boundary: str
    other: str

    @property
    def owners(self) -> set[str]:
        other = self.other if self.other.startswith("the ") else self.other.partition(".")[0]
        return {self.boundary.partition(".")[0], other}


def between_bodies(
    outlines: Mapping[str, DeformedOutline],
    given: Mapping[str, float] = MappingProxyType({}),
    spared: Callable[[str, str, IntArray, IntArray], BoolArray] | None = None,
) -> Iterator[Overlap]:
    """Overlaps of bodies, deeper than the gaps ``given`` for either, without the points ``spared``."""
    for one, other in permutations(outlines, 2):
        own, there = outlines[one], outlines[other]
        low, high = there.points.min(axis=0), there.points.max(axis=0)
        near = np.flatnonzero(((own.points > low) & (own.points < high)).all(axis=1))
        near = near[inside_polygon(there.edges, own.points[near])] if len(near) else near
        if not len(near):
            continue
        depth, chord = distances(own.points[near], there.edges)
        facing = there.chords[chord, 0]
        uncertainty = own.uncertainty[near] + there.uncertainty[facing]
        deep = depth > max(given.get(one, 0.0), given.get(other, 0.0)) + uncertainty
        if spared is not None:
            deep &= ~spared(one, other, near, facing)
        others = [f"{other}.{label(there.names[number])}" for number in there.surface[facing[deep]]]
        yield from deepest(own, near[deep], depth[deep], one, others)


def deepest(
    own: DeformedOutline, at: IntArray, depth: FloatArray, body: str, others: Sequence[str]
) -> Iterator[Overlap]:
    """The deepest of the points ``at`` (e,) for each pair of boundaries."""
    boundaries = [f"{body}.{label(own.names[number])}" for number in own.surface[at]]
    pairs_found = set()
    for worst in np.argsort(-depth, kind="stable"):
        pair = boundaries[worst], others[worst]
        if pair not in pairs_found:
            pairs_found.add(pair)
            x, y = own.points[at[worst]].tolist()
            yield Overlap(float(depth[worst]), (x, y), *pair)


def label(name: str) -> str:
    """Name of the boundary of a surface in the case."""
    return name.partition("/")[0]


def overlap_check(
    found: Sequence[Overlap], position: float, hint: Callable[[Overlap, Sequence[Overlap]], str]
) -> Check:
    if not found:
        return Check("overlap", 0.0, "")
    worst = max(found, key=lambda overlap: overlap.depth)
    x, y = worst.place
    message = (
        f"{worst.boundary} lies inside {worst.other} by {worst.depth:.3g} near ({x:.6g}, {y:.6g}) at "
        f"position {position:.6g}, and no contact is defined there"
    )
    return Check("overlap", len(found), message, hint(worst, found))


def overlaps(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[Check]:
    """Boundaries inside another body, an obstacle or their own body, by ``displacements`` of ``clouds``."""
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
            f"body {name} overlaps itself {near}from position {state.position:.6g} on: self-contact is not "
            f"supported, and results beyond that position are invalid"
        )
        yield Check("self_overlap", len(within), message, place=f"body {name}")


def _with_obstacles(
    built: CondensedScene, state: State, outlines: Mapping[str, DeformedOutline], given: Mapping[str, float]
) -> Iterator[Overlap]:
    """Overlaps of boundaries with the rigid obstacles of contacts, deeper than the gaps ``given``. A body
    without a contact with an obstacle that lies inside it initially is not checked against it."""
    moved = platen_displacements(built, state)
    slack = {name: COARSE_ROUND_OFF * np.ptp(own.drawn, axis=0).max() for name, own in outlines.items()}
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
            deep &= adjacent <= slack[body] + 1e-3 * depth
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
                if (((own.drawn - closest) * outward).sum(axis=1) < -slack[body]).any():
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
    """Mask (e,) of ``points`` within sliding distances ``along`` (e,) of corners of ``chosen`` surfaces."""
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
