"""Load path: initial state, steps, and requested states."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mlsanm_cli.contact.complementarity.problem import OPEN, SLIP
from mlsanm_cli.contact.laws.contact_state import (
    ContactState,
    EndlessError,
    SlidingError,
    UnbalancedError,
    residual,
)
from mlsanm_cli.contact.laws.coulomb import event_driven_path
from mlsanm_cli.contact.laws.coulomb import start as first_state
from mlsanm_cli.contact.laws.frictionless import solve_exact
from mlsanm_cli.contact.response.compressed import compressed
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene, factors_at
from mlsanm_cli.solve.contact_states import near_limit
from mlsanm_cli.solve.state import UNLOADED, Checkpoint, PathStep, State

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
        yield built.step(state, solves=0 if position else condensed.solves)


def exact_path(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """Exact contact without friction at requested positions and evenly between them, each from the previous
    set; on the way to a limit load as close to it as states exist."""
    condensed, positions = built.condensed, built.stops
    near, wanted = near_limit(condensed, built.stages) if built.ends_early else None, set(positions)
    if near is not None:
        wanted |= {near.stage + share * near.part for share in LIMIT_LEVELS}
    rows = MIN_ROWS if compressed(condensed.gap.pressure) is None else MIN_ROWS_OF_MANY
    for begin, end in itertools.pairwise(positions):
        parts = int(np.ceil(rows * (end - begin) / positions[-1]))
        wanted |= {begin + part / parts * (end - begin) for part in range(1, parts)}
    if start is None:
        gap, factors = condensed.gap.constant, built.stages[0]
        if condensed.overlap(gap):
            step = _step(built, solve_exact(condensed, factors), 0.0)
        else:
            motion = np.zeros(len(condensed.balance.constant))
            status = np.where(gap <= 0.0, SLIP, OPEN).astype(np.int8)
            step = built.step(State(0.0, factors, np.zeros(len(gap)), gap, motion, status))
        yield step
    passed, closed = (0.0, None) if start is None else (start.position, start.state.closed)
    for position in sorted(one for one in wanted if one > passed):
        factors = factors_at(built.stages, position)
        known = next((end for end in built.ends if np.array_equal(end.factors, factors)), None)
        try:
            contacts = known or solve_exact(condensed, factors, closed)
        except (UnbalancedError, EndlessError):
            if position in positions:
                raise
            continue  # what floats on its way to a contact has no state there
        closed = contacts.closed
        yield _step(built, contacts, position, contacts.solves)


def friction_path(built: CondensedScene, start: Checkpoint | None = None) -> Iterator[PathStep]:
    """Path of exact contact with Coulomb friction, from event to event, with all requested states and a
    limited number of others."""
    condensed, stages = built.condensed, built.stages
    typical = max((float(end.pressure.max(initial=0.0)) for end in built.ends), default=0.0)
    if start is None:
        contacts, stage, reached = first_state(condensed, stages[0], typical), 0, 0.0
        yield _step(built, contacts, 0.0)
    else:
        contacts, stage, reached = start.state.contacts(condensed.friction_nodes), start.stage, start.fraction
    for number in range(stage, len(stages) - 1):
        halts = sorted(place for one in built.stops if reached < (place := one - number) <= 1.0)
        args = stages[number + 1], halts, stages[number], reached, typical or None
        path, stored, solves, unloaded = event_driven_path(condensed, contacts, *args), contacts, 0, False
        try:
            for contacts in path:
                position, solves = number + contacts.fraction, solves + contacts.solves
                snaps = contacts.jumped and not unloaded
                unloaded = contacts.pressure.max(initial=0.0) < UNLOADED * _least(built, position)
                enough = contacts.fraction >= reached + 1.0 / MAX_ROWS
                if contacts.fraction in halts or enough or contacts.jumped:
                    step = _step(built, contacts, position, solves)
                    if snaps:
                        what = f"the contact snaps to another state before position {position:.6g}"
                        step = replace(step, warning=f"{what}: there is no continuous path")
                    yield step
                    stored, solves, reached = contacts, 0, contacts.fraction
        except NumericalError as error:
            if contacts is not stored:
                yield _step(built, contacts, number + contacts.fraction, solves)
            if isinstance(error, SlidingError):
                raise SlidingError(error.fraction, f" at position {number + error.fraction:.9g}") from error
            position = number + (reached if contacts is stored else contacts.fraction)
            raise NumericalError(f"{error.message} beyond position {position:.9g}", error.hint) from error
        reached = 0.0


def _least(built: CondensedScene, position: float) -> float:
    """Part of the pressures at the ends of earlier stages that unloading leaves."""
    before = (float(end.pressure.max(initial=0.0)) for end in built.ends[: int(position)])
    return UNLOADED * max(before, default=0.0)


def _step(built: CondensedScene, contacts: ContactState, position: float, systems: int = 0) -> PathStep:
    """Step that ends at a state after so many ``systems``."""
    worst = residual(built.condensed, contacts, _least(built, position))
    state = State.of(contacts, built.condensed.friction_nodes, position, worst)
    solves = (4 if len(contacts.traction) else 2) * systems
    return built.step(state, iterations=systems, factorizations=systems, solves=solves)
