"""Estimated CPU time of a run: a model fitted to Hertz scenes of 1300 to 17500 nodes. It is accurate to about
a factor of two on one core of a current machine with compiled kernels."""

from __future__ import annotations

import math

from mlsanm_cli.app.scene.assemble import SceneModel, mls_settings
from mlsanm_cli.case import Case

START = 1.0
PER_NODE = 1.0e-5
FACTOR = 5.0e-7
COLUMN = 3.7e-8
REFINED = 60
SLOW = {"auto": 1.0, "superlu": 3.0}
"""Time of factorisation and solution relative to the built-in solver, by ``solver.linear``."""
STAGE = 0.06
STAGE_NODE = 5.0e-4
STEPS = 70
DENSE = 7.0e-11
FIELDS = 1.0e-5
REFERENCE_STENCIL = 16.0
FINITE_STEPS = 6
FINITE_NODE = 3.5e-4
"""Steps of a stage at finite strain, and seconds of one per node: an unsymmetric factorisation and series."""


def cpu_seconds(case: Case, prepared: SceneModel) -> float:
    """Estimated CPU seconds of ``mlsanm run``.

    Clouds and operators take time of order n, the number of nodes, the factorisation n^1.5 (nested dissection
    in the plane), the condensation n log n per solution: few with the built-in solver, which has half
    solutions, else one per contact node. Each step of the path takes time of order m^3 for m contact nodes.
    """
    sizes = [len(model.cloud.points) for model in prepared.models.values()]
    touching = {
        name: sum(int(p.candidate.sum()) for p in prepared.pairings if name in p.bodies)
        for name in prepared.models
    }
    settings = mls_settings(case)
    stencil = settings.stencil_size / REFERENCE_STENCIL
    solver = "superlu" if settings.square else case.solver.linear
    slow = SLOW[solver]
    columns = [count + len(case.load) for count in touching.values()]
    if solver == "auto":
        columns = [min(count, REFINED) for count in columns]
    unknown = sum(int(pairing.candidate.sum()) for pairing in prepared.pairings)
    bulk = PER_NODE * stencil * sum(sizes) + slow * FACTOR * stencil**1.2 * sum(n**1.5 for n in sizes)
    condensing = (
        slow * COLUMN * stencil**0.6 * sum(m * n * math.log2(n) for m, n in zip(columns, sizes, strict=True))
    )
    path: float = (
        len(case.stage) * (STAGE + STAGE_NODE * unknown + STEPS * DENSE * unknown**3) if unknown else 0.0
    )
    if case.model.strain == "finite":
        path = FINITE_STEPS * FINITE_NODE * len(case.stage) * stencil**0.7 * sum(sizes)
    return float(START + bulk + condensing + path + FIELDS * max(len(case.output.at), 1) * sum(sizes))
