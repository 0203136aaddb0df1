"""Load path: initial state, steps, and requested states."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP, ContactStatus
from mlsanm_cli.contact.laws.active_set import ExactState, solve_exact
from mlsanm_cli.contact.laws.contact_state import ContactSolution
from mlsanm_cli.contact.laws.coulomb import CoulombState, event_driven_path, residual
from mlsanm_cli.contact.laws.coulomb import start as first_state
from mlsanm_cli.contact.laws.failures import EndlessError, SlidingError, UnbalancedError
from mlsanm_cli.contact.response.compressed import compressed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene, factors_at
from mlsanm_cli.solve.limit_loads import near_limit
from mlsanm_cli.solve.state import (
    UNLOADED,
    Checkpoint,
    PathStep,
    State,
    friction_history,
    output_positions,
    stops,
)

LIMIT_LEVELS = (0.5, 0.9, 0.99, 0.999)
"""Parts of a limit load at which the path has states."""
MIN_ROWS = 20
"""Least number of states of a path without friction, even between the requested ones."""
MIN_ROWS_OF_MANY = 1
"""The same for contacts with many unknowns, whose states take seconds each."""
MAX_ROWS = 40
"""Largest number of events of a stage with friction that are stored as steps, evenly distributed."""


def load_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """The path of the scene, or its remaining part, by the method of its contact law."""
    if built.laws:
        from mlsanm_cli.solve.plastic_path import plastic_path

        return plastic_path(built, start)
    if not built.case.touching:
        return linear_path(built, start)
    # Imported when needed, as each method imports another package.
    if built.case.is_regularized and not built.follows_exactly:
        from mlsanm_cli.paper.path import paper_path

        return _limited(built, start, paper_path(built, start))
    return (friction_path if len(built.condensed.friction_nodes) else exact_path)(built, start)


def _limited(built: CondensedScene, start: Checkpoint | None, path: Iterator[PathStep]) -> Iterator[PathStep]:
    """The path with NumericalError beyond the allowed number of steps."""
    most = built.case.solver.max_steps
    for count, step in enumerate(path, start.steps if start else 0):
        if count > most:
            why = f"max steps, more than {most} steps come before position {step.state.position:.9g}"
            raise NumericalError(f"the path stopped: {why}", "raise solver.max_steps")
        assert step.checkpoint is not None
        yield replace(step, checkpoint=replace(step.checkpoint, steps=count + 1))


def linear_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """Path without contact: every state is a linear combination of the solutions of the loads."""
    wanted, condensed, none = output_positions(built), built.condensed, np.zeros(0)
    for position in stops(built):
        if start is not None and position <= start.position:
            continue
        factors = factors_at(built.stages, position)
        motion = np.linalg.solve(condensed.balance.motion, -condensed.balance.load @ factors)
        status = np.zeros(0, dtype=np.int8)
        state = State(position, factors, none, none, np.asarray(motion, dtype=np.float64), status)
        yield PathStep(
            state,
            (state,) if position in wanted else (),
            solves=0 if position else condensed.solves,
            checkpoint=Checkpoint(state),
        )


def exact_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """Exact contact at the known ends of stages, at requested positions and evenly between them, each from
    the previous set; on the way to a limit load as close to it as states exist."""
    wanted, positions = output_positions(built), stops(built)
    ends = {
        float(number): one
        for number, one in enumerate(built.ends, start=1)
        if np.array_equal(one.factors, built.stages[number])
    }
    near, towards = near_limit(built.condensed, built.stages) if built.ends_early else None, []
    if near is not None:
        stage = np.ceil(near[1]) - 1.0
        towards = [float(stage + share * (near[1] - stage)) for share in LIMIT_LEVELS]
    rows = MIN_ROWS if compressed(built.condensed.gap.pressure) is None else MIN_ROWS_OF_MANY
    state = unloaded_state(built) if start is None else start.state
    if start is None:
        yield PathStep(state, (state,) if 0.0 in wanted else (), checkpoint=Checkpoint(state))
    for position in sorted({*positions, *_between(positions, rows), *towards}):
        if position <= state.position:
            continue
        active = state.closed if state.position > 0.0 else None
        factors = factors_at(built.stages, position)
        try:
            exact = ends[position] if position in ends else solve_exact(built.condensed, factors, active)
        except NumericalError as error:
            if position in positions or not isinstance(error, UnbalancedError | EndlessError):
                raise
            continue  # what floats on its way to a contact has no state there
        step = exact_step(exact, position)
        state = step.state
        yield replace(step, saved=(state,) if position in wanted else (), checkpoint=Checkpoint(state))


def _between(positions: Sequence[float], rows: int) -> Iterator[float]:
    """Positions that divide the intervals of ``positions`` into at least ``rows`` in total."""
    for begin, end in itertools.pairwise(positions):
        parts = int(np.ceil(rows * (end - begin) / positions[-1]))
        yield from (begin + part / parts * (end - begin) for part in range(1, parts))


def exact_step(exact: ExactState, position: float) -> PathStep:
    """Exact state without friction as a step without saved states."""
    status, solves = np.where(exact.active, SLIP, OPEN).astype(np.int8), exact.solves
    state = State(position, exact.factors, exact.pressure, exact.gap, exact.motion, status, exact.residual)
    return PathStep(state, (), iterations=solves, factorizations=solves, solves=2 * solves)


def unloaded_state(built: CondensedScene) -> State:
    """Initial state of the path, deformed only if surfaces overlap."""
    gap, factors = built.condensed.gap, built.stages[0]
    if built.condensed.overlap(gap.constant):
        return exact_step(solve_exact(built.condensed, factors), 0.0).state
    zero, motion = np.zeros(len(gap.constant)), np.zeros(len(built.condensed.balance.constant))
    status = np.where(gap.constant <= 0.0, SLIP, OPEN).astype(np.int8)
    return State(0.0, factors, zero, gap.constant, motion, status)


def friction_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """Path of exact contact with Coulomb friction, from event to event."""
    if start is None:
        state, begun, reached = first_state(built.condensed, built.stages[0], _typical(built) or 0.0), 0, 0.0
        yield replace(_row(built, 0, state, state.solves), iterations=0, solves=0)
    else:
        state, begun, reached = _restored(start), start.stage, start.fraction
    for stage in range(begun, len(built.stages) - 1):
        state = yield from _stage_path(built, stage, state, reached)
        reached = 0.0


def _typical(built: CondensedScene) -> float | None:
    """Largest pressure at the ends of stages, None without any."""
    return max((float(end.pressure.max(initial=0.0)) for end in built.ends), default=0.0) or None


def _stage_path(
    built: CondensedScene, stage: int, state: CoulombState, reached: float
) -> Generator[PathStep, None, CoulombState]:
    """Path of a stage beyond the part ``reached``, with all requested states and a limited number of others;
    returns the state at its end."""
    halts = sorted(place for position in stops(built) if reached < (place := position - stage) <= 1.0)
    before, solves, jump, unloaded = reached, 0, "", False
    pending: Callable[[], PathStep] | None = None
    begin, end = built.stages[stage], built.stages[stage + 1]
    try:
        path = event_driven_path(built.condensed, state, end, halts, begin, reached, _typical(built))
        for state in path:
            reached, solves = state.fraction, solves + state.solves
            if state.jumped and not unloaded:
                jump = (
                    f"the contact snaps to another state before position {stage + reached:.6g}: "
                    f"there is no continuous path"
                )
            unloaded = _share(built, state, stage + reached) < UNLOADED
            pending = partial(_row, built, stage, state, solves, jump)
            if reached in halts or reached >= before + 1.0 / MAX_ROWS or state.jumped:
                yield pending()
                before, solves, jump, pending = reached, 0, "", None
    except NumericalError as error:
        if pending is not None:
            yield pending()
        if isinstance(error, SlidingError):
            raise SlidingError(error.fraction, f" at position {stage + error.fraction:.9g}") from error
        raise NumericalError(f"{error.message} beyond position {stage + reached:.9g}", error.hint) from error
    return state


def _row(built: CondensedScene, stage: int, exact: CoulombState, solves: int, jump: str = "") -> PathStep:
    """Step that ends at an event, after ``solves`` systems, with a warning of a ``jump``."""
    position = stage + exact.fraction
    state = coulomb_state(built, exact, position)
    return PathStep(
        state,
        (state,) if position in output_positions(built) else (),
        iterations=solves,
        factorizations=solves,
        solves=4 * solves,
        warning=jump,
        checkpoint=Checkpoint(state, friction_history(exact.sets, exact.stick_reference)),
    )


def _restored(start: Checkpoint) -> CoulombState:
    """Exact state of a checkpoint."""
    state, history = start.state, start.history
    values = ContactSolution(state.pressure, state.traction, state.motion, state.gap, state.slip)
    sets = ContactStatus(**history["sets"])
    return CoulombState(state.factors, values, sets, history["stick_reference"], state.work)


def coulomb_state(built: CondensedScene, state: CoulombState, position: float) -> State:
    """Exact state with friction as a state of the path at a position."""
    values = state.values
    return State(
        position,
        state.factors,
        values.pressure,
        values.gap,
        values.motion,
        state.sets.status(built.condensed.friction_nodes),
        _share(built, state, position) * residual(built.condensed, state),
        values.traction,
        values.slip,
        state.work,
    )


def _share(built: CondensedScene, state: CoulombState, position: float) -> float:
    """Pressures over the least by which residuals are measured, if they are below."""
    before = max((float(end.pressure.max(initial=0.0)) for end in built.ends[: int(position)]), default=0.0)
    least, now = UNLOADED * before, float(state.values.pressure.max(initial=0.0))
    return now / least if now < least else 1.0
