"""Contact pairs of a case on given clouds, and their checks before solving."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.load_profiles import AmountField
from mlsanm_cli.app.scene.materials import materials
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import AnyObstacle, Case, Contact, DiskObstacle, Place, PlaneObstacle
from mlsanm_cli.case.model.contacts import PolylineObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.curves import Arc
from mlsanm_cli.cloud.joined import SMOOTH_ANGLE
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.geometry.obstacles import Chain, Plane, Round, Shape
from mlsanm_cli.contact.geometry.pairing import Pairing, pair_surfaces
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.roundoff import COARSE_ROUND_OFF

BOND_TOLERANCE = 0.05
"""Largest initial distance of bonded surfaces, in spacings; curves through points, and polygons, coincide
only so far."""
FIT_TOLERANCE = 1e-3
"""Largest initial gap of a press fit, in spacings."""


def pair(case: Case, boundaries: Boundaries, clouds: Mapping[str, Cloud]) -> list[Pairing]:
    """Slave nodes and their projections for every contact, within its reach. Raises CaseError."""
    pairings, problems = list[Pairing](), list[CaseProblem]()
    for contact in case.contact:
        try:
            pairings.append(_paired(case, boundaries, contact, clouds))
        except CaseError as error:
            problems += error.problems
    if case.model.strain == "small":
        problems += _continued(pairings, clouds)
    if problems:
        raise CaseError(tuple(problems))
    return pairings


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


def _paired(case: Case, boundaries: Boundaries, contact: Contact, clouds: Mapping[str, Cloud]) -> Pairing:
    pairing, key = _facing(case, boundaries, contact, clouds), f"contact.{contact.name}"
    if not len(pairing.position):
        slave, other = (*contact.names, "the obstacle")[:2]
        hint = _unfaced_hint(boundaries, contact, clouds)
        raise CaseError((CaseProblem(key, f"no node of {slave} faces {other}", hint=hint),))
    if contact.bonded:
        return _bonded(pairing)
    profile = profile_of(contact)
    if profile is not None:
        pairing = replace(pairing, gap=pairing.gap + profile.at(pairing.points))
    if contact.interference is not None:
        pairing = _fitted(pairing, contact.interference)
    reach = contact.reach if isinstance(contact.reach, float) else pairing.first_reach()
    pairing = pairing.with_reach(reach)
    if not pairing.candidate.any():
        message = f"no initial gap is below {reach:g}; the smallest is {pairing.gap.min():g}"
        raise CaseError((CaseProblem(f"{key}.reach", message),))
    return pairing


def _unfaced_hint(boundaries: Boundaries, contact: Contact, clouds: Mapping[str, Cloud]) -> str:
    """A hint on why no node of a contact's slave faces the other side."""
    if isinstance(contact.obstacle, PolylineObstacle):
        return REVERSE
    if contact.obstacle is not None:
        return "bodies must lie on the side of the obstacle to which its normal points, or outside its circle"
    places, directions = [], []
    for side in contact.sides:
        surface = boundaries.surface(clouds[side.body], side, f"contact.{contact.name}")
        places.append(clouds[side.body].points[surface.index])
        directions.append(surface.normal.mean(axis=0))
    distance = float(nearest(cKDTree(places[1]), places[0])[0].min())
    facing = [f"{side} faces {_direction(way)}" for side, way in zip(contact.names, directions, strict=True)]
    return (
        f"{' and '.join(facing)}, at least {distance:.3g} apart: contact surfaces must face each other; turn "
        "a body (shape.side, for instance), move it, or choose another boundary"
    )


def _direction(way: FloatArray) -> str:
    """A direction in words: up, down, left, right."""
    x, y = (float(part) for part in way)
    if max(abs(x), abs(y)) < 0.1:
        return "all directions"
    words = [
        word
        for part, (less, more) in ((y, ("down", "up")), (x, ("left", "right")))
        for word in ([more if part > 0.0 else less] if abs(part) > 0.4 * max(abs(x), abs(y)) else [])
    ]
    return " and ".join(words)


def profile_of(contact: Contact) -> AmountField | None:
    """The gap of a contact in addition to its geometric one, None if there is none."""
    return AmountField(f"contact.{contact.name}.gap", contact.gap) if contact.gap else None


def _facing(case: Case, boundaries: Boundaries, contact: Contact, clouds: Mapping[str, Cloud]) -> Pairing:
    places = boundaries.keyed(contact.name)
    exchanged = case.model.strain == "finite" and _stiff_slave(case, [place for place, _ in places])
    if exchanged:
        places.reverse()
    (body, slave), *others = [
        (place.body, boundaries.surface(clouds[place.body], place, key)) for place, key in places
    ]
    master = others[0] if contact.obstacle is None else shape_of(contact.obstacle)
    pairing = pair_surfaces(contact.name, body, clouds[body], slave, master, contact.coefficient)
    return replace(pairing, exchanged=exchanged)


def _stiff_slave(case: Case, places: Sequence[Place]) -> bool:
    """Whether the slave is the stiffer body. At finite strain pressures are nodal values of the softer body,
    which would not resist pressures that vary faster than its spacing."""
    stiffness = materials(case)
    names = [next(body.material for body in case.body if body.name == place.body) for place in places]
    slave, *masters = (float(stiffness[name].contact_compliance(np.array([[0.0, 1.0]]))[0]) for name in names)
    return any(slave < (1.0 - COARSE_ROUND_OFF) * master for master in masters)


REVERSE = "the obstacle lies to the left of its line, seen in the order of its points: reverse the order"


def shape_of(obstacle: AnyObstacle) -> Shape:
    """The geometry of an obstacle."""
    if isinstance(obstacle, PlaneObstacle):
        size = math.hypot(*obstacle.normal)
        return Plane(obstacle.point, (obstacle.normal[0] / size, obstacle.normal[1] / size))
    if isinstance(obstacle, DiskObstacle):
        return Round(obstacle.center, obstacle.radius, obstacle.inside)
    return Chain(np.array(obstacle.points))


def _bonded(pairing: Pairing) -> Pairing:
    """The pairing with coincident nodes as candidates. Raises CaseError if there are none."""
    drawn = np.abs(pairing.gap)
    candidate = drawn <= BOND_TOLERANCE * pairing.spacing
    if candidate.any():
        return replace(pairing, candidate=candidate)
    nearest = int(np.argmin(drawn))
    x, y = pairing.partner[nearest]
    message = f"bonded surfaces are at least {drawn[nearest]:g} apart, near ({x:g}, {y:g})"
    hint = "draw them so that they coincide"
    raise CaseError((CaseProblem(f"contact.{pairing.name}.friction", message, hint=hint),))


def _fitted(pairing: Pairing, interference: float) -> Pairing:
    """The pairing shifted so that the surfaces just touch; the load of the fit subtracts ``interference``
    from the gaps. Raises CaseError if they are apart, or overlap by more.
    """
    deepest = int(np.argmin(pairing.gap))
    gap = float(pairing.gap[deepest])
    slack = FIT_TOLERANCE * float(pairing.spacing[deepest])
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


def refuse_overlap(contacts: Sequence[Contact], pairings: Sequence[Pairing]) -> None:
    """Raises CaseError for surfaces that initially overlap by more than the node spacing."""
    problems = []
    for pairing in pairings:
        deepest = int(np.argmin(pairing.gap + pairing.spacing))
        if pairing.gap[deepest] < -pairing.spacing[deepest]:
            contact = next(one for one in contacts if one.name == pairing.name)
            (x, y), overlap = pairing.partner[deepest], -pairing.gap[deepest]
            message = f"the surfaces overlap by {overlap:g} near ({x:g}, {y:g}), more than the node spacing"
            hint = "move one body so that the surfaces at most touch, or declare it with interference"
            if isinstance(contact.obstacle, PolylineObstacle):
                hint += f"; if it lies on the wrong side, {REVERSE}"
            outside = _outside(pairing)
            hint = "move it into the hole" if outside else hint
            problems.append(CaseProblem(f"contact.{pairing.name}", outside or message, hint=hint))
    if problems:
        raise CaseError(tuple(problems))


def _outside(pairing: Pairing) -> str:
    """What is wrong with a surface that lies outside the circular hole it is to touch, "" for others."""
    sides = [(pairing.slave.curve, pairing.partner), (getattr(pairing.master, "curve", None), pairing.points)]
    names = (*pairing.names, "the obstacle")
    for number, (hole, points) in enumerate(sides):
        if not isinstance(hole, Arc) or hole.sweep > -2.0 * math.pi:
            continue
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        away = float(np.hypot(*(middle - np.array(hole.center))))
        if away > hole.radius:
            x, y = hole.center
            return f"{names[1 - number]} lies outside {names[number]}, whose centre is ({x:g}, {y:g})"
    return ""
