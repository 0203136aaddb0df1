"""A point on the path of regularised contact: the first one, those of checkpoints, and states there."""

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

RETURNS = 3
"""Behind an event so many updates are made at most; tractions past their limits are put back as often."""


@dataclass(frozen=True, eq=False)
class Point:
    """Where the path is: its problem, unknowns, fraction of the stage, work dissipated (n,) so far."""

    problem: ContactProblem
    x: FloatArray
    lam: float
    work: FloatArray

    @property
    def friction(self) -> RegularizedFriction | None:
        """The problem, where friction has a memory."""
        problem = self.problem
        return problem if isinstance(problem, RegularizedFriction) and problem.n else None


def checkpoint_at(point: Point, state: State, follower: Follower | None = None) -> Checkpoint:
    """What the path continues from at a point, whose state is given; a piece begins anew without a
    follower."""
    checkpoint = Checkpoint(state) if follower is None else checkpoint_of(state, follower)
    problem = point.friction
    if problem is None:
        return checkpoint
    history = FrictionHistory(problem.sets, problem.stick_reference, problem.law.threshold)
    return replace(checkpoint, history=history)


def restored(built: CondensedScene, start: Checkpoint) -> Point:
    """The point where a checkpoint was made."""
    stage = min(start.stage, len(built.stages) - 2)
    coupling = coupling_of(built, regularization(built))
    x, lam = unknowns_of(start.state), start.position - stage
    history = start.history
    if history is None:
        problem = problem_of(built, coupling, stage)
        if isinstance(problem, HolonomicContact):
            x = problem.with_auxiliary(x, lam)
        return Point(problem, x, lam, start.state.work)
    base = replace(coupling.with_stick_compliance(), law=replace(coupling.law, threshold=history.threshold))
    begin, end = built.stages[stage], built.stages[stage + 1]
    friction = RegularizedFriction(base, begin, end, history.sets, history.stick_reference)
    return Point(friction, x, lam, start.state.work)


def inside(point: Point) -> Point:
    """The point with no sticking node beyond its limit, at rest where it is now.

    What tractions put back change elsewhere is solved for, which may move others past their limits again.
    """
    problem = point.friction
    assert problem is not None
    for _ in range(RETURNS):
        x = problem.within_cone(point.x)
        if np.array_equal(x, point.x):
            return point
        problem = problem.rested(x, point.lam)
        x = x - problem.tangent(x, point.lam).solve(problem.residual(x, point.lam))
        point = replace(point, x=x, problem=problem)
    x = problem.within_cone(point.x)
    return replace(point, x=x, problem=problem.rested(x, point.lam))


def moved(point: Point, x: FloatArray, lam: float) -> Point:
    """A later point of the same piece of path; slipping nodes have dissipated the work of their tractions."""
    problem = point.friction
    if problem is None:
        return replace(point, x=x, lam=lam)
    mean = 0.5 * (problem.split(point.x)[3] + problem.split(x)[3])
    slipped = problem.stick_coordinate(x, lam) - problem.stick_coordinate(point.x, point.lam)
    work = point.work - np.where(problem.sets.slip_sign != 0.0, mean * slipped, 0.0)
    return Point(problem, x, lam, work)


def between(point: Point, x: FloatArray, lam: float) -> Point:
    """The same within a step, where the series may leave the friction cone by its residual."""
    return moved(point, x if point.friction is None else point.friction.within_cone(x), lam)


def series_of(problem: ContactProblem, branch: Branch, stage: int) -> dict[str, FloatArray]:
    """Coefficients over the path parameter a, 0 <= a <= length; with ``denominator`` the Padé form holds."""
    pressure, gap, motion, traction, *_ = problem.split(branch.x)
    parts = {"pressure": pressure, "gap": gap, "motion": problem.coupling.split_motions(motion)[0]}
    return series_arrays(branch, stage, parts | {"traction": traction} if problem.n else parts)


def state_of(point: Point, stage: int, residual: float) -> State:
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
