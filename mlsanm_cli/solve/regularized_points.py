"""A point on the path of regularised contact: the first one, those of checkpoints, and states there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.laws.contact_status import ContactStatus
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction, Tally
from mlsanm_cli.continuation import AnmOptions, Branch, Follower, NewtonOptions, correct
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.series import (
    ContactProblem,
    checkpoint_of,
    coupling_of,
    drawn,
    problem_of,
    regularization,
    series_arrays,
    smooth_status,
    start_point,
    unknowns_of,
)
from mlsanm_cli.solve.state import Checkpoint, FrictionHistory, PathStep, State

RETURNS = 3
"""Behind an event so many updates are made at most; tractions past their limits are put back as often."""
OPENINGS = 20
FREE = 1e-3
"""Before the first load tractions are below this part of their limits."""
APART = "before the first load friction does not hold what contacts alone hold: the surfaces are drawn apart"
APART_HINT = 'draw the surfaces touching, or use contact.regularization.law = "exact"'


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


def start_at_rest(built: CondensedScene, options: AnmOptions | NewtonOptions) -> tuple[Point, PathStep]:
    """The point before the first load and the path's first row. Raises NumericalError where nothing holds a
    body or platen."""
    if len(built.condensed.friction_nodes) and not built.is_holonomic:
        point = _first(built, options)
        assert point.friction is not None
        return point, PathStep(_at_rest(point), (), factorizations=point.friction.tally.taken())
    problem = problem_of(built, coupling_of(built, regularization(built)), 0)
    found = correct(problem, start_point(built, problem), 0.0, options)
    # Dissipation is a matter of history, which the holonomic law does not know.
    point = Point(problem, found.x, 0.0, np.full(problem.n, np.nan))
    return point, PathStep(_at_rest(point), (), 0.0, 0, found.updates, found.factorizations, found.solves)


def _at_rest(point: Point) -> State:
    return state_of(point, 0, float(np.abs(point.problem.residual(point.x, 0.0)).max()))


def _first(built: CondensedScene, options: AnmOptions | NewtonOptions) -> Point:
    """The state before the first load: as drawn, no traction anywhere.

    Pressed nodes stick from the very start; friction of the others begins when they reach the law's
    threshold. Raises NumericalError where nothing holds a body or platen.
    """
    c, coupling = built.condensed, coupling_of(built, regularization(built)).softened()
    law = coupling.law
    nothing, begin = np.zeros(len(c.friction_nodes)), built.stages[0]
    x = np.concatenate([drawn(built, coupling), nothing])
    pressure = x[: len(c.weight)]
    full, tally = law.threshold, Tally()

    def problem_at(pressure: FloatArray, sticking: bool, stick_reference: FloatArray) -> RegularizedFriction:
        pressed = np.zeros(len(pressure), dtype=bool)
        pressed[c.friction_nodes] = pressure[c.friction_nodes] > -FREE * law.eta[c.friction_nodes]
        stuck = pressed[c.friction_nodes] & sticking
        own = 0.5 * np.maximum(pressure[c.friction_nodes], 0.0)
        threshold = np.where(stuck, np.minimum(full, own), full)
        base = replace(coupling, law=replace(law, threshold=threshold))
        return RegularizedFriction(
            base, begin, begin, ContactStatus(pressed, stuck, nothing), stick_reference, tally
        )

    drawn_x, stick_reference, pressure = x, nothing, x[: len(c.weight)]
    for _ in range(OPENINGS):
        problem = problem_at(pressure, True, stick_reference)
        try:
            x = correct(problem, x, 0.0, options).x
        except NumericalError as error:
            if not len(c.balance.constant):
                raise
            raise NumericalError(APART, APART_HINT) from error
        pressure, _, motion, traction = problem.split(x)
        limit = FREE * c.friction * np.maximum(pressure[c.friction_nodes], 0.0)
        if (np.abs(traction) <= limit)[problem.sets.stuck].all():
            break
        traction[:] = 0.0
        # Condensed slips know that the tractions are gone; displacements among the unknowns do not.
        stick_reference = c.slip(begin, coupling.split_motions(motion)[0], pressure, nothing)
    else:
        # Tractions that go from node to node, as in wedges and grooves: normals alone may hold the bodies.
        free = _without_friction(problem_at(drawn_x[: len(c.weight)], False, nothing), drawn_x, options)
        if free is None:
            problem = problem_at(pressure, True, stick_reference)
            return inside(Point(problem, correct(problem, x, 0.0, options).x, 0.0, nothing), problem)
        pressure, _, motion, _ = free[0].split(free[1])
        rest = c.slip(begin, coupling.split_motions(motion)[0], pressure, nothing)
        return Point(problem_at(pressure, True, rest), free[1], 0.0, nothing)
    return Point(problem, x, 0.0, nothing)


def _without_friction(
    problem: RegularizedFriction,
    x: FloatArray,
    options: AnmOptions | NewtonOptions,
) -> tuple[RegularizedFriction, FloatArray] | None:
    """The state before the first load where nothing rubs; None where only friction holds bodies."""
    try:
        return problem, correct(problem, x, 0.0, options).x
    except (NumericalError, np.linalg.LinAlgError):
        return None


def checkpoint_at(point: Point, state: State, follower: Follower | None = None) -> Checkpoint:
    """What the path goes on from at a point, whose state is given; a piece begins anew without a follower."""
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
    base = replace(coupling.softened(), law=replace(coupling.law, threshold=history.threshold))
    begin, end = built.stages[stage], built.stages[stage + 1]
    friction = RegularizedFriction(base, begin, end, history.sets, history.stick_reference)
    return Point(friction, x, lam, start.state.work)


def inside(point: Point, problem: RegularizedFriction) -> Point:
    """The point of a ``problem`` with no sticking node beyond its limit, at rest where it is now.

    What tractions put back change elsewhere is solved for, which may move others past their limits again.
    """
    for _ in range(RETURNS):
        x = problem.within_cone(point.x)
        if np.array_equal(x, point.x):
            return replace(point, problem=problem)
        problem = problem.rested(x, point.lam)
        x = x - problem.tangent(x, point.lam).solve(problem.residual(x, point.lam))
        point = replace(point, x=x)
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
