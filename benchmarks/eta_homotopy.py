"""Eta of the hyperbolic law lowered at the load of a stage's end: a rival of the load path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.scales import regularize
from mlsanm_cli.continuation import Correction, correct
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.series import (
    ContactProblem,
    coupling_of,
    path_options,
    problem_of,
    regularization,
    start_point,
)


def lowered(built: CondensedScene, etas: Sequence[float]) -> Iterator[Correction]:
    """States at the end of the first stage for relative ``etas``, of all contacts alike, large ones first.

    Each begins at the one before. Raises NumericalError where that does not converge.
    """
    law = regularization(built)
    whole = regularize(built.condensed, built.ends, 1.0).eta
    before: ContactProblem | None = None
    x = np.zeros(0)
    for eta in etas:
        problem = problem_of(built, coupling_of(built, replace(law, eta=eta * whole)), stage=0)
        guess = start_point(built, problem) if before is None else carried(before, x, eta * whole)
        found = correct(problem, guess, 1.0, path_options(built))
        yield found
        x, before = found.x, problem


def carried(problem: ContactProblem, x: FloatArray, eta: FloatArray) -> FloatArray:
    """Unknowns on the hyperbola of ``eta`` (m,), pressures, near those on that of ``problem``.

    Closed nodes keep their pressure, open ones their gap; tractions stay in proportion to what friction can
    carry.
    """
    law, m = problem.law, problem.m
    p, h = problem.split(x)[:2]
    closed = p / law.pressure > h / law.gap
    pressure = np.where(closed, p, eta * (law.delta / h - 1.0))
    gap = np.where(closed, eta * law.delta / (np.maximum(p, 0.0) + eta), h)
    whole = np.concatenate([pressure, gap, x[2 * m :]])
    if isinstance(problem, HolonomicContact):
        rub = problem.condensed.friction_nodes
        problem.split(whole)[3][:] *= (pressure + eta)[rub] / (p + law.eta)[rub]
    return whole
