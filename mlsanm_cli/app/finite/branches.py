"""Bifurcations of the path of one body, and the stable branches that leave it there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.continuation import PathOptions, Step, Tangent, bifurcation, branching
from mlsanm_cli.continuation.roots import root
from mlsanm_cli.mechanics.finite.problem import FiniteProblem, FiniteTangent
from mlsanm_cli.mechanics.finite.stability import SoftMotion
from mlsanm_cli.records import dataclass

BRANCH_STEP = 0.01
"""Distance from a bifurcation to the first state on the other branch, over the extent of the body."""
LIMIT_SAMPLES = 65
"""Points of a step at which the slope of the load factor is evaluated to find limit points."""


@dataclass(frozen=True, eq=False)
class Fork:
    """A bifurcation at a load factor ``lam``, with the ``motion`` (2N,) in which the branches differ, and
    whether the deflection before ``decided`` on the branch. The ``legs``, steps with the softest motions at
    their ends, lead to it and on to a stable state of the other branch; there are none without one nearby."""

    lam: float
    motion: FloatArray
    decided: bool
    legs: tuple[tuple[Step, SoftMotion], ...]


def softest(problem: FiniteProblem, x: FloatArray, lam: float, tangent: Tangent | None = None) -> SoftMotion:
    """The softest motion in the state ``x`` (2N,), by its ``tangent`` if that is known."""
    tangent = tangent or problem.tangent(x, lam)
    assert isinstance(tangent, FiniteTangent)
    return tangent.softest(x, problem.factors(lam))


def fork(
    problem: FiniteProblem,
    step: Step,
    before: SoftMotion,
    ahead: SoftMotion,
    options: PathOptions,
    size: float,
) -> Fork | None:
    """The bifurcation in a ``step`` between states whose softest motions are ``before`` and ``ahead``: a loss
    of stability that is no limit point. ``size`` is the extent of the body."""
    turns = limit_points(step)
    if not before.stable or ahead.unstable <= len(turns):
        return None

    def least(x: FloatArray, lam: float) -> float:
        return softest(problem, x, lam).resistance

    a, point = bifurcation(problem, step.branch, least, options, on_path=bool(step.order))
    if turns and turns[0][0] <= a:
        return None
    mode = softest(problem, point.x, point.lam)
    part = mode.part_in(point.x)
    motion = -mode.motion if part < 0.0 else mode.motion
    other = branching(problem, point.x, point.lam, motion, BRANCH_STEP * size, options)
    if other is not None and other[1].lam < 1.0:
        piece, end = other
        beyond = softest(problem, end.x, end.lam)
        if beyond.stable:
            way = step.arc_length * a / step.branch.length
            first = replace(step, branch=step.branch.shortened(a), x=point.x, lam=point.lam, arc_length=way)
            counts = (end.residual, BRANCH_STEP, end.updates, end.factorizations, end.solves)
            second = Step(step.index + 1, piece, end.x, end.lam, *counts, order=0)
            return Fork(point.lam, motion, bool(part), ((first, mode), (second, beyond)))
    return Fork(point.lam, motion, bool(part), ())


def limit_points(step: Step) -> list[tuple[float, bool]]:
    """Limit points within a step of power series: its parameter, and whether it is a maximum."""
    branch, found = step.branch, list[tuple[float, bool]]()
    if not step.order:
        return found

    def slope(a: float) -> float:
        return float(branch.derivative_weights(np.array([a]))[0] @ branch.terms[1])

    a = np.linspace(0.0, branch.length, LIMIT_SAMPLES)
    slopes = branch.derivative_weights(a) @ branch.terms[1]
    for k in np.flatnonzero(slopes[:-1] * slopes[1:] < 0.0):
        found.append((root(slope, a[k], a[k + 1]), bool(slopes[k] > 0.0)))
    return found
