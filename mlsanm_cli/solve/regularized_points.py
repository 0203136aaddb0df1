"""Points on the path of regularised contact, their checkpoints and states."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.continuation import Branch, Follower
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.series import (
    ContactProblem,
    checkpoint_of,
    coupling_of,
    problem_of,
    regularization,
    series_arrays,
    smooth_status,
    unknowns_of,
)
from mlsanm_cli.solve.state import Checkpoint, FrictionHistory, State

MAX_UPDATES = 3
"""Largest number of updates after an event."""


@dataclass(frozen=True, eq=False)
class PathPoint:
    """Point on the path: problem, unknowns, fraction of the stage, and dissipated work (n,)."""

    problem: ContactProblem
    x: FloatArray
    lam: float
    work: FloatArray

    @property
    def friction(self) -> RegularizedFriction | None:
        """The problem, if friction has a memory."""
        problem = self.problem
        return problem if isinstance(problem, RegularizedFriction) and problem.n else None


def checkpoint_at(point: PathPoint, state: State, follower: Follower | None = None) -> Checkpoint:
    """Checkpoint at a point with its state; without a follower a new piece begins."""
    checkpoint = Checkpoint(state) if follower is None else checkpoint_of(state, follower)
    problem = point.friction
    if problem is None:
        return checkpoint
    history = FrictionHistory(problem.sets, problem.stick_reference, problem.law.threshold)
    return replace(checkpoint, history=history)


def restored(built: CondensedScene, start: Checkpoint) -> PathPoint:
    """The point of a checkpoint."""
    stage = min(start.stage, len(built.stages) - 2)
    coupling = coupling_of(built, regularization(built))
    x, lam = unknowns_of(start.state), start.position - stage
    history = start.history
    if history is None:
        problem = problem_of(built, coupling, stage)
        if isinstance(problem, HolonomicContact):
            x = problem.with_auxiliary(x, lam)
        return PathPoint(problem, x, lam, start.state.work)
    base = coupling.with_stick_compliance().with_thresholds(history.threshold)
    begin, end = built.stages[stage], built.stages[stage + 1]
    friction = RegularizedFriction(base, begin, end, history.sets, history.stick_reference)
    return PathPoint(friction, x, lam, start.state.work)


def inside(point: PathPoint, goal: float) -> PathPoint:
    """The point with a residual below ``goal``, if updates reach it, and no sticking node beyond its limit:
    such nodes are held at their limits while the others are updated, then stick where they are."""
    problem = point.friction
    assert problem is not None
    x, limited = _updated(problem, point.x, point.lam, goal), problem
    while (more := limited.at_limits(x)) is not limited:
        x, limited = _updated(more, more.on_limits(x), point.lam, goal), more
    if limited is problem:
        return replace(point, x=x)
    x = limited.on_limits(x)
    return replace(point, x=x, problem=problem.rested(x, point.lam))


def _updated(problem: RegularizedFriction, x: FloatArray, lam: float, goal: float) -> FloatArray:
    """Unknowns after a few Newton updates, as long as these reduce the residual."""
    residual = problem.residual(x, lam)
    for _ in range(MAX_UPDATES):
        if np.abs(residual).max() <= goal:
            break
        try:
            better = x - problem.tangent(x, lam).solve(residual)
        except np.linalg.LinAlgError:
            break
        left = problem.residual(better, lam)
        if not np.abs(left).max() < np.abs(residual).max():
            break
        x, residual = better, left
    return x


def moved(point: PathPoint, x: FloatArray, lam: float) -> PathPoint:
    """A later point of the same piece, with the work dissipated by slipping nodes."""
    problem = point.friction
    if problem is None:
        return replace(point, x=x, lam=lam)
    mean = 0.5 * (problem.split(point.x)[3] + problem.split(x)[3])
    slipped = problem.stick_coordinate(x, lam) - problem.stick_coordinate(point.x, point.lam)
    work = point.work - np.where(problem.sets.slip_sign != 0.0, mean * slipped, 0.0)
    return PathPoint(problem, x, lam, work)


def between(point: PathPoint, x: FloatArray, lam: float) -> PathPoint:
    """A point within a step, where the series may exceed the friction limits by its residual."""
    return moved(point, x if point.friction is None else point.friction.within_cone(x), lam)


def series_of(problem: ContactProblem, branch: Branch, stage: int) -> dict[str, FloatArray]:
    """Coefficients in the path parameter a, 0 <= a <= length; with ``denominator`` of the Padé form."""
    pressure, gap, motion, traction, *_ = problem.split(branch.x)
    parts = {"pressure": pressure, "gap": gap, "motion": problem.coupling.split_motions(motion)[0]}
    return series_arrays(branch, stage, parts | {"traction": traction} if problem.n else parts)


def state_of(point: PathPoint, stage: int, residual: float) -> State:
    """The state at a point of a stage."""
    problem, x, lam = point.problem, point.x, point.lam
    pressure, gap, motion, traction, *_ = problem.split(x)
    held = problem.condensed.friction_nodes[problem.sticking(x, lam)]
    motion, displacement = problem.coupling.split_motions(motion)
    return State(
        stage + lam,
        problem.factors(lam),
        pressure,
        gap,
        motion,
        traction,
        problem.slip(x, lam),
        point.work,
        smooth_status(problem.law, pressure, gap, held),
        residual,
        displacement,
    )
