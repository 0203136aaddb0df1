"""Contacts at small strain: their figures, their surfaces as lines, how far they slide, the worst nodes of a
failed state, and finer points below them at which fields are written: the largest stress lies a part of the
contact's width below the surface, where the cloud may have no node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.app.checks.check import Check
from mlsanm_cli.app.checks.references import reference_profile
from mlsanm_cli.app.output.parts import contact_figures, contact_part, obstacle_shift, vtu_states
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import spacing_of
from mlsanm_cli.arrays import FloatArray, runs_of
from mlsanm_cli.case import PlaneObstacle
from mlsanm_cli.cloud.cloud import Cloud, at_axis, nearest
from mlsanm_cli.cloud.spacing import Zone, build_cloud
from mlsanm_cli.contact.geometry.pairing import Pairing
from mlsanm_cli.io.vtu import VtuPart
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.memo import Memo
from mlsanm_cli.records import dataclass
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.fields import contact_values, fields_of, platen_displacements, slave_arc
from mlsanm_cli.solve.state import Fields, State

MAX_NEIGHBOR_DISTANCE = 3.0
"""Contact nodes are neighbours up to this distance, relative to the mean of their weights (lengths)."""
PER_HALF_WIDTH = 12.0
"""Points over the half-width of a contact patch."""
FINE_RADIUS, GROWTH = 1.5, 0.25
"""Radius of the fine zone in half-widths, and growth of the spacing beyond it."""
MAX_PATCHES = 12
"""Largest number of patches of a contact with fine points, the widest first."""
MIN_REFINEMENT = 0.7
"""Zones whose spacing is above this part of that of the cloud are omitted."""


def contact_lines(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], shown: Mapping[str, Fields]
) -> dict[str, VtuPart]:
    """The slave surfaces of all contacts in one state, moved as the bodies are ``shown`` on ``clouds``."""
    lines = {}
    for pairing in built.condensed.pairings:
        record, chosen, body = contact_values(built, pairing, state), pairing.candidate, pairing.slave_body
        points, normal, tangent = pairing.points[chosen], pairing.normal[chosen], pairing.tangent[chosen]
        # Candidates that are adjacent along the surface.
        arc, weight = pairing.arc[chosen], pairing.weight[chosen]
        numbers = np.arange(len(arc), dtype=np.int64)
        pairs = np.stack([numbers, np.roll(numbers, -1)], axis=1)
        apart = np.append(np.diff(arc), np.hypot(*(points[:1] - points[-1:]).T))
        near = apart <= MAX_NEIGHBOR_DISTANCE * 0.5 * (np.roll(weight, -1) + weight)
        near[-1:] &= pairing.slave.curve.closed and len(arc) > 2
        lines[pairing.name] = contact_part(
            *(points, pairs[near], record, pairing.name in built.condensed.tangential),
            arc_length=slave_arc(pairing),
            displacement=along_boundary(clouds[body], shown[body]["displacement"], points),
            normal=normal,
            contact_stress=record["pressure"][:, None] * normal + record["traction"][:, None] * tangent,
        )
    return lines


def along_boundary(cloud: Cloud, values: FloatArray, points: FloatArray) -> FloatArray:
    """Nodal ``values`` (n, c) at ``points`` (m, 2) on the boundary of a cloud, linear between its nodes."""
    first, last = cloud.edges.T
    start, along = cloud.points[first], cloud.points[last] - cloud.points[first]
    count = min(8, len(start))
    near = cKDTree(start + 0.5 * along).query(points, k=count)[1].reshape(len(points), count)
    offset = points[:, None] - start[near]
    share = np.clip((offset * along[near]).sum(axis=2) / (along[near] ** 2).sum(axis=2), 0.0, 1.0)
    away = offset - share[..., None] * along[near]
    best = (away**2).sum(axis=2).argmin(axis=1)
    rows = np.arange(len(points))
    edge, part = near[rows, best], share[rows, best][:, None]
    return np.asarray((1.0 - part) * values[first[edge]] + part * values[last[edge]])


def sliding_distance(
    built: CondensedScene, state: State, clouds: Mapping[str, Cloud], displacements: Mapping[str, FloatArray]
) -> Iterator[Check]:
    """Sliding distance of every contact in a state over its width, from the ``displacements`` (n, 2) of all
    bodies at the points of ``clouds``: contact partners are those of the undeformed state."""

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
    """The bodies in the ``state`` of a failed run, and the worst nodes.

    Contact nodes have the ``residual`` of the exact laws relative to peak pressure and elastic gap,
    ``cone_ratio``, the traction over its limit (nan without friction), and ``worst``, the rank from 1, or 0;
    other nodes have nan.
    """
    condensed, pressure, gap = built.condensed, state.pressure, state.gap
    rough, fields = condensed.friction_nodes, fields_of(built, [state], stress=True)[0][0]
    bodies = vtu_states(nodes, fields, ("displacement", "stress", "von_mises"))
    if not len(pressure):
        return list(bodies.values()), {"position": state.position, "worst_nodes": []}
    peak, elastic = float(np.abs(pressure).max()) or 1.0, condensed.elastic_gap(pressure) or 1.0
    limit, traction = condensed.friction * np.maximum(pressure[rough], 0.0), np.abs(state.traction)
    ratio, beyond = np.full(len(pressure), np.nan), np.zeros(len(pressure))
    ratio[rough] = np.divide(traction, limit, out=np.full(len(limit), np.nan), where=limit > 0.0)
    beyond[rough] = np.maximum(traction - limit, 0.0)
    violations = (
        np.abs(condensed.gap(*state.unknowns) - gap) / elastic,
        np.maximum(-gap, 0.0) / elastic,
        np.maximum(-pressure, 0.0) / peak,
        beyond / peak,
        np.minimum(np.abs(pressure) / peak, np.abs(gap) / elastic),
    )
    residual = np.max(violations, axis=0)
    values = {"residual": residual, "pressure": pressure, "gap": gap, "cone_ratio": ratio}
    # nan first.
    worst = np.argsort(-np.nan_to_num(residual, nan=np.inf), kind="stable")[:10].tolist()
    rank = np.zeros(len(residual))
    rank[worst] = 1.0 + np.arange(len(worst))
    owners = [(one, node) for one in condensed.pairings for node in np.flatnonzero(one.candidate)]
    rows = [
        {"contact": one.name, **dict(zip("xy", one.points[node].tolist(), strict=True))}
        | {name: float(figure[k]) for name, figure in values.items()}
        for k, (one, node) in ((k, owners[k]) for k in worst)
    ]
    data = {
        body: {**part.data, "worst": np.zeros(len(part.points))}
        | {name: np.full(len(part.points), np.nan) for name in values}
        for body, part in bodies.items()
    }
    for pairing in condensed.nodal:
        # A node of several contacts shows the one with the larger residual.
        there, own = data[pairing.slave_body], pairing.node[pairing.candidate]
        span = condensed.spans[pairing.name]
        worse = ~(residual[span] <= there["residual"][own])
        for name, figure in (*values.items(), ("worst", rank)):
            there[name][own[worse]] = figure[span][worse]
    parts = [part._replace(data=data[body]) for body, part in bodies.items()]
    return parts, {"position": state.position, "worst_nodes": rows}


@dataclass(frozen=True)
class View:
    """The points of a ``cloud`` at which the fields of a body of a ``model`` are written."""

    model: BodyModel
    cloud: Cloud

    @cached_property
    def rows(self) -> sparse.csr_array:
        """Displacement x and y and stresses xx, yy, xy at the points (5e, 2N), quantity by quantity."""
        return self.model.probe_rows(self.cloud.points)

    @cached_property
    def values(self) -> sparse.csr_array:
        """A nodal field at the points (e, n)."""
        return self.model.field_rows(self.cloud.points)


def finer_views(built: CondensedScene, boundaries: Boundaries, memo: Memo) -> dict[str, View]:
    """Finer points for bodies whose clouds are too coarse for their contact patches at the ends of stages.
    Scenes with the same patches share them by the ``memo``."""
    condensed, finer = built.condensed, {}
    for body in (body for body in built.case.body if not body.has_nodes):
        model, zones = built.scene.bodies[body.name].model, list[Zone]()
        for pairing in (one for one in condensed.on_grids if body.name in one.bodies):
            closed = np.any([state.closed[condensed.spans[pairing.name]] for state in built.ends], axis=0)
            # A hat ends at the node beyond the one after it.
            patches = pairing.grid.hats.nodes[runs_of(closed) + np.array([0, 1])]
            patches = patches[np.argsort(patches[:, 0] - patches[:, 1], kind="stable")][:MAX_PATCHES]
            for slave in (slave for owner, slave, _ in pairing.sides if owner == body.name):
                for first, last in patches.tolist():
                    half, s = 0.5 * (last - first), np.array([0.5 * (first + last)])
                    middle = pairing.grid.facing.side(s, slave)[0][0]
                    point = (float(middle.real), float(middle.imag))
                    nearest = min(model.cloud.tree.query(point)[1], len(model.cloud.points) - 1)
                    if half / PER_HALF_WIDTH < MIN_REFINEMENT * model.cloud.spacing[nearest]:
                        zones.append(Zone.around(point, half / PER_HALF_WIDTH, FINE_RADIUS * half, GROWTH))
        if zones:
            spacing = spacing_of(boundaries, body).with_zones(tuple(zones))
            cloud = build_cloud(boundaries.outline(body.name), spacing, body.seed, memo=memo)
            finer[body.name] = memo.value("view", (model, cloud), partial(View, model, cloud))
    return finer
