"""Assembly of a body's equations: rows of its nodes and pieces, and their weights.

Weights make all rows strains: equilibrium h/E, traction 1/E, displacement ``HOLD_WEIGHT``/h; they decrease
towards singular corners, notches and holes. The equilibrium of the pieces
(:mod:`mlsanm_cli.mechanics.pieces`) is thousands of times as strong. Equation (2) of docs/method.md."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from types import MappingProxyType

import numpy as np
import scipy.sparse as sparse
from scipy.spatial import cKDTree

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.cloud.cells import Halves
from mlsanm_cli.cloud.cloud import Cloud, nearest
from mlsanm_cli.cloud.sight import SMOOTH_TURN
from mlsanm_cli.mechanics.body import BodyEquations, ElasticBody, first_rows
from mlsanm_cli.mechanics.body_model import BodyModel
from mlsanm_cli.mechanics.elasticity import first_order_rows, moduli_of, traction_moduli
from mlsanm_cli.mechanics.pieces import Pieces, rule_of
from mlsanm_cli.mechanics.rigid import FreeSystem, free_motions, pins
from mlsanm_cli.mechanics.supports import (
    FREE,
    MIN_DISTANCE,
    NO_SPRING,
    ONE_SIDED_WEIGHT,
    POWER,
    WEIGHT_REACH,
    Held,
    Springs,
    corner_weight,
    reentrant_corners,
    restrained,
    thickness,
)
from mlsanm_cli.memo import digest
from mlsanm_cli.operators import least_squares
from mlsanm_cli.operators.factors import LinearSolver, structure
from mlsanm_cli.operators.least_squares import Strong
from mlsanm_cli.operators.stencil_weights import nodal_pairs, nodal_rows
from mlsanm_cli.operators.system import LinearSystem

HOLD_WEIGHT = 5.0
"""Weight of held displacements."""


def assemble(
    model: BodyModel,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    solver: LinearSolver,
    springs: Springs = MappingProxyType({}),
    touching: Collection[str] = (),
    unloaded: int = 0,
) -> ElasticBody:
    """Choose the conditions of every surface and set up the rows.

    ``held`` are the surfaces with held components, ``held_nodes`` (node, component) pairs held at zero, the
    last ``unloaded`` of which only fix the position and take no force from their pieces. Components with
    ``springs`` have the row sigma n + k u. A body with free rigid motions is pinned, which affects nothing
    but these motions. ``touching`` are the surfaces in contact.
    """
    cloud, material = model.cloud, model.material
    free = free_motions(cloud, held, held_nodes, springs)
    single = [*held_nodes, *pins(cloud.points, free)]
    first_row, total = first_rows(cloud)
    total += len(single)
    restraints = restrained(held, springs, cloud, material)
    # In nearly incompressible plane bodies, pairs would make nodal pressures alternate.
    unpaired = material.nearly_incompressible and not cloud.revolved
    pieces = Pieces(cloud, () if unpaired else touching, restraints)
    count = total + 3 * pieces.count
    # Computed on first use, by the equations or for the body's forces.
    loads = cache(partial(pieces.loads, first_row, count, restraints))
    pulls = spring_rows(cloud, springs, total)
    whole = sparse.csr_array(_rows(model, held, single) + pulls)
    indptr, indices = structure(whole)
    rows = sparse.csr_array((whole.data, indices, indptr), shape=whole.shape)
    weight = row_weights(model, held, single, springs, restraints, touching)
    known = pieces.rows_known(list(held_nodes[: len(held_nodes) - unloaded]))

    def factorise() -> LinearSystem:
        """The system with the equilibrium of the pieces as strong rows, strains times their strength, zero
        where forces are not known. The rows are weighted in place: they are the largest array."""
        some = np.asarray(known.reshape(3, -1).any(axis=0))
        lines = pieces.fluxes(model.stress_around, restraints, rule_of(model), some)
        if pulls.nnz:
            # A spring row prescribes the sum of traction and spring force.
            lines = lines + loads()[:, :total] @ pulls
        strength = pieces.strengths_of(material) / (material.modulus * pieces.size)
        scale = np.where(known, np.tile(strength, 3), 0.0)
        lines, on_pieces = (sparse.csr_array(sparse.diags_array(scale) @ part) for part in (lines, loads()))
        rows.data *= np.repeat(weight, np.diff(rows.indptr))
        node = [np.flatnonzero(level >= 0) for level in pieces.levels]
        piece = np.concatenate([level[some] for level, some in zip(pieces.levels, node, strict=True)])
        times, at = np.bincount(piece, minlength=pieces.count), cloud.points[np.concatenate(node)]
        sums_of = [np.bincount(piece, values, pieces.count) for values in at.T]
        places = np.stack(sums_of, axis=1) / np.maximum(times, 1)[:, None]
        unscaled = sparse.diags_array(1.0 / np.where(scale > 0.0, scale, 1.0))
        sums = sparse.csr_array(pieces.sums(known) @ unscaled)
        strong = Strong(lines, on_pieces, np.tile(np.arange(pieces.count), 3), places, sums)
        return least_squares.factorise(rows, weight, cloud.points, solver, strong)

    # Of the input of the rows, which are many times as large. Points between nodes tell of the curves.
    curves = [surface.curve.points(Halves.of(surface).arc) for surface in cloud.surfaces.values()]
    kind = [cloud.content, material.stiffness, material.flows, model.settings]
    chosen = [held, held_nodes, springs, solver, sorted(touching), unloaded]
    content = digest(kind, weight, curves, chosen)
    equations = BodyEquations(content, factorise)
    body = ElasticBody(model, held, springs, free, count, pieces, loads, equations, tuple(held_nodes))
    if not free.components:
        return body
    unpinned = partial(FreeSystem, body, single[len(held_nodes) :])
    return replace(body, equations=BodyEquations(content, unpinned))


def node_rows(body: ElasticBody) -> sparse.csr_array:
    """The rows (r, 2N) of a body's nodes: equilibrium, conditions of surfaces, single held components."""
    cloud = body.model.cloud
    pulls = spring_rows(cloud, body.springs, first_rows(cloud)[1] + len(body.held_nodes))
    return sparse.csr_array(_rows(body.model, body.held, body.held_nodes) + pulls)


def _rows(
    model: BodyModel, held: Mapping[str, tuple[bool, bool]], single: Sequence[tuple[int, int]]
) -> sparse.csr_array:
    """All rows (r, 2N), without springs."""
    equilibrium = [model.equilibrium(component) for component in (0, 1)]

    def traction(name: str, component: int) -> FloatArray:
        surface, cloud = model.cloud.surfaces[name], model.cloud
        moduli = moduli_of(model.material.stiffness, cloud.radius(cloud.points[surface.index]))
        return traction_moduli(moduli, surface.normal, component)

    return rows_of_nodes(model, held, equilibrium, traction, single_rows(single, len(model.cloud.points)))


def single_rows(
    single: Sequence[tuple[int, int]], nodes: int, turned: int = 0, angle: float = 0.0
) -> sparse.csr_array:
    """Rows (s, 2N) of displacements of ``single`` nodes, the last ``turned`` rotated by ``angle``."""
    directions, last = np.eye(2)[[component for _, component in single]].reshape(-1, 2), len(single) - turned
    cos, sin = np.cos(angle), np.sin(angle)
    directions[last:] = directions[last:] @ np.array([[cos, sin], [-sin, cos]])
    rows = nodal_pairs(np.array([node for node, _ in single], dtype=np.int64), directions, nodes)
    rows.eliminate_zeros()
    return rows


def rows_of_nodes(
    model: BodyModel,
    held: Held,
    equilibrium: Sequence[sparse.csr_array],
    traction: Callable[[str, int], FloatArray],
    single: sparse.csr_array,
) -> sparse.csr_array:
    """Rows (r, 2N): ``equilibrium`` in x and y, conditions of surfaces, and ``single`` nodes. Components not
    ``held`` have the ``traction`` of a surface and component, as for :func:`first_order_rows`."""
    blocks, count = list(equilibrium), len(model.cloud.points)
    for name, surface in model.cloud.surfaces.items():
        stencils = model.stencils.take(surface.index)
        for component in (0, 1):
            if held.get(name, FREE)[component]:
                blocks.append(nodal_rows(surface.index, component, count))
            else:
                blocks.append(first_order_rows(stencils, traction(name, component)))
    return sparse.csr_array(sparse.vstack([*blocks, single], format="csr"))


def spring_rows(cloud: Cloud, springs: Springs, rows: int) -> sparse.csr_array:
    """Contribution (r, 2N) of springs to the r ``rows``."""
    pulls, first_row = sparse.csr_array((rows, 2 * len(cloud.points))), first_rows(cloud)[0]
    for name, stiffness in springs.items():
        index = cloud.surfaces[name].index
        for component, spring in enumerate(stiffness):
            at = first_row[name] + component * len(index) + np.arange(len(index))
            entries = (np.full(len(index), spring), (at, 2 * index + component))
            pulls = pulls + sparse.csr_array(entries, shape=pulls.shape)
    return pulls


def row_weights(
    model: BodyModel,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    springs: Springs,
    restraints: Held,
    touching: Collection[str] = (),
) -> FloatArray:
    """Weights (r,) of the rows in the least-squares sum; stresses are singular where ``restraints`` end, but
    next to surfaces ``touching``. Equilibrium and tractions have the factors of :func:`corner_weight` and of
    min(1, (distance + radius) / thickness)^POWER, with the distance from the nearest reentrant corner, of
    radius 0, or concave part of the outline (:mod:`mlsanm_cli.mechanics.supports`)."""
    cloud, modulus = model.cloud, model.material.modulus
    corners = reentrant_corners(cloud)
    if model.tips is not None:
        # Without singular functions: all but isolated ones between free faces.
        bound = [cloud.surfaces[name].index for name, axes in restraints.items() if any(axes)]
        away = np.abs(cloud.points[corners][:, None] - model.tips.place).sum(axis=2).min(axis=1)
        corners = corners[np.isin(corners, np.concatenate([corners[:0], *bound])) | (away > 0.0)]
    restraints = {name: axes for name, axes in restraints.items() if not cloud.on_axis(cloud.surfaces[name])}
    corner = corner_weight(cloud, restraints, springs, touching)
    size = cloud.room
    if len(corners):
        away = nearest(cKDTree(cloud.points[corners]), cloud.points)[0]
        size = np.minimum(size, np.maximum(away, MIN_DISTANCE * cloud.spacing))
    factor = corner * np.minimum(size / thickness(cloud), 1.0) ** POWER
    inside = np.ones(len(cloud.points))
    if model.settings.narrows:
        # Less at boundary nodes, but not near sharp corners and where fields may be singular.
        nodes = cloud.boundary_nodes
        sharp = [node for node, turn, _ in cloud.corners if abs(turn) > SMOOTH_TURN]
        away = corner[nodes] ** (1.0 / POWER)
        if len(sharp):
            distance = nearest(cKDTree(cloud.points[sharp]), cloud.points[nodes])[0]
            away = np.minimum(away, distance / (WEIGHT_REACH * thickness(cloud)))
        inside[nodes] -= (1.0 - ONE_SIDED_WEIGHT) * away
    weights = [factor * inside * cloud.spacing / modulus] * 2
    for name, surface in cloud.surfaces.items():
        spacing = cloud.spacing[surface.index]
        # A node at the end of a surface represents half a spacing of it.
        traction = factor[surface.index] * np.sqrt(surface.weight / spacing)
        for component, holds in enumerate(held.get(name, FREE)):
            # A stiff spring counts as a hold.
            stiffness = modulus + springs.get(name, NO_SPRING)[component] * (spacing / HOLD_WEIGHT)
            weights.append(HOLD_WEIGHT / spacing if holds else traction / stiffness)
    single = np.array([node for node, _ in held_nodes], dtype=np.int64)
    return np.concatenate([*weights, HOLD_WEIGHT / cloud.spacing[single]])
