"""A point on the path of the regularised contact with friction, and the mark that it is found again by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.continuation import Branch
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.series import coupling_of, regularization, series_arrays, smooth_status
from mlsanm_cli.solve.state import State

RETURNS = 3
"""Behind an event so many updates are made at most; tractions past their limits are put back as often."""


@dataclass(frozen=True, eq=False)
class Point:
    """Where the path is: its problem, unknowns, fraction of the stage, work dissipated (n,) so far."""

    problem: RegularizedFriction
    x: FloatArray
    lam: float
    work: FloatArray


@dataclass(frozen=True, eq=False)
class RubbingMark:
    """Where a path is: what makes up its :class:`Point`, and what the walk along the stage knows besides.

    ``tangent`` are the unknowns at which the tangent was made that nearby points share; ``held`` the sets of
    the piece of path behind, which ``began`` at a fraction of the stage and is over if an ``event`` ended it.
    Before the first step of a stage there is no ``piece``. Where no state goes on from here ``no_state``
    tells whether that is for sliding, else it is None.
    """

    stage: int
    lam: float
    x: FloatArray
    work: FloatArray
    sets: ContactStatus
    stick_reference: FloatArray
    threshold: FloatArray
    tangent: FloatArray | None = None
    event: bool = False
    held: ContactStatus | None = None
    began: float = 0.0
    standing: int = 0
    piece: Branch | None = None
    no_state: bool | None = None

    @property
    def within(self) -> bool:
        """Whether the stage is under way."""
        return self.piece is not None and self.lam < 1.0


def mark_of(point: Point, stage: int) -> RubbingMark:
    """The mark of a point with no stage under way."""
    problem = point.problem
    return RubbingMark(
        stage, point.lam, point.x, point.work, problem.sets, problem.stick_reference, problem.law.threshold
    )


def marked(built: CondensedScene, mark: RubbingMark) -> Point:
    """The point where a mark was made."""
    coupling = coupling_of(built, regularization(built)).softened()
    base = replace(coupling, law=replace(coupling.law, threshold=mark.threshold))
    begin, end = built.stages[mark.stage], built.stages[mark.stage + 1]
    problem = RegularizedFriction(base, begin, end, mark.sets, mark.stick_reference)
    if mark.tangent is not None:
        problem.tangent(mark.tangent, mark.lam)
        problem.tally.taken()
    return Point(problem, mark.x, mark.lam, mark.work)


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
