"""Equations of the regularised contact laws; points and states on their paths from the series of steps."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np

from mlsanm_cli.arrays import FloatArray
from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.scales import Regularization, regularize
from mlsanm_cli.contact.monolithic.system import SparseCoupling, sparse_coupling
from mlsanm_cli.continuation import AnmOptions, Branch, NewtonOptions, Outcome, Problem
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Checkpoint, State, friction_history

BRANCH_HINT = (
    'raise contact.regularization.eta or solver.tolerance, or use contact.regularization.law = "exact"'
)
UNLIMITED = sys.maxsize

ContactProblem = RegularizedFriction | HolonomicContact


def previous_piece(start: Checkpoint, x: FloatArray) -> Branch | None:
    """The linear piece of path before a checkpoint with unknowns x (size,); None if a piece begins anew."""
    if start.fraction == 0.0 or not len(start.heading):
        return None
    ends = np.array([x, start.heading[:-1]]), np.array([start.fraction, start.heading[-1]])
    return Branch(*ends, start.pace)


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


def start_point(built: CondensedScene, problem: ContactProblem) -> FloatArray:
    """Unknowns near the initial state."""
    x = drawn(built, problem.coupling)
    return problem.with_auxiliary(x, 0.0) if isinstance(problem, HolonomicContact) else x


def drawn(built: CondensedScene, coupling: Coupling) -> FloatArray:
    """Initial gaps, those closed or negative opened slightly, with the corresponding pressures; no motions
    and tractions."""
    law, still = coupling.law, np.zeros(len(coupling.motion) + len(built.condensed.friction_nodes))
    gap = np.maximum(built.condensed.gap.constant, 0.1 * law.gap)
    return np.concatenate([law.eta * (law.delta / gap - 1.0), gap, still])


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
    def residual(self) -> float:
        """Largest residual."""
        return float(np.abs(self.problem.residual(self.x, self.lam)).max())

    @property
    def friction(self) -> RegularizedFriction | None:
        """The problem, if friction has a memory."""
        problem = self.problem
        return problem if isinstance(problem, RegularizedFriction) and problem.n else None


def checkpoint_at(point: PathPoint, state: State, piece: Branch | None = None) -> Checkpoint:
    """Checkpoint at a point with its state, and the direction of the last ``piece`` if it continues."""
    found, problem = Checkpoint(state), point.friction
    if piece is not None:
        found = replace(found, heading=np.append(piece.x[1], piece.lam[1]), pace=piece.length)
    if problem is None:
        return found
    history = friction_history(problem.sets, problem.stick_reference, problem.law.threshold)
    return replace(found, history=history)


def restored(built: CondensedScene, start: Checkpoint) -> PathPoint:
    """The point of a checkpoint."""
    stage, state, history = min(start.stage, len(built.stages) - 2), start.state, start.history
    coupling = coupling_of(built, regularization(built))
    lam = start.position - stage
    x = np.concatenate([state.pressure, state.gap, state.motion, state.displacement, state.traction])
    if not history:
        problem = problem_of(built, coupling, stage)
        if isinstance(problem, HolonomicContact):
            x = problem.with_auxiliary(x, lam)
        return PathPoint(problem, x, lam, state.work)
    base = coupling.with_stick_compliance().with_thresholds(history["threshold"])
    begin, end = built.stages[stage], built.stages[stage + 1]
    sets = ContactStatus(**history["sets"])
    friction = RegularizedFriction(base, begin, end, sets, history["stick_reference"])
    return PathPoint(friction, x, lam, state.work)


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
    """Coefficients of position and unknowns in the path parameter a, 0 <= a <= length; with ``denominator``
    of the Padé form."""
    pressure, gap, motion, traction, *_ = problem.split(branch.x)
    found = {"position": branch.lam.copy(), "pressure": pressure, "gap": gap}
    found["position"][0] += stage
    found["motion"] = problem.coupling.split_motions(motion)[0]
    if problem.n:
        found["traction"] = traction
    return found if branch.denominator is None else {**found, "denominator": branch.denominator}


def state_of(point: PathPoint, stage: int, residual: float) -> State:
    """The state at a point of a stage. A node is closed if its pressure, in units of the scene, exceeds its
    gap."""
    problem, x, lam = point.problem, point.x, point.lam
    pressure, gap, motion, traction, *_ = problem.split(x)
    motion, displacement = problem.coupling.split_motions(motion)
    closed = pressure / problem.law.pressure > gap / problem.law.gap
    stuck = problem.sticking(x, lam) & closed[problem.condensed.friction_nodes]
    return State(
        stage + lam,
        problem.factors(lam),
        pressure,
        gap,
        motion,
        ContactStatus(closed, stuck, np.zeros(0)).status(problem.condensed.friction_nodes),
        residual,
        traction,
        problem.slip(x, lam),
        point.work,
        displacement,
    )
