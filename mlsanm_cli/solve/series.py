"""Equations of the regularised contact laws, and states from the series of their steps."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP, STICK
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.scales import Regularization, regularize
from mlsanm_cli.contact.monolithic.system import SparseCoupling, sparse_coupling
from mlsanm_cli.continuation import (
    AnmOptions,
    Branch,
    Follower,
    NewtonOptions,
    Outcome,
    Problem,
    Step,
)
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Checkpoint, PathStep, State

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
    """Unknowns of a state from a series after one Newton update, and their residual.

    Series only satisfy the tolerance, while results are compared to the last digit.
    """
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
    """The step with unknowns, fractions and residuals at its ``places``.

    Inner ones are corrected values of its series; a step without a series has a place at its end only.
    """
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
    """Status (m,) of the candidates under the regularised law; those in ``held`` stick where closed.

    A node is closed if its pressure, in units of the scene, exceeds its gap.
    """
    closed = pressure / law.pressure > gap / law.gap
    status = np.where(closed, SLIP, OPEN).astype(np.int8)
    status[held[closed[held]]] = STICK
    return status
