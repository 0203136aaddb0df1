"""Size and cost of a scene before it is built."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mlsanm_cli.app.clouds import outline_of, spacing_of
from mlsanm_cli.app.foreign import foreign
from mlsanm_cli.app.scene import mls_settings
from mlsanm_cli.case import Body, Case, Mesh, Points
from mlsanm_cli.cloud.size import estimate_nodes
from mlsanm_cli.cloud.spacing import Spacing
from mlsanm_cli.contact.pairing import Pairing
from mlsanm_cli.errors import CaseError, CaseProblem
from mlsanm_cli.values import dataclass

COUNT_LIMIT = 2e8
PROCESS_MB = 280.0
"""Memory of a process before its first body."""
FILL = {"auto": 1.0, "superlu": 3.0, "pardiso": 1.5, "mumps": 0.25}
"""Memory for the factor against ours, by ``solver.linear``: SuperLU's is of both halves, MUMPS's on disk."""
DENSE = 8.0
"""Square matrices of the contact unknowns that are there at the same time; 5 to 6 were measured."""


@dataclass(frozen=True)
class Estimate:
    """``nodes`` per body, ``memory_mb`` of the whole process."""

    nodes: dict[str, float]
    memory_mb: float


def estimate(case: Case) -> Estimate:
    """Nodes by quadrature of the spacing field or counted, memory by the model below."""
    nodes = {body.name: _nodes(body) for body in case.body}
    return Estimate(nodes, _memory_mb(nodes, mls_settings(case).stencil_size, _solver(case)))


def _solver(case: Case) -> str:
    """What factorises the case's bodies."""
    return "superlu" if mls_settings(case).square else case.solver.linear


def _memory_mb(nodes: Mapping[str, float], stencil: int, solver: str) -> float:
    fill = FILL[solver]
    return PROCESS_MB + sum(_body_memory_mb(count, stencil, fill) for count in nodes.values())


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
    """Raise CaseError, with the key that makes it so large, when the scene would not fit into memory."""
    size = estimate(case)
    room = available_memory_mb()
    if size.memory_mb > room:
        counts = ", ".join(f"{name} {count:.3g}" for name, count in size.nodes.items())
        message = (
            f"the scene needs about {size.memory_mb / 1024:.3g} GB of memory, the machine has "
            f"{room / 1024:.3g} GB (nodes: {counts})"
        )
        key, hint = _cause(case, size, room)
        raise CaseError((CaseProblem(key, message, hint=hint),))
    return size


def refuse_too_many_contacts(case: Case, pairings: Sequence[Pairing]) -> None:
    """Raise CaseError, with the largest contact, where the dense systems of the path would not fit."""
    unknowns = {p.name: int(p.candidate.sum()) * (2 if p.friction else 1) for p in pairings}
    memory_mb = DENSE * sum(unknowns.values()) ** 2 * 8 / 2**20
    room = available_memory_mb()
    if memory_mb > room:
        name = max(unknowns, key=lambda name: unknowns[name])
        message = (
            f"{sum(unknowns.values())} unknowns of contact need about {memory_mb / 1024:.3g} GB of memory, "
            f"the machine has {room / 1024:.3g} GB"
        )
        hint = f"use larger spacings along {next(c.slave for c in case.contact if c.name == name)}"
        raise CaseError((CaseProblem(f"contact.{name}", message, hint=hint),))


def _cause(case: Case, size: Estimate, room: float) -> tuple[str, str]:
    """The key to change, and how."""
    settings = mls_settings(case)
    usual = replace(settings, neighbors=None).stencil_size
    if _memory_mb(size.nodes, usual, _solver(case)) <= room:
        return "mls.neighbors", f'"auto" takes {usual}'
    on_disk = _memory_mb(size.nodes, settings.stencil_size, "mumps")
    if on_disk <= room and not settings.square:
        return "solver.linear", f'"mumps", with its factors on disk, needs about {on_disk / 1024:.3g} GB'
    body = max(case.body, key=lambda body: size.nodes[body.name])
    if body.brings_nodes:
        return f"body.{body.name}.shape.file", "use a coarser mesh"
    hint = "use larger spacings, smaller refinement radii or a larger growth"
    assert body.spacing is not None
    even = estimate_nodes(outline_of(body), Spacing(body.spacing), COUNT_LIMIT)
    if even >= 0.5 * size.nodes[body.name] or not body.refine:
        return f"body.{body.name}.spacing", hint
    finest = min(range(len(body.refine)), key=lambda index: body.refine[index].spacing)
    return f"body.{body.name}.refine.{finest}.spacing", hint
