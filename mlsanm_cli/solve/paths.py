"""Load path: initial state, steps, and requested states."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP
from mlsanm_cli.contact.laws.contact_state import ContactState, residual
from mlsanm_cli.contact.laws.coulomb import event_driven_path
from mlsanm_cli.contact.laws.coulomb import start as first_state
from mlsanm_cli.contact.laws.failures import EndlessError, SlidingError, UnbalancedError
from mlsanm_cli.contact.laws.frictionless import solve_exact
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
    # Imported when needed, as each method imports another package.
    if built.laws:
        from mlsanm_cli.solve.plastic_path import plastic_path

        return plastic_path(built, start)
    if not built.case.touching:
        return linear_path(built, start)
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
    condensed, passed = built.condensed, -1.0 if start is None else start.position
    for position in (one for one in built.stops if one > passed):
        factors = factors_at(built.stages, position)
        motion = np.linalg.solve(condensed.balance.motion, -condensed.balance.load @ factors)
        state = State(position, factors, motion=np.asarray(motion, dtype=np.float64))
        yield replace(_step(built, state), solves=0 if position else condensed.solves)


def exact_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """Exact contact at the known ends of stages, at requested positions and evenly between them, each from
    the previous set; on the way to a limit load as close to it as states exist."""
    condensed, positions = built.condensed, built.stops
    known = zip(built.ends, built.stages[1:], strict=False)
    ends = {
        float(number): one
        for number, (one, factors) in enumerate(known, start=1)
        if np.array_equal(one.factors, factors)
    }
    near, wanted = near_limit(condensed, built.stages) if built.ends_early else None, set(positions)
    if near is not None:
        stage = np.ceil(near[1]) - 1.0
        wanted |= {float(stage + share * (near[1] - stage)) for share in LIMIT_LEVELS}
    rows = MIN_ROWS if compressed(condensed.gap.pressure) is None else MIN_ROWS_OF_MANY
    for begin, end in itertools.pairwise(positions):
        parts = int(np.ceil(rows * (end - begin) / positions[-1]))
        wanted |= {begin + part / parts * (end - begin) for part in range(1, parts)}
    state = _drawn(built) if start is None else start.state
    if start is None:
        yield _step(built, state)
    for position in sorted(wanted):
        if position <= state.position:
            continue
        closed = state.closed if state.position > 0.0 else None
        factors = factors_at(built.stages, position)
        try:
            contacts = ends[position] if position in ends else solve_exact(condensed, factors, closed)
        except NumericalError as error:
            if position in positions or not isinstance(error, UnbalancedError | EndlessError):
                raise
            continue  # what floats on its way to a contact has no state there
        state = _state(built, contacts, position)
        yield _step(built, state, contacts.solves)


def _drawn(built: CondensedScene) -> State:
    """Initial state of contacts without friction, deformed only if surfaces overlap."""
    gap, factors = built.condensed.gap.constant, built.stages[0]
    if built.condensed.overlap(gap):
        return _state(built, solve_exact(built.condensed, factors), 0.0)
    motion = np.zeros(len(built.condensed.balance.constant))
    return State(
        0.0, factors, np.zeros(len(gap)), gap, motion, np.where(gap <= 0.0, SLIP, OPEN).astype(np.int8)
    )


def friction_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """Path of exact contact with Coulomb friction, from event to event, with all requested states and a
    limited number of others."""
    largest = max((float(end.pressure.max(initial=0.0)) for end in built.ends), default=0.0)
    if start is None:
        contacts, stage, reached = first_state(built.condensed, built.stages[0], largest), 0, 0.0
        first = _step(built, _state(built, contacts, 0.0), contacts.solves, contacts)
        yield replace(first, iterations=0, solves=0)
    else:
        contacts = start.state.contacts(built.condensed.friction_nodes, start.history)
        stage, reached = start.stage, start.fraction
    for number in range(stage, len(built.stages) - 1):
        halts = sorted(place for one in built.stops if reached < (place := one - number) <= 1.0)
        before, solves, warning, pending = reached, 0, "", False
        begin, end = built.stages[number], built.stages[number + 1]
        unloaded = False
        path = event_driven_path(built.condensed, contacts, end, halts, begin, reached, largest or None)
        try:
            for contacts in path:
                reached, solves, pending = contacts.fraction, solves + contacts.solves, True
                if contacts.jumped and not unloaded:
                    warning = (
                        f"the contact snaps to another state before position {number + reached:.6g}: "
                        f"there is no continuous path"
                    )
                unloaded = _share(built, contacts, number + reached) < UNLOADED
                if reached in halts or reached >= before + 1.0 / MAX_ROWS or contacts.jumped:
                    step = _step(built, _state(built, contacts, number + reached), solves, contacts)
                    yield replace(step, warning=warning)
                    before, solves, warning, pending = reached, 0, "", False
        except NumericalError as error:
            if pending:
                step = _step(built, _state(built, contacts, number + reached), solves, contacts)
                yield replace(step, warning=warning)
            if isinstance(error, SlidingError):
                raise SlidingError(error.fraction, f" at position {number + error.fraction:.9g}") from error
            raise NumericalError(
                f"{error.message} beyond position {number + reached:.9g}", error.hint
            ) from error
        reached = 0.0


def _state(built: CondensedScene, contacts: ContactState, position: float) -> State:
    worst = _share(built, contacts, position) * residual(built.condensed, contacts)
    return State.of(contacts, built.condensed.friction_nodes, position, worst)


def _share(built: CondensedScene, contacts: ContactState, position: float) -> float:
    """Pressures over the least by which residuals are measured, if they are below."""
    before = max((float(end.pressure.max(initial=0.0)) for end in built.ends[: int(position)]), default=0.0)
    least, now = UNLOADED * before, float(contacts.pressure.max(initial=0.0))
    return now / least if now < least else 1.0


def _step(
    built: CondensedScene, state: State, systems: int = 0, contacts: ContactState | None = None
) -> PathStep:
    """Step that ends at a ``state`` after so many ``systems``; with friction in that of the ``contacts``."""
    return PathStep(
        state,
        (state,) if state.position in built.outputs else (),
        iterations=systems,
        factorizations=systems,
        solves=(2 if contacts is None else 4) * systems,
        checkpoint=Checkpoint(state, friction_history(contacts) if contacts is not None else {}),
    )
