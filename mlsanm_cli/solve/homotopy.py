"""The hyperbolic law's eta lowered at the load of a stage's end: a rival of the load path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.homotopy import carried
from mlsanm_cli.contact.laws.scales import regularize
from mlsanm_cli.continuation import Correction, Family, solve_at
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.series import (
    Memoryless,
    coupling_of,
    path_options,
    problem_of,
    regularization,
    start_point,
)


def lowered(built: CondensedScene, etas: Sequence[float]) -> Iterator[Correction]:
    """States at the end of the first stage for relative ``etas``, of all contacts alike, large ones first.

    Raises NumericalError for friction with memory, whose states do not follow from the load alone, and where
    no solution is found.
    """
    if len(built.condensed.friction_nodes) and not built.is_holonomic:
        raise NumericalError(
            "friction with memory has no state that follows from the load alone",
            'use contact.regularization.friction_law = "holonomic", or follow the load path',
        )
    law = regularization(built)
    whole = regularize(built.condensed, built.ends, 1.0).eta

    def problem(eta: float) -> Memoryless:
        return problem_of(built, coupling_of(built, replace(law, eta=eta * whole)), stage=0)

    def guess(x: FloatArray, before: float, eta: float) -> FloatArray:
        return carried(problem(before), x, eta * whole)

    start = start_point(built, problem(etas[0]))
    yield from solve_at(Family(problem, guess), etas, start, 1.0, path_options(built))
