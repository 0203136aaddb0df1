"""A body's equations from the conditions on its surfaces: rows, their weights, sums of them.

Least squares takes all rows. Weights: equilibrium h/E, traction 1/E, displacement ``HOLD``/h, which makes all
rows strains; towards singular corners, notches and holes they are lowered. The square schemes choose among
the rows (:mod:`mlsanm_cli.mechanics.equations`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np
import scipy.sparse as sparse

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.cloud.cloud import Cloud
from mlsanm_cli.mechanics.body import BodyModel, ElasticBody
from mlsanm_cli.mechanics.corners import corner_weight, inward_weight
from mlsanm_cli.mechanics.deferred import Equations, Timed
from mlsanm_cli.mechanics.elasticity import traction_rows
from mlsanm_cli.mechanics.equations import RowTable, choose_equations
from mlsanm_cli.mechanics.force_sums import ForceSums
from mlsanm_cli.mechanics.halves import even_motions, fold_of
from mlsanm_cli.mechanics.rigid import FreeSystem, free_motions, pins
from mlsanm_cli.mechanics.springs import Held, Springs, gripped, stiffest_soft
from mlsanm_cli.memo import digest
from mlsanm_cli.operators import least_squares, square
from mlsanm_cli.operators.folded import Fold, Folded
from mlsanm_cli.operators.linear.interface import DirectSolver
from mlsanm_cli.operators.rows import nodal_rows
from mlsanm_cli.operators.structure import compact
from mlsanm_cli.operators.system import LinearSystem

HOLD = 5.0
"""Weight of held displacements, measured: between 3 and 10 the bulk error no longer depends on it."""


def assemble(
    model: BodyModel,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    solver: DirectSolver,
    springs: Springs = MappingProxyType({}),
    timed: Timed = nullcontext,
    halved: bool = False,
) -> ElasticBody:
    """Choose the conditions of every surface and set up the rows.

    ``held`` names the surfaces with held components, ``held_nodes`` are (node, component) pairs held at zero.
    Components of surfaces with ``springs`` have the row sigma n + k u. A body that can still move is pinned
    where that holds it, which changes nothing but its rigid motion.
    The system is factorised within ``timed()``. If ``halved``, it is that of one half of a cloud with a
    mirror and answers to the symmetric part of loads; supports and springs must be symmetric, and single held
    nodes on the mirror.
    """
    cloud = model.cloud
    free = free_motions(cloud, held, held_nodes, springs)
    if halved:
        free = even_motions(cloud, free)
    single = [*held_nodes, *pins(cloud.points, free)]
    first_row, total = _first_rows(cloud)
    table = RowTable(first_row, total, total + len(single), model.material.modulus, springs)
    fold = fold_of(cloud, table, single) if halved else None
    pulls = _pulls(cloud, table, len(model.nodes))
    rows = _rows(model, held, single, table, fold)
    if fold is not None:
        pulls = pulls[fold.kept]
    rows = sparse.csr_array(rows + pulls) if springs else rows
    if fold is not None:
        rows, pulls = fold.halved(rows), fold.halved(pulls)
    rows = compact(rows)
    factorise: Callable[[], LinearSystem]
    weight = np.zeros(0)
    if model.settings.square:
        choice = choose_equations(cloud, held, single, table, model.ghosts)
        factorise = partial(square.factorise, rows, choice, model.nodes, solver)
    else:
        limit = stiffest_soft(cloud, model.material)
        weight = _row_weights(cloud, held, single, table, gripped(held, springs, limit))
        balance = ForceSums(cloud, held, held_nodes, first_row, table.total, springs, limit)
        sums, whole, nodes = balance.through_cuts(), balance.of_springs(), model.nodes
        if fold is not None:
            weight = fold.weights(weight, HOLD / cloud.spacing)
            sums, whole, nodes = fold.sums(sums), fold.sums(whole), nodes[fold.own]
        images = np.concatenate([(rows.T @ sums.T).T, (pulls.T @ whole.T).T])
        sums = np.concatenate([sums, whole])
        # In place: of all that there is before the factor, the rows are the largest part.
        rows.data *= np.repeat(weight, np.diff(rows.indptr))
        factorise = partial(least_squares.factorise, rows, weight, nodes, solver, sums, images)
        if fold is not None:
            factorise = partial(_folded, fold, factorise)
    # What rows and sums are made from, in place of them: they are many times as large. The weights tell what
    # nodes and normals do not of the curves behind them.
    content = digest(model.rows_content, weight, held, held_nodes, springs, solver.name, halved)
    equations = Equations(content, factorise)
    body = ElasticBody(model, held, springs, free, first_row, table.total, equations, timed, halved)
    if not free.components:
        return body
    pinned = replace(body, timed=nullcontext)
    return replace(body, equations=Equations(content, partial(_freed, pinned, single[len(held_nodes) :])))


def _first_rows(cloud: Cloud) -> tuple[dict[str, int], int]:
    """Where the rows of every surface begin, behind those of equilibrium, and how many rows there are."""
    first_row, total = {}, 2 * len(cloud.points)
    for name, surface in cloud.surfaces.items():
        first_row[name] = total
        total += 2 * len(surface.index)
    return first_row, total


def _rows(
    model: BodyModel,
    held: Mapping[str, tuple[bool, bool]],
    single: Sequence[tuple[int, int]],
    table: RowTable,
    fold: Fold | None,
) -> sparse.csr_array:
    """All rows, or those that the ``fold`` keeps, (r, 2N), springs left out."""
    cloud, c, count = model.cloud, model.material.stiffness, len(model.nodes)

    def some(first: int, size: int) -> IntArray | None:
        return None if fold is None else fold.kept_within(first, size)

    points = len(cloud.points)
    blocks = [model.equilibrium(component, some(component * points, points)) for component in (0, 1)]
    for name, surface in cloud.surfaces.items():
        size, stencils = len(surface.index), model.stencils.take(surface.index)
        for component in (0, 1):
            if held.get(name, (False, False))[component]:
                block = nodal_rows(surface.index, component, count)
            else:
                block = traction_rows(stencils, c, surface.normal, component)
            at = some(table.surfaces[name] + component * size, size)
            blocks.append(block if at is None else block[at])
    at = some(table.nodes, len(single))
    for node, component in single if at is None else [single[number] for number in at]:
        blocks.append(nodal_rows(np.array([node], dtype=np.int64), component, count))
    return sparse.csr_array(sparse.vstack(blocks, format="csr"))


def _folded(fold: Fold, factorise: Callable[[], LinearSystem]) -> Folded:
    return Folded(factorise(), fold)


def _pulls(cloud: Cloud, table: RowTable, nodes: int) -> sparse.csr_array:
    """What springs add to the rows (r, 2N)."""
    pulls = sparse.csr_array((table.total, 2 * nodes))
    for name, stiffness in table.springs.items():
        index = cloud.surfaces[name].index
        for component, spring in enumerate(stiffness):
            at = table.surfaces[name] + component * len(index) + np.arange(len(index))
            entries = (np.full(len(index), spring), (at, 2 * index + component))
            pulls = pulls + sparse.csr_array(entries, shape=pulls.shape)
    return pulls


def _freed(body: ElasticBody, pinned: Sequence[tuple[int, int]]) -> FreeSystem:
    """The body's system without its pins."""
    model, cloud = body.model, body.model.cloud
    count = len(cloud.points)
    patterns = body.free.patterns(model.nodes)
    # Ghosts carry no displacement of the body.
    share = np.zeros(model.unknowns)
    share[: 2 * count] = np.repeat(cloud.areas, 2)
    inertia = patterns.T @ (share[:, None] * patterns)
    mean = np.asarray(np.linalg.solve(inertia, patterns.T * share), dtype=np.float64)
    work = np.zeros((len(inertia), body.rows))
    balance: FloatArray = np.zeros((body.rows, len(inertia)))
    for row, pattern in enumerate(patterns[: 2 * count].T):
        motion = pattern.reshape(-1, 2)
        for component in (0, 1):
            equilibrium = slice(component * count, (component + 1) * count)
            # Right-hand sides of equilibrium are minus a body force.
            work[row, equilibrium] = -cloud.areas * motion[:, component]
            balance[equilibrium, row] = motion[:, component]
        for name, surface in cloud.surfaces.items():
            work[row] += body.source(name, surface.weight[:, None] * motion[surface.index], held=False)
    balance = balance @ np.linalg.inv(inertia)
    places = np.array([2 * node + component for node, component in pinned])
    return FreeSystem(body.system, patterns, mean, places, work, balance)


def _row_weights(
    cloud: Cloud,
    held: Mapping[str, tuple[bool, bool]],
    held_nodes: Sequence[tuple[int, int]],
    table: RowTable,
    grips: Held,
) -> FloatArray:
    """Weights (r,) of the rows in the least-squares sum; stresses are singular beside ``grips``."""
    factor = corner_weight(cloud, grips) * inward_weight(cloud)
    weights = [factor * cloud.spacing / table.modulus] * 2
    for name, surface in cloud.surfaces.items():
        spacing = cloud.spacing[surface.index]
        # A node at the end of a surface stands for half a spacing of it.
        traction = factor[surface.index] * np.sqrt(surface.weight / spacing)
        for component, holds in enumerate(held.get(name, (False, False))):
            # A spring so stiff that it holds counts as such.
            weights.append(
                HOLD / spacing if holds else traction / table.moduli(name, component, spacing / HOLD)
            )
    single = np.array([node for node, _ in held_nodes], dtype=np.int64)
    return np.concatenate([*weights, HOLD / cloud.spacing[single]])
