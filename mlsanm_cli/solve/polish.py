"""``solver.polish``: replaces saved states of a regularised path by those of the exact laws.

Without friction an exact state depends on its load alone: it is found from the sets of the regularised state
in one to three dense solves. The same holds for holonomic friction, whose exact state is one increment from
the unloaded scene. Friction with memory depends on the whole path: the exact path is followed in parallel
from event to event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from mlsanm_cli.contact.complementarity.problem import STICK, ContactStatus
from mlsanm_cli.contact.laws.active_set import solve_exact
from mlsanm_cli.contact.laws.coulomb import increment, unloaded
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.solve.condensed_scene import CondensedScene
from mlsanm_cli.solve.event_driven import coulomb_state, friction_path
from mlsanm_cli.solve.paths import exact_step, path_of, unloaded_state
from mlsanm_cli.solve.state import Checkpoint, PathStep, Polish, State

Polisher = Callable[[State], PathStep]
"""Returns the exact state at the position of a regularised one as a row of its own, with its counters."""


def polished(built: CondensedScene, start: Checkpoint | None) -> Iterator[PathStep]:
    """The path with every saved state and the last one replaced by exact ones, each in a row of its own. A
    saved level inside a step also gets the part of the step's series before it."""
    behind = max(start.position, start.told) if start else -1.0
    polish, end = _polisher(built, behind), float(len(built.case.stage))
    for step in path_of(built, start):
        for state in step.saved:
            if behind < state.position != step.state.position:
                better = _improved(built, polish, state)
                # Without a first step there is no state to continue from.
                start = replace(start, told=state.position) if start else None
                better = replace(better, series=step.series, series_attributes=step.series_attributes)
                yield replace(better, checkpoint=start)
        start = step.checkpoint
        saved = any(state.position == step.state.position for state in step.saved)
        if not saved and step.state.position != end:
            yield replace(step, saved=())
            continue
        better = _improved(built, polish, step.state)
        yield replace(
            step,
            state=better.state,
            saved=better.saved if saved else (),
            factorizations=step.factorizations + better.factorizations,
            solves=step.solves + better.solves,
            warning="; ".join(text for text in (step.warning, better.warning) if text),
            polish=better.polish,
        )


def _improved(built: CondensedScene, polish: Polisher, state: State) -> PathStep:
    """Row with the exact state instead of the regularised one, which is kept if polishing is not requested
    and there is no other."""
    try:
        row = polish(state)
    except NumericalError as error:
        if built.case.solver.polish == "auto":
            # A body may be held by the regularised law only.
            return PathStep(state, (state,))
        where = f"at position {state.position:.9g} the exact laws have no state"
        raise NumericalError(
            f"{where}: {error.message}", error.hint or "set solver.polish = false"
        ) from error
    peak = max(float(end.pressure.max()) for end in built.ends)
    pressure, traction = row.state.pressure - state.pressure, row.state.traction - state.traction
    # In the L2 norm changes of single nodes at contact edges are irrelevant.
    weight = built.condensed.weight
    whole = max(float(weight @ end.pressure**2) for end in built.ends)
    square = max(weight @ pressure**2, weight[built.condensed.friction_nodes] @ traction**2)
    changed = Polish(
        pressure=float(np.abs(pressure).max(initial=0.0)) / peak,
        traction=float(np.abs(traction).max(initial=0.0)) / peak,
        factorizations=row.factorizations,
        overall=float(np.sqrt(square / whole)),
    )
    return replace(row, saved=(row.state,), polish=changed)


def _polisher(built: CondensedScene, behind: float) -> Polisher:
    if not len(built.condensed.friction_nodes):
        return partial(_frictionless, built)
    if built.is_holonomic:
        return partial(_holonomic, built)
    return partial(_alongside, friction_path(built), behind)


def _frictionless(built: CondensedScene, state: State) -> PathStep:
    if state.position == 0.0:
        return PathStep(unloaded_state(built), ())
    return exact_step(solve_exact(built.condensed, state.factors, state.closed), state.position)


def _holonomic(built: CondensedScene, state: State) -> PathStep:
    """Coulomb's law for the total slip: one increment from the unloaded scene."""
    c = built.condensed
    stuck = state.status[c.friction_nodes] == STICK
    slides = state.closed[c.friction_nodes] & ~stuck
    sets = ContactStatus(state.closed, stuck, np.where(slides, np.sign(state.traction), 0.0))
    start = replace(unloaded(c, built.stages[0]), sets=sets)
    found, systems = increment(c, start, state.factors)
    # The holonomic law does not define dissipation.
    exact = replace(coulomb_state(built, found, state.position), work=state.work)
    return PathStep(exact, (), factorizations=systems, solves=2 * systems)


def _alongside(exact: Iterator[PathStep], behind: float, state: State) -> PathStep:
    """The ``exact`` path from one requested level to the next, after the position ``behind``."""
    passed: list[PathStep] = []
    for step in exact:
        if step.state.position > behind:
            passed.append(step)
        if step.state.position == state.position:
            break
    # Both paths stop at the same levels.
    assert passed[-1].state.position == state.position
    return replace(
        passed[-1],
        factorizations=sum(step.factorizations for step in passed),
        solves=sum(step.solves for step in passed),
        warning="; ".join(step.warning for step in passed if step.warning),
    )
