"""Load path of exact contact with Coulomb friction, from event to event."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from functools import partial

from mlsanm_cli.contact.complementarity.problem import ContactStatus
from mlsanm_cli.contact.laws.contact_state import ContactSolution
from mlsanm_cli.contact.laws.coulomb import CoulombState, event_driven_path, residual
from mlsanm_cli.contact.laws.coulomb import start as first_state
from mlsanm_cli.contact.laws.failures import SlidingError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.state import (
    UNLOADED,
    Checkpoint,
    PathStep,
    State,
    friction_history,
    output_positions,
    stops,
)

MAX_ROWS = 40
"""Largest number of events of a stage with friction that are stored as steps, evenly distributed."""


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
