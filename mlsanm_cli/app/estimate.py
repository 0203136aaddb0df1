"""Size and cost of a scene before it is built."""

from __future__ import annotations

import math
import os

from mlsanm_cli.app.clouds import outline_of, spacing_of
from mlsanm_cli.app.foreign import foreign
from mlsanm_cli.app.scene import mls_settings
from mlsanm_cli.case import Body, Case, Mesh, Points
from mlsanm_cli.cloud.size import estimate_nodes
from mlsanm_cli.errors import RunError
from mlsanm_cli.values import dataclass

COUNT_LIMIT = 2e8
PROCESS_MB = 280.0
"""Memory of a process before its first body."""
SUPERLU = 3.0
"""Its factor, of both halves, against ours."""


@dataclass(frozen=True)
class Estimate:
    """``nodes`` per body, ``memory_mb`` of the whole process."""

    nodes: dict[str, float]
    memory_mb: float


def estimate(case: Case) -> Estimate:
    """Nodes by quadrature of the spacing field or counted, memory by the model below."""
    nodes = {body.name: _nodes(body) for body in case.body}
    settings = mls_settings(case)
    fill = SUPERLU if settings.square or case.solver.linear == "superlu" else 1.0
    parts = [_body_memory_mb(count, settings.stencil_size, fill) for count in nodes.values()]
    return Estimate(nodes, PROCESS_MB + sum(parts))


def _nodes(body: Body) -> float:
    if isinstance(body.shape, Mesh | Points) and body.shape.brings_nodes:
        return float(len(foreign(body.shape).points))
    return estimate_nodes(outline_of(body), spacing_of(body), COUNT_LIMIT)


def _body_memory_mb(nodes: float, stencil: int, fill: float) -> float:
    """Stencils, rows, normal equations and sums of rows, and the factor, whose part per node grows like log n
    under nested dissection; fitted to measured runs (docs/performance.md)."""
    factor = 72.5 * fill * stencil * max(math.log2(max(nodes, 2.0)) - 7.2, 1.0)
    return nodes * (270.0 * stencil + 1400.0 + factor) / 1e6


def available_memory_mb() -> float:
    """Physical memory of the machine."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20


def refuse_too_large(case: Case) -> Estimate:
    """Raise RunError when the scene would not fit into memory."""
    size = estimate(case)
    room = available_memory_mb()
    if size.memory_mb > room:
        counts = ", ".join(f"{name} {count:.3g}" for name, count in size.nodes.items())
        raise RunError(
            f"the scene needs about {size.memory_mb / 1024:.3g} GB of memory, the machine has "
            f"{room / 1024:.3g} GB (nodes: {counts})",
            "use larger spacings, smaller refinement radii or a larger growth",
        )
    return size
