"""The scene of a case on its clouds: kernels, nodes, operators, pairs and conditions; its size and cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mlsanm_cli.app.context import RunContext
from mlsanm_cli.app.scene.assemble import NOTHING, SceneModel, mls_settings, prepare
from mlsanm_cli.app.scene.boundaries import Boundaries
from mlsanm_cli.app.scene.clouds import clouds, spacing_of
from mlsanm_cli.app.scene.contact_pairs import refuse_overlap
from mlsanm_cli.app.scene.outlines import given_nodes
from mlsanm_cli.case import Case, LoadedCase
from mlsanm_cli.cloud.curves import Outline, Segment
from mlsanm_cli.cloud.membership import inside_polygon
from mlsanm_cli.cloud.spacing import Spacing, Zone
from mlsanm_cli.errors import CaseError, CaseProblem, RunError
from mlsanm_cli.kernels.aot.jit import is_warm, load
from mlsanm_cli.kernels.aot.machine import Machine
from mlsanm_cli.records import dataclass
from mlsanm_cli.system import physical_memory_mb

ANNOUNCED_NODES = 50_000
"""Scenes with more nodes are announced: they take long, and may be due to a typing error."""
COUNT_LIMIT = 2e8
PROCESS_MB = 150.0
"""Memory of a process before its first body."""
CHOLESKY, SUPERLU = 96.0, 217.0
"""Bytes of a factor per node, node of its stencil and level of nested dissection: of the built-in Cholesky
factorisation, and of SuperLU, with both factors."""
DENSE = 8.0
"""Square matrices of the contact unknowns in memory at the same time; 5 to 6 were measured."""
START, STAGE = 0.8, 0.1
"""CPU seconds of the program, and of a stage with contact."""
PER_NODE, FACTOR, FINITE_NODE = 5.0e-5, 5.0e-7, 2.0e-3
"""CPU seconds per node, per node^1.5, and at finite strain per node and stage, with REFERENCE_STENCIL."""
SLOW = {"auto": 1.0, "superlu": 3.0}
"""Time of factorisation and solution relative to the built-in solver, by ``solver.linear``."""
REFERENCE_STENCIL = 16.0
NODES_PER_SQUARE = 0.89
"""Nodes per area h^2 of an advancing-front cloud, fitted to 16 uniform and graded clouds."""
MAX_CELLS = 500_000
NODES_PER_STEP = 0.44
"""Extra nodes per boundary node, from the same fit: half of a boundary node's area lies outside."""


@dataclass(frozen=True)
class Refinement:
    """Refined clouds: ``zones`` around segments in addition to those of the case, the results of the
    ``passes`` so far, and the message of a pass that ``failed``, if one did. At finite strain only the
    ``knots`` of all sides of all contacts, arc lengths."""

    zones: tuple[Zone, ...] = ()
    passes: tuple[Mapping[str, Any], ...] = ()
    failed: str = ""
    knots: Sequence[Sequence[Any]] = ()

    @classmethod
    def read(cls, plain: Mapping[str, Any]) -> Refinement:
        """From its plain values."""
        zones = [Zone(Segment((a, b), (c, d)), *asked) for a, b, c, d, *asked in plain["zones"]]
        return cls(**{**plain, "zones": tuple(zones), "passes": tuple(plain["passes"])})

    @property
    def plain(self) -> dict[str, Any]:
        """Plain values; a zone is a row of start, end, spacing, radius and growth."""
        ends = [zone.curve.ends for zone in self.zones]
        asked = [(zone.spacing, zone.radius, zone.growth) for zone in self.zones]
        rows = [[*start, *end, *rest] for (start, end), rest in zip(ends, asked, strict=True)]
        knots = [[np.asarray(arc).tolist() for arc in sides] for sides in self.knots]
        return {**vars(self), "zones": rows, "knots": knots}


def load_kernels(context: RunContext) -> Machine:
    """Loads the compiled kernels; announces compilation, and warns if they cannot be kept."""
    with context.phase("jit"):
        if not is_warm():
            context.console.phase("compiling kernels, once for this installation (10 to 20 s)")
        loaded = load()
    if loaded.note:
        context.console.warning(loaded.note)
    return loaded


def build_scene(loaded: LoadedCase, context: RunContext, zones: tuple[Zone, ...] = ()) -> SceneModel:
    """The scene on its clouds, refined in ``zones``. Raises CaseError for a scene that exceeds the memory,
    and for invalid contacts."""
    load_kernels(context)
    try:
        with context.phase("cloud"):
            boundaries = Boundaries.of(loaded.case)
            nodes, memory = refuse_too_large(boundaries)
        if nodes > ANNOUNCED_NODES:
            needs = f"which need about {memory / 1024:.2g} GB of memory"
            context.console.note(f"about {nodes:.2g} nodes, {needs}")
        prepared = place(boundaries, context, zones)
        # The dense systems of the path.
        unknowns = {p.name: int(p.candidate.sum()) * (2 if p.friction else 1) for p in prepared.pairings}
        total, room = sum(unknowns.values()), physical_memory_mb()
        memory = DENSE * total**2 * 8 / 2**20
        if memory > room:
            largest = max(loaded.case.contact, key=lambda contact: unknowns[contact.name])
            message = (
                f"{total} contact unknowns need about {memory / 1024:.3g} GB of memory, the machine has "
                f"{room / 1024:.3g} GB"
            )
            hint = f"use larger spacings along {largest.names[0]}"
            raise CaseError((CaseProblem(f"contact.{largest.name}", message, hint=hint),))
        refuse_overlap(loaded.case.contact, prepared.pairings)
    except CaseError as error:
        raise loaded.located(error) from error
    return prepared


def place(
    boundaries: Boundaries,
    context: RunContext,
    zones: tuple[Zone, ...] = (),
    before: SceneModel | None = None,
) -> SceneModel:
    """Clouds, stencils, pairs and conditions; ``zones`` refine every body in addition to the case, and bodies
    equal to those ``before`` are reused."""
    with context.phase("cloud", "placing nodes"):
        nodes = clouds(boundaries, zones, context.memo)
    with context.phase("operators", "building operators"):
        return prepare(boundaries, nodes, context.memo, before.models if before is not None else NOTHING)


def estimate_nodes(outline: Outline, spacing: Spacing) -> float:
    """Estimated number of nodes, at most COUNT_LIMIT, from the integrals of 1/h^2 over the region, by
    quadtree, and of 1/h along its outline."""
    chains = [curve.points(np.linspace(0.0, curve.length, 65)) for curve in outline.curves]
    edges = np.concatenate([np.hstack([chain[:-1], chain[1:]]) for chain in chains])
    low, high = edges[:, :2].min(axis=0), edges[:, :2].max(axis=0)
    size = float((high - low).max())
    cells = low[None, :] + 0.5 * size
    total = 0.0
    while len(cells):
        h = spacing.at(cells)
        # Fine enough when a cell holds few nodes: the spacing is then nearly uniform in it.
        fine = size <= 4.0 * h
        inside = inside_polygon(edges, cells[fine])
        total += NODES_PER_SQUARE * float((size**2 / h[fine] ** 2)[inside].sum())
        if total > COUNT_LIMIT:
            return COUNT_LIMIT
        if len(cells) > MAX_CELLS:
            # With at least 16 nodes in each of so many cells, the rest need not be refined.
            coarse = inside_polygon(edges, cells[~fine])
            total += NODES_PER_SQUARE * float((size**2 / h[~fine] ** 2)[coarse].sum())
            break
        quarter = 0.25 * size
        corners = quarter * np.array([(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
        cells = (cells[~fine][:, None, :] + corners).reshape(-1, 2)
        outside = ((cells < low - quarter) | (cells > high + quarter)).any(axis=1)
        cells = cells[~outside]
        size *= 0.5
    try:
        steps = sum(len(spacing.steps_along(curve)) - 1 for curve in outline.curves)
    except RunError:
        return COUNT_LIMIT
    return min(total + NODES_PER_STEP * steps, COUNT_LIMIT)


def node_counts(boundaries: Boundaries) -> dict[str, float]:
    """Nodes by body: by quadrature of the spacing field, or counted."""
    counts = {}
    for body in boundaries.case.body:
        given = given_nodes(body)
        if given is not None:
            counts[body.name] = float(len(given.points))
        else:
            counts[body.name] = estimate_nodes(boundaries.outline(body.name), spacing_of(boundaries, body))
    return counts


def memory_mb(case: Case, nodes: Mapping[str, float], stencil: int | None = None) -> float:
    """Memory of the process: stencils, rows and factors of all bodies, and the factorisation of the largest;
    fitted to measured runs (docs/performance.md). ``stencil`` are the nodes of a stencil, by default those of
    the case."""
    stencil = stencil or mls_settings(case).stencil_size
    built_in = case.model.strain == "small" and case.solver.linear != "superlu"
    per_level, without = (CHOLESKY, 8.0) if built_in else (SUPERLU, 7.2)
    counts = list(nodes.values())
    kept = sum((150.0 * stencil + 1950.0) * count for count in counts)
    # The last levels of nested dissection hardly cause fill.
    levels = [max(math.log2(max(count, 2.0)) - without, 1.0) for count in counts]
    factors = sum(per_level * n * stencil * level for n, level in zip(counts, levels, strict=True))
    made = (115.0 * stencil + 1400.0) * max(counts)
    return PROCESS_MB + (kept + factors + made) / 1e6


def refuse_too_large(boundaries: Boundaries) -> tuple[float, float]:
    """Estimated nodes and memory (MB). Raises CaseError, for the key that causes the size (the neighbours,
    else the spacing or refinement of the largest body), if the scene would not fit in memory."""
    case, nodes = boundaries.case, node_counts(boundaries)
    memory, room = memory_mb(case, nodes), physical_memory_mb()
    if memory > room:
        counts = ", ".join(f"{name} {count:.3g}" for name, count in nodes.items())
        message = (
            f"the scene needs about {memory / 1024:.3g} GB of memory, the machine has "
            f"{room / 1024:.3g} GB (nodes: {counts})"
        )
        usual = replace(mls_settings(case), neighbors=None).stencil_size
        if memory_mb(case, nodes, usual) <= room:
            raise CaseError((CaseProblem("mls.neighbors", message, hint=f'"auto" takes {usual}'),))
        body = max(case.body, key=lambda body: nodes[body.name])
        key, hint = f"body.{body.name}.shape.file", "use a coarser mesh"
        if not body.has_nodes:
            hint = "use larger spacings, smaller refinement radii or a larger growth"
            key = f"body.{body.name}.spacing"
            finest = min(enumerate(body.refine), key=lambda item: item[1].spacing, default=None)
            if finest and (isinstance(body.spacing, str) or finest[1].spacing < body.spacing):
                key = f"body.{body.name}.refine.{finest[0]}.spacing"
        raise CaseError((CaseProblem(key, message, hint=hint),))
    return sum(nodes.values()), memory


def cpu_seconds(case: Case, prepared: SceneModel) -> float:
    """Estimated CPU seconds of ``mlsanm run`` with compiled kernels, to about a factor of two: clouds,
    operators and fields of n nodes take time of order n, the factorisation n^1.5 (nested dissection in the
    plane)."""
    sizes = [len(model.cloud.points) for model in prepared.models.values()]
    settings, stages = mls_settings(case), len(case.stage)
    stencil = settings.stencil_size / REFERENCE_STENCIL
    slow = SLOW[case.solver.linear]
    bulk = PER_NODE * stencil * sum(sizes) + slow * FACTOR * stencil**1.2 * sum(n**1.5 for n in sizes)
    path = STAGE * stages if prepared.pairings else 0.0
    if case.model.strain == "finite":
        path = FINITE_NODE * stencil**0.7 * stages * sum(sizes)
    return float(START + bulk + path)
