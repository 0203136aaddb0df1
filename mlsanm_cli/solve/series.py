"""Equations of the regularised contact laws; points and states on their paths from the series of steps."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP, STICK
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.scales import Regularization, regularize
from mlsanm_cli.contact.monolithic.system import SparseCoupling, sparse_coupling
from mlsanm_cli.continuation import AnmOptions, Branch, Follower, NewtonOptions, Outcome, Problem, Step
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Checkpoint, FrictionHistory, PathStep, State

BRANCH_HINT = (
    'raise contact.regularization.eta or solver.tolerance, or use contact.regularization.law = "exact"'
)
UNLIMITED = sys.maxsize

ContactProblem = RegularizedFriction | HolonomicContact


def checkpoint_of(state: State, follower: Follower) -> Checkpoint:
    """Checkpoint with the direction of the last step."""
    piece = follower.outcome.piece
    if piece is None:
        return Checkpoint(state)
    return Checkpoint(state, heading=np.append(piece.x[1], piece.lam[1]), pace=piece.length)


def previous_piece(start: Checkpoint, x: FloatArray) -> Branch | None:
    """The linear piece of path before a checkpoint with unknowns x (size,); None if a piece begins anew."""
    if start.fraction == 0.0 or not len(start.heading):
        return None
    ends = np.array([x, start.heading[:-1]]), np.array([start.fraction, start.heading[-1]])
    return Branch(*ends, start.pace)


def unknowns_of(state: State) -> FloatArray:
    """Pressures, gaps, motions, displacements (if unknowns) and tractions of a state as one vector."""
    return np.concatenate([state.pressure, state.gap, state.motion, state.displacement, state.traction])


def regularization(built: CondensedScene) -> Regularization:
    """The regularised law of the case with the scales of the scene."""
    condensed = built.condensed
    eta, stick = np.empty(len(condensed.weight)), np.empty(len(condensed.friction_nodes))
    for contact in built.case.touching:
        eta[condensed.spans[contact.name]] = contact.regularization.eta
        if contact.friction:
            stick[condensed.tangential[contact.name]] = contact.regularization.stick
    return regularize(condensed, built.ends, eta, stick)


def coupling_of(built: CondensedScene, law: Regularization) -> DenseCoupling | SparseCoupling:
    """Responses of the bodies in the scales of a law."""
    if built.case.solver.formulation == "monolithic":
        return sparse_coupling(built.scene, built.condensed, law)
    return DenseCoupling.of(built.condensed, law)


def problem_of(built: CondensedScene, coupling: Coupling, stage: int) -> ContactProblem:
    """Equations of a stage under a law without memory."""
    make = HolonomicContact if len(built.condensed.friction_nodes) else RegularizedFriction.frictionless
    return make(coupling, built.stages[stage], built.stages[stage + 1])


def path_options(built: CondensedScene) -> AnmOptions | NewtonOptions:
    """Method and options of the case; steps are counted over the whole path, not per stage."""
    solver = built.case.solver
    if solver.method == "newton":
        return NewtonOptions(tolerance=solver.tolerance, max_steps=UNLIMITED)
    return AnmOptions(order=solver.order, tolerance=solver.tolerance, pade=solver.pade, max_steps=UNLIMITED)


def levels_in(wanted: tuple[float, ...], stage: int) -> list[float]:
    """Requested positions within a stage, as fractions of it."""
    return [position - stage for position in wanted if stage < position < stage + 1]


def stopped(stage: int, outcome: Outcome) -> NumericalError:
    """Error of a path that did not reach the end of its stage."""
    return NumericalError(
        f"the path stopped at position {stage + outcome.lam:.6g}: {outcome.reason.value} ({outcome.message})",
        BRANCH_HINT,
    )


def sharpened(problem: Problem, x: FloatArray, lam: float) -> tuple[FloatArray, float]:
    """Unknowns of a state from a series after one Newton update, and their residual. Series only satisfy the
    tolerance, while results are compared to the last digit."""
    defect = problem.residual(x, lam)
    before = float(np.abs(defect).max())
    try:
        better = x - problem.tangent(x, lam).solve(defect)
    except np.linalg.LinAlgError:  # a fold at the very target: the series' own state keeps the tolerance
        return x, before
    after = float(np.abs(problem.residual(better, lam)).max())
    return (better, after) if after < before and problem.admissible(better, lam) else (x, before)


def at_target(problem: Problem, step: Step) -> Step:
    """Last step of a stage with its end corrected, unless Newton's method has done that."""
    if not step.order:
        return step
    x, residual = sharpened(problem, step.x, step.lam)
    return _with_updates(replace(step, x=x, residual=residual), 1)


def _with_updates(step: Step, count: int) -> Step:
    return replace(
        step,
        iterations=step.iterations + count,
        factorizations=step.factorizations + count,
        solves=step.solves + count,
    )


def start_point(built: CondensedScene, problem: ContactProblem) -> FloatArray:
    """Initial gaps, those closed or negative opened slightly, and the corresponding pressures."""
    x = drawn(built, problem.coupling)
    if isinstance(problem, HolonomicContact):
        return problem.with_auxiliary(np.concatenate([x, np.zeros(problem.n)]), 0.0)
    return x


def drawn(built: CondensedScene, coupling: Coupling) -> FloatArray:
    """Pressures (m,), gaps (m,) and motions (k,) of the regularised law near the initial state."""
    law, motion = coupling.law, np.zeros(len(coupling.motion))
    gap = np.maximum(built.condensed.gap.constant, 0.1 * law.gap)
    return np.concatenate([law.eta * (law.delta / gap - 1.0), gap, motion])


def states_in(
    problem: Problem, step: Step, stage: int, places: list[float]
) -> tuple[Step, list[tuple[FloatArray, float, float]]]:
    """The step with unknowns, fractions and residuals at its ``places``. Inner ones are corrected values of
    its series; a step without a series has a place at its end only."""
    states, sharp = [], 0
    for position in places:
        if not step.order or position - stage >= step.lam:
            states.append((step.x, step.lam, step.residual))
            continue
        x, lam = step.branch.evaluate(step.branch.parameter_at(position - stage))
        x, residual = sharpened(problem, x, lam)
        states.append((x, lam, residual))
        sharp += 1
    return _with_updates(step, sharp), states


def at(places: list[float], states: list[State], end: State) -> tuple[State, ...]:
    """The states with the positions asked for, not the ones a last bit away that the series had."""
    return tuple(
        end if position == end.position else replace(state, position=position)
        for position, state in zip(places, states, strict=True)
    )


def path_step(
    step: Step, end: State, stage: int, saved: tuple[State, ...], series: dict[str, FloatArray]
) -> PathStep:
    """A finished step for the recorder; predictors between states are not stored."""
    return PathStep(
        state=end,
        saved=saved,
        length=step.arc_length,
        order=step.order,
        iterations=step.iterations,
        factorizations=step.factorizations,
        solves=step.solves,
        series=series if step.order else {},
        series_attributes={"length": step.branch.length, "stage": stage},
    )


def series_arrays(branch: Branch, stage: int, parts: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Stored series of a step: position, named parts of the unknowns, denominator."""
    position = branch.lam.copy()
    position[0] += stage
    arrays = {"position": position, **parts}
    return arrays if branch.denominator is None else {**arrays, "denominator": branch.denominator}


def smooth_status(
    law: Regularization, pressure: FloatArray, gap: FloatArray, held: IntArray
) -> NDArray[np.int8]:
    """Status (m,) of the candidates under the regularised law; those in ``held`` stick where closed. A node
    is closed if its pressure, in units of the scene, exceeds its gap."""
    closed = pressure / law.pressure > gap / law.gap
    status = np.where(closed, SLIP, OPEN).astype(np.int8)
    status[held[closed[held]]] = STICK
    return status


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
