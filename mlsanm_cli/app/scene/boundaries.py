"""Boundaries of a case on the outlines of its bodies: sides of one name, lists, parts; the sides of contacts,
and the conditions on boundaries. Outlines have one piece per smooth stretch, and are cut at the ends of
loaded, fixed and contacting parts and where tractions are discontinuous. Boundaries of several pieces and
parts of boundaries are sets of pieces; supports and loads act on each piece. A contact joins its pieces to
one surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from mlsanm_cli.app.scene.loads import profiles, spread
from mlsanm_cli.app.scene.outlines import drawn, given_nodes, run_of
from mlsanm_cli.case import Body, Case, Contact, Force, Place, Pressure, Traction
from mlsanm_cli.case.model.conditions import Support
from mlsanm_cli.case.model.loads import OnBoundary
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Arc, Outline, turn
from mlsanm_cli.cloud.surface import SMOOTH_ANGLE, BoundaryRun, Surface
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

MAX_END_DISTANCE = 0.1
"""Largest distance of the given end of a part from the boundary, relative to the boundary's length."""
COINCIDENCE = 1e-4
"""Largest distance of coincident surfaces, relative to their length."""
Cuts = Mapping[int, Sequence[float]]
"""Arc lengths at which the curves of an outline are cut, by curve number."""
Condition: TypeAlias = Support | OnBoundary


def prescribes(condition: Condition) -> tuple[bool, bool]:
    """Whether a condition prescribes the displacements, or makes them rigid, in x and in y."""
    held = {axis for axis, kind in condition.conditions(None) if kind not in ("spring", "traction")}
    return 0 in held, 1 in held


@dataclass(frozen=True, eq=False)
class Boundaries:
    """The ``drawn`` outline of every body of a ``case`` and its ``cuts``; the ``conditions`` on boundaries:
    key, support or load, and place, of plates for each of their bodies; the ``sides`` of every contact as
    drawn, slave first; the ``names`` of the surfaces of every place with a condition or a contact, in order
    along the outline. Loads of kind `force` are body forces and tractions in this case."""

    case: Case
    drawn: Mapping[str, Outline]
    cuts: Mapping[str, Cuts]
    conditions: Sequence[tuple[str, Condition, Place]]
    sides: Mapping[str, tuple[tuple[Place, BoundaryRun], ...]]
    names: Mapping[Place, tuple[str, ...]]

    @classmethod
    def of(cls, case: Case) -> Boundaries:
        """Raises CaseError for invalid parts, and for pieces of a contact's side that do not join."""
        outlines = {body.name: drawn(body.shape) for body in case.body}
        loads = [
            spread(load, outlines, case.model.revolved) if isinstance(load, Force) else load
            for load in case.load
        ]
        case = case.model_copy(update={"load": tuple(loads)})
        conditions: list[tuple[str, Condition, Place]] = [
            (f"support.{number}", support, support.place)
            for number, support in enumerate(case.support)
            if support.place is not None
        ]
        for load in case.load:
            if isinstance(load, OnBoundary):
                conditions += [(f"load.{load.name}", load, place) for place in load.places]
        sides: dict[str, tuple[tuple[Place, BoundaryRun], ...]] = {}
        placed = [(key, place) for key, _, place in conditions]
        for contact in case.contact:
            key, both = f"contact.{contact.name}", len(contact.sides) > 1
            keys = [f"{key}.{role}" for role in ("slave", "master")]
            places = [
                _facing_part(outlines, contact, number)
                if contact.bonded and both
                else _with_roundings(case, conditions, outlines, contact, place, keys[number])
                for number, place in enumerate(contact.sides)
            ]
            placed += [(key, place) for place in places]
            runs = [run_of(outlines, place, role) for place, role in zip(places, keys, strict=False)]
            sides[contact.name] = tuple(zip(places, runs, strict=True))
        cuts = {body.name: _cuts_of(case, body, outlines, placed) for body in case.body}
        places = [place for _, place in placed] + [side for one in case.contact for side in one.sides]
        names = {place: _names(outlines[place.body], cuts[place.body], place) for place in places}
        return cls(case, outlines, cuts, conditions, sides, names)

    def outline(self, body: str) -> Outline:
        """The outline of a body with its cuts."""
        return self.drawn[body].cut(self.cuts[body])

    def split(self, body: str, cloud: Cloud) -> Cloud:
        """A cloud from a file with its surfaces cut like the outline, at the nearest nodes."""
        if not self.cuts[body]:
            return cloud
        surfaces: dict[str, Surface] = {}
        for number, name in enumerate(self.drawn[body].names):
            whole, places = cloud.surfaces[name], sorted(self.cuts[body].get(number, ()))
            if not places:
                surfaces[name] = whole
                continue
            at = [int(np.argmin(np.abs(whole.arc_length - place))) for place in places]
            count = len(whole.index)
            ends = [*at, at[0] + count] if whole.curve.closed else [0, *at, count - 1]
            parts = Outline((name,), (whole.curve,)).cut({0: places})
            for own, curve, (low, high) in zip(parts.names, parts.curves, pairwise(ends), strict=True):
                nodes = np.arange(low, high + 1) % count
                arc = np.mod(whole.arc_length[nodes] - whole.arc_length[nodes[0]], whole.curve.length)
                surfaces[own] = Surface(own, curve, whole.index[nodes], arc, whole.normal[nodes])
        return Cloud(cloud.points, cloud.spacing, surfaces, cloud.mirror)


def _names(outline: Outline, cuts: Cuts, place: Place) -> tuple[str, ...]:
    """The names of the surfaces of a place, in order along the outline."""
    chains = outline.chains(outline.numbers(*place.edges))
    # Loaded and held boundaries need not join.
    numbers = chains[0][0] if len(chains) == 1 else sorted(k for chain, _ in chains for k in chain)
    run = BoundaryRun(outline, tuple(numbers), chains[0][1], place.ends)
    (first, length), found = run.range, []
    for number, start in zip(run.numbers, run.starts, strict=False):
        for name, low, high in outline.pieces(number, cuts.get(number, ())):
            found.append(((start + 0.5 * (low + high) - first) % run.starts[-1], name))
    if place.ends is None:
        return tuple(name for _, name in found)
    return tuple(name for away, name in sorted(found) if away < length)


def _cuts_of(
    case: Case, body: Body, outlines: Mapping[str, Outline], placed: Sequence[tuple[str, Place]]
) -> Cuts:
    """The cuts of the outline of a body, with given nodes at the nearest ones: at the ends of parts and where
    tractions are discontinuous."""
    marks: list[tuple[BoundaryRun, float]] = []
    for key, place in placed:
        if place.body != body.name or place.ends is None:
            continue
        run = run_of(outlines, place, key)
        whole = run.starts[-1]
        for name, end in zip(("from", "to"), place.ends, strict=True):
            at, away = run.nearest(end)
            if away > MAX_END_DISTANCE * whole:
                message = f"({end[0]:g}, {end[1]:g}) is {away:g} away from the boundary"
                raise CaseError((CaseProblem(f"{key}.{name}", message, hint="give a point on or near it"),))
            marks.append((run, at))
        if run.range[1] <= COARSE_ROUND_OFF * whole:
            message = "the part of the boundary between these points has no length"
            raise CaseError((CaseProblem(f"{key}.to", message, hint="give two different points"),))
    for load in case.load:
        if isinstance(load, Pressure | Traction) and load.owner == body.name:
            for run, _, jumps in profiles(outlines[body.name], load):
                marks += [(run, (run.range[0] + jump) % run.starts[-1]) for jump in jumps]
    cuts: dict[int, list[float]] = {}
    for run, at in marks:
        pieces = zip(run.numbers, run.curves, run.starts, strict=False)
        number, curve, start = next(piece for piece in pieces if piece[2] <= at <= piece[2] + piece[1].length)
        s = at - start
        given = given_nodes(body)
        if given is not None:
            nodes = given.cloud.surfaces[run.outline.names[number]].arc_length
            s = float(nodes[np.argmin(np.abs(nodes - s))])
        known = [*cuts.get(number, ()), *(() if curve.closed else (0.0, curve.length))]
        if all(abs(s - other) > COARSE_ROUND_OFF * curve.length for other in known):
            cuts.setdefault(number, []).append(s)
    return cuts


def _with_roundings(
    case: Case,
    conditions: Sequence[tuple[str, Condition, Place]],
    outlines: Mapping[str, Outline],
    contact: Contact,
    place: Place,
    key: str,
) -> Place:
    """The side of a contact, extended by adjacent rounded corners: the contact zone of a face may extend into
    them. Roundings with conditions of their own but tractions, or between two sides in contact, are excluded.
    """
    if place.ends is not None:
        return place
    run = run_of(outlines, place, key)
    if run.around:
        return place
    outline, found = run.outline, list[tuple[str, int]]()
    others = {name for other in case.contact if other is not contact for name in other.boundaries}
    taken = others | {*contact.boundaries}
    for _, condition, where in conditions:
        taken |= set() if isinstance(condition, Pressure | Traction) else {*where.boundaries}
    for last, ahead in ((run.numbers[0], 0), (run.numbers[-1], 1)):
        adjacent = outline.neighbours(last)[ahead]
        curve = outline.curves[adjacent]
        if not isinstance(curve, Arc) or curve.sweep <= 0.0 or curve.closed:
            continue
        before, after = (outline.curves[last], curve)[:: 1 if ahead else -1]
        numbers = adjacent, outline.neighbours(adjacent)[ahead]
        rounding, beyond = (f"{place.body}.{outline.names[k].partition('/')[0]}" for k in numbers)
        apart = beyond not in others and (beyond in place.boundaries or beyond not in contact.boundaries)
        if abs(turn(before, after)) < SMOOTH_ANGLE and rounding not in taken and apart:
            found.append((rounding, adjacent))
    # All arcs of a name are included, or none.
    arcs = {number for _, number in found}
    more = {name for name, _ in found if {*outline.numbers(name.partition(".")[2])} <= arcs}
    return Place((*place.boundaries, *sorted(more))) if more else place


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
