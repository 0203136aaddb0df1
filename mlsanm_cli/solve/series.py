"""The load path of the smooth contact law, followed by power series or by Newton-Raphson."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mlsanm_cli.arrays import FloatArray, IntArray
from mlsanm_cli.contact.laws.contact_status import OPEN, SLIP, STICK
from mlsanm_cli.contact.laws.coupling import Coupling, DenseCoupling
from mlsanm_cli.contact.laws.holonomic import HolonomicContact
from mlsanm_cli.contact.laws.regularization import Regularization
from mlsanm_cli.contact.laws.regularized_friction import RegularizedFriction
from mlsanm_cli.contact.laws.scales import regularize
from mlsanm_cli.contact.monolithic.system import SparseCoupling, sparse_coupling
from mlsanm_cli.continuation import (
    AnmOptions,
    Branch,
    Correction,
    Follower,
    NewtonOptions,
    Outcome,
    Problem,
    Step,
    correct,
    follow,
)
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import Checkpoint, PathStep, State, wanted_positions

BRANCH_HINT = (
    'raise contact.regularization.eta or solver.tolerance, or use contact.regularization.law = "exact"'
)
UNLIMITED = sys.maxsize
WIDER = (1e4, 1e3, 1e2, 1e1, 1.0)


def smooth_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """Laws without memory; wanted states come from the series of their step, or end one of Newton's."""
    wanted = wanted_positions(built)
    coupling, options = coupling_of(built, regularization(built)), path_options(built)
    for stage in range(start.stage if start else 0, len(built.case.stage)):
        before, piece, problem = 0.0, None, problem_of(built, coupling, stage)
        if start is not None and stage == start.stage:
            before, x = start.fraction, _unknowns(problem, start)
            piece = previous_piece(start, x)
        elif start is None and stage == 0:
            corrected = _started(built, coupling, options)
            x = corrected.x
            first = _regularized_state(problem, x, 0.0, stage, corrected.residual)
            yield PathStep(
                first,
                (first,) if 0.0 in wanted else (),
                iterations=corrected.updates,
                factorizations=corrected.factorizations,
                solves=corrected.solves,
                checkpoint=Checkpoint(first),
            )
        if not problem.change.any():
            state = _regularized_state(problem, x, 1.0, stage, float(np.abs(problem.residual(x, 1.0)).max()))
            yield PathStep(
                state,
                tuple(replace(state, position=p) for p in wanted if stage < p <= stage + 1),
                checkpoint=Checkpoint(state),
            )
            continue
        levels = levels_in(wanted, stage)
        follower = follow(problem, x, before, 1.0, options, piece, levels=levels)
        for step in follower.steps():
            if step.lam == 1.0:
                step = at_target(problem, step)
            x = step.x
            end = _regularized_state(problem, x, step.lam, stage, step.residual)
            places = [p for p in wanted if stage + before < p <= stage + step.lam]
            step, states = states_in(problem, step, stage, places)
            saved = [_regularized_state(problem, *one[:2], stage, one[2]) for one in states]
            told = path_step(step, end, stage, at(places, saved, end), _series(problem, step.branch, stage))
            yield replace(told, checkpoint=checkpoint_of(end, follower))
            before = step.lam
        if not follower.outcome.reached:
            raise stopped(stage, follower.outcome)


Memoryless = RegularizedFriction | HolonomicContact


def _started(
    built: CondensedScene, coupling: DenseCoupling | SparseCoupling, options: AnmOptions | NewtonOptions
) -> Correction:
    """The state before the first load. Where loose bodies are far from where they float, as surfaces overlap
    that are drawn touching elsewhere, the law's length is first made longer, then comes back."""
    problem = problem_of(built, coupling, 0)
    try:
        return correct(problem, start_point(built, problem), 0.0, options)
    except NumericalError as error:
        failure, x = error, None
    for wider in WIDER:
        law = replace(coupling.law, delta=wider * coupling.law.delta)
        problem = problem_of(built, replace(coupling, law=law), 0)
        try:
            found = correct(problem, start_point(built, problem) if x is None else x, 0.0, options)
        except NumericalError:
            raise failure from None
        x = found.x
    return found


def checkpoint_of(state: State, follower: Follower) -> Checkpoint:
    """What a path that is taken up again at a state has to know of the step before."""
    piece = follower.outcome.piece
    if piece is None:
        return Checkpoint(state)
    return Checkpoint(state, heading=np.append(piece.x[1], piece.lam[1]), pace=piece.length)


def previous_piece(start: Checkpoint, x: FloatArray) -> Branch | None:
    """The piece of path behind a checkpoint whose unknowns are x (size,), as far as the next one asks for
    it; None where a piece begins anew."""
    if start.fraction == 0.0 or not len(start.heading):
        return None
    ends = np.array([x, start.heading[:-1]]), np.array([start.fraction, start.heading[-1]])
    return Branch(*ends, start.pace)


def unknowns_of(state: State) -> FloatArray:
    """Pressures, gaps, motions, displacements where the path has them, and tractions of a state."""
    return np.concatenate([state.pressure, state.gap, state.motion, state.displacement, state.traction])


def _unknowns(problem: Memoryless, start: Checkpoint) -> FloatArray:
    x = unknowns_of(start.state)
    return problem.with_auxiliary(x, start.fraction) if isinstance(problem, HolonomicContact) else x


def regularization(built: CondensedScene) -> Regularization:
    """The case's smooth law with the scene's scales."""
    condensed = built.condensed
    eta, stick = np.empty(len(condensed.weight)), np.empty(len(condensed.friction_nodes))
    for contact in built.case.touching:
        eta[condensed.spans[contact.name]] = contact.regularization.eta
        if contact.friction:
            stick[condensed.tangential[contact.name]] = contact.regularization.stick
    return regularize(condensed, built.ends, eta, stick)


def coupling_of(built: CondensedScene, law: Regularization) -> DenseCoupling | SparseCoupling:
    """What the bodies answer with, in the scales of a law."""
    if built.case.solver.formulation == "monolithic":
        return sparse_coupling(built.scene, built.condensed, law)
    return DenseCoupling.of(built.condensed, law)


def problem_of(built: CondensedScene, coupling: Coupling, stage: int) -> Memoryless:
    """The equations of a stage under a law without memory."""
    make = HolonomicContact if len(built.condensed.friction_nodes) else RegularizedFriction.frictionless
    return make(coupling, built.stages[stage], built.stages[stage + 1])


def path_options(built: CondensedScene) -> AnmOptions | NewtonOptions:
    """The case's method and its options; steps are counted over the whole path, not by those of a stage."""
    solver = built.case.solver
    if solver.method == "newton":
        return NewtonOptions(tolerance=solver.tolerance, max_steps=UNLIMITED)
    return AnmOptions(order=solver.order, tolerance=solver.tolerance, pade=solver.pade, max_steps=UNLIMITED)


def levels_in(wanted: tuple[float, ...], stage: int) -> list[float]:
    """The wanted positions within a stage, as fractions of it."""
    return [position - stage for position in wanted if stage < position < stage + 1]


def stopped(stage: int, outcome: Outcome) -> NumericalError:
    """What to say of a path that did not reach the end of its stage."""
    return NumericalError(
        f"the path stopped at position {stage + outcome.lam:.6g}: {outcome.reason.value} ({outcome.message})",
        BRANCH_HINT,
    )


def sharpened(problem: Problem, x: FloatArray, lam: float) -> tuple[FloatArray, float]:
    """Unknowns of a state from a series with one more Newton update, and their residual.

    A series only keeps the tolerance, where users compare figures to the last digit.
    """
    lack = problem.residual(x, lam)
    before = float(np.abs(lack).max())
    try:
        better = x - problem.tangent(x, lam).solve(lack)
    except np.linalg.LinAlgError:  # a fold at the very target: the series' own state keeps the tolerance
        return x, before
    after = float(np.abs(problem.residual(better, lam)).max())
    return (better, after) if after < before and problem.admissible(better, lam) else (x, before)


def at_target(problem: Problem, step: Step) -> Step:
    """The last step of a stage, its end sharpened unless Newton's method has done that."""
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


def start_point(built: CondensedScene, problem: Memoryless) -> FloatArray:
    """Open gaps as drawn, closed or overlapping ones opened a little, and the pressures that go with them."""
    x = drawn(built, problem.coupling)
    if isinstance(problem, HolonomicContact):
        return problem.with_auxiliary(np.concatenate([x, np.zeros(problem.n)]), 0.0)
    return x


def drawn(built: CondensedScene, coupling: Coupling) -> FloatArray:
    """Pressures (m,), gaps (m,) and motions (k,) of the smooth law near the scene as drawn."""
    gap = np.maximum(built.condensed.gap.constant, 0.1 * coupling.law.gap)
    pressure = coupling.law.eta * (coupling.law.delta / gap - 1.0)
    return np.concatenate([pressure, gap, np.zeros(len(coupling.motion))])


def states_in(
    problem: Problem, step: Step, stage: int, places: list[float]
) -> tuple[Step, list[tuple[FloatArray, float, float]]]:
    """The step with what its ``places`` took, and there unknowns, fractions and residuals.

    Those inside come from its series, sharpened; a step without a series has such a place at its end only.
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
    """A finished step as the recorder takes it; what is only a guess between two states is not stored."""
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


def _series(problem: Memoryless, branch: Branch, stage: int) -> dict[str, FloatArray]:
    """Coefficients over the path parameter a, 0 <= a <= length; with ``denominator`` the Pade form holds."""
    pressure, gap, motion, traction, *_ = problem.split(branch.x)
    parts = {"pressure": pressure, "gap": gap, "motion": problem.coupling.split_motions(motion)[0]}
    return series_arrays(branch, stage, parts | {"traction": traction} if problem.n else parts)


def series_arrays(branch: Branch, stage: int, parts: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """What is stored of a step's series: position, the named parts of the unknowns, denominator."""
    position = branch.lam.copy()
    position[0] += stage
    arrays = {"position": position, **parts}
    return arrays if branch.denominator is None else {**arrays, "denominator": branch.denominator}


def smooth_status(
    law: Regularization, pressure: FloatArray, gap: FloatArray, held: IntArray
) -> NDArray[np.int8]:
    """Status (m,) of the candidates under the smooth law; those in ``held`` stick where they are closed.

    A node counts as closed where its pressure, in units of the scene, has outgrown its gap.
    """
    closed = pressure / law.pressure > gap / law.gap
    status = np.where(closed, SLIP, OPEN).astype(np.int8)
    status[held[closed[held]]] = STICK
    return status


def _regularized_state(problem: Memoryless, x: FloatArray, lam: float, stage: int, residual: float) -> State:
    pressure, gap, motion, *rest = problem.split(x)
    motion, displacement = problem.coupling.split_motions(motion)
    held = np.zeros(0, dtype=np.int64)
    traction = slip = work = np.zeros(0)
    if isinstance(problem, HolonomicContact):
        traction, slip = rest[0], problem.slip(x, lam)
        held = problem.condensed.friction_nodes[np.abs(slip) < problem.small]
        # Dissipation is a matter of history, which this law does not know.
        work = np.full(problem.n, np.nan)
    status = smooth_status(problem.law, pressure, gap, held)
    return State(
        stage + lam,
        problem.factors(lam),
        pressure,
        gap,
        motion,
        traction,
        slip,
        work,
        status,
        residual,
        displacement,
    )
