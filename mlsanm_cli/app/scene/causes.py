"""What most likely is wrong with a scene, in the words of whoever drew it: distances, directions, signs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mlsanm_cli.app.scene.surfaces import surface_at
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Contact
from mlsanm_cli.case.model.loads import Platen, Traction
from mlsanm_cli.case.model.obstacles import PolylineObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.startup import cKDTree

FAR = 0.25
"""Surfaces drawn apart by this part of the smaller body's size are reported of."""
STRAIN = 0.1
"""Strains from which on a linear model has errors of that order."""
MOST = 0.99
"""Strains beyond this part of all count as those at corners, where they have no bound."""


def no_opposite_surface_hint(case: Case, contact: Contact, clouds: Mapping[str, Cloud]) -> str:
    """Why no node of a contact's slave may face its partner."""
    if isinstance(contact.obstacle, PolylineObstacle):
        return "the obstacle lies to the left of its line, seen in the order of its points: reverse the order"
    if contact.obstacle is not None:
        return "bodies must lie on the side of the obstacle to which its normal points, or outside its circle"
    places, directions = [], []
    for side in contact.sides:
        surface = surface_at(case, clouds[side.body], side, f"contact.{contact.name}")
        places.append(clouds[side.body].points[surface.index])
        directions.append(surface.normal.mean(axis=0))
    distance = float(nearest(cKDTree(places[1]), places[0])[0].min())
    facing = [f"{side} faces {_direction(way)}" for side, way in zip(contact.names, directions, strict=True)]
    return (
        f"{' and '.join(facing)}, {distance:.3g} apart at least: contact surfaces must face each other; turn "
        "a body (shape.side, for instance), move it, or choose another boundary"
    )


def _direction(way: FloatArray) -> str:
    """A direction as on paper."""
    x, y = (float(part) for part in way)
    if max(abs(x), abs(y)) < 0.1:
        return "all around"
    words = [
        word
        for part, (less, more) in ((y, ("down", "up")), (x, ("left", "right")))
        for word in ([more if part > 0.0 else less] if abs(part) > 0.4 * max(abs(x), abs(y)) else [])
    ]
    return " and ".join(words)


def distance_warnings(pairings: tuple[Pairing, ...], clouds: Mapping[str, Cloud]) -> Iterator[str]:
    """Contacts whose surfaces are drawn far apart."""
    for pairing in pairings:
        size = min(float(np.ptp(clouds[body].points, axis=0).max()) for body in pairing.bodies)
        gap = float(pairing.gap.min()) + pairing.closed_by
        if gap > FAR * size:
            yield (
                f"contact {pairing.name}: the surfaces are drawn {gap:.3g} apart, {gap / size:.2g} times the "
                "size of the smaller body: move the bodies together, unless they are meant to travel so far"
            )


def pull_hint(case: Case, pairings: tuple[Pairing, ...]) -> str:
    """Which forces pull bodies away from their contacts, "" where none do."""
    found = []
    for load in case.load:
        force = _force(load)
        for pairing in pairings:
            if force is None or getattr(load, "owner", None) not in pairing.bodies:
                continue
            # The master's outward normal points at the slave.
            away = pairing.normal.mean(axis=0) * (1.0 if load.owner == pairing.slave_body else -1.0)
            if force @ away > 0.0:
                found.append(f"load {load.name} pulls {load.owner} away from contact {pairing.name}")
    return f"{'; '.join(found)}: change its sign" if found else ""


def _force(load: object) -> FloatArray | None:
    """The direction of a load's force, where it is given by numbers."""
    if isinstance(load, Platen):
        moved = load.control
        held = [moved.get(axis, ("force", 0.0)) for axis in "xy"]
        return np.array([value if how == "force" else 0.0 for how, value in held])
    if isinstance(load, Traction) and all(isinstance(part, int | float) for part in load.traction or ("",)):
        return np.array(load.traction, dtype=np.float64)
    return None


def strain_of(points: FloatArray, displacement: FloatArray, von_mises: FloatArray, modulus: float) -> float:
    """How far a body is strained: by how much its displacements (n, 2) differ over its size, or the stresses
    (n,) that most of it stays below over its stiffness, whichever is more."""
    apart = float(np.ptp(displacement, axis=0).max()) / float(np.ptp(points, axis=0).max())
    return max(apart, float(np.quantile(von_mises, MOST)) / modulus)


def strain_warnings(case: Case, strains: Mapping[str, float]) -> Iterator[str]:
    """Bodies strained so far that a linear model no longer holds."""
    materials = {body.name: body.material for body in case.body}
    for body, strain in strains.items():
        if strain > STRAIN:
            yield (
                f"body {body} is strained or rotated by {100.0 * strain:.3g} %, but the linear model is "
                f"valid for a few percent only; check the units of material.{materials[body]} against those "
                "of the loads"
            )
