"""Contact surfaces and obstacles as lines, for files and pictures, and warnings of surfaces that slide far.
At small strain contact partners are those of the undeformed state. If they slide by a considerable part of
the contact's width, other points touch, and pressures are reported at points that have moved."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import AnyObstacle, Case, DiskObstacle, ObstacleMotion, PlaneObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import Fields
from mlsanm_cli.solve.functionals import contact_values, platen_displacements, slave_arc
from mlsanm_cli.solve.state import State

MAX_NEIGHBOR_DISTANCE = 3.0
"""Contact nodes are neighbours up to this distance, relative to the mean of their weights (lengths)."""
CIRCLE_POINTS = 181
PLANE_LENGTH = 0.75
"""Length of a plane to both sides, in diameters of the scene."""
NEAREST_EDGES = 8


def contact_lines(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], shown: Mapping[str, Fields]
) -> dict[str, VtuPart]:
    """The slave surfaces of all contacts in one state, moved as the bodies are ``shown`` on ``clouds``."""
    return {
        pairing.name: _contact(built, pairing, state, clouds[pairing.slave_body], shown)
        for pairing in built.condensed.pairings
    }


def obstacle_lines(built: CondensedScene, state: State) -> dict[str, VtuPart]:
    """The rigid obstacles in one state, by the contact that they belong to."""
    moved = platen_displacements(built, state)
    points = np.concatenate([body.model.cloud.points for body in built.scene.bodies.values()])
    lines = {}
    for name, (places, edges) in obstacles(built.case, points.min(axis=0), points.max(axis=0)).items():
        shift = obstacle_shift(built.case, name, moved)
        lines[name] = VtuPart(places, edges, {"displacement": np.tile(shift, (len(places), 1))})
    return lines


def obstacles(case: Case, low: FloatArray, high: FloatArray) -> dict[str, tuple[FloatArray, IntArray]]:
    """Points (k, 2) and pairs of neighbours (e, 2) of the obstacle of every contact before loading. Planes
    are drawn with a length relative to the scene, whose box is from ``low`` (2,) to ``high`` (2,)."""
    return {
        contact.name: _drawn(contact.obstacle, low, high)
        for contact in case.contact
        if contact.obstacle is not None
    }


def obstacle_shift(case: Case, contact: str, moved: Mapping[str, FloatArray]) -> FloatArray:
    """Displacement (2,) of an obstacle, from the displacements ``moved`` by load, which are all equal."""
    names = [load.name for load in case.load if isinstance(load, ObstacleMotion) and load.obstacle == contact]
    return next((moved[name] for name in names if name in moved), np.zeros(2))


def _contact(
    built: CondensedScene, pairing: Pairing, state: State, cloud: Cloud, shown: Mapping[str, Fields]
) -> VtuPart:
    record = contact_values(built, pairing, state)
    chosen = pairing.candidate
    points = pairing.points[pairing.candidate]
    normal, tangent = pairing.normal[chosen], pairing.tangent[chosen]
    data = contact_data(record, slave_arc(pairing), pairing.name in built.condensed.tangential)
    load = record["pressure"][:, None] * normal + record["traction"][:, None] * tangent
    moved = along_boundary(cloud, shown[pairing.slave_body]["displacement"], points)
    data |= {"displacement": moved, "normal": normal, "contact_stress": load}
    return VtuPart(points, _neighbours(pairing), data)


def contact_data(record: Mapping[str, Any], arc: FloatArray, friction: bool) -> dict[str, NDArray[Any]]:
    """The values of a ``record`` at the nodes of a contact at ``arc`` lengths (c,)."""
    data: dict[str, NDArray[Any]] = {
        "pressure": record["pressure"],
        "traction": record["traction"],
        "gap": record["gap"],
        "status": record["status"].astype(np.int32),
        "arc_length": arc,
    }
    # Without friction the slip is not computed; viewers cannot show nan.
    return data | {"slip": record["slip"]} if friction else data


def _neighbours(pairing: Pairing) -> IntArray:
    """Pairs (e, 2) of candidates of a contact that are adjacent along the surface."""
    chosen = pairing.candidate
    arc, weight, points = pairing.arc[chosen], pairing.weight[chosen], pairing.points[chosen]
    numbers = np.arange(len(arc), dtype=np.int64)
    pairs = np.stack([numbers[:-1], numbers[1:]], axis=1)
    together = np.diff(arc) <= MAX_NEIGHBOR_DISTANCE * 0.5 * (weight[1:] + weight[:-1])
    pairs = pairs[together]
    if pairing.slave.curve.closed and len(arc) > 2:
        across = float(np.hypot(*(points[0] - points[-1])))
        if across <= MAX_NEIGHBOR_DISTANCE * 0.5 * (weight[0] + weight[-1]):
            pairs = np.concatenate([pairs, [[numbers[-1], 0]]])
    return pairs


def along_boundary(cloud: Cloud, values: FloatArray, points: FloatArray) -> FloatArray:
    """Nodal ``values`` (n, c) at ``points`` (m, 2) on the boundary of a cloud, linear between its nodes, as
    on the edges of its triangles."""
    first, last = cloud.edges.T
    start, along = cloud.points[first], cloud.points[last] - cloud.points[first]
    count = min(NEAREST_EDGES, len(start))
    near = cKDTree(start + 0.5 * along).query(points, k=count)[1].reshape(len(points), count)
    offset = points[:, None] - start[near]
    share = (offset * along[near]).sum(axis=2) / (along[near] ** 2).sum(axis=2)
    share = np.clip(share, 0.0, 1.0)
    away = offset - share[..., None] * along[near]
    best = (away**2).sum(axis=2).argmin(axis=1)
    rows = np.arange(len(points))
    edge, part = near[rows, best], share[rows, best][:, None]
    result: FloatArray = (1.0 - part) * values[first[edge]] + part * values[last[edge]]
    return result


def _drawn(obstacle: AnyObstacle, low: FloatArray, high: FloatArray) -> tuple[FloatArray, IntArray]:
    if isinstance(obstacle, PlaneObstacle):
        normal = np.array(obstacle.normal) / np.hypot(*obstacle.normal)
        middle = 0.5 * (low + high)
        foot = middle - ((middle - np.array(obstacle.point)) @ normal) * normal
        reach = PLANE_LENGTH * float(np.hypot(*(high - low))) * np.array([normal[1], -normal[0]])
        points = np.array([foot - reach, foot + reach])
    elif isinstance(obstacle, DiskObstacle):
        angle = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        points = np.array(obstacle.center) + obstacle.radius * ring
    else:
        points = np.array(obstacle.points)
    numbers = np.arange(len(points), dtype=np.int64)
    return points, np.stack([numbers[:-1], numbers[1:]], axis=1)


def sliding_distance(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[Check]:
    """Sliding distance of every contact in a state, over its width; ``displacements`` (n, 2) are those of all
    bodies at the points of ``clouds``."""
    obstacles = {contact.name: contact.obstacle for contact in built.case.contact}
    moved = platen_displacements(built, state)
    for pairing in built.condensed.pairings:
        # Sliding along a plane changes nothing.
        if isinstance(obstacles.get(pairing.name), PlaneObstacle):
            continue
        chosen = pairing.candidate
        closed = contact_values(built, pairing, state)["pressure"] > 0.0
        if not closed.any():
            continue
        own = _at(pairing.points[pairing.candidate][closed], pairing.slave_body, clouds, displacements)
        if pairing.master_body is None:
            other = np.tile(obstacle_shift(built.case, pairing.name, moved), (len(own), 1))
        else:
            partner = pairing.partner[chosen][closed]
            other = _at(partner, pairing.master_body, clouds, displacements)
        slid = float(np.abs(((own - other) * pairing.tangent[chosen][closed]).sum(axis=1)).max())
        width = float(pairing.weight[chosen][closed].sum())
        yield Check(
            "sliding_distance",
            slid / width,
            f"the surfaces of contact {pairing.name} slide along each other by {slid:.3g} at position "
            f"{state.position:.6g}, but the contact is only {width:.3g} wide: at small strain pressures act "
            f"on the points that faced each other initially, an error of this distance on one side",
            'set model.strain = "finite" (material law "saint-venant-kirchhoff" extends the same elasticity)',
            f"contact {pairing.name}",
        )


def _at(
    points: FloatArray, body: str, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> FloatArray:
    """Displacements (e, 2) of a body at the nodes closest to ``points`` (e, 2)."""
    _, found = nearest(cKDTree(clouds[body].points), points, 1)
    return displacements[body][found.reshape(-1)]
