"""The load path: states at its start, after every step, and at the positions where fields are wanted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mlsanm_cli.app.build import Built
from mlsanm_cli.app.marks import BEGINNING, Start
from mlsanm_cli.app.rubbing_path import rubbing_path
from mlsanm_cli.app.rubbing_point import RubbingMark
from mlsanm_cli.app.series_path import SmoothMark, is_holonomic, smooth_path
from mlsanm_cli.app.states import PathStep, State, factors_at, stops, wanted_positions
from mlsanm_cli.arrays import BoolArray, FloatArray
from mlsanm_cli.contact.active_set import ExactState, solve_exact
from mlsanm_cli.contact.coulomb import CoulombState, residual
from mlsanm_cli.contact.history import Event, follow
from mlsanm_cli.contact.history import start as begin
from mlsanm_cli.contact.sets import OPEN, SLIP
from mlsanm_cli.contact.sliding import SlidingError
from mlsanm_cli.errors import NumericalError
from mlsanm_cli.values import dataclass

ROWS = 40
"""Of the events of a stage with friction so many are stored as steps, evenly along it."""


@dataclass(frozen=True)
class LinearMark:
    """Where a path without contact is: its states do not depend on each other."""

    position: float


@dataclass(frozen=True, eq=False)
class ExactMark:
    """Where a path without friction is, and its closed nodes (m,), with which the next search begins."""

    position: float
    active: BoolArray | None


@dataclass(frozen=True, eq=False)
class FrictionMark:
    """Where a path with exact friction is: the ``fraction`` of a stage that began at load factors (L,).

    ``found`` tells that no rates led to the state.
    """

    stage: int
    begin: FloatArray
    fraction: float
    state: CoulombState
    found: bool = False


def path_of(built: Built, start: Start = BEGINNING) -> Iterator[PathStep]:
    """The path of the scene, or what of it is left, by the method its contact law asks for."""
    if not built.case.contact:
        return linear_path(built, start.mark(LinearMark))
    smooth, rough = built.case.contact[0].regularization.law != "exact", bool(len(built.condensed.rubbing))
    if smooth and rough and not is_holonomic(built):
        return _limited(built, start, rubbing_path(built, start.mark(RubbingMark)))
    if smooth:
        return _limited(built, start, smooth_path(built, start.mark(SmoothMark)))
    return (
        friction_path(built, start.mark(FrictionMark)) if rough else exact_path(built, start.mark(ExactMark))
    )


def _limited(built: Built, start: Start, path: Iterator[PathStep]) -> Iterator[PathStep]:
    """The path as long as it takes no more steps than it may, whatever pieces it is made of."""
    most = built.case.solver.max_steps
    for count, step in enumerate(path, start.steps):
        if count > most:
            why = f"max steps, more than {most} steps come before position {step.state.position:.9g}"
            raise NumericalError(f"the path stopped: {why}", "raise solver.max_steps")
        yield step


def linear_path(built: Built, mark: LinearMark | None) -> Iterator[PathStep]:
    """A scene without contact: every state is a combination of the loads' own solutions."""
    wanted = wanted_positions(built)
    condensed = built.condensed
    for position in stops(built):
        if mark is not None and position <= mark.position:
            continue
        factors = factors_at(built.stages, position)
        nothing = np.zeros(0)
        motion = np.zeros(len(condensed.balance.constant))
        if len(motion):
            solved = np.linalg.solve(condensed.balance.motion, -condensed.balance.load @ factors)
            motion = np.asarray(solved, dtype=np.float64)
        status = np.zeros(0, dtype=np.int8)
        state = State(
            position, factors, nothing, nothing, motion, nothing, nothing, nothing, status, residual=0.0
        )
        yield PathStep(
            state,
            (state,) if position in wanted else (),
            solves=0 if position else condensed.solves,
            mark=LinearMark(position),
        )


def exact_path(built: Built, mark: ExactMark | None) -> Iterator[PathStep]:
    """Exact contact at the stages' ends and wherever fields are wanted, each from the set before."""
    wanted = wanted_positions(built)
    if mark is None:
        first, mark = unloaded_state(built), ExactMark(0.0, None)
        yield PathStep(first, (first,) if 0.0 in wanted else (), mark=mark)
    for position in stops(built):
        if position <= mark.position:
            continue
        exact = solve_exact(built.condensed, factors_at(built.stages, position), mark.active)
        mark, step = ExactMark(position, exact.active), exact_step(exact, position)
        yield replace(step, saved=(step.state,) if position in wanted else (), mark=mark)


def exact_step(exact: ExactState, position: float) -> PathStep:
    """An exact state without friction as a step with nothing saved."""
    return PathStep(
        _exact_state(exact, position),
        (),
        iterations=exact.solves,
        factorizations=exact.solves,
        solves=2 * exact.solves,
    )


def unloaded_state(built: Built) -> State:
    """The start of the path: as drawn, unless the surfaces overlap there."""
    gap, factors = built.condensed.gap, built.stages[0]
    if built.condensed.overlap(gap.constant):
        return _exact_state(solve_exact(built.condensed, factors), 0.0)
    zero, nothing = np.zeros(len(gap.constant)), np.zeros(0)
    motion = np.zeros(len(built.condensed.balance.constant))
    status = np.where(gap.constant <= 0.0, SLIP, OPEN).astype(np.int8)
    return State(0.0, factors, zero, gap.constant, motion, nothing, nothing, nothing, status, residual=0.0)


def _exact_state(exact: ExactState, position: float) -> State:
    nothing = np.zeros(0)
    return State(
        position,
        exact.factors,
        exact.pressure,
        exact.gap,
        exact.motion,
        nothing,
        nothing,
        nothing,
        np.where(exact.active, SLIP, OPEN).astype(np.int8),
        exact.residual,
    )


def friction_path(built: Built, mark: FrictionMark | None = None) -> Iterator[PathStep]:
    """Exact contact with Coulomb friction, followed from event to event."""
    wanted, condensed = wanted_positions(built), built.condensed
    if mark is None:
        event = begin(condensed, built.stages[0])
        mark = FrictionMark(0, event.state.factors, 0.0, event.state)
        first = coulomb_state(built, event.state, 0.0)
        yield PathStep(first, (first,) if 0.0 in wanted else (), factorizations=event.solves, mark=mark)
    state = mark.state
    for stage, end in enumerate(built.stages[1:]):
        if stage < mark.stage:
            continue
        within = mark if stage == mark.stage else FrictionMark(stage, state.factors, 0.0, state)
        places = {position - stage for position in stops(built) if stage < position <= stage + 1}
        halts = sorted(place for place in places if place > within.fraction)
        rows, reached = _Rows(built, within, places, wanted), within.fraction
        try:
            for event in follow(condensed, state, end, halts, within.begin, within.fraction, within.found):
                state, reached = event.state, event.fraction
                yield from rows.add(event)
        except SlidingError as error:
            yield from rows.last()
            where = f"at position {stage + error.fraction:.9g}"
            raise NumericalError(f"{error.message} {where}", error.hint) from error
        except NumericalError as error:
            yield from rows.last()
            raise NumericalError(
                f"{error.message} beyond position {stage + reached:.9g}", error.hint
            ) from error


class _Rows:
    """Makes steps of one stage's events: all wanted ones, and of the others as many as are worth storing."""

    def __init__(
        self, built: Built, within: FrictionMark, halts: set[float], wanted: tuple[float, ...]
    ) -> None:
        self._built, self._stage, self._halts, self._wanted = built, within.stage, halts, wanted
        self._begin, self._before, self._solves = within.begin, within.fraction, 0
        self._jump: str = ""
        self._pending: Event | None = None

    def add(self, event: Event) -> Iterator[PathStep]:
        """The step that ends at an event, if it is worth one."""
        self._solves += event.solves
        self._pending = event
        if event.jumped:
            self._jump = (
                f"the contact jumps to another state before position {self._stage + event.fraction:.6g}: "
                f"friction and pressure leave it no gradual way"
            )
        if event.fraction in self._halts or event.fraction >= self._before + 1.0 / ROWS or event.jumped:
            yield from self.last()

    def last(self) -> Iterator[PathStep]:
        """The step that ends at the last event."""
        if self._pending is None:
            return
        position = self._stage + self._pending.fraction
        state = coulomb_state(self._built, self._pending.state, position)
        yield PathStep(
            state,
            (state,) if position in self._wanted else (),
            iterations=self._solves,
            factorizations=self._solves,
            solves=4 * self._solves,
            warning=self._jump,
            mark=FrictionMark(
                self._stage, self._begin, self._pending.fraction, self._pending.state, self._pending.found
            ),
        )
        self._before, self._solves, self._jump, self._pending = self._pending.fraction, 0, "", None


def coulomb_state(built: Built, state: CoulombState, position: float) -> State:
    """An exact state with friction at a path position."""
    values, sets = state.values, state.sets
    return State(
        position,
        state.factors,
        values.pressure,
        values.gap,
        values.motion,
        values.traction,
        values.slip,
        state.work,
        sets.status(built.condensed.rubbing),
        residual(built.condensed, state),
    )
