"""Error estimate of the largest stress on the free boundary of every body: least squares satisfies traction
conditions there approximately, and the difference is an error of the stress."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray, IntArray, runs_of
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.body import ElasticBody
from mlsanm_cli.mechanics.elasticity import traction_of
from mlsanm_cli.mechanics.near_field import as_real
from mlsanm_cli.mechanics.supports import FREE, NO_SPRING, reentrant_corners, thickness
from mlsanm_cli.roundoff import FINE_ROUND_OFF, ROUND_OFF
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Fields, State

NEIGHBORHOOD = 3.2
"""Nodes within so many spacings are in the neighbourhood of a node."""
BESIDE_GRID = 1.0
"""The same beside contacts with contact grids, which end between two nodes."""
SINGULAR_DISTANCE = 0.25
"""Distance from singular stresses, relative to a body's thickness, within which peaks are not evaluated."""
MIN_PEAK_SHARE = 0.2
"""Peaks below this part of the largest stress in the body, contacts included, are omitted."""
RIGHT_ANGLE_COSINE = 0.2
"""Product of normals below which a face is at a right angle to a plane of symmetry."""
STRAIGHT_COSINE = 0.999
"""Product of normals above which two surfaces continue each other."""


def boundary_peaks(
    built: CondensedScene, state: State, fields: Mapping[str, Fields]
) -> dict[str, dict[str, Any]]:
    """Largest von Mises ``stress`` on the free boundary of every body, its ``place``, its relative ``error``,
    and the stress ``at_contact`` where that is larger."""
    peaks, bodies = {}, built.scene.bodies
    largest = max(  # stress scale of the displacements over the sizes of the bodies
        float(body.model.material.modulus * np.abs(fields[name]["displacement"]).max())
        / float(np.ptp(body.model.cloud.points, axis=0).max())
        for name, body in bodies.items()
    )
    for name, body in bodies.items():
        factors, *others = state.unknowns
        source = built.condensed.source(name, *state.unknowns).toarray()[:, 0]
        missing = traction_error(body, fields[name]["rest"], source) * along_over_across(body)
        # The remainder of near fields of contacts on other sides is no load.
        alone = built.condensed.source(name, factors, *map(np.zeros_like, others)).toarray()[:, 0]
        applied = np.zeros(len(missing))
        for surface, traction in _given(body, fields[name]["displacement"], alone).items():
            np.maximum.at(applied, body.model.cloud.surfaces[surface].index, np.hypot(*traction.T))
        unbounded, touching = _left_out(built, state, name)
        stress, cloud, nodes = fields[name]["von_mises"], body.model.cloud, body.model.cloud.boundary_nodes
        bounded = np.ones(len(stress), dtype=bool)
        bounded[_near(cloud, unbounded, SINGULAR_DISTANCE * thickness(cloud), NEIGHBORHOOD)] = False
        free = bounded & ~(applied > stress)
        near = {reach: _near(cloud, places, 0.0, reach) for reach, places in touching.items()}
        for spoiled in near.values():
            free[spoiled] = False
        reach = NEIGHBORHOOD * cloud.spacing[nodes]
        around = cKDTree(cloud.points[nodes]).query_ball_point(cloud.points[nodes], reach)
        least = MIN_PEAK_SHARE * float(stress[bounded].max(initial=0.0))
        tops = {
            node: float(stress[node] + missing[nodes[place]].max())
            for node, place in zip(nodes.tolist(), around, strict=True)
            if free[node] and stress[node] > least and stress[node] >= stress[nodes[place]].max()
        }
        # Of equal peaks the first.
        highest = (1.0 - ROUND_OFF) * max(tops.values(), default=0.0)
        worst = next((node for node, top in tops.items() if top >= highest), None)
        if worst is None or not stress[worst] > FINE_ROUND_OFF * largest:
            continue
        least = FINE_ROUND_OFF * thickness(cloud)
        x, y = (value if abs(value) > least else 0.0 for value in cloud.points[worst].tolist())
        error = tops[worst] / float(stress[list(tops)].max()) - 1.0
        peaks[name] = {"stress": float(stress[worst]), "place": (x, y), "error": error}
        at_contact = np.intersect1d(near[BESIDE_GRID], nodes[bounded[nodes]])
        if (highest := float(stress[at_contact].max(initial=0.0))) > stress[worst]:
            peaks[name]["at_contact"] = highest
    return peaks


def traction_error(body: ElasticBody, displacement: FloatArray, source: FloatArray) -> FloatArray:
    """Traction error (n,) of a ``displacement`` (N, 2) for a right-hand side ``source`` (r,); 0 inside and
    where held. Where a load ends on a side that continues half of the jump is no error."""
    cloud = body.model.cloud
    missing = np.zeros(len(cloud.points))
    stress, given = body.model.stress(displacement), _given(body, displacement, source)
    for name, surface in cloud.surfaces.items():
        free = ~np.array(body.held.get(name, FREE))
        apart = traction_of(stress[surface.index], surface.normal) * free - given[name]
        np.maximum.at(missing, surface.index, np.hypot(*apart.T))
    for name, one in cloud.surfaces.items():
        for after, other in cloud.surfaces.items():
            joined = not one.curve.closed and one.index[-1] == other.index[0]
            if joined and one.normal[-1] @ other.normal[0] > STRAIGHT_COSINE:
                jump = 0.5 * np.hypot(*(given[name][-1] - given[after][0]))
                missing[other.index[0]] = max(missing[other.index[0]] - jump, 0.0)
    return missing


def _given(body: ElasticBody, displacement: FloatArray, source: FloatArray) -> dict[str, FloatArray]:
    """Prescribed tractions (b, 2) of a right-hand side and springs on all surfaces; 0 where held."""
    tractions = {}
    for name, surface in body.model.cloud.surfaces.items():
        rows = [body.condition_rows(name, axis) for axis in (0, 1)]
        pulled = displacement[surface.index] * body.springs.get(name, NO_SPRING)
        free = ~np.array(body.held.get(name, FREE))
        tractions[name] = (source[np.stack(rows, axis=1)] - pulled) * free
    return tractions


def along_over_across(body: ElasticBody) -> FloatArray:
    """Stiffness along the boundary over that across, at least 1 (n,): stress errors over traction errors."""
    stiffness = body.model.material.in_plane
    compliance, ratio = np.linalg.inv(stiffness), np.ones(len(body.model.cloud.points))
    for surface in body.model.cloud.surfaces.values():
        x, y = surface.normal.T
        across, along = np.stack([x * x, y * y, 2.0 * x * y]), np.stack([y * y, x * x, -x * y])
        stiffer = np.einsum("in,ij,jn,kn,kl,ln->n", across, stiffness, across, along, compliance, along)
        np.maximum.at(ratio, surface.index, 1.0 / stiffer)
    return ratio


def _near(cloud: Cloud, places: FloatArray, radius: float, spacings: float) -> IntArray:
    """Nodes within a ``radius`` of the ``places`` (s, 2), but at least so many ``spacings``."""
    if not len(places):
        return np.zeros(0, dtype=np.int64)
    reach = np.maximum(radius, spacings * cloud.spacing[cloud.tree.query(places)[1]])
    return np.unique(np.concatenate(cloud.tree.query_ball_point(places, reach))).astype(np.int64)


def _left_out(
    built: CondensedScene, state: State, name: str
) -> tuple[FloatArray, Mapping[float, FloatArray]]:
    """Places of a body with unbounded stress (s, 2), and clamped, touching or bonded ones (t, 2) by the
    spacings around them in which stresses are spoiled."""
    body, none = built.scene.bodies[name], np.zeros((0, 2))
    cloud, surfaces = body.model.cloud, body.model.cloud.surfaces
    nodes = [node for node, _ in body.held_nodes]
    nodes += reentrant_corners(cloud).tolist()
    # Ends of held surfaces other than planes of symmetry.
    for before, one in surfaces.items():
        for after, other in surfaces.items():
            if one.curve.closed or one.index[-1] != other.index[0]:
                continue
            first, second = (sum(body.restrained.get(surface, FREE)) for surface in (before, after))
            beyond = one.normal[-1] @ other.normal[0] > RIGHT_ANGLE_COSINE
            if first != second and (max(first, second) == 2 or beyond):
                nodes.append(int(other.index[0]))
    unbounded = [cloud.points[np.array(nodes, dtype=np.int64)]]
    touching = {NEIGHBORHOOD: [none], BESIDE_GRID: [none]}
    for surface, axes in body.restrained.items():
        if all(axes):
            touching[NEIGHBORHOOD].append(cloud.points[surfaces[surface].index])
    for pairing in built.condensed.reported:
        for slave in (slave for owner, slave, _ in pairing.sides if owner == name):
            there = (pairing.points if slave else pairing.partner)[pairing.candidate]
            if pairing.bonded:
                unbounded.append(there[[0, -1]])
                touching[NEIGHBORHOOD].append(there)
                continue
            closed = state.closed[built.condensed.spans[pairing.name]]
            if pairing.nodal:
                touching[NEIGHBORHOOD].append(there[closed])
                continue
            # A hat ends at the node beyond the one after it.
            for first, last in pairing.grid.hats.nodes[runs_of(closed) + np.array([0, 1])].tolist():
                s = np.linspace(first, last, 2 + int((last - first) / float(cloud.spacing.min())))
                touching[BESIDE_GRID].append(as_real(pairing.grid.facing.side(s, slave)[0]))
    return np.concatenate(unbounded), {key: np.concatenate(listed) for key, listed in touching.items()}
