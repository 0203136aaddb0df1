"""Contacts at small strain: their figures, their surfaces and obstacles as lines, and how far they slide.

Contact partners are those of the undeformed state: if they slide by a considerable part of the contact's
width, other points touch, and pressures are reported at points that have moved.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.checks.states import diagnose, node_fields, worst_nodes
from mlsanm_cli.app.output.parts import contact_figures, contact_part, obstacle_shift, obstacles, vtu_states
from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.case import PlaneObstacle
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.cloud.revolution import at_axis
from mlsanm_cli.cloud.search import nearest
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import fields_of
from mlsanm_cli.solve.functionals import contact_values, platen_displacements, slave_arc
from mlsanm_cli.solve.state import Fields, State

MAX_NEIGHBOR_DISTANCE = 3.0
"""Contact nodes are neighbours up to this distance, relative to the mean of their weights (lengths)."""
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


def _contact(
    built: CondensedScene, pairing: Pairing, state: State, cloud: Cloud, shown: Mapping[str, Fields]
) -> VtuPart:
    record = contact_values(built, pairing, state)
    chosen = pairing.candidate
    points = pairing.points[pairing.candidate]
    normal, tangent = pairing.normal[chosen], pairing.tangent[chosen]
    load = record["pressure"][:, None] * normal + record["traction"][:, None] * tangent
    moved = along_boundary(cloud, shown[pairing.slave_body]["displacement"], points)
    return contact_part(
        *(points, _neighbours(pairing), record, pairing.name in built.condensed.tangential),
        arc_length=slave_arc(pairing),
        displacement=moved,
        normal=normal,
        contact_stress=load,
    )


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


def sliding_distance(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[Check]:
    """Sliding distance of every contact in a state, over its width; ``displacements`` (n, 2) are those of all
    bodies at the points of ``clouds``."""

    def at(points: FloatArray, body: str) -> FloatArray:
        _, found = nearest(cKDTree(clouds[body].points), points, 1)
        return displacements[body][found.reshape(-1)]

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
        own = at(pairing.points[chosen][closed], pairing.slave_body)
        if pairing.master_body is None:
            other = np.tile(obstacle_shift(built.case, pairing.name, moved), (len(own), 1))
        else:
            other = at(pairing.partner[chosen][closed], pairing.master_body)
        slid = float(np.abs(((own - other) * pairing.tangent[chosen][closed]).sum(axis=1)).max())
        width, place = float(pairing.weight[chosen][closed].sum()), f"contact {pairing.name}"
        message = (
            f"the surfaces of {place} slide along each other by {slid:.3g} at position "
            f"{state.position:.6g}, but the contact is only {width:.3g} wide: at small strain pressures act "
            f"on the points that faced each other initially, an error of this distance on one side"
        )
        law = 'material law "saint-venant-kirchhoff" extends the same elasticity'
        hint = f'set model.strain = "finite" ({law})'
        yield Check("sliding_distance", slid / width, message, hint, place)


def contact_summary(built: CondensedScene, pairing: Pairing, state: State) -> dict[str, Any]:
    """The figures of a contact, with those of the reference solution if the case has one."""
    values = contact_values(built, pairing, state)
    pressure, force = values["pressure"], built.condensed.quantities["contact"][pairing.name](*state.unknowns)
    if pairing.bonded:
        return {
            "peak_pressure": float(pressure.max(initial=0.0)),
            "peak_tension": float(-pressure.min(initial=0.0)),
            "peak_traction": float(np.abs(values["traction"]).max(initial=0.0)),
            "force": force.tolist(),
            "closed_nodes": len(pressure),
            "stick_nodes": len(pressure),
        }
    axis = at_axis(pairing.points[pairing.candidate], built.case.model.revolved)
    figures = contact_figures(values, slave_arc(pairing), pressure, force, axis)
    profile = reference_profile(built, pairing, state)
    if profile is not None:
        figures["reference"] = {
            "solution": built.case.reference.solution if built.case.reference else None,
            "peak_pressure": profile.peak,
            "half_width": profile.half_width,
            "pressure_error_l2": profile.error_l2,
        }
    return figures


def worst_state(
    built: CondensedScene, state: State, nodes: Mapping[str, Cloud]
) -> tuple[Sequence[VtuPart], dict[str, Any]]:
    """The bodies in the ``state`` of a failed run with residuals of contact nodes, and the worst nodes."""
    cause = diagnose(built, state)
    fields, _ = fields_of(built, [state], stress=True)[0]
    bodies = vtu_states(nodes, fields, ("displacement", "stress", "von_mises"))
    if len(cause["residual"]):
        more = node_fields(built, cause)
        bodies = {name: body._replace(data={**body.data, **more[name]}) for name, body in bodies.items()}
    return list(bodies.values()), {"position": state.position, "worst_nodes": worst_nodes(built, cause)}
