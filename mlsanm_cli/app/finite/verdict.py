"""Admissibility of a state at finite strain, also of boundaries inside bodies and obstacles that no contact
prevents, and the error of a path that cannot be continued."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from mlsanm_cli.app.checks.deformed import DeformedOutline, distances, outline_of
from mlsanm_cli.app.finite.scene import FiniteScene
from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.contact.finite.rigid import RigidContact
from mlsanm_cli.continuation import Outcome
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.mechanics.finite.law import determinant

ELLIPTICITY_WARNING = 0.1
"""Least eigenvalue of the acoustic tensor over the shear modulus below which a run warns."""
_LAWS = 'use law = "neo-hookean", which admits any compression, or smaller loads'


def check_deformation(
    scene: FiniteScene, position: float, factors: FloatArray, displacement: FloatArray
) -> None:
    """NumericalError, with body and node, if det F <= 0 or the law has lost ellipticity in a state of load
    ``factors`` (L,) and ``displacement`` (2N,) of all bodies."""
    for name, own in scene.parts(displacement).items():
        (volume, place), body = _least_volume(scene, name, own), scene.bodies[name]
        if not volume > 0.0:
            raise NumericalError(
                f"{place}: the deformation is not invertible at position {position:.6g} "
                f"(det F = {volume:.3g})",
                "use smaller loads, or finer nodes there",
            )
        waves = body.ellipticity(own, factors)
        node = int(np.argmin(waves))
        if waves[node] <= 0.0:
            place, kind = place_of(scene, name, node), body.law.kind
            raise NumericalError(
                f"{place}: {kind} has lost ellipticity at position {position:.6g} (acoustic tensor "
                f"{waves[node]:.3g} of the shear modulus): the state is not unique",
                _LAWS,
            )


def _least_volume(scene: FiniteScene, name: str, displacement: FloatArray) -> tuple[float, str]:
    """Smallest det F at the nodes of a body, and its place."""
    volume = 1.0 + determinant(scene.bodies[name].gradient(displacement))
    node = int(np.argmin(volume))
    return float(volume[node]), place_of(scene, name, node)


def path_failure(
    scene: FiniteScene, position: float, factors: FloatArray, displacement: FloatArray, outcome: Outcome
) -> NumericalError:
    """Error of a path of one body that cannot be continued from its last state."""
    name, body = scene.alone
    waves = body.ellipticity(displacement, factors)
    soft = int(np.argmin(waves))
    where = f"the path stopped at position {position:.6g}: {outcome.reason.value} ({outcome.message})"
    if waves[soft] < ELLIPTICITY_WARNING:
        place = place_of(scene, name, soft)
        close = f"{place} is close to losing ellipticity (acoustic tensor {waves[soft]:.2g})"
        return NumericalError(f"{where}; {close}", _LAWS)
    volume, place = _least_volume(scene, name, displacement)
    return NumericalError(
        f"{where}; the smallest det F is {volume:.3g}, at {place}",
        "use smaller loads, finer nodes, or raise solver.tolerance",
    )


def place_of(scene: FiniteScene, name: str, node: int) -> str:
    """A node of a body, in messages."""
    x, y = scene.bodies[name].elastic.model.cloud.points[node]
    return f"body {name}, node {node} at ({x:.6g}, {y:.6g})"


MAX_DEPTH = 0.5
"""Allowed penetration of nodes in spacings: between nodes a surface is not known better."""


@dataclass(frozen=True)
class _Body:
    """A body with its ``cloud``, the deformed ``places`` (n, 2) of its nodes and its ``outline``."""

    name: str
    cloud: Cloud
    places: FloatArray
    outline: DeformedOutline


def check_overlaps(
    scene: FiniteScene, position: float, factors: FloatArray, displacement: FloatArray
) -> None:
    """NumericalError if a boundary lies inside a body or an obstacle in a state of load ``factors`` (L,) and
    ``displacement`` (2N,) of all bodies."""
    bodies = {}
    for name, own in scene.parts(displacement).items():
        cloud, values = scene.bodies[name].elastic.model.cloud, own.reshape(-1, 2)
        bodies[name] = _Body(name, cloud, cloud.points + values, outline_of(cloud, values))
    for body in bodies.values():
        place = _crossing(body.outline)
        if place is not None:
            raise NumericalError(
                f"body {body.name} touches itself near ({place[0]:.6g}, {place[1]:.6g}) at position "
                f"{position:.6g}: self-contact is not supported",
                "use smaller loads, or model it as two bodies",
            )
    found = [*_between_bodies(bodies), *_obstacles(scene, bodies, factors)]
    if found:
        depth, (x, y), one, other = max(found)
        raise NumericalError(
            f"{one} lies inside {other} by {depth:.3g} near ({x:.6g}, {y:.6g}) at position {position:.6g}",
            "add a [[contact]] between them, or use finer nodes there",
        )


def _between_bodies(bodies: dict[str, _Body]) -> Iterator[tuple[float, tuple[float, float], str, str]]:
    """Depth and place of overlaps, the surface inside, and the surface of the other body."""
    for one, other in permutations(bodies.values(), 2):
        for surface in one.cloud.surfaces.values():
            points = one.places[surface.index]
            low, high = other.outline.points.min(axis=0), other.outline.points.max(axis=0)
            near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
            near = near[inside_polygon(other.outline.edges, points[near])] if len(near) else near
            if not len(near):
                continue
            depth, chord = distances(points[near], other.outline.edges)
            over = depth - MAX_DEPTH * one.cloud.spacing[surface.index[near]]
            worst = int(np.argmax(over))
            if over[worst] > 0.0:
                x, y = points[near[worst]].tolist()
                there = other.outline.names[other.outline.surface[other.outline.chords[chord[worst], 0]]]
                yield float(depth[worst]), (x, y), _named(one, surface.name), _named(other, there)


def _obstacles(
    scene: FiniteScene, bodies: dict[str, _Body], factors: FloatArray
) -> Iterator[tuple[float, tuple[float, float], str, str]]:
    """The same for rigid obstacles and the surfaces that have no contact with one."""
    rigid = [one for one in scene.contacts.pairs if isinstance(one, RigidContact)]
    taken = {(one.slave.body, name) for one in rigid for name, _ in one.slave.members}
    for contact in rigid:
        body = bodies[contact.slave.body]
        for surface in body.cloud.surfaces.values():
            if (body.name, surface.name) in taken:
                continue
            depth = -contact.seen(body.places[surface.index], surface.normal, factors)[0]
            over = depth - MAX_DEPTH * body.cloud.spacing[surface.index]
            worst = int(np.argmax(over))
            if over[worst] > 0.0:
                x, y = body.places[surface.index[worst]].tolist()
                obstacle = f"the obstacle of contact {contact.name}"
                yield float(depth[worst]), (x, y), _named(body, surface.name), obstacle


def _named(body: _Body, surface: str) -> str:
    return f"{body.name}.{surface.partition('/')[0]}"


def _crossing(outline: DeformedOutline) -> tuple[float, float] | None:
    """Intersection of two chords of an outline that are not adjacent, if there is one."""
    start, way = outline.edges[:, :2], outline.edges[:, 2:] - outline.edges[:, :2]
    low, high = np.minimum(start, start + way), np.maximum(start, start + way)
    one, other = np.nonzero(((low[:, None] < high[None]) & (high[:, None] > low[None])).all(axis=2))
    kept = one < other
    one, other = one[kept], other[kept]
    between = start[other] - start[one]
    across = way[one, 0] * way[other, 1] - way[one, 1] * way[other, 0]
    length = np.hypot(*way.T)
    slanted = np.abs(across) > 1e-9 * length[one] * length[other]
    one, other, between, across = one[slanted], other[slanted], between[slanted], across[slanted]
    mine = (between[:, 0] * way[other, 1] - between[:, 1] * way[other, 0]) / across
    theirs = (between[:, 0] * way[one, 1] - between[:, 1] * way[one, 0]) / across
    # Adjacent chords share an end.
    inner = (np.minimum(mine, theirs) > 1e-6) & (np.maximum(mine, theirs) < 1.0 - 1e-6)
    if not inner.any():
        return None
    first = int(np.flatnonzero(inner)[0])
    x, y = (start[one[first]] + mine[first] * way[one[first]]).tolist()
    return x, y
