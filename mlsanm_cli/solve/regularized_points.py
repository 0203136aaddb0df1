"""A point on the path of the regularised contact with friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.continuation import Branch, Follower
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.series import (
    checkpoint_of,
    coupling_of,
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

    problem: RegularizedFriction
    x: FloatArray
    lam: float
    work: FloatArray


def checkpoint_at(point: Point, state: State, follower: Follower | None = None) -> Checkpoint:
    """What the path goes on from at a point, whose state is given; a piece begins anew without a follower."""
    problem = point.problem
    history = FrictionHistory(problem.sets, problem.stick_reference, problem.law.threshold)
    return replace(Checkpoint(state) if follower is None else checkpoint_of(state, follower), history=history)


def restored(built: CondensedScene, start: Checkpoint) -> Point:
    """The point where a checkpoint was made."""
    history = start.history
    assert history is not None
    coupling = coupling_of(built, regularization(built)).softened()
    base = replace(coupling, law=replace(coupling.law, threshold=history.threshold))
    stage = min(start.stage, len(built.stages) - 2)
    begin, end = built.stages[stage], built.stages[stage + 1]
    problem = RegularizedFriction(base, begin, end, history.sets, history.stick_reference)
    return Point(problem, unknowns_of(start.state), start.position - stage, start.state.work)


def inside(point: Point) -> Point:
    """The point with no sticking node beyond its limit, at rest where it is now.

    What tractions put back change elsewhere is solved for, which may move others past their limits again.
    """
    for _ in range(RETURNS):
        x = point.problem.within_cone(point.x)
        if np.array_equal(x, point.x):
            return point
        problem = point.problem.rested(x, point.lam)
        x = x - problem.tangent(x, point.lam).solve(problem.residual(x, point.lam))
        point = replace(point, x=x, problem=problem)
    x = point.problem.within_cone(point.x)
    return replace(point, x=x, problem=point.problem.rested(x, point.lam))


def moved(point: Point, x: FloatArray, lam: float) -> Point:
    """A later point of the same piece of path; slipping nodes have dissipated what they rubbed through."""
    problem = point.problem
    mean = 0.5 * (problem.split(point.x)[3] + problem.split(x)[3])
    slipped = problem.stick_coordinate(x, lam) - problem.stick_coordinate(point.x, point.lam)
    work = point.work - np.where(problem.sets.slip_sign != 0.0, mean * slipped, 0.0)
    return Point(problem, x, lam, work)


def series_of(problem: RegularizedFriction, branch: Branch, stage: int) -> dict[str, FloatArray]:
    names = ("pressure", "gap", "motion", "traction")
    pressure, gap, motion, traction = problem.split(branch.x)
    parts = (pressure, gap, problem.coupling.split_motions(motion)[0], traction)
    return series_arrays(branch, stage, dict(zip(names, parts, strict=True)))


def state_of(point: Point, stage: int, residual: float) -> State:
    problem, c = point.problem, point.problem.condensed
    pressure, gap, motion, traction = problem.split(point.x)
    factors = problem.factors(point.lam)
    status = smooth_status(problem.law, pressure, gap, c.friction_nodes[problem.sets.stuck])
    slip = problem.stick_coordinate(point.x, point.lam) - problem.law.stick_compliance * traction
    motion, displacement = problem.coupling.split_motions(motion)
    return State(
        stage + point.lam,
        factors,
        pressure,
        gap,
        motion,
        traction,
        slip,
        point.work,
        status,
        residual,
        displacement,
    )
