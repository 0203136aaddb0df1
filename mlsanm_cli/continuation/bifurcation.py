"""Bifurcations: where a branch leaves the path, found by a function that changes its sign there, and a point
of that branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mlsanm_cli.continuation.corrector import Correction, Effort, correct, iterate
from mlsanm_cli.continuation.problem import FloatArray, PathOptions, Problem, SingularTangentError
from mlsanm_cli.continuation.roots import root
from mlsanm_cli.continuation.series import Branch

# The place on a step, as a part of the step; a part of the distance of the first point from it.
_PRECISION = 1e-3
_SHORTENINGS = 6


def bifurcation(
    problem: Problem,
    branch: Branch,
    least: Callable[[FloatArray, float], float],
    options: PathOptions,
    on_path: bool,
) -> tuple[float, Correction]:
    """The parameter of a ``branch`` at which ``least`` (x, lam), positive at its start, becomes negative, and
    the state there. Branches that are not ``on_path`` between their ends are corrected. Raises NumericalError
    if that fails."""

    def state(a: float) -> Correction:
        x, lam = branch.evaluate(a)
        return Correction(x, lam, 0.0) if on_path else correct(problem, x, lam, options)

    def height(a: float) -> float:
        point = state(a)
        return least(point.x, point.lam)

    if height(0.0) <= 0.0:
        return 0.0, state(0.0)
    a = root(height, 0.0, branch.length, _PRECISION * branch.length)
    return a, state(a)


def branching(
    problem: Problem, x: FloatArray, lam: float, mode: FloatArray, size: float, options: PathOptions
) -> tuple[Branch, Correction] | None:
    """The piece of path from a bifurcation (``x`` (size,), ``lam``) to a point of the other branch, and that
    point. Its difference from ``x`` has the projection ``size`` on the ``mode`` (size,), or a part of that if
    none is found there; None if there is none either."""
    along = mode / (mode @ mode)

    def in_plane(dx: FloatArray, slope: FloatArray) -> float:
        return -float(along @ dx) / float(along @ slope)

    for part in 0.5 ** np.arange(_SHORTENINGS):
        effort = Effort()
        try:
            point = iterate(problem, x + part * size * mode, lam, in_plane, options, effort)
        except SingularTangentError:
            continue
        if point.residual <= options.tolerance:
            way = np.array([x, point.x - x]), np.array([lam, point.lam - lam])
            updates, factorizations = effort["updates"], effort["factorizations"]
            counted = replace(point, updates=updates, factorizations=factorizations, solves=effort["solves"])
            return Branch(*way, 1.0), counted
    return None
