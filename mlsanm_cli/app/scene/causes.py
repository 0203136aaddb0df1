"""Probable causes of errors in a scene in terms of the case: distances, directions, signs, units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.case import Case, Contact, Platen, Traction
from mlsanm_cli.case.model.contacts import PolylineObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.geometry.pairing import Pairing

STRAIN_QUANTILE = 0.99
"""Larger strains are those at corners, where they are unbounded."""


def no_opposite_surface_hint(boundaries: Boundaries, contact: Contact, clouds: Mapping[str, Cloud]) -> str:
    """A hint on why no node of a contact's slave faces the other side."""
    if isinstance(contact.obstacle, PolylineObstacle):
        return "the obstacle lies to the left of its line, seen in the order of its points: reverse the order"
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


def pull_hint(case: Case, pairings: tuple[Pairing, ...]) -> str:
    """A hint on forces that pull bodies away from their contacts, "" if there are none."""
    found = []
    for load in case.load:
        force = _force(load)
        for pairing in pairings:
            if force is None or getattr(load, "owner", None) not in pairing.bodies:
                continue
            # The normal of a pairing, the master's outward one, points to the slave.
            away = pairing.normal.mean(axis=0) * (1.0 if load.owner == pairing.slave_body else -1.0)
            if force @ away > 0.0:
                found.append(f"load {load.name} pulls {load.owner} away from contact {pairing.name}")
    return f"{'; '.join(found)}: change its sign" if found else ""


def _force(load: object) -> FloatArray | None:
    """The direction of the force of a load, None if it is not given by numbers."""
    if isinstance(load, Platen):
        moved = load.control
        held = [moved.get(axis, ("force", 0.0)) for axis in "xy"]
        return np.array([value if how == "force" else 0.0 for how, value in held])
    if isinstance(load, Traction) and all(isinstance(part, int | float) for part in load.traction or ("",)):
        return np.array(load.traction, dtype=np.float64)
    return None


def strain_of(points: FloatArray, displacement: FloatArray, von_mises: FloatArray, modulus: float) -> float:
    """Strain of a body: the range of its displacements (n, 2) over its size, or a high quantile of its
    stresses (n,) over its stiffness, whichever is larger."""
    apart = float(np.ptp(displacement, axis=0).max()) / float(np.ptp(points, axis=0).max())
    return max(apart, float(np.quantile(von_mises, STRAIN_QUANTILE)) / modulus)
