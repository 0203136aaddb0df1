"""Contact pairs of a case on given clouds, the surfaces that face each other, and their checks before
solving."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.loads import AmountField
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import AnyObstacle, Case, Contact, DiskObstacle, PlaneObstacle, rounded
from mlsanm_cli.case.model.contacts import PolylineObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Arc, Curve
from mlsanm_cli.cloud.surface import SMOOTH_ANGLE, joined_surface
from mlsanm_cli.contact.geometry.facing import Facing
from mlsanm_cli.contact.geometry.obstacles import Chain, Plane, Round, Shape
from mlsanm_cli.contact.geometry.pairing import Pairing, pair_surfaces
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

BOND_TOLERANCE = 0.05
"""Largest initial distance of bonded surfaces, in spacings; curves through points, and polygons, coincide
only so far."""
FIT_TOLERANCE = 1e-3
"""Largest initial gap of a press fit, in spacings."""
ALIKE = 1e-3
"""Curvatures that differ by less than this part are alike, as those of splines through points may be, and so
are minima of gaps that differ by less than this part of the height of a gap profile."""
RAYS, MINIMUM_PASSES = 17, 8
"""Samples of a gap between which its minimum is searched for, and number of refinements."""
TIP_SAMPLES = 400
"""Samples of the gap along a surface with a corner."""
ASIDE = 0.01
"""Distance from a corner at which its sides are looked at, relative to the surface."""
MAX_OPENING = math.sin(math.radians(60.0))
"""Gap over distance from the corner above which a side stays open."""
REVERSE = "the obstacle lies to the left of its line, seen in the order of its points: reverse the order"


def pair(boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> list[Pairing]:
    """Slave nodes and their projections for every contact, within its reach. Raises CaseError."""
    pairings, problems = list[Pairing](), list[CaseProblem]()
    for contact in boundaries.case.contact:
        try:
            pairings.append(_paired(boundaries, contact, clouds))
        except CaseError as error:
            problems += error.problems
    if boundaries.case.model.strain == "small":
        problems += _continued(pairings, clouds)
    if problems:
        raise CaseError(tuple(problems))
    return pairings


def _paired(boundaries: Boundaries, contact: Contact, clouds: Mapping[str, Cloud]) -> Pairing:
    case, key = boundaries.case, f"contact.{contact.name}"
    obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
    sides = []
    for place, run in boundaries.sides[contact.name]:
        pieces = [clouds[place.body].surfaces[name] for name in boundaries.names[place]]
        label, around = place.label.partition(".")[2], run.around and run.ends is None
        sides.append((place.body, joined_surface(label, pieces, around)))
    exchanged = False
    if case.model.strain == "finite" and len(sides) > 1:
        # At finite strain pressures are nodal values of the slave: a stiffer body as the slave would not
        # resist pressures that vary faster than its spacing.
        stiffness, material = materials(case), {body.name: body.material for body in case.body}
        across = np.array([[0.0, 1.0]])
        slave, master = (float(stiffness[material[body]].contact_compliance(across)[0]) for body, _ in sides)
        exchanged = slave < (1.0 - COARSE_ROUND_OFF) * master
    (body, own), *others = sides[::-1] if exchanged else sides
    pairing = pair_surfaces(contact.name, body, clouds[body], own, obstacle or others[0], contact.coefficient)
    pairing = replace(pairing, exchanged=exchanged)
    if not len(pairing.position):
        names = (*contact.names, "the obstacle")
        places = [clouds[body].points[surface.index] for body, surface in sides]
        hint = _unfaced_hint(contact, places, [surface.normal.mean(axis=0) for _, surface in sides])
        raise CaseError((CaseProblem(key, f"no node of {names[0]} faces {names[1]}", hint=hint),))
    if contact.bonded:
        drawn = np.abs(pairing.gap)
        coincides = drawn <= BOND_TOLERANCE * pairing.spacing
        if not coincides.any():
            least = int(np.argmin(drawn))
            x, y = pairing.partner[least]
            message = f"bonded surfaces are at least {drawn[least]:g} apart, near ({x:g}, {y:g})"
            hint = "draw them so that they coincide"
            raise CaseError((CaseProblem(f"{key}.friction", message, hint=hint),))
        return replace(pairing, candidate=coincides)
    profile = profile_of(contact)
    if profile is not None:
        pairing = replace(pairing, gap=pairing.gap + profile.at(pairing.points))
    if contact.interference is not None:
        pairing = _fitted(pairing, contact.interference)
    reach = contact.reach if isinstance(contact.reach, float) else pairing.first_reach()
    pairing = replace(pairing, candidate=pairing.gap <= reach)
    if not pairing.candidate.any():
        message = f"no initial gap is below {reach:g}; the smallest is {pairing.gap.min():g}"
        raise CaseError((CaseProblem(f"{key}.reach", message),))
    return pairing


def _unfaced_hint(contact: Contact, places: Sequence[FloatArray], normals: Sequence[FloatArray]) -> str:
    """A hint on why no node of a contact's slave faces the other side; ``places`` are the nodes of both."""
    if isinstance(contact.obstacle, PolylineObstacle):
        return REVERSE
    if contact.obstacle is not None:
        return "bodies must lie on the side of the obstacle to which its normal points, or outside its circle"
    facing = []
    for side, (x, y) in zip(contact.names, normals, strict=True):
        most = max(abs(x), abs(y))
        words = [
            more if part > 0.0 else less
            for part, less, more in ((y, "down", "up"), (x, "left", "right"))
            if abs(part) > 0.4 * most
        ]
        facing.append(f"{side} faces {' and '.join(words) if most >= 0.1 else 'all directions'}")
    distance = float(np.min(cKDTree(places[1]).query(places[0])[0]))
    return (
        f"{' and '.join(facing)}, at least {distance:.3g} apart: contact surfaces must face each other; turn "
        "a body (shape.side, for instance), move it, or choose another boundary"
    )


def _fitted(pairing: Pairing, interference: float) -> Pairing:
    """The pairing shifted so that the surfaces just touch; the load of the fit subtracts ``interference``
    from the gaps. Raises CaseError if they are apart, or overlap by more."""
    deepest = int(np.argmin(pairing.gap))
    gap, slack = float(pairing.gap[deepest]), FIT_TOLERANCE * float(pairing.spacing[deepest])
    x, y = pairing.partner[deepest]
    if gap > slack:
        message = f"the surfaces of a press fit are at least {gap:g} apart, near ({x:g}, {y:g})"
        hint = "draw them touching, or overlapping by at most the interference"
    elif gap < -interference - slack:
        message = f"the surfaces overlap by {-gap:g} near ({x:g}, {y:g}), more than the interference"
        hint = "the interference is the largest overlap, including any that is drawn"
    else:
        return replace(pairing, gap=pairing.gap - gap, interference=interference, closed_by=gap)
    raise CaseError((CaseProblem(f"contact.{pairing.name}.interference", message, hint=hint),))


def _continued(pairings: Sequence[Pairing], clouds: Mapping[str, Cloud]) -> Iterator[CaseProblem]:
    """Contacts that share a node and its partner on surfaces that are smooth there: pressures would go on
    from one to the other, each with the fields of a surface that ends."""
    for one, other in combinations([pairing for pairing in pairings if not pairing.bonded], 2):
        if one.slave_body != other.slave_body or one.master_body != other.master_body:
            continue
        _, first, second = np.intersect1d(one.node, other.node, return_indices=True)
        slack = COARSE_ROUND_OFF * float(np.ptp(clouds[one.slave_body].points, axis=0).max())
        same = np.hypot(*(one.partner[first] - other.partner[second]).T) <= slack
        for points, body in ((one.points[first], one.slave_body), (one.partner[first], one.master_body)):
            if body is not None:
                sharp = [node for node, turn, _ in clouds[body].corners if abs(turn) > SMOOTH_ANGLE]
                away = np.abs(points[:, None] - clouds[body].points[sharp]).max(axis=2)
                same &= away.min(axis=1, initial=np.inf) > slack
        if same.any():
            x, y = one.points[first][same][0].tolist()
            yield CaseProblem(
                f"contact.{other.name}",
                f"contacts {one.name} and {other.name} meet at ({x:.6g}, {y:.6g}) on one pair of surfaces, "
                "where pressures would go on from one to the other",
                hint="describe both by one contact",
            )


def profile_of(contact: Contact) -> AmountField | None:
    """The gap of a contact in addition to its geometric one, None if there is none."""
    return AmountField(f"contact.{contact.name}.gap", contact.gap) if contact.gap else None


def shape_of(obstacle: AnyObstacle) -> Shape:
    """The geometry of an obstacle."""
    match obstacle:
        case PlaneObstacle(normal=(x, y)):
            size = math.hypot(x, y)
            return Plane(obstacle.point, (x / size, y / size))
        case DiskObstacle():
            return Round(obstacle.center, obstacle.radius, obstacle.inside)
    return Chain(np.array(obstacle.points))


def refuse_overlap(contacts: Sequence[Contact], pairings: Sequence[Pairing]) -> None:
    """Raises CaseError for surfaces that initially overlap by more than the node spacing."""
    problems = []
    for pairing in pairings:
        deepest = int(np.argmin(pairing.gap + pairing.spacing))
        if pairing.gap[deepest] >= -pairing.spacing[deepest]:
            continue
        contact = next(one for one in contacts if one.name == pairing.name)
        (x, y), overlap = pairing.partner[deepest], -pairing.gap[deepest]
        message = f"the surfaces overlap by {overlap:g} near ({x:g}, {y:g}), more than the node spacing"
        hint = "move one body so that the surfaces at most touch, or declare it with interference"
        if isinstance(contact.obstacle, PolylineObstacle):
            hint += f"; if it lies on the wrong side, {REVERSE}"
        names = (*pairing.names, "the obstacle")
        master = getattr(pairing.master, "curve", None)
        sides = ((pairing.slave.curve, pairing.partner), (master, pairing.points))
        for number, (hole, points) in enumerate(sides):
            if not isinstance(hole, Arc) or hole.sweep > -2.0 * math.pi:
                continue
            middle, (x, y) = 0.5 * (points.min(axis=0) + points.max(axis=0)), hole.center
            if np.hypot(*(middle - np.array(hole.center))) > hole.radius:
                where = f"{names[number]}, whose centre is ({x:g}, {y:g})"
                message, hint = f"{names[1 - number]} lies outside {where}", "move it into the hole"
                break
        problems.append(CaseProblem(f"contact.{pairing.name}", message, hint=hint))
    if problems:
        raise CaseError(tuple(problems))


def facing_of(case: Case, pairing: Pairing) -> Facing:
    """The surfaces of a contact; the more curved one is the base, and the flatter one defines the direction
    of pressures. Flat faces may differ in the rounding of their edges only: the least curvature where they
    touch first counts, then the mean one."""
    contact = next(contact for contact in case.contact if contact.name == pairing.name)
    slave, profile = pairing.slave.curve, profile_of(contact)
    obstacle = None if contact.obstacle is None else shape_of(contact.obstacle)
    master = obstacle.curve if obstacle else pairing.surface_of(False).curve
    if master is None:
        return Facing(slave, None, obstacle, profile=profile)
    slack = COARSE_ROUND_OFF * float(np.ptp(pairing.points, axis=0).max())
    touching = pairing.gap <= pairing.gap.min() + slack
    at = pairing.points[touching], pairing.partner[touching]
    if touching.sum() == 1:
        # Between the nodes beside the nearest one.
        facing = Facing(slave, None if obstacle else master, obstacle)
        away = np.sort(np.hypot(*(pairing.points - at[0]).T))
        aside = float(away[min(2, len(away) - 1)])
        (middle,) = facing.locate(at[0])
        first, last = middle - aside, middle + aside
        if not slave.closed:
            first, last = max(first, 0.0), min(last, slave.length)
        there, partner, _ = facing.opposite(np.array([minimum(facing, first, last)]))
        at = there, partner

    def curved(curve: Curve, places: FloatArray, points: FloatArray) -> tuple[float, float]:
        near, whole = (np.abs(curve.curvature(curve.closest(some))) for some in (places, points))
        return float(near.min()), float(whole.mean())

    slave_first = obstacle is not None or pairing.names[0] < pairing.names[1]
    sides = curved(slave, at[0], pairing.points), curved(master, at[1], pairing.partner)
    for bend, opposite in zip(*sides, strict=True):
        if abs(bend - opposite) > ALIKE * max(bend, opposite):
            slave_first = bend > opposite
            break
    if obstacle and slave_first:
        return Facing(slave, None, obstacle, profile=profile)
    curves = (slave, master) if slave_first else (master, slave)
    return Facing(*curves, obstacle, slave_first, profile=profile)


def minimum(facing: Facing, first: float, last: float) -> float:
    """The arc length between two others at which the gap is smallest, by successive refinement."""
    for _ in range(MINIMUM_PASSES):
        s = np.linspace(first, last, RAYS)
        least = int(np.argmin(facing.gap(s)))
        first, last = s[max(least - 1, 0)], s[min(least + 1, len(s) - 1)]
    return 0.5 * float(first + last)


def check_tips(case: Case, pairings: Sequence[Pairing]) -> None:
    """CaseError if a surface touches first at a corner within itself from which both of its sides open
    slowly: a contact grid ends at the corner, and what the other side carries would be missed."""
    problems = []
    for pairing in (one for one in pairings if not one.bonded):
        sides = zip((pairing.slave, pairing.master), pairing.bodies, ("slave", "master"), strict=False)
        for surface, body, role in sides:
            corners = np.zeros(0) if surface is None else surface.curve.corners
            for place in surface.curve.points(corners) if surface is not None and len(corners) else ():
                facing = facing_of(case, pairing)
                base, size = facing.base, facing.base.length
                at, aside = float(facing.locate(place[None])[0]), ASIDE * size
                if not (base.closed or aside < abs(at) < size - aside):
                    continue
                tip, *beside = facing.gap(np.array([at, at - aside, at + aside]))
                opening = (np.array(beside) - tip) / aside
                sign = 1.0 if facing.slave_first else -1.0
                least = float(facing.gap(sign * np.linspace(0.0, size, TIP_SAMPLES)).min())
                slow = opening.min() > COARSE_ROUND_OFF and opening.max() < MAX_OPENING
                if not (slow and tip <= least + COARSE_ROUND_OFF * size):
                    continue
                message = (
                    f"body {body} touches with its sharp corner at ({place[0]:.6g}, {place[1]:.6g}), on both "
                    "sides of which pressures would be unbounded"
                )
                hint = f"{rounded(case, body)}, and add the name of the arc to contact.{pairing.name}.{role}"
                problems.append(CaseProblem(f"contact.{pairing.name}", message, hint=hint))
    if problems:
        raise CaseError(tuple(problems))
