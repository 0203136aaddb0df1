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


@dataclass(frozen=True)
class Estimate:
    """``nodes`` per body, ``memory_mb`` of the whole process."""

    nodes: dict[str, float]
    memory_mb: float


def estimate(case: Case) -> Estimate:
    """Nodes by quadrature of the spacing field or counted, memory by the model below."""
    nodes = {body.name: _nodes(body) for body in case.body}
    stencil = mls_settings(case).stencil_size
    return Estimate(nodes, 150.0 + sum(_body_memory_mb(count, stencil) for count in nodes.values()))


def _nodes(body: Body) -> float:
    if isinstance(body.shape, Mesh | Points) and body.shape.brings_nodes:
        return float(len(foreign(body.shape).points))
    return estimate_nodes(outline_of(body), spacing_of(body), COUNT_LIMIT)


def _body_memory_mb(nodes: float, stencil: int) -> float:
    """Rows, normal equations and Cholesky factor, the latter growing like n log n under nested dissection."""
    rows = 2.2 * nodes * 2 * stencil * 12
    normal = 2 * nodes * 6.5 * stencil * 12
    factor = 2 * nodes * 2.2 * stencil * math.log2(max(nodes, 2.0)) * 2 * 12
    return (6 * rows + 3 * normal + factor) / 2**20


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
