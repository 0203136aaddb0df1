"""Boundaries of a case on the outlines of its bodies: sides of one name, lists, parts.

Outlines have one piece per smooth stretch, and are cut at the ends of loaded, fixed and contacting parts and
where tractions are discontinuous. Boundaries of several pieces and parts of boundaries are sets of pieces;
supports and loads act on each piece. A contact joins its pieces to one surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise

import numpy as np

from mlsanm_cli.app.scene.conditions import conditions
from mlsanm_cli.app.scene.contact_sides import sides_of
from mlsanm_cli.app.scene.forces import with_spread_forces
from mlsanm_cli.app.scene.load_profiles import profiles
from mlsanm_cli.app.scene.outlines import drawn, imported_geometry, run_of
from mlsanm_cli.case import Body, Case, Place, Platen, Pressure, Traction
from mlsanm_cli.case.model.conditions import Kind, compatible
from mlsanm_cli.case.model.shapes import Mesh, Points
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Curve, Outline, Segment
from mlsanm_cli.cloud.joined import BoundaryRun
from mlsanm_cli.cloud.surface import Surface, joined_surface
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.records import dataclass
from mlsanm_cli.roundoff import COARSE_ROUND_OFF, FINE_ROUND_OFF

MAX_END_DISTANCE = 0.1
"""Largest distance of the given end of a part from the boundary, relative to the boundary's length."""
ONE_CONDITION = "one condition per boundary and direction"
NO_CONDITION = (
    "only tractions and pressures may act on a contact surface: restrict both to different parts of it with "
    "from and to"
)
Cuts = Mapping[int, Sequence[float]]
"""Arc lengths at which the curves of an outline are cut, by curve number."""


@dataclass(frozen=True, eq=False)
class Boundaries:
    """The ``drawn`` outline of every body of a ``case`` and its ``cuts``; the ``sides`` of every contact,
    slave first. Loads of kind `force` are body forces and tractions in this case."""

    case: Case
    drawn: Mapping[str, Outline]
    cuts: Mapping[str, Cuts]
    sides: Mapping[str, tuple[Place, ...]]

    @classmethod
    def of(cls, case: Case) -> Boundaries:
        """Raises CaseError for invalid parts, and for pieces of a contact's side that do not join."""
        outlines = {body.name: drawn(body.shape) for body in case.body}
        case = with_spread_forces(case, outlines)
        sides = {contact.name: sides_of(case, outlines, contact) for contact in case.contact}
        conditioned = [(key, place) for key, _, place in conditions(case)]
        touching = [(f"contact.{name}", place) for name, places in sides.items() for place in places]
        parts = [(key, place) for key, place in (*conditioned, *touching) if place.ends is not None]
        cuts = {body.name: _cuts_of(case, body, outlines, parts) for body in case.body}
        return cls(case, outlines, cuts, sides)

    def outline(self, body: str) -> Outline:
        """The outline of a body with its cuts."""
        return self.drawn[body].cut(self.cuts[body])

    def curve(self, place: Place, key: str) -> tuple[Curve, tuple[Curve, ...]]:
        """The curve of a side of a contact, and the other curves of the body's outline. Raises CaseError."""
        run = run_of(self.drawn, place, key)
        others = tuple(curve for k, curve in enumerate(run.outline.curves) if k not in run.numbers)
        return run.part, others

    def keyed(self, contact: str) -> list[tuple[Place, str]]:
        """The sides of a contact, slave first, with their keys in the case."""
        roles = zip(self.sides[contact], ("slave", "master"), strict=False)
        return [(place, f"contact.{contact}.{role}") for place, role in roles]

    def surface(self, cloud: Cloud, place: Place, key: str) -> Surface:
        """A side of a contact as one surface. Raises CaseError if its pieces do not join."""
        run = run_of(self.drawn, place, key)
        pieces = [cloud.surfaces[name] for name in self.names(place)]
        return joined_surface(place.label.partition(".")[2], pieces, run.around and run.ends is None)

    def parts(self, cloud: Cloud, place: Place) -> list[tuple[Surface, float]]:
        """The surfaces of a place in the order of the outline, and the arc lengths along it, also across
        pieces that do not join, at which they start."""
        surfaces = [cloud.surfaces[name] for name in self.names(place)]
        starts = accumulate((surface.curve.length for surface in surfaces), initial=0.0)
        return list(zip(surfaces, starts, strict=False))

    def names(self, place: Place) -> tuple[str, ...]:
        """The names of the surfaces of a place, in order along the outline."""
        outline, cuts = self.drawn[place.body], self.cuts[place.body]
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

    def split(self, body: str, cloud: Cloud) -> Cloud:
        """A cloud from a file with its surfaces cut like the outline."""
        cuts = self.cuts[body]
        if not cuts:
            return cloud
        surfaces: dict[str, Surface] = {}
        for number, name in enumerate(self.drawn[body].names):
            whole, places = cloud.surfaces[name], sorted(cuts.get(number, ()))
            if not places:
                surfaces[name] = whole
                continue
            parts = Outline((name,), (whole.curve,)).cut({0: places})
            for own, curve, nodes in zip(parts.names, parts.curves, _split(whole, places), strict=True):
                arc = np.mod(whole.arc_length[nodes] - whole.arc_length[nodes[0]], whole.curve.length)
                surfaces[own] = Surface(own, curve, whole.index[nodes], arc, whole.normal[nodes])
        return Cloud(cloud.points, cloud.spacing, surfaces, cloud.mirror)

    def bond_ends(self, contact: str) -> list[tuple[float, float]]:
        """The points at which a bond ends on a surface that continues."""
        found = []
        for place in self.sides[contact]:
            if place.ends is None:
                continue
            run = run_of(self.drawn, place, f"contact.{contact}")
            found += [point for point in place.ends if run.continues(run.nearest(point)[0])]
        return found


def _cuts_of(
    case: Case, body: Body, outlines: Mapping[str, Outline], parts: Sequence[tuple[str, Place]]
) -> Cuts:
    """The cuts of the outline of a body at the ends of ``parts`` and where tractions are discontinuous."""
    cuts: dict[int, list[float]] = {}
    for key, place in parts:
        if place.body != body.name:
            continue
        run = run_of(outlines, place, key)
        whole = run.starts[-1]
        assert place.ends is not None
        for name, end in zip(("from", "to"), place.ends, strict=True):
            at, away = run.nearest(end)
            if away > MAX_END_DISTANCE * whole:
                message = f"({end[0]:g}, {end[1]:g}) is {away:g} away from the boundary"
                raise CaseError((CaseProblem(f"{key}.{name}", message, hint="give a point on or near it"),))
            _add_cut(cuts, run, body, at)
        if run.range[1] <= COARSE_ROUND_OFF * whole:
            message = "the part of the boundary between these points has no length"
            raise CaseError((CaseProblem(f"{key}.to", message, hint="give two different points"),))
    for load in case.load:
        if isinstance(load, Pressure | Traction) and load.owner == body.name:
            for profile in profiles(body.shape, load):
                whole = profile.run.starts[-1]
                for jump in profile.jumps:
                    _add_cut(cuts, profile.run, body, (profile.run.range[0] + jump) % whole)
    return cuts


def _add_cut(cuts: dict[int, list[float]], run: BoundaryRun, body: Body, at: float) -> None:
    """Adds a cut of a run at an arc length (with given nodes: at the nearest one), unless it exists."""
    for number, curve, start in zip(run.numbers, run.curves, run.starts, strict=False):
        if not start <= at <= start + curve.length:
            continue
        s = at - start
        if body.has_nodes:
            assert isinstance(body.shape, Mesh | Points)
            nodes = imported_geometry(body.shape).cloud.surfaces[run.outline.names[number]].arc_length
            s = float(nodes[np.argmin(np.abs(nodes - s))])
        small = COARSE_ROUND_OFF * curve.length
        known = [*cuts.get(number, ()), *(() if curve.closed else (0.0, curve.length))]
        if all(abs(s - other) > small for other in known):
            cuts.setdefault(number, []).append(s)
        return


def _split(surface: Surface, places: Sequence[float]) -> list[list[int]]:
    """Node positions of the parts of a surface cut at the nodes at arc lengths ``places``."""
    at = [int(np.argmin(np.abs(surface.arc_length - place))) for place in places]
    count = len(surface.index)
    if surface.curve.closed:
        return [[k % count for k in range(a, b + 1)] for a, b in pairwise([*at, at[0] + count])]
    return [list(range(a, b + 1)) for a, b in pairwise([0, *at, count - 1])]


def refuse_conflicts(boundaries: Boundaries) -> None:
    """Raises CaseError for conditions that exclude each other on a piece of a boundary, and for conditions
    other than tractions on a contact surface."""
    case = boundaries.case
    taken: dict[tuple[str, str], list[tuple[int, Kind, str, str, bool]]] = {}
    problems: dict[tuple[str, str], CaseProblem] = {}
    for key, condition, place in conditions(case):
        owner = condition.label if isinstance(condition, Platen) else place.label
        outline = boundaries.outline(place.body)
        for name in boundaries.names(place):
            acting = taken.setdefault((place.body, name), [])
            kinds = list(condition.conditions(_normal(outline.curves[outline.names.index(name)])))
            for component, kind in kinds:
                for _, other, there, label, partial in [entry for entry in acting if entry[0] == component]:
                    if compatible(other, kind) and not (kind.startswith("platen") and label != owner):
                        continue
                    part = "a part of " if partial or place.ends else ""
                    where = f"{part}{place.body}.{name.partition('/')[0]} in {'xy'[component]}"
                    problem = CaseProblem(key, f"{key} and {there} both act on {where}", hint=ONE_CONDITION)
                    problems.setdefault((key, there), problem)
            acting += [(component, kind, key, owner, place.ends is not None) for component, kind in kinds]
    for contact in case.contact:
        for role, side in zip(("slave", "master"), contact.sides, strict=False):
            for name in boundaries.names(side):
                for _, kind, there, _, partial in taken.get((side.body, name), ()):
                    # Prescribed tractions and contact tractions add up.
                    if kind != "traction":
                        key, part = (
                            f"contact.{contact.name}.{role}",
                            "a part of " if partial or side.ends else "",
                        )
                        message = f"{there} acts on {part}the contact surface {side.label}"
                        problems.setdefault((key, ""), CaseProblem(key, message, hint=NO_CONDITION))
    if problems:
        raise CaseError(tuple(problems.values()))


def _normal(curve: Curve) -> tuple[float, float] | None:
    """The outward normal of a straight curve, None for others."""
    if not isinstance(curve, Segment):
        return None
    x, y = curve.normals(np.zeros(1))[0].tolist()
    return (x if abs(x) > FINE_ROUND_OFF else 0.0, y if abs(y) > FINE_ROUND_OFF else 0.0)
